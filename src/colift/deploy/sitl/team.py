"""A mission flown by simulated autopilots: a process a drone, all in lock step with the plant.

The flight is driven from outside at two layers (:meth:`colift.flight.flight.Flight.act`): attitude control and actuation. Every
``EXCHANGE`` each autopilot is told its drone's state and the sticks for the attitude and thrust that position control wants, runs
for as long, and answers with its motors' commands, which the motors of the mission follow with their lag, noise and faults.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.deploy.sitl import betaflight
from colift.deploy.sitl.process import Autopilot, check, settled
from colift.deploy.softer import notes, softer
from colift.errors import ColiftError, SettingError
from colift.flight.flight import Flight, Progress, random_key, start_state
from colift.flight.leg import places_of
from colift.flight.runner import Run
from colift.interrupts import heard
from colift.kernel.ports import PORTS
from colift.mission.load import load_mission
from colift.mission.mission import Mission
from colift.part import make
from colift.team.geometry import matrix_of
from colift.world.actuation.motors import Motors

Array = NDArray[np.float64]

EXCHANGE = 0.002
"""Time between two exchanges with the autopilots, s."""
BOOT, LEVEL, ARM, TILT = 2.0, 5.0, 0.5, 1.0
"""What an autopilot is given before the flight, s: to boot, to see that it stands level, to arm, and to turn to the attitude in which it is let go."""
PAUSE = 0.01
"""Time between two exchanges before the flight, s."""
SILENCE = 0.1
"""Time without an answer after which a drone is taken for lost, s."""
LAG = 0.06
"""Time by which a drone's thrust vector lags behind the sticks, s, as the controllers are told."""
DRIVEN = {
    "attitude_control": {"kind": "external"},
    "actuation": {"kind": "external", "lag": LAG},
}
"""What the autopilots are, in the mission."""


@dataclass(frozen=True)
class Kill:
    """A process that is ended with SIGKILL, and when, s."""

    at: float
    drone: int


def for_autopilots(name: str, overrides: dict[str, Any]) -> tuple[Mission, Motors, list[str]]:
    """A mission as autopilots fly it, the motors that they drive, and a note on each setting that is another for them.

    Gains that a Betaflight's angle loop does not bear are lowered, unless they stand in ``overrides``.
    """
    asked = load_mission(name, overrides)
    found = asked.actuation
    motors = found if isinstance(found, Motors) else make("actuation", {"kind": "motors"}, asked)
    assert isinstance(motors, Motors)
    lowered = softer(asked, overrides)
    changes = {**overrides, **DRIVEN, **lowered}
    if hasattr(asked.observation, "lag"):  # forces are told by the thrust, not by where it points
        changes["observation.lag"] = motors.motor_lag()
    return load_mission(name, changes), motors, notes(lowered)


class Rotors:
    """The mission's motors, of the drones that fly, behind the autopilots' mixers."""

    def __init__(self, mission: Mission, part: Motors) -> None:
        self._mission, self._part = mission, part
        self._drones: list[int] = []
        self._team = mission.team
        self._own = part
        self._wire: Any = None

    def follow(self, flight: Flight, wanted: Array, dt: float) -> Any:
        """What the actuation writes after motors have wanted these thrusts (n, 4), N, for ``dt``, s."""
        if flight.drones != self._drones:
            self._begin(flight.drones)
        sees = self._wire.sees
        sees.thrusts[:], sees.torques[:] = self._own.together(self._team, wanted)
        sees.motor_health[:] = flight.bus.motor_health
        PORTS["actuation"].invoke(self._wire, round(flight.time / dt), flight.time, dt)
        return self._wire.writes

    def _begin(self, drones: list[int]) -> None:
        team, part, port = self._mission.team.of(drones), self._part.of(drones), PORTS["actuation"]
        memory, signals = part.memory(team), port.signals(team.n)
        if self._wire is not None:
            places = places_of(self._drones, drones)
            stay = places >= 0
            memory = part.carry_over(self._wire.memory, memory, places)
            signals["saturated_times"][stay] = self._wire.writes.saturated_times[places[stay]]
        key = random_key(self._mission.seed, "actuation")
        self._drones, self._team, self._own = list(drones), team, part
        self._wire = port.wire(type(part).kernel, part.params(team), memory, signals, key=key)


class SitlFlight:
    """A mission in the air, flown by one simulated autopilot a drone.

    Parameters
    ----------
    mission : Mission
        As :func:`for_autopilots` makes it.
    motors : Motors
        Which the autopilots drive.
    kills : sequence of Kill
        Processes to end in flight.

    Raises
    ------
    MissingExtraError
        Where there is no firmware, no compiler or no Linux.
    SettingError
        For a kill that cannot be.

    """

    def __init__(self, mission: Mission, motors: Motors, kills: Sequence[Kill] = ()) -> None:
        check()
        n, timing = mission.team.n, mission.timing
        for kill in kills:
            if not 0 <= kill.drone < n:
                raise SettingError.of("kill", kill.drone, f"must be a drone from 0 to {n - 1}")
            if not 0.0 < kill.at < timing.duration:
                raise SettingError.of(
                    "kill", f"{kill.at:g} s", f"must be in flight, of {timing.duration:g} s"
                )
        self.mission, self.flight = mission, Flight(mission)
        self.autopilots: list[Autopilot] = []
        self._motors, self._rotors = motors, Rotors(mission, motors)
        self._most = 0.25 * motors.thrust_limits(mission.team)
        self._kills = sorted(kills, key=lambda kill: kill.at)
        self._every = max(1, round(EXCHANGE / timing.step))
        self._dt = self._every * timing.step
        self._velocities = np.zeros((n, 3))
        self._silent = np.zeros(n)

    def run(self, progress: Progress | None = None) -> Run:
        """Fly to the end of the mission; whatever happens, no process outlives it."""
        flight, timing, told = self.flight, self.mission.timing, 0
        with tempfile.TemporaryDirectory(prefix="colift-sitl-") as folder, heard() as interrupted:
            try:
                self._start(Path(folder), interrupted)
                self._follow(flight.drones)
                begin = time.perf_counter()
                for step in range(0, timing.steps, self._every):
                    flight.advance(min(self._every, timing.steps - step) * timing.step)
                    if flight.outcome != "completed":
                        break
                    self._kill()
                    self._exchange()
                    interrupted()
                    if progress is not None and (step * 100) // timing.steps > told:
                        told = (step * 100) // timing.steps
                        progress(step / timing.steps)
            finally:
                for autopilot in self.autopilots:
                    autopilot.end()
        flown = time.perf_counter() - begin
        return Run(recording=flight.recording(), loop_time=flown, compiled=flight.compiled)

    def _start(self, folder: Path, interrupted: Callable[[], None]) -> None:
        """Start all processes and bring them to where they are let go: armed, at the attitudes of the start."""
        mission = self.mission
        start, thrusts = start_state(mission)
        n, first = mission.team.n, mission.first_drones()
        level, hover = (
            np.tile([1.0, 0.0, 0.0, 0.0], (n, 1)),
            mission.team.masses * mission.team.gravity,
        )
        attitudes = level.copy()
        attitudes[first], hover[first] = start.attitudes, thrusts
        for drone, turning in enumerate(self._turning(hover)):
            own = folder / str(drone)
            own.mkdir()
            settled(betaflight.settings(turning), own)
            self.autopilots.append(Autopilot(own))
            interrupted()
        for autopilot in self.autopilots:
            autopilot.send(BOOT)
        for autopilot in self.autopilots:
            autopilot.wait()
        self._stand(level, np.zeros(n), LEVEL, armed=False)
        self._stand(level, np.zeros(n), ARM, armed=True)
        self._stand(attitudes, hover, TILT, armed=True)
        for drone, autopilot in enumerate(self.autopilots):
            if not autopilot.motors.any():
                raise ColiftError(f"the autopilot of drone {drone} did not arm")

    def _turning(self, hover: Array) -> list[float]:
        """Of each drone, turning acceleration about x and y per change of its motors' commands, near these thrusts, 1/s²."""
        team = self.mission.team
        each = 0.25 * np.maximum(hover, team.masses * team.gravity)
        slope = 2.0 * np.sqrt(each * self._most)
        turning = 4.0 * self._motors.levers(team) * slope / team.inertias[:, :2].mean(axis=1)
        return [float(value) for value in turning]

    def _stand(self, attitudes: Array, thrusts: Array, duration: float, *, armed: bool) -> None:
        """Hold all drones at attitudes for a time, with sticks to match and motors for these thrusts."""
        wanted = betaflight.command(0.25 * thrusts, self._most)
        sticks = betaflight.sticks(attitudes, attitudes, wanted)
        gravity, still = self.mission.team.gravity, np.zeros(3)
        states = [betaflight.state(each, still, gravity * matrix_of(each)[2]) for each in attitudes]
        told = list(zip(self.autopilots, states, sticks, strict=True))
        for _ in range(round(duration / PAUSE)):
            for autopilot, state, own in told:
                autopilot.send(PAUSE, state, betaflight.packet(own, armed=armed))
            for autopilot in self.autopilots:
                autopilot.wait()

    def _exchange(self) -> None:
        """Tell all autopilots where they are and what is wanted, and let their motors follow what they answer."""
        flight = self.flight
        bus, drones = flight.bus, flight.drones
        matrices = np.array([matrix_of(each) for each in bus.attitudes])
        thrusts = np.maximum(np.einsum("ij,ij->i", bus.drone_forces, matrices[:, :, 2]), 0.0)
        wanted = betaflight.command(0.25 * thrusts, self._most[drones])
        sticks = betaflight.sticks(bus.attitudes, bus.desired_attitudes, wanted)
        felt = (bus.velocities - self._velocities[drones]) / self._dt
        felt[:, 2] += self.mission.team.gravity
        self._velocities[drones] = bus.velocities
        for i, drone in enumerate(drones):
            state = betaflight.state(bus.attitudes[i], bus.rates[i], felt[i] @ matrices[i])
            self.autopilots[drone].send(self._dt, state, betaflight.packet(sticks[i], armed=True))
        for drone in drones:
            self.autopilots[drone].wait()
        self._follow(drones)
        self._lose(drones)

    def _follow(self, drones: list[int]) -> None:
        """Let the motors follow what the autopilots answered last."""
        order = list(betaflight.MOTORS)
        commands = np.array([self.autopilots[drone].motors[order] for drone in drones])
        wanted = betaflight.thrusts(commands, self._most[drones, None])
        written = self._rotors.follow(self.flight, wanted, self._dt)
        self.flight.act("actuation", **written._asdict())
        self.flight.act("attitude_control", torques=written.applied_torques)

    def _kill(self) -> None:
        while self._kills and self._kills[0].at <= self.flight.time + 1e-9:
            self.autopilots[self._kills.pop(0).drone].kill()

    def _lose(self, drones: list[int]) -> None:
        """Go on without drones whose autopilots have been silent for long enough."""
        for drone in drones:
            self._silent[drone] += 0.0 if self.autopilots[drone].alive else self._dt
        if lost := [drone for drone in drones if self._silent[drone] > SILENCE]:
            self.flight.leave(lost)
