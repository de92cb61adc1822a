"""Fly a mission: bind its parts to the team, run the loop, hand back a recording."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from colift.allocation.base import INFO_SIZE
from colift.geometry import min_norm_tensions, zero_yaw_quaternion
from colift.mission.schema import Mission
from colift.part import LAYERS
from colift.plant.base import Start
from colift.recording import Recording
from colift.simulation.loop import CYCLE_WIDTH, Periods, Vectors, advance, is_compiled
from colift.simulation.signals import CYCLE_SIGNALS, SIGNALS, columns, make_bus

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
        team = mission.team
        parts = {layer: getattr(mission, layer) for layer in LAYERS}
        kernels = [type(parts[layer]).kernel for layer in LAYERS[:-1]]
        plant = type(parts["plant"])
        self._kernels = [*kernels, plant.observe, plant.kernel]
        self.compiled = all(is_compiled(kernel) for kernel in self._kernels)
        self.loop_time = 0.0
        self._every = Periods(mission.timing.step, **mission.timing.multiples())
        self._bus = make_bus(team.n)
        self._bus.desired_directions[:] = mission.start_directions()
        self._params = Vectors(*(parts[layer].params(team) for layer in LAYERS))
        memory = {layer: parts[layer].memory(team) for layer in LAYERS[:-1]}
        memory["plant"] = mission.plant.initial(team, start_state(mission))
        self._memory = Vectors(**memory)
        steps = mission.timing.steps
        self._log = np.zeros(((steps - 1) // self._every.recording + 1, self._bus.row.size))
        self._cycles = np.zeros(((steps - 1) // self._every.allocation + 1, CYCLE_WIDTH))
        self._info = np.zeros(INFO_SIZE)
        self._step = 0
        self.outcome = "completed"

    def run(self, progress: Progress | None = None) -> Recording:
        """Fly from where we are to the end of the mission.

        A flight whose numbers stop being finite ends there; the recording says so in ``outcome``.
        """
        steps = self.mission.timing.steps
        stops = self._stops()
        for stop in stops:
            self._apply_events()
            self._advance(stop)
            if progress is not None:
                progress(stop / steps)
            if not np.isfinite(self._bus.row).all():
                self.outcome = f"diverged before t = {stop * self._every.step:g} s"
                break
        return self.recording()

    def recording(self) -> Recording:
        """What has been recorded so far."""
        every = self._every
        rows = (self._step - 1) // every.recording + 1
        cycles = (self._step - 1) // every.allocation + 1
        n = self.mission.drones.count
        where = columns(n)
        arrays = {
            s.name: self._log[:rows, where[s.name]].reshape(rows, *s.shape_for(n)) for s in SIGNALS
        }
        for k, signal in enumerate(CYCLE_SIGNALS):
            arrays[signal.name] = self._cycles[:cycles, k]
        return Recording(
            mission=self.mission,
            time=np.arange(rows, dtype=np.float64) * (every.recording * every.step),
            cycle_time=np.arange(cycles, dtype=np.float64) * (every.allocation * every.step),
            arrays=arrays,
            outcome=self.outcome,
        )

    def _advance(self, stop: int) -> None:
        loop: Any = advance if self.compiled else getattr(advance, "py_func", advance)
        begin = time.perf_counter()
        loop(
            self._step,
            stop,
            self._every,
            *self._kernels,
            self._params,
            self._memory,
            self._info,
            self._bus,
            self._log,
            self._cycles,
        )
        self.loop_time += time.perf_counter() - begin
        self._step = stop

    def _stops(self) -> list[int]:
        """Steps to come at which the loop pauses: each simulated second, each event, the end."""
        step, steps = self._every.step, self.mission.timing.steps
        chunk = max(1, round(CHUNK / step))
        events = {self._event_step(event.at) for event in self.mission.events}
        return sorted(
            s for s in {*range(chunk, steps, chunk), *events, steps} if self._step < s <= steps
        )

    def _event_step(self, at: float) -> int:
        return round(at / self._every.step)

    def _apply_events(self) -> None:
        """Give plant and allocator the parameters that hold at the present step."""
        mission, due = self.mission, {}
        for event in sorted(self.mission.events, key=lambda event: event.at):
            if self._event_step(event.at) <= self._step:
                due[event.field] = event.value
        if "load.mass" in due:
            truth = replace(mission.team, load_mass=due.pop("load.mass"))
            self._params.plant[:] = mission.plant.params(truth)
        if due:
            changed = {field.partition(".")[2]: value for field, value in due.items()}
            part = mission.allocation.model_copy(update=changed)
            self._params.allocation[:] = part.params(mission.team)


def start_state(mission: Mission) -> Start:
    """At rest on the start formation, each drone's thrust holding its share of the load.

    The attitude is the zero-yaw one for the static thrust, so that the flight starts in balance.
    """
    team = mission.team
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
