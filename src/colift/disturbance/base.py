"""The contract of disturbances: each adds its share to the wind and to the forces on the bodies."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, ClassVar

from colift.jit import f8, i8, matrix, vector, void
from colift.part import Part

if TYPE_CHECKING:
    from colift.mission.mission import Mission

SIGNATURE = void(
    i8, i8, f8, matrix, matrix, matrix, matrix, matrix, matrix, vector, vector, vector, vector,
    vector, matrix,
)  # fmt: skip
"""``kernel(step, key, dt, load, positions, velocities, attitudes, directions, direction_rates, thrusts,
attached, params, memory, wind, external)``, called each physics step.

===============  ==========  ===========================================================
step             int         number of the physics step
key              int         of this part's random numbers (:mod:`colift.math.noise`)
dt               float       physics step, s
load             (2, 3)      true position (m) and velocity (m/s), world
positions        (n, 3)      of the drones, world, m
velocities       (n, 3)      of the drones, world, m/s
attitudes        (n, 4)      wxyz, body to world
directions       (n, 3)      unit vectors from drone to load, world
direction_rates  (n, 3)      their time derivatives, 1/s
thrusts          (n,)        that act, N
attached         (n,)        1 where the cable holds, 0 where it is cut
wind             (3,)        in/out: add to it; velocity of the air, world, m/s
external         (n + 1, 3)  in/out: add to it; forces on the drones and, last, the load, world, N
===============  ==========  ===========================================================

Both start at zero each step. Parts that make wind (``makes_wind``) come first, whatever their order in the
mission, so that those that turn wind into forces find all of it.
"""


class DisturbancePart(Part):
    """Base of all disturbances."""

    layer: ClassVar[str] = "disturbance"
    makes_wind: ClassVar[bool] = False
    """Whether it adds to the wind."""
    feels_wind: ClassVar[bool] = False
    """Whether it turns wind into forces."""

    def warnings(self, mission: Mission) -> Iterable[tuple[str, str]]:
        if self.makes_wind and not any(part.feels_wind for part in mission.disturbance):
            yield (
                "kind",
                "makes wind, which acts on nothing: there is no disturbance of kind drag that turns it into forces",
            )
