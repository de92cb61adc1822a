"""The contract of the actuation layer: from commands to what the rotors do."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from colift.allocation._hover import thrusts_of
from colift.jit import f8, i8, matrix, vector, void
from colift.part import Part, Vector
from colift.team import Team

if TYPE_CHECKING:
    from colift.mission.mission import Mission

SIGNATURE = void(i8, i8, f8, vector, matrix, matrix, vector, vector, vector, matrix, vector)
"""``kernel(step, key, dt, thrusts, torques, motor_health, params, memory, applied_thrusts,
applied_torques, saturated_times)``, called each physics step.

================  ======  ==============================================================
step              int     number of the physics step
key               int     of this part's random numbers (:mod:`colift.math.noise`)
dt                float   physics step, s
thrusts           (n,)    commands, along the body z axes, N
torques           (n, 3)  commands, body frame, N m
motor_health      (n, 4)  share of its thrust that each motor still gives, 0 to 1
applied_thrusts   (n,)    out: N
applied_torques   (n, 3)  out: body frame, N m
saturated_times   (n,)    in/out: time in which each drone's motors could not give what was commanded, s
================  ======  ==============================================================
"""


class ActuationPart(Part):
    """Base of all models of the rotors."""

    layer: ClassVar[str] = "actuation"
    has_motors: ClassVar[bool] = True
    """Whether a motor acts at its own place, so that a weak one turns its drone."""
    thrust_setting: ClassVar[str] = "kind"
    """Setting that limits the thrust, for messages."""

    def motor_lag(self) -> float:
        """Time constant of the motors, s."""
        return 0.0

    def thrust_limits(self, team: Team) -> Vector:
        """Largest steady thrust of each drone (n,), N; inf where there is no limit."""
        return np.full(team.n, np.inf)

    def warnings(self, mission: Mission) -> Iterable[tuple[str, str]]:
        drones = mission.first_drones()
        team = mission.team.of(drones)
        given = self.of(drones).thrust_limits(team)
        if np.isinf(given).all() or team.gravity == 0.0:
            return
        directions, dt = mission.start_directions(), mission.timing.allocation
        allocation = mission.allocation.of(drones)
        needed = thrusts_of(team, allocation.hover(team, directions, dt))
        i = int(np.argmax(needed / given))
        if needed[i] > (1.0 - SPARE) * given[i]:
            spare = 100.0 * (1.0 - needed[i] / given[i])
            yield (
                self.thrust_setting,
                f"leaves {spare:.2g} % of thrust to spare: to hold load.mass = {team.load_mass:g} kg in hover "
                f"drone {i} needs {needed[i]:.4g} N of its {given[i]:.4g} N, and turning and wind take more",
            )


SPARE = 0.1
"""Share of the thrust that hover should leave to turn and to resist the wind."""
