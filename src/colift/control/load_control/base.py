"""The contract of the load-control layer: from the load's tracking error to a wanted force."""

from __future__ import annotations

from typing import ClassVar

from colift.control.margins import Hanging
from colift.kernel.ports import PORTS
from colift.part import Part
from colift.team import Team

SIGNATURE = PORTS["load_control"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called at the layer's own period, ``now.dt``.
"""
DRAWN = 0.05
"""Time in which what a controller has learned is drawn to ``sees.agreed_force`` of a team without a leader, s."""


class LoadControlPart(Part):
    """Base of all load controllers."""

    layer: ClassVar[str] = "load_control"
    senses: ClassVar[tuple[str, ...]] = ("load",)
    """The sensors (:data:`colift.world.sensing.base.SENSORS`) whose delay it suffers."""
    turns: ClassVar[bool] = False
    """Whether it wants a moment, as a rigid load needs, too."""

    def check(self, team: Team) -> list[tuple[str, str]]:
        if team.body is not None and not self.turns:
            return [("kind", "wants no moment: a rigid load needs pose")]
        return super().check(team)

    gain_setting: ClassVar[str] = "kind"
    """Setting to change where the loop is near instability, for messages."""

    def hanging(self, team: Team, axis: int) -> Hanging | None:
        """The law for small errors along a horizontal axis of the world, 0 or 1; None where there is no such law."""
        return None
