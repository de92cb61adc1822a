"""A mission flown by vehicles over MAVLink: a flight whose plant is the world outside.

Each cycle the flight is told where vehicles and load are, goes on by one period with all of its controllers, and each vehicle is
told what comes of it: attitude and thrust, or where to be. What it records is the flight as it was.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from colift.deploy.mavlink.link import LOAD, STATION, Line, Tracked, Vehicle
from colift.deploy.mavlink.setpoints import (
    Convention,
    attitude_target,
    normalised,
    position_target,
)
from colift.deploy.softer import notes, softer
from colift.errors import ColiftError
from colift.flight.flight import Flight, start_state
from colift.interrupts import heard
from colift.mission.load import load_mission
from colift.mission.mission import Mission
from colift.record.recording import Recording
from colift.team.geometry import matrix_of
from colift.world.plant.base import STATE

Array = NDArray[np.float64]
Target = Literal["attitude", "position"]

PERIOD = 0.02
"""Time between two set-points, s."""
STREAM = 1.2
"""Time for which set-points are sent before a vehicle is asked to follow them, s: PX4 asks for one second."""
GATHER = 30.0
"""Longest wait for all to tell where they are, and then to follow and arm, s."""
NEAR = 0.3
"""How far from its place in the mission each may be at the start, m."""
SILENCE = 0.5
"""Time without news after which a vehicle is taken for lost, s; and after which a load that nobody tracks ends the flight."""
LATE = 0.5
"""By so much a cycle may be late, s; a station that was held up for longer hands all back."""
LAG = 0.1
"""By which a vehicle's thrust vector lags behind its set-points, s, as the controllers are told."""
OUTSIDE: dict[str, Any] = {
    "plant": {"kind": "external"},
    "sensing": {"kind": "ideal"},
    "attitude_control": {"kind": "external"},
    "actuation": {"kind": "external", "lag": LAG},
    "disturbance": [],
    "fault": [],
    "truth": {},
}
"""What is not simulated, in the mission."""


def for_vehicles(name: str, overrides: dict[str, Any]) -> tuple[Mission, list[str]]:
    """A mission whose plant, sensors, attitude loops and motors are outside, and a note on each gain that is lowered for that.

    What it simulates beside them is left out.
    """
    asked = load_mission(name, overrides)
    lowered = softer(asked, overrides)
    return load_mission(name, {**overrides, **lowered, **OUTSIDE}), notes(lowered)


class Station:
    """Controls vehicles by set-points.

    Parameters
    ----------
    mission : Mission
        As :func:`for_vehicles` makes it.
    vehicles : sequence of Vehicle
        One for each drone of the mission.
    load : Tracked
        What tells where the load is.
    target : str
        What vehicles are told: ``"attitude"`` and thrust, or ``"position"`` with velocity and acceleration.
    hover : float, optional
        Thrust (0 to 1) at which a vehicle hovers by itself; the convention's unless given.

    """

    def __init__(
        self,
        mission: Mission,
        vehicles: Sequence[Vehicle],
        load: Tracked,
        *,
        target: Target = "attitude",
        hover: float | None = None,
    ) -> None:
        self.mission, self.vehicles, self.load, self.target = mission, vehicles, load, target
        self.flight = Flight(mission)
        self.flying = False
        self.hover = hover
        self._begin = self._took_off = -np.inf
        self._cycles = 0
        self._first = self.flight.wires.plant.memory.copy()
        self._start = start_state(mission)

    def step(self, now: float) -> bool:
        """One cycle at a time, s; whether there is another one."""
        for each in (*self.vehicles, self.load):
            each.listen(now)
        for vehicle in self.vehicles:
            vehicle.beat(now)
        if self.flying:
            return self._fly(now)
        if self._begin == -np.inf:
            self._begin = now
        if all(each.age(now) < SILENCE for each in (*self.vehicles, self.load)):
            self._prepare(now)
        elif now - self._begin > GATHER:
            gone = [
                each.title for each in (*self.vehicles, self.load) if not each.age(now) < SILENCE
            ]
            raise ColiftError(f"nothing was heard of {', '.join(gone)} within {GATHER:g} s")
        return True

    @property
    def addresses(self) -> list[tuple[str, int]]:
        """Where it listens for each vehicle and, last, for the load."""
        return [each.line.address for each in (*self.vehicles, self.load)]

    def close(self) -> None:
        """Close its ports."""
        for each in (*self.vehicles, self.load):
            each.line.close()

    def _prepare(self, now: float) -> None:
        """Stream the set-points of the start, then have all follow them; then fly."""
        self._check_places()
        start, thrusts = self._start
        for i, vehicle in enumerate(self.vehicles):
            vehicle.say(self._attitude(i, now, start.attitudes[i], float(thrusts[i])))
        streamed = now - self._begin
        if all(vehicle.obeys and vehicle.armed for vehicle in self.vehicles):
            self.flying, self._took_off = True, now - PERIOD
        elif streamed > GATHER:
            idle = [each.title for each in self.vehicles if not (each.obeys and each.armed)]
            raise ColiftError(
                f"{', '.join(idle)}: did not follow set-points and arm within {GATHER:g} s"
            )
        elif streamed > STREAM:
            for vehicle in self.vehicles:
                vehicle.take_over(now)

    def _check_places(self) -> None:
        places = STATE.view(self._first, "position")
        due = [*zip(self.vehicles, places, strict=True), (self.load, self._start[0].load_position)]
        wrong = [
            f"{each.title} is at {np.round(each.position, 2)} m, {away:.2f} m from {np.round(place, 2)}"
            for each, place in due
            if (away := float(np.linalg.norm(each.position - place))) > NEAR
        ]
        if wrong:
            raise ColiftError(
                f"not at their places in the mission (within {NEAR:g} m): {'; '.join(wrong)}"
            )

    def _fly(self, now: float) -> bool:
        flight = self.flight
        due = round((now - self._took_off) / PERIOD) - self._cycles
        if due * PERIOD > LATE:
            flight.outcome = (
                f"the station was held up for {due * PERIOD:.2g} s at t = {flight.time:g} s"
            )
        elif self.load.age(now) > SILENCE:
            flight.outcome = f"the load was not tracked any more at t = {flight.time:g} s"
        else:
            self._lose(now)
        if flight.outcome == "completed":
            self._tell_where()
            flight.advance(due * PERIOD)
            self._cycles += due
        if flight.outcome == "completed":
            for i, drone in enumerate(flight.drones):
                self.vehicles[drone].say(self._told(i, drone, now))
                self._log(i, self.vehicles[drone], now)
            if flight.time < self.mission.timing.duration:
                return True
        for drone in flight.drones:
            self.vehicles[drone].hand_back()
        return False

    def _log(self, i: int, vehicle: Vehicle, now: float) -> None:
        """Tell a vehicle what its log should hold beside its own (:mod:`colift.record.importing.ulog`)."""
        bus = self.flight.bus
        vehicle.tell("load", now, self.load.position)
        vehicle.tell("load_v", now, self.load.velocity)
        vehicle.tell("share", now, -bus.received_tensions[i] * bus.received_directions[i])
        vehicle.tell("force", now, bus.force)

    def _lose(self, now: float) -> None:
        """Go on without vehicles that are silent, or follow no more; they are told nothing any more, so that they help themselves."""
        vehicles = [(drone, self.vehicles[drone]) for drone in self.flight.drones]
        if lost := [i for i, each in vehicles if not (each.age(now) <= SILENCE and each.obeys)]:
            self.flight.leave(lost)

    def _tell_where(self) -> None:
        """Put the flight's load and drones to where they are."""
        memory = self.flight.wires.plant.memory
        found = [self.vehicles[drone] for drone in self.flight.drones]
        STATE.view(memory, "load_position")[:] = self.load.position
        STATE.view(memory, "load_velocity")[:] = self.load.velocity
        for name in ("position", "velocity", "attitude", "rates"):
            STATE.view(memory, name)[:] = [getattr(each, name) for each in found]

    def _told(self, i: int, drone: int, now: float) -> dict[str, Any]:
        """Set-point of the vehicle in place ``i`` of those that fly."""
        bus = self.flight.bus
        if self.target == "attitude":
            thrust = float(bus.drone_forces[i] @ matrix_of(bus.estimated_attitudes[i])[:, 2])
            return self._attitude(drone, now, bus.desired_attitudes[i], thrust)
        team = self.mission.team
        direction, end = bus.received_directions[i], bus.wanted_ends[i]
        length = team.cable_lengths[drone] + bus.reeled[i, 0]
        pull = bus.received_tensions[i] * direction / team.masses[drone]
        return position_target(now, 0.0, end[0] - length * direction, end[1], end[2] - pull)

    def _attitude(self, drone: int, now: float, attitude: Array, thrust: float) -> dict[str, Any]:
        team = self.mission.team
        hover = self.vehicles[drone].convention.hover if self.hover is None else self.hover
        weight = float(team.masses[drone] * team.gravity)
        return attitude_target(now, attitude, normalised(thrust, weight, hover))


def over_udp(
    mission: Mission,
    convention: Convention,
    host: str,
    port: int,
    *,
    target: Target = "attitude",
    hover: float | None = None,
) -> Station:
    """A station that listens for drone i, system i + 1, at UDP port ``port + i``, and behind them for what tracks the load; at free ports for 0."""
    n = mission.team.n
    lines: list[Line] = []
    try:
        lines.extend(Line(host, port + i if port else 0, STATION) for i in range(n + 1))
    except ColiftError:
        for line in lines:
            line.close()
        raise
    vehicles = [Vehicle(lines[i], i + 1, f"drone {i}", convention) for i in range(n)]
    load = Tracked(lines[n], LOAD, "the load")
    return Station(mission, vehicles, load, target=target, hover=hover)


def run(
    station: Station, clock: Callable[[], float], progress: Callable[[float], None] | None = None
) -> Recording:
    """Step a station each time that ``clock`` tells the time of the next cycle (s), to the end of its mission.

    Interrupted, it hands all vehicles back, and what was recorded is lost.
    """
    duration = station.mission.timing.duration
    with heard() as interrupted:
        try:
            while station.step(clock()):
                interrupted()
                if progress is not None:
                    progress(min(station.flight.time / duration, 1.0))
        finally:
            for vehicle in station.vehicles:
                vehicle.hand_back()
    return station.flight.recording()
