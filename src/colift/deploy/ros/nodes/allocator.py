"""The node of the allocator: wanted force on the load in, force of each cable out."""

from __future__ import annotations

from types import MappingProxyType
from typing import Any

from colift.deploy.ros.allocating import Allocating
from colift.deploy.ros.nodes.node import TeamNode
from colift.mission.mission import Mission
from colift.record.exchange.messages import acceleration_of, body_of, wrench, wrench_of


class AllocatorNode(TeamNode):
    """Answers each wanted force once; what it has answered it repeats to who asks again."""

    says = ("cable_command",)
    hears = MappingProxyType({
        "load": body_of, "drone": body_of, "reference": body_of, "acceleration": acceleration_of, "wrench": wrench_of,
    })  # fmt: skip

    def __init__(self, mission: Mission, *, lock_step: bool) -> None:
        super().__init__("allocator", mission, lock_step=lock_step)

    def prepare(self) -> None:
        self.does = Allocating(self.mission)
        self._load: Any = None
        self._drones: list[Any] = [None] * self.n
        self._forces: Any = None

    def heard(self, key: str, drone: int, at: int, found: Any) -> None:
        if key == "drone":
            self._drones[drone] = found
        elif key == "load":
            self._load = found
            self.does.told(load=found)
        elif key == "wrench":
            self._answer(at, *found)
        else:
            self.does.told(**{key: found})

    def begin(self) -> None:
        self.does.last = -1

    def _answer(self, at: int, force: Any, moment: Any) -> None:
        does = self.does
        if at != does.last:
            if does.last < 0 or at < does.last:  # the first one, or a flight that begins anew
                does.last = -1
                does.begin(self._load, self._drones)
            self._forces = does.answer(at, force, moment)
        for i, pull in enumerate(self._forces):
            self.say("cable_command", wrench(at, pull), i)
