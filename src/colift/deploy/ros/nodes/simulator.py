"""The node of the simulator: the mission's world, and the drones in it."""

from __future__ import annotations

import math
import time
from typing import Any

from geometry_msgs.msg import TransformStamped

from colift.deploy.ros.holding import SILENT
from colift.deploy.ros.nodes.diagnosing import ERROR, OK, WARN, Condition
from colift.deploy.ros.nodes.node import AGAIN, TeamNode
from colift.deploy.ros.nodes.speaking import say_load_side
from colift.deploy.ros.simulating import Simulating, Takes
from colift.mission.mission import Mission
from colift.record.exchange import messages
from colift.record.exchange.messages import (
    acceleration_of,
    body_of,
    filled,
    setpoint_of,
    wrench_of,
)
from colift.record.exchange.topics import LOAD, drone
from colift.record.exchange.urdf import urdf

LATE = 2.0
"""Time without a step after which it says so, s."""
STATE = ("clock", "tf", "description", "load", "drone", "cable")


class SimulatorNode(TeamNode):
    """One period after the other: it says where all are, waits for the answer, and flies on.

    In lock step it waits as long as it takes for who steers, and says again what nobody answered. Otherwise it flies at ``speed`` over real time
    with what it has.
    """

    hears_time = False

    def __init__(self, mission: Mission, takes: Takes, *, speed: float | None = None) -> None:
        self.takes, self.speed = takes, speed
        alone = takes == "cables"
        self.says = (*STATE, "reference", "acceleration", "wrench") if alone else STATE
        self.hears = {"cable_command": wrench_of}
        if not alone:
            self.hears |= {
                "setpoint": setpoint_of, "reference": body_of, "acceleration": acceleration_of, "wrench": wrench_of,
            }  # fmt: skip
        self.sections = (
            "attitude_control",
            *(("load_control", "position_control", "observation") if alone else ()),
        )
        super().__init__("simulator", mission, lock_step=speed is None)
        if self.lock_step and alone:
            self.be_patient(1.0)

    def prepare(self) -> None:
        self.does = Simulating(self.mission, self.takes)
        self._setpoints: list[Any] = [None] * self.n
        self._answered = [-1] * self.n
        self._begun, self._waits = False, True
        self._said: dict[str, tuple[int, Any]] = {}
        self._since = self._again = 0.0
        self._paced_from = self._began = math.inf

    def begin(self) -> None:
        self.say("description", {"data": urdf(self.mission.team, self.mission.name)})
        self._paced_from = time.monotonic() - 1e-9 * self.does.at / (self.speed or 1.0)
        self._state()

    def heard(self, key: str, drone: int, at: int, found: Any) -> None:
        does = self.does
        if key == "cable_command":
            does.held.hear(drone, at, found[0])
            if self.takes == "cables":
                self._answered[drone], self._waits = at, True
        elif key == "setpoint":
            self._setpoints[drone], self._answered[drone], self._waits = found, at, True
        elif key == "wrench":
            does.asked(*found)
        else:
            self._said[key] = at, found
            if len({time for time, _ in self._said.values()}) == 1 and len(self._said) == 2:
                does.led(self._said["reference"][1], self._said["acceleration"][1])
        if self.lock_step and self._complete():
            self._advance()

    def condition(self) -> Condition:
        does, now = self.does, time.monotonic()
        flown, held = 1e-9 * does.at, does.held
        values = {
            "simulated, s": f"{flown:.2f}",
            "over real time": f"{flown / max(now - self._began, 1e-3):.2f}",
            "silences of the allocator": held.silences,
            "steered until, s": f"{1e-9 * min(self._answered):.2f}",
        }
        if does.flight.outcome != "completed":
            return Condition(ERROR, does.flight.outcome, values)
        if not self._begun:
            return Condition(WARN, "waits for who steers", values)
        if held.silent and self.takes == "cables":
            return Condition(
                ERROR,
                "the allocator is silent: forces are held, the load is brought to rest",
                values,
            )
        if does.at - min(self._answered) > SILENT * self.period or now > self._since + LATE:
            return Condition(
                ERROR, f"nobody steers since {1e-9 * min(self._answered):.2f} s", values
            )
        return Condition(OK, "", values)

    def _complete(self) -> bool:
        return all(at >= self.does.at for at in self._answered)

    def due(self, now: float) -> None:
        """Fly on where it is time, or nobody answers that is waited for."""
        complete = self._complete()
        if not complete and now >= self._again:
            self._again = now + AGAIN
            self._state()
        if not self._begun and not complete:
            return
        if self.lock_step:
            held = self.takes == "cables" and now >= self._since + self.patience * self._waits
            if complete or held:
                self._waits = complete
                self._advance()
        elif now >= self._paced_from + 1e-9 * (self.does.at + self.period) / (self.speed or 1.0):
            self._advance()

    def _advance(self) -> None:
        if not self._begun:
            self._begun, self._began = True, time.monotonic()
            self._paced_from = self._began
        if self.takes == "setpoints" and None not in self._setpoints:
            self.does.told(self._setpoints)
        self.does.advance()
        self._since, self._again = time.monotonic(), time.monotonic() + AGAIN
        self.over = self.does.over
        self._state()

    def _state(self) -> None:
        does, at = self.does, self.does.at
        self.say("clock", {"clock": messages.stamp(at)})
        for i, pull in enumerate(does.cables()):
            self.say("cable", messages.wrench(at, pull), i)
        load, drones = does.load(), does.drones()
        for i, body in enumerate(drones):
            self.say("drone", messages.odometry(at, drone(i), body), i)
        self.say("load", messages.odometry(at, LOAD, load))
        if self.is_heard("tf"):
            framed = messages.frames(at, load, drones, does.ends())
            self.say("tf", {"transforms": [filled(TransformStamped(), each) for each in framed]})
        if self.takes == "cables":
            say_load_side(self, at, does.flight.bus)
