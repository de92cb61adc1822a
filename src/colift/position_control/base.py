"""The contract of the position-control layer: from wanted cables to wanted thrust and attitude."""

from __future__ import annotations

from typing import ClassVar

from colift.jit import f8, matrix, vector, void
from colift.part import Part

SIGNATURE = void(
    matrix,
    matrix,
    matrix,
    matrix,
    matrix,
    vector,
    matrix,
    f8,
    vector,
    vector,
    matrix,
    vector,
    matrix,
    matrix,
)
"""``kernel(positions, velocities, measured_attitudes, measured_rates, reference, tensions, directions,
dt, params, memory, forces, thrusts, attitudes, rates)``.

==================  ======  ==========================================================
positions           (n, 3)  of the drones, world, m
velocities          (n, 3)  of the drones, world, m/s
measured_attitudes  (n, 4)  of the drones, wxyz, as old as their sensor makes them
measured_rates      (n, 3)  body rates, body frame, rad/s
reference   (4, 3)  wanted position, velocity, acceleration, jerk of the load
tensions    (n,)    wanted tensions, N
directions  (n, 3)  wanted unit directions from drone to load, world
dt          float   control period, s
forces      (n, 3)  out: wanted thrust vectors ``u_i``, world, N
thrusts     (n,)    out: thrust commands, N
attitudes   (n, 4)  out: wanted attitudes, wxyz
rates       (n, 3)  out: wanted body rates, body frame, rad/s
==========  ======  ==================================================================
"""


class PositionControlPart(Part):
    """Base of all position controllers."""

    layer: ClassVar[str] = "position_control"
    senses: ClassVar[tuple[str, ...]] = ("tracking",)
    """The sensors (:data:`colift.sensing.base.SENSORS`) whose delay it suffers."""
