"""The contract of the estimation layer: from measurements to the state that the controllers use."""

from __future__ import annotations

from typing import ClassVar

from colift.jit import f8, i8, matrix, vector, void
from colift.part import Part

SIGNATURE = void(
    i8, f8, matrix, matrix, matrix, matrix, matrix, vector, vector, matrix, vector, vector,
    matrix, matrix, matrix, matrix, matrix,
)  # fmt: skip
"""``kernel(step, dt, load, positions, velocities, attitudes, rates, thrusts, tensions, directions, params,
memory, estimated_load, estimated_positions, estimated_velocities, estimated_attitudes,
estimated_rates)``, called each physics step.

===========  ========  ==================================================================
step         int       number of the physics step
dt           float     physics step, s
load         (2, 3)    measured position (m) and velocity (m/s), world
positions    (n, 3)    measured, of the drones, world, m
velocities   (n, 3)    measured, world, m/s
attitudes    (n, 4)    measured, wxyz, body to world
rates        (n, 3)    measured, body frame, rad/s
thrusts      (n,)      last commands, N
tensions     (n,)      last wanted of the drones, N
directions   (n, 3)    last wanted unit directions from drone to load, world
estimated_*  as above  in/out: what the controllers use; on entry, the last estimate
===========  ========  ==================================================================

A sensor that has nothing new repeats its last value.
"""


class EstimationPart(Part):
    """Base of all estimators."""

    layer: ClassVar[str] = "estimation"
