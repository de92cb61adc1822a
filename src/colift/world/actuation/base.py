"""The contract of the actuation layer: from commands to what the rotors do."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

import numpy as np

from colift.kernel.ports import PORTS
from colift.part import Part, Setup, Vector
from colift.team import Team

SIGNATURE = PORTS["actuation"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called each physics step. ``saturated_times`` grow while a drone's motors cannot give what was commanded.
"""


class ActuationPart(Part):
    """Base of all models of the rotors."""

    layer: ClassVar[str] = "actuation"
    has_motors: ClassVar[bool] = True
    """Whether a motor acts at its own place, so that a weak one turns its drone."""
    thrust_setting: ClassVar[str] = "kind"
    """Setting that limits the thrust, for messages."""

    def thrust_path(self, team: Team) -> str:
        """Path in the mission of what limits the thrust, for messages: the drones' number or the setting."""
        known = np.isfinite(team.max_thrusts).all()
        given = self.thrust_setting in self.model_fields_set
        if known and not given and np.array_equal(self.thrust_limits(team), team.max_thrusts):
            return "drones.max_thrust"
        return f"{self.layer}.{self.thrust_setting}"

    def motor_lag(self) -> float:
        """Time constant of the motors, s."""
        return 0.0

    def assumed(self, team: Team) -> dict[str, Vector]:
        """Numbers (n,) of drones that they do not have of themselves, by field, as this part has them."""
        return {}

    def guessed(self, team: Team) -> set[str]:
        """Those of :meth:`assumed` that neither the drones nor this part's settings say."""
        return set()

    def thrust_limits(self, team: Team) -> Vector:
        """Largest steady thrust of each drone (n,), N; inf where there is no limit.

        Where nothing is simulated that limits it, it is what the drones are known to have.
        """
        return team.max_thrusts.copy()

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        drones = mission.first_drones()
        team = mission.team.of(drones)
        given = self.of(drones).thrust_limits(team)
        if np.isinf(given).all() or team.gravity == 0.0:
            return
        directions, dt = mission.start_directions(), mission.timing.allocation
        allocation = mission.allocation.of(drones)
        hover = allocation.hover(team, directions, dt)
        needed = team.hover_thrusts(hover.tensions, hover.directions)
        i = int(np.argmax(needed / given))
        if needed[i] > (1.0 - SPARE) * given[i]:
            spare = 100.0 * (1.0 - needed[i] / given[i])
            yield (
                self.thrust_path(team).removeprefix(f"{self.layer}."),
                f"leaves {spare:.2g} % of thrust to spare: to hold load.mass = {team.load_mass:g} kg in hover "
                f"drone {i} needs {needed[i]:.4g} N of its {given[i]:.4g} N, and turning and wind take more",
            )


SPARE = 0.1
"""Share of the thrust that hover should leave to turn and to resist the wind."""
