"""The node that writes a bag of all that the others say."""

from __future__ import annotations

import struct
from typing import Any

from colift.deploy.ros.nodes.diagnosing import OK, Condition
from colift.deploy.ros.nodes.node import TeamNode, message_class
from colift.mission.mission import Mission
from colift.record.exchange.bag import Writer
from colift.record.exchange.topics import TOPICS

OTHERS = {"/diagnostics": "diagnostic_msgs/msg/DiagnosticArray"}
"""Topics beside ours that it keeps, and their types."""


STAMP = struct.Struct("<4xiI")
"""A message's bytes up to the stamp that it begins with: what tells their order, then s and ns."""


class RecorderNode(TeamNode):
    """Keeps the messages as they came, by the time at which they did.

    In lock step, which waits for no recorder, by the time in their header: there it gets what was said before it was heard of, too.
    """

    def __init__(self, mission: Mission, bag: Writer, *, lock_step: bool) -> None:
        super().__init__("recorder", mission, lock_step=lock_step)
        self._bag, self.kept = bag, 0

    def prepare(self) -> None:
        for topic in TOPICS.values():
            if topic.name.startswith("/"):  # nobody else's clock and frames
                continue
            for name in topic.below(self.n):
                quality = self.quality(topic, past=self.lock_step)
                self._keep(self.resolve_topic_name(name), topic.type, quality)
        for name, kind in OTHERS.items():
            self._keep(name, kind, 10)

    def condition(self) -> Condition:
        return Condition(OK, "", {"messages kept": self.kept})

    def _time(self, data: bytes, stamped: bool) -> int:
        """Of a message, ns."""
        if not (self.lock_step and stamped):
            return int(self.get_clock().now().nanoseconds)
        seconds, rest = STAMP.unpack_from(data)
        return int(seconds * 1_000_000_000 + rest)

    def _keep(self, name: str, kind: str, quality: Any) -> None:
        def hear(data: bytes) -> None:
            if self.active:
                self._bag.put(name, kind, self._time(data, stamped), data)
                self.kept += 1

        made = message_class(kind)
        stamped = "header" in made.get_fields_and_field_types()
        self._ears.append(self.create_subscription(made, name, hear, quality, raw=True))
