"""Fly a mission: bind its parts to the team, run the loop, hand back a recording."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.allocation.base import INFO_SIZE
from colift.geometry import min_norm_tensions, widest_gap, zero_yaw_quaternion
from colift.mission.schema import Event, Mission
from colift.part import LAYERS, Vector
from colift.plant.base import Start
from colift.recording import Recording
from colift.simulation.loop import CYCLE_WIDTH, Periods, Vectors, advance, is_compiled, kernels_of
from colift.simulation.signals import CYCLE_SIGNALS, SIGNALS, Bus, columns, make_bus
from colift.team import Team

Progress = Callable[[float], None]
"""Called with the fraction flown, between 0 and 1."""

CHUNK = 1.0
"""Simulated seconds between two looks at progress and interrupts."""


class Flight:
    """A mission in the air; :meth:`run` flies it to the end.

    Attributes
    ----------
    compiled : bool
        Whether every part is compiled, and so the loop.
    loop_time : float
        Wall time spent in the loop so far, s.

    """

    def __init__(self, mission: Mission) -> None:
        self.mission = mission
        self._kernels = kernels_of({layer: type(getattr(mission, layer)) for layer in LAYERS})
        self.compiled = all(is_compiled(kernel) for kernel in self._kernels)
        self.loop_time = 0.0
        self.outcome = "completed"
        self._step = 0
        self._every = Periods(mission.timing.step, **mission.timing.multiples())
        self._cycles = np.zeros((self._rows(self._every.allocation), CYCLE_WIDTH))
        self._info = np.zeros(INFO_SIZE)
        self._allocation = mission.allocation
        self._load_mass = mission.load.mass
        self._legs: list[_Leg] = []
        drones = mission.first_drones()
        team = mission.team.of(drones)
        start = start_state(mission)
        self._begin_leg(drones, self._fresh_memory(team, start))
        self._legs[-1].bus.desired_directions[:] = start.directions

    def run(self, progress: Progress | None = None) -> Recording:
        """Fly from where we are to the end of the mission.

        A flight whose numbers stop being finite ends there; the recording says so in ``outcome``.
        """
        steps = self.mission.timing.steps
        for stop in self._stops():
            for event in self.mission.events:
                if self._event_step(event) == self._step:
                    self._apply(event)
            self._advance(stop)
            if progress is not None:
                progress(stop / steps)
            if not np.isfinite(self._legs[-1].bus.row).all():
                self.outcome = f"diverged before t = {stop * self._every.step:g} s"
                break
        return self.recording()

    def recording(self) -> Recording:
        """What has been recorded so far; NaN for a drone that has left."""
        every, n = self._every, self.mission.drones.count
        rows = -(-self._step // every.recording)
        cycles = -(-self._step // every.allocation)
        arrays = {s.name: np.full((rows, *s.shape_for(n)), np.nan) for s in SIGNALS}
        ends = [*(-(-leg.first_step // every.recording) for leg in self._legs[1:]), rows]
        begin = 0
        for leg, end in zip(self._legs, ends, strict=True):
            where = columns(leg.team.n)
            for s in SIGNALS:
                values = leg.log[begin:end, where[s.name]]
                values = values.reshape(end - begin, *s.shape_for(leg.team.n))
                if s.shape[0] == "n":
                    arrays[s.name][begin:end, leg.drones] = values
                elif s.shape[0] == "n+1":
                    arrays[s.name][begin:end, [*leg.drones, n]] = values
                else:
                    arrays[s.name][begin:end] = values
            begin = end
        for k, signal in enumerate(CYCLE_SIGNALS):
            arrays[signal.name] = self._cycles[:cycles, k]
        return Recording(
            mission=self.mission,
            time=np.arange(rows, dtype=np.float64) * (every.recording * every.step),
            cycle_time=np.arange(cycles, dtype=np.float64) * (every.allocation * every.step),
            arrays=arrays,
            outcome=self.outcome,
        )

    def _fresh_memory(self, team: Team, start: Start) -> dict[str, Vector]:
        memory = {layer: getattr(self.mission, layer).memory(team) for layer in LAYERS[:-1]}
        return {**memory, "plant": self.mission.plant.initial(team, start)}

    def _begin_leg(self, drones: list[int], memory: dict[str, Vector]) -> None:
        """From here on these drones of the mission fly; every layer is bound to their team."""
        parts = {layer: getattr(self.mission, layer) for layer in LAYERS}
        parts["allocation"] = self._allocation.of(drones)
        team = self.mission.team.of(drones)
        bus = make_bus(team.n)
        self._legs.append(
            _Leg(
                first_step=self._step,
                drones=drones,
                team=team,
                bus=bus,
                params=Vectors(*(parts[layer].params(team) for layer in LAYERS)),
                memory=Vectors(**memory),
                log=np.zeros((self._rows(self._every.recording), bus.row.size)),
            )
        )
        self._set_load_mass(self._load_mass)

    def _advance(self, stop: int) -> None:
        loop: Any = advance if self.compiled else getattr(advance, "py_func", advance)
        leg = self._legs[-1]
        begin = time.perf_counter()
        loop(
            self._step,
            stop,
            self._every,
            *self._kernels,
            leg.params,
            leg.memory,
            self._info,
            leg.bus,
            leg.log,
            self._cycles,
        )
        self.loop_time += time.perf_counter() - begin
        self._step = stop

    def _rows(self, period: int) -> int:
        """How often something happens that happens every ``period`` steps, the first included."""
        return (self.mission.timing.steps - 1) // period + 1

    def _stops(self) -> list[int]:
        """Steps to come at which the loop pauses: each simulated second, each event, the end."""
        step, steps = self._every.step, self.mission.timing.steps
        chunk = max(1, round(CHUNK / step))
        events = {self._event_step(event) for event in self.mission.events}
        return sorted(
            s for s in {*range(chunk, steps, chunk), *events, steps} if self._step < s <= steps
        )

    def _event_step(self, event: Event) -> int:
        return round(event.at / self._every.step)

    def _apply(self, event: Event) -> None:
        """Let an event happen, now."""
        section, _, name = event.field.partition(".")
        leg = self._legs[-1]
        if section == "load":
            self._set_load_mass(event.value)
        elif name == "lose":
            self._regroup([drone for drone in leg.drones if drone != event.value])
        elif name == "join":
            self._regroup(sorted([*leg.drones, event.value]))
        else:
            self._allocation = self._allocation.model_copy(update={name: event.value})
            leg.params.allocation[:] = self._allocation.of(leg.drones).params(leg.team)

    def _set_load_mass(self, mass: float) -> None:
        self._load_mass = mass
        leg = self._legs[-1]
        leg.params.plant[:] = self.mission.plant.params(replace(leg.team, load_mass=mass))

    def _regroup(self, drones: list[int]) -> None:
        """Go on with these drones: who is missing has its cable cut, who is new hangs on a taut one."""
        old = self._legs[-1]
        team = self.mission.team.of(drones)
        places = np.array([old.drones.index(d) if d in old.drones else -1 for d in drones])
        stay, new = places[places >= 0], places < 0
        directions = np.zeros((team.n, 3))
        directions[~new] = old.bus.directions[stay]
        for i in np.flatnonzero(new):
            taken = directions[np.linalg.norm(directions, axis=1) > 0.0]
            directions[i] = widest_gap(taken, np.radians(self.mission.start.cone_deg))
        start = Start(
            load_position=old.bus.load[0],
            load_velocity=old.bus.load[1],
            directions=directions,
            attitudes=np.tile([1.0, 0.0, 0.0, 0.0], (team.n, 1)),
        )
        memory = {
            layer: getattr(self.mission, layer).carry_over(
                getattr(old.memory, layer), fresh, places
            )
            for layer, fresh in self._fresh_memory(team, start).items()
        }
        self._begin_leg(drones, memory)
        bus = self._legs[-1].bus
        for signal in SIGNALS:
            now, before = getattr(bus, signal.name), getattr(old.bus, signal.name)
            if signal.shape[0] in {"n", "n+1"}:
                now[: team.n][~new] = before[stay]
                now[team.n :] = before[len(old.drones) :]
            else:
                now[:] = before
        bus.desired_directions[new] = directions[new]


@dataclass(frozen=True)
class _Leg:
    """A stretch of the flight with the same drones, and what the loop needs for it."""

    first_step: int
    drones: list[int]
    team: Team
    bus: Bus
    params: Vectors
    memory: Vectors
    log: NDArray[np.float64]


def start_state(mission: Mission) -> Start:
    """Of the drones that fly at first: at rest on the start formation, each drone's thrust holding its share of the load.

    The attitude is the zero-yaw one for the static thrust, so that the flight starts in balance.
    """
    drones = mission.first_drones()
    team = mission.team.of(drones)
    directions = mission.start_directions()
    first = mission.reference.sample(np.zeros(1), team)[0]
    weight = [0.0, 0.0, team.load_mass * team.gravity]
    tensions = np.maximum(min_norm_tensions(directions, weight), 0.0)
    thrust = -tensions[:, None] * directions
    thrust[:, 2] += team.masses * team.gravity
    norms = np.linalg.norm(thrust, axis=1, keepdims=True)
    upward = np.array([0.0, 0.0, 1.0])
    aim = np.where(norms > 1e-9, thrust / np.maximum(norms, 1e-9), upward)
    return Start(
        load_position=first[0] + np.asarray(mission.start.load_offset),
        load_velocity=np.zeros(3),
        directions=directions,
        attitudes=zero_yaw_quaternion(aim),
    )
