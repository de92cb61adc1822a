"""The node of the cascade: where load and drones are in, wanted force and the drones' set-points out."""

from __future__ import annotations

import math
import time
from types import MappingProxyType
from typing import Any

from colift.deploy.ros.nodes.node import AGAIN, TeamNode
from colift.deploy.ros.nodes.speaking import say_load_side
from colift.deploy.ros.steering import Steering
from colift.mission.mission import Mission
from colift.record.exchange.messages import body_of, setpoint, wrench_of
from colift.record.exchange.topics import drone


class CascadeNode(TeamNode):
    """One cycle for each state of the team: it asks the allocator, waits ``patience`` (s) for the answer, and flies.

    The first answer of all is waited for as long as it takes: nobody takes off without an allocator. Who did not answer in time
    is waited for again once he has.
    """

    says = ("reference", "acceleration", "wrench", "setpoint")
    hears = MappingProxyType({"load": body_of, "drone": body_of, "cable_command": wrench_of})

    def __init__(self, mission: Mission, *, lock_step: bool, patience: float | None = None) -> None:
        super().__init__("cascade", mission, lock_step=lock_step)
        short = 0.5 * mission.timing.allocation
        self.patience = patience if patience is not None else 1.0 if lock_step else short

    def prepare(self) -> None:
        self.does = Steering(self.mission)
        self._load: tuple[int, Any] = (-1, None)
        self._drones: list[tuple[int, Any]] = [(-1, None)] * self.n
        self._at, self._until = -1, math.inf
        self._begun, self._waits, self._wanted = False, True, list[Any]()

    def begin(self) -> None:
        self._at = -1

    def heard(self, key: str, drone: int, at: int, found: Any) -> None:
        if key == "cable_command":
            self.does.held.hear(drone, at, found[0])
            self._waits = True
            if at == self._at and not self._wanted and self.does.held.heard(at):
                self._begun = True
                self._fly()
            return
        if key == "load":
            self._load = at, found
        else:
            self._drones[drone] = at, found
        if self._load[0] == at and all(each[0] == at for each in self._drones):
            self._lead(at)

    def due(self, now: float) -> None:
        if now >= self._until and not self._wanted:
            if self._begun:
                self._waits = False
                self._fly()
            else:  # the question may have been lost, or nobody there to hear it
                self._until = now + AGAIN
                say_load_side(self, self._at, self.does.bus)

    def _lead(self, at: int) -> None:
        if at != self._at:
            self._at, self._wanted = at, []
            self.does.lead(at, self._load[1], [each[1] for each in self._drones])
            patience = self.patience if self._waits else 0.0
            self._until = time.monotonic() + (patience if self._begun else AGAIN)
            say_load_side(self, at, self.does.bus)
        elif self._wanted:  # somebody did not hear
            self._tell()

    def _fly(self) -> None:
        self._until = math.inf
        self._wanted = self.does.fly(self._at)
        self._tell()

    def _tell(self) -> None:
        for i, each in enumerate(self._wanted):
            self.say("setpoint", setpoint(self._at, drone(i), each), i)
