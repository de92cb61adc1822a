"""The contract of the link between the central allocator and the drones."""

from __future__ import annotations

from typing import ClassVar

from colift.kernel.ports import PORTS
from colift.part import Part

SIGNATURE = PORTS["link"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called each physics step. ``received_ages`` are times since what was received was sent.
"""


class LinkPart(Part):
    """Base of all links."""

    layer: ClassVar[str] = "link"
