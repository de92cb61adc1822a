"""The contract of the sensing layer: from the truth to what the controllers are told."""

from __future__ import annotations

from typing import ClassVar

from colift.jit import f8, i8, matrix, vector, void
from colift.part import Part

SIGNATURE = void(
    i8, i8, f8, matrix, matrix, matrix, matrix, matrix, vector, vector, vector, matrix, matrix,
    matrix, matrix, matrix,
)  # fmt: skip
"""``kernel(step, key, dt, load, positions, velocities, attitudes, rates, stuck, params, memory,
measured_load, measured_positions, measured_velocities, measured_attitudes, measured_rates)``.

==========  ==========  ==================================================================
step        int         number of the physics step
key         int         of this part's random numbers (:mod:`colift.math.noise`)
dt          float       physics step, s
load        (2, 3)      true position (m) and velocity (m/s), world
positions   (n, 3)      true, of the drones, world, m
velocities  (n, 3)      true, world, m/s
attitudes   (n, 4)      true, wxyz, body to world
rates       (n, 3)      true body rates, body frame, rad/s
stuck       (n + 1,)    1 where the sensors of a drone or, last, the load repeat their last value
measured_*  as above    in/out: what the controllers are told; on entry, what they were told last
==========  ==========  ==================================================================
"""


SENSORS = ("load", "tracking", "attitude", "rates")
"""What is measured: the load, and of each drone its position and velocity, its attitude, its body rates."""


class SensingPart(Part):
    """Base of all sensor models."""

    layer: ClassVar[str] = "sensing"

    def delays(self) -> dict[str, float]:
        """Age of what is measured when it arrives, s: of ``load``, ``tracking``, ``attitude`` and ``rates``."""
        return dict.fromkeys(SENSORS, 0.0)
