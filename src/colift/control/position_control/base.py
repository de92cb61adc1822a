"""The contract of the position-control layer: from wanted cables to wanted thrust and attitude."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

from colift.control.margins import Places
from colift.kernel.ports import PORTS
from colift.part import Part
from colift.team import Team
from colift.team.geometry import Array
from colift.team.load import Pose

SIGNATURE = PORTS["position_control"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called at the layer's own period, ``now.dt``. Attitudes and rates are as old as their sensors make them.
"""


class PositionControlPart(Part):
    """Base of all position controllers."""

    layer: ClassVar[str] = "position_control"
    senses: ClassVar[tuple[str, ...]] = ("tracking",)
    """The sensors (:data:`colift.world.sensing.base.SENSORS`) whose delay it suffers."""
    gain_setting: ClassVar[str] = "kind"
    """Setting to change where the loop is near instability, for messages."""

    def places(self, team: Team, axis: int) -> Places | None:
        """The law for small errors along a horizontal axis of the world, 0 or 1; None where there is no such law."""
        return None

    def planned_pulls(
        self, team: Team, poses: Sequence[Pose], formations: Sequence[Array]
    ) -> tuple[Array, Array] | None:
        """Forces (poses, n, 3), N, by which it leads the cables of a rigid load along wanted poses; None where it plans none.

        With a formation for each, as of :func:`colift.team.plan.shares`. Beside the forces (poses, n) what is asked of each cable along
        its direction in the formation, over its part of the whole force: 0 for one that should be slack.
        """
        return None

    def axis_delay(self) -> float:
        """Delay over which the axis of the thrust that is known is carried forward, s."""
        return 0.0
