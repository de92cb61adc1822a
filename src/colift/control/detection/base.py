"""The contract of fault detection: which drones still carry, from what a flight stack knows."""

from __future__ import annotations

from typing import ClassVar

from colift.kernel.ports import PORTS
from colift.part import Part

SIGNATURE = PORTS["detection"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called at the period of the position controllers. Set ``carrying`` to 0 for a drone that is judged lost to the load: it leaves
the team at once, the others share the load anew, and its cable is released if it still holds.
"""


class DetectionPart(Part):
    """Base of all methods of detection."""

    layer: ClassVar[str] = "detection"
    of_itself: ClassVar[bool] = False
    """Whether each drone judges itself and nobody else. In a team without a leader it then lets go of its own cable, and the others learn of it by
    its agent only; else all are told."""
