"""The contract of the position-control layer: from wanted cables to wanted thrust and attitude."""

from __future__ import annotations

from typing import ClassVar

from colift.kernel.ports import PORTS
from colift.part import Part

SIGNATURE = PORTS["position_control"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called at the layer's own period, ``now.dt``. Attitudes and rates are as old as their sensors make them.
"""


class PositionControlPart(Part):
    """Base of all position controllers."""

    layer: ClassVar[str] = "position_control"
    senses: ClassVar[tuple[str, ...]] = ("tracking",)
    """The sensors (:data:`colift.world.sensing.base.SENSORS`) whose delay it suffers."""
