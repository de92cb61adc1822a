"""What a node says of itself on ``/diagnostics``: once a second, and at once when it changes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue

OK, WARN, ERROR, STALE = (
    DiagnosticStatus.OK,
    DiagnosticStatus.WARN,
    DiagnosticStatus.ERROR,
    DiagnosticStatus.STALE,
)
EVERY = 1.0
"""s."""


@dataclass(frozen=True)
class Condition:
    """How a node is: level, a sentence, numbers."""

    level: bytes
    message: str
    values: Mapping[str, Any] = field(default_factory=dict)


class Diagnostics:
    """Tells the condition of a node."""

    def __init__(self, node: Any) -> None:
        self._node = node
        self._publisher = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._next, self._level = -math.inf, OK

    def due(self, now: float) -> None:
        """Tell it, where it is time at ``now`` (s, of the machine's clock)."""
        node = self._node
        found = node.condition() if node.active else Condition(STALE, "not active")
        if now < self._next and found.level == self._level:
            return
        self._next, self._level = now + EVERY, found.level
        values = {**found.values, "messages refused": node.refused, "deadlines missed": node.late}
        status = DiagnosticStatus(
            level=found.level,
            name=f"colift: {node.get_name()}",
            message=found.message or "ok",
            hardware_id=node.mission.name,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
        )
        message = DiagnosticArray(status=[status])
        message.header.stamp = node.get_clock().now().to_msg()
        self._publisher.publish(message)
