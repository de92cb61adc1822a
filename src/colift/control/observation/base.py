"""The contract of the observation layer: from the estimate to the external forces on drones and load."""

from __future__ import annotations

from typing import ClassVar

from colift.kernel.ports import PORTS
from colift.part import Part
from colift.team import Team

SIGNATURE = PORTS["observation"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called at the period of position control, just before it. What a layer above sees of it is one call old.
"""


class ObservationPart(Part):
    """Base of all observers of forces."""

    layer: ClassVar[str] = "observation"
    senses: ClassVar[tuple[str, ...]] = ("tracking",)
    """The sensors (:data:`colift.world.sensing.base.SENSORS`) whose delay it suffers."""

    def watching(self, team: Team) -> tuple[float, float]:
        """Bandwidths of the observers of the whole momentum and of each drone's own, 1/s; 0 for none."""
        return 0.0, 0.0

    def axis_delay(self) -> float:
        """Delay over which the axis of the thrust that is known is carried forward, s."""
        return 0.0
