"""The contract of the observation layer: from the estimate to the external forces on drones and load."""

from __future__ import annotations

from typing import ClassVar

from colift.kernel.ports import PORTS
from colift.part import Part

SIGNATURE = PORTS["observation"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called at the period of position control, just before it. What a layer above sees of it is one call old.
"""


class ObservationPart(Part):
    """Base of all observers of forces."""

    layer: ClassVar[str] = "observation"
    senses: ClassVar[tuple[str, ...]] = ("tracking",)
    """The sensors (:data:`colift.world.sensing.base.SENSORS`) whose delay it suffers."""
