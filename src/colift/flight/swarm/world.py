"""The world of a swarm: a load that the agents' pulls carry, and the hand that kills and restarts them.

The load is a point. A drone's pull follows its agent's command with the lag of a motor; who has not answered for ``WATCHDOG``
pulls no more. Each drone measures the load with an error of its own.
"""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from colift.errors import ColiftError
from colift.flight.swarm.protocol import END, HOST, Command, Tick, command_of, pack_tick
from colift.interrupts import heard as interrupts
from colift.mission import load_mission
from colift.mission.mission import Mission
from colift.team.geometry import Array, min_norm_tensions

WHOLE = 0.02
"""Share of the weight that may be missing of a force that is whole."""
WATCHDOG = 0.05
"""Time without an answer after which a drone pulls no more, s."""
LAG = 0.02
"""Of a pull behind its command, s."""
SUBSTEPS = 10
BIAS, NOISE, SPEED_NOISE = 0.02, 0.002, 0.01
"""Of a drone's measurement of the load: a steady error, m, and noise, m and m/s."""
FELT_NOISE = 0.02
"""Of the force that is felt, over the weight."""
START_TIME = 120.0
"""Longest time until all agents are there, s: they may have to compile."""
ANSWER_TIME = 1.0
"""Longest wait for an agent that lives, s, where the world waits."""

CYCLE = 0.01
"""Shortest cycle, s."""
GAINS = {"k_p": 35.0, "k_d": 9.0, "k_i": 13.0}
"""Of the load's own controller where the mission has none, over its mass: those of the paper."""

Watch = Callable[[int, "Swarm"], None]


@dataclass(frozen=True)
class Stroke:
    """What is done to an agent: killed with SIGKILL, or started again."""

    at: float
    drone: int
    restart: bool = False


@dataclass
class Flown:
    """What was recorded, a row a cycle.

    Attributes
    ----------
    dt : float
        Cycle, s.
    load, wanted : list of (3,)
        Where the load was and was to be, m.
    pulls : list of (n, 3)
        What each drone did to the load, N.
    wished : list of (3,)
        What those that answered wanted all to do, on average, with a motor's lag, N; where nobody did, what was wanted last.
    asked : list of (3,)
        The same before that lag.
    hears : list of (n,)
        Whom each heard, a bit for each number; 0 for those that did not answer.
    status : list of (n,)
        What its agent said of itself; -1 for those that did not answer.

    """

    dt: float
    load: list[Array] = field(default_factory=list)
    wanted: list[Array] = field(default_factory=list)
    pulls: list[Array] = field(default_factory=list)
    asked: list[Array] = field(default_factory=list)
    wished: list[Array] = field(default_factory=list)
    hears: list[list[int]] = field(default_factory=list)
    status: list[list[int]] = field(default_factory=list)

    @property
    def missing(self) -> Array:
        """By how much the sum of pulls misses the mean wish, (rows,), N."""
        pulls = np.array(self.pulls).sum(axis=1)
        return np.asarray(np.linalg.norm(pulls - np.array(self.wished), axis=1))

    def missing_now(self) -> float:
        """The last of it."""
        return float(np.linalg.norm(self.pulls[-1].sum(axis=0) - self.wished[-1]))

    def summary(self, strokes: Sequence[Stroke], weight: float) -> dict[str, Any]:
        """Distance from the path, m, and for each agent that was killed the time until the force was whole again, s; none where it never was."""
        away = np.linalg.norm(np.array(self.load) - np.array(self.wanted), axis=1)
        killed = [
            {
                "drone": stroke.drone,
                "at": stroke.at,
                "settled": self.settled(stroke.at, WHOLE, weight),
            }
            for stroke in strokes
            if not stroke.restart
        ]
        return {
            "tracking_max_m": float(away.max()),
            "tracking_rms_m": float(np.sqrt(np.mean(away**2))),
            "killed": killed,
        }

    def settled(self, at: float, share: float, weight: float) -> float | None:
        """Time from ``at`` (s) until so much of the weight is missing no more in the two seconds from there, s; none where it still is."""
        first = round(at / self.dt)
        missing = self.missing[first : first + round(2.0 / self.dt)] > share * weight
        if missing.size == 0 or missing[-1]:
            return None
        late = np.flatnonzero(missing)
        return float((late[-1] + 1) * self.dt) if late.size else 0.0


def for_agents(name: str, overrides: dict[str, Any]) -> tuple[dict[str, Any], list[str]]:
    """What else a mission needs to be flown by a swarm: agents, a law of the load's place, a cycle of 10 ms.

    With a note on each, and on what of the mission this world does not have.
    """
    mission = load_mission(name, overrides)
    found: dict[str, Any] = {}
    if mission.kinds["agents"] != "leaderless":
        found["agents.kind"] = "leaderless"
    if mission.timing.allocation < CYCLE:
        found["timing.allocation"] = CYCLE
    if mission.kinds["load_control"] != "pid":
        mass = mission.team.load_mass
        found |= {"load_control": {"kind": "pid", **{k: [g * mass] * 3 for k, g in GAINS.items()}}}
    notes = [f"{field} = {value}" for field, value in found.items()]
    left = [name for name in ("events", "disturbance", "fault") if getattr(mission, name)]
    if left:
        notes.append(f"left out: {', '.join(left)}")
    return {**overrides, **found}, notes


class Swarm:
    """Agents as processes, and the world that they fly in."""

    def __init__(
        self, mission: Mission, name: str, overrides: dict[str, Any], *, loss: float = 0.0
    ) -> None:
        if not mission.agents.decides or mission.kinds["agents"] != "leaderless":
            raise ColiftError('agents.kind: a swarm needs "leaderless"')
        if mission.kinds["load_control"] != "pid":
            raise ColiftError(
                'load_control.kind: a swarm needs "pid", which brings the load to its place by itself'
            )
        if len(mission.first_drones()) < mission.team.n:
            raise ColiftError("drones.join: a swarm flies all its drones from the start")
        self.mission, self.n, self.loss = mission, mission.team.n, loss
        self.dt = mission.timing.allocation
        self._source = name, overrides
        self._rng = np.random.default_rng(mission.seed)
        self._line = self._bound()
        self.ports = self._free_ports()
        self.processes: list[subprocess.Popen[bytes] | None] = [None] * self.n
        self.sessions = [0] * self.n
        self.flown = Flown(self.dt)
        team, directions = mission.team, mission.start_directions()
        weight = np.array([0.0, 0.0, team.load_mass * team.gravity])
        tensions = np.maximum(min_norm_tensions(directions, weight, None), 0.0)
        self.pulls = -tensions[:, None] * directions
        self.load = np.zeros((2, 3))
        self.load[0] = mission.reference.sample(np.zeros(1), team)[0, 0]
        self._bias = BIAS * self._rng.standard_normal((self.n, 3)) / np.sqrt(3.0)
        self._last: list[Command | None] = [None] * self.n
        self._wish, self._wished = weight, weight.copy()
        self._directions, self._tensions = directions.copy(), tensions.copy()

    def _bound(self) -> socket.socket:
        line = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        line.bind((HOST, 0))
        return line

    def _free_ports(self) -> list[int]:
        lines = [self._bound() for _ in range(self.n)]
        ports = [line.getsockname()[1] for line in lines]
        for line in lines:
            line.close()
        return ports

    def start(self, drone: int) -> None:
        """Start a drone's agent, in its next session."""
        self.sessions[drone] = self.sessions[drone] % 15 + 1
        name, overrides = self._source
        command = [
            sys.executable, "-m", "colift.flight.swarm.agent", name, "--overrides", json.dumps(overrides),
            "--number", str(drone), "--session", str(self.sessions[drone]), "--ports", json.dumps(self.ports),
            "--world", str(self._line.getsockname()[1]), "--loss", str(self.loss), "--seed", str(self.mission.seed),
        ]  # fmt: skip
        environment = {**os.environ, "OMP_NUM_THREADS": "1"}
        self.processes[drone] = subprocess.Popen(command, env=environment, start_new_session=True)

    def kill(self, drone: int) -> None:
        """End a drone's agent as a crash would: SIGKILL."""
        process = self.processes[drone]
        if process is not None and process.poll() is None:
            process.send_signal(signal.SIGKILL)
            process.wait()

    def close(self) -> None:
        """End all."""
        for drone, port in enumerate(self.ports):
            self._line.sendto(END, (HOST, port))
            process = self.processes[drone]
            if process is not None:
                try:
                    process.wait(2.0)
                except subprocess.TimeoutExpired:
                    self.kill(drone)
        self._line.close()

    def _alive(self, drone: int) -> bool:
        process = self.processes[drone]
        return process is not None and process.poll() is None

    def run(
        self, duration: float, strokes: Sequence[Stroke], *, waits: bool, watch: Watch | None = None
    ) -> Flown:
        """Fly for ``duration`` (s): on the clock, or, where the world ``waits``, with each cycle as long as its answers take.

        A restarted agent counts once it answers. Interrupted, it ends all processes and hands on.
        """
        due = sorted(strokes, key=lambda stroke: stroke.at)
        with interrupts() as interrupted:
            try:
                for drone in range(self.n):
                    self.start(drone)
                self._gather(0, START_TIME, everybody=True)
                begin = time.monotonic()
                for cycle in range(1, round(duration / self.dt)):
                    while due and due[0].at <= cycle * self.dt:
                        self._strike(due.pop(0))
                    wait = ANSWER_TIME if waits else begin + cycle * self.dt - time.monotonic()
                    self._gather(cycle, max(wait, 0.0), everybody=waits)
                    if not waits:
                        time.sleep(max(begin + cycle * self.dt - time.monotonic(), 0.0))
                    self._fly(cycle)
                    if watch is not None:
                        watch(cycle, self)
                    interrupted()
            finally:
                self.close()
        return self.flown

    def _strike(self, stroke: Stroke) -> None:
        self.kill(stroke.drone)
        if stroke.restart:
            self.start(stroke.drone)
            self._last[stroke.drone] = None

    def _tell(self, cycle: int) -> None:
        felt = self.pulls.sum(axis=0)
        weight = self.mission.team.load_mass * self.mission.team.gravity
        for drone, port in enumerate(self.ports):
            place = self.load[0] + self._bias[drone] + NOISE * self._rng.standard_normal(3)
            speed = self.load[1] + SPEED_NOISE * self._rng.standard_normal(3)
            own = felt + FELT_NOISE * weight * self._rng.standard_normal(3)
            pull = (float(np.linalg.norm(self.pulls[drone])), *self._directions[drone])
            tick = Tick(cycle, (*place, *speed), tuple(own), pull)
            self._line.sendto(pack_tick(tick), (HOST, port))

    def _gather(self, cycle: int, wait: float, *, everybody: bool) -> None:
        """Tell all a cycle and take what they answer, for so long at most; ``everybody`` who lives and has answered before is waited for."""
        self._tell(cycle)
        again = time.monotonic() + 0.2
        end = time.monotonic() + wait
        while True:
            expected = [
                drone for drone in range(self.n)
                if self._alive(drone) and (cycle == 0 or self._last[drone] is not None)
            ]  # fmt: skip
            answered = [last is not None and last.cycle == cycle for last in self._last]
            if all(answered[drone] for drone in expected) and (
                cycle > 0 or len(expected) == self.n
            ):
                return
            left = end - time.monotonic()
            if cycle == 0 and (left <= 0.0 or len(expected) < self.n):
                raise ColiftError("an agent did not start; its message is above")
            if left <= 0.0:
                return
            ready, _, _ = select.select([self._line], [], [], min(left, 0.05))
            if not ready:
                if cycle == 0 and time.monotonic() > again:  # those that were not there yet
                    self._tell(cycle)
                    again = time.monotonic() + 0.2
                continue
            try:
                data, (_, port) = self._line.recvfrom(256)
            except ConnectionError:  # a dead agent's port
                continue
            command = command_of(data)
            if (
                command is not None
                and port in self.ports
                and self.ports.index(port) == command.number
            ):
                last = self._last[command.number]
                if last is None or command.cycle >= last.cycle:
                    self._last[command.number] = command

    def _fly(self, cycle: int) -> None:
        team, n = self.mission.team, self.n
        mass = self.mission.true_bodies.load_mass
        hears, status, wanted = [0] * n, [-1] * n, np.zeros((n, 3))
        answers = [last for last in self._last if last is not None and last.cycle == cycle]
        if answers:
            self._wish = np.mean([answer.wish for answer in answers], axis=0)
        for answer in answers:
            hears[answer.number], status[answer.number] = answer.hears, answer.status
        for drone, last in enumerate(self._last):
            if last is None or (cycle - last.cycle) * self.dt > WATCHDOG:
                continue
            self._directions[drone] = last.direction
            wanted[drone] = -last.tension * np.array(last.direction)
        h = self.dt / SUBSTEPS
        for _ in range(SUBSTEPS):
            self.pulls += h / (h + LAG) * (wanted - self.pulls)
            self._wished += h / (h + LAG) * (self._wish - self._wished)
            self.load[1] += h * (self.pulls.sum(axis=0) / mass - np.array([0.0, 0.0, team.gravity]))
            self.load[0] += h * self.load[1]
        flown = self.flown
        flown.load.append(self.load[0].copy())
        flown.wanted.append(self.mission.reference.sample(np.array([cycle * self.dt]), team)[0, 0])
        flown.pulls.append(self.pulls.copy())
        flown.asked.append(self._wish)
        flown.wished.append(self._wished.copy())
        flown.hears.append(hears)
        flown.status.append(status)
