"""The node of the cascade: where load and drones are in, wanted force and the drones' set-points out."""

from __future__ import annotations

import math
import time
from types import MappingProxyType
from typing import Any

import numpy as np

from colift.deploy.ros.nodes.diagnosing import ERROR, OK, WARN, Condition
from colift.deploy.ros.nodes.node import AGAIN, TeamNode
from colift.deploy.ros.nodes.speaking import say_load_side
from colift.deploy.ros.steering import Steering
from colift.mission.mission import Mission
from colift.record.exchange.messages import body_of, setpoint, wrench_of
from colift.record.exchange.topics import drone

FARTHEST = 1.0
"""Distance of the load from its reference, m, beyond which no flight begins."""


class CascadeNode(TeamNode):
    """One cycle for each state of the team: it asks the allocator, waits ``patience`` (s) for the answer, and flies.

    The first answer of all is waited for as long as it takes: nobody takes off without an allocator. Who did not answer in time
    is waited for again once he has.
    """

    says = ("reference", "acceleration", "wrench", "setpoint")
    sections = ("load_control", "position_control", "observation")
    hears = MappingProxyType({"load": body_of, "drone": body_of, "cable_command": wrench_of})

    def __init__(self, mission: Mission, *, lock_step: bool) -> None:
        super().__init__("cascade", mission, lock_step=lock_step)
        self.be_patient(1.0 if lock_step else 0.5 * mission.timing.allocation)

    def prepare(self) -> None:
        self.does = Steering(self.mission)
        self._load: tuple[int, Any] = (-1, None)
        self._drones: list[tuple[int, Any]] = [(-1, None)] * self.n
        self._at, self._until = -1, -math.inf
        self._begun, self._waits, self._wanted = False, True, list[Any]()
        self._away, self._old, self.zero = 0.0, 0, 0

    def begin(self) -> None:
        if self._at >= 0:
            self.prepare()
            self.parameters.put(self.does.flight, self.sections)
        self._simulated = self.lock_step or self.get_parameter("use_sim_time").value

    def condition(self) -> Condition:
        held = self.does.held
        values = {
            "silences of the allocator": held.silences,
            "cycles flown with old forces": self._old,
            "age of the oldest force, s": f"{1e-9 * max(self._at - int(held.since.min()), 0):.3f}",
        }
        if self._away > FARTHEST:
            return Condition(
                ERROR, f"the load is {self._away:.2f} m from where the reference begins", values
            )
        if not self._begun:
            return Condition(WARN, "waits for load, drones and allocator", values)
        if held.silent:
            return Condition(
                ERROR,
                "the allocator is silent: forces are held, the load is brought to rest",
                values,
            )
        return Condition(OK, "", values)

    def heard(self, key: str, drone: int, at: int, found: Any) -> None:
        if key == "cable_command":
            self.does.held.hear(drone, at, found[0])
            self._waits = True
            asked = at == self._at and not self._wanted
            if asked and self.does.held.heard(at):
                self._begun = True
                self._fly()
            return
        if key == "load":
            self._load = at, found
        else:
            self._drones[drone] = at, found
        if self._load[0] == at and all(each[0] == at for each in self._drones):
            if not self._begun:
                self._ask(at)
            elif at > self._at:
                self._lead(at)
                self._until = time.monotonic() + self.patience * self._waits
                say_load_side(self, at, self.does.bus)
            elif self._wanted:  # somebody did not hear
                self._tell()

    def due(self, now: float) -> None:
        if self._begun and now >= self._until and not self._wanted:
            self._waits, self._old = False, self._old + 1
            self._fly()

    def _ask(self, at: int) -> None:
        """Before the flight: ask the allocator every ``AGAIN``, each time as if it began now."""
        now = time.monotonic()
        if now < self._until:
            return
        self._until = now + AGAIN
        if not self._simulated:
            self.zero, at = self.zero + at, 0
        self.does.again()
        self._lead(at)
        self._away = float(np.linalg.norm(self._load[1].position - self.does.bus.reference[0]))
        if self._away <= FARTHEST:
            say_load_side(self, at, self.does.bus)

    def _lead(self, at: int) -> None:
        self._at, self._wanted = at, []
        self.does.lead(at, self._load[1], [each[1] for each in self._drones])

    def _fly(self) -> None:
        self._until = math.inf
        self._wanted = self.does.fly(self._at)
        self._tell()

    def _tell(self) -> None:
        for i, each in enumerate(self._wanted):
            self.say("setpoint", setpoint(self._at + self.zero, drone(i), each), i)
