"""The node of the allocator: wanted force on the load in, force of each cable out."""

from __future__ import annotations

import math
import time
from types import MappingProxyType
from typing import Any

from colift.control.allocation.base import INFO_BALANCE, INFO_ITERATIONS
from colift.deploy.ros.allocating import Allocating
from colift.deploy.ros.nodes.diagnosing import OK, STALE, WARN, Condition
from colift.deploy.ros.nodes.node import TeamNode
from colift.mission.mission import Mission
from colift.record.exchange.messages import acceleration_of, body_of, wrench, wrench_of

QUIET = 1.0
"""Time without a question after which it says so, s."""


class AllocatorNode(TeamNode):
    """Answers each wanted force once; what it has answered it repeats to who asks again."""

    says = ("cable_command",)
    hears = MappingProxyType({
        "load": body_of, "drone": body_of, "reference": body_of, "acceleration": acceleration_of, "wrench": wrench_of,
    })  # fmt: skip

    sections = ("allocation",)

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
        self._asked = -math.inf

    def condition(self) -> Condition:
        does = self.does
        counts = {f"status {s.name}": count for s, count in sorted(does.statuses.items())}
        values = {
            **counts, "iterations": int(does.info[INFO_ITERATIONS]), "force residual, N": f"{does.info[INFO_BALANCE]:.3g}",
            "longest call, ms": f"{1e3 * does.longest:.3g}",
        }  # fmt: skip
        if time.monotonic() - self._asked > QUIET:
            return Condition(STALE, "nobody asks", values)
        if does.last_status.ok:
            return Condition(OK, "", values)
        return Condition(WARN, does.last_status.name.lower().replace("_", " "), values)

    def _answer(self, at: int, force: Any, moment: Any) -> None:
        does = self.does
        self._asked = time.monotonic()
        if at != does.last:
            if does.last < 0 or at < does.last:  # the first one, or a flight that begins anew
                does.last = -1
                does.begin(self._load, self._drones)
            self._forces = does.answer(at, force, moment)
        for i, pull in enumerate(self._forces):
            self.say("cable_command", wrench(at, pull), i)
