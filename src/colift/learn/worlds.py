"""Worlds: missions that differ from each other by chance, ready to begin in compiled code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from colift.errors import ColiftError, MissionError, Problem, UnknownNameError
from colift.flight.flight import Flight, start_state, timetable
from colift.flight.loop import CYCLE_WIDTH
from colift.kernel.signals import LEGEND, columns
from colift.learn import kernels
from colift.learn.arena import gather
from colift.learn.kernels import Eyes
from colift.learn.levels import LEVELS, OBSERVATIONS, driven
from colift.learn.numbers import MOST_BOXES, NUMBERS, observed
from colift.learn.tasks import NEAR_SCALE, RIGID, TASKS, TERMS, UNKNOWN_RADIUS, Task
from colift.mission.load import layered, load_mission
from colift.mission.mission import Mission
from colift.team.geometry import matrix_of, min_norm_tensions
from colift.world.actuation.motors import Motors
from colift.world.fault.base import Change

Array = NDArray[np.float64]


class World(NamedTuple):
    """One mission as compiled code begins it."""

    arena: Array
    """All that its flight changes, after the first physics step (size,)."""
    keys: NDArray[np.int64]
    """Of the random numbers of each wire (wires,)."""
    due: Array
    """Changes by faults (d, 3): step, place in the arena, value."""
    numbers: Array
    """:data:`~colift.learn.numbers.NUMBERS`."""
    first: NDArray[np.float32]
    """What is observed after the first step."""


class Room(NamedTuple):
    """Where a team flies: what the loop is called with, and all its arrays in one vector."""

    arguments: tuple[Any, ...]
    eyes: Any
    arena: Array


@dataclass(frozen=True)
class Setting:
    """What an environment is: a task, a team, the level of its action, what is observed, and what differs between worlds."""

    task: Task
    drones: int
    load: str
    level: str
    observation: str
    period: float
    changes: Mapping[str, Any]
    ranges: Mapping[str, tuple[Any, Any]]
    seed: int

    @classmethod
    def of(
        cls,
        task: str,
        *,
        drones: int = 4,
        load: str = "point",
        level: str = "forces",
        observation: str = "central",
        period: float = 0.01,
        changes: Mapping[str, Any] | None = None,
        ranges: Mapping[str, tuple[Any, Any]] | None = None,
        world_seed: int = 0,
    ) -> Setting:
        """What an environment's options say.

        Parameters
        ----------
        task
            Name (:data:`colift.learn.tasks.TASKS`).
        drones
            Number of drones, 1 to 64.
        load
            ``"point"`` or ``"rigid"`` (:data:`colift.learn.tasks.RIGID`).
        level
            Of the action (:data:`colift.learn.levels.LEVELS`).
        observation
            ``"central"``, ``"drone"`` or ``"part"`` (:data:`colift.learn.levels.OBSERVATIONS`).
        period
            Of a step of the environment, s: a whole multiple of the physics step.
        changes
            Of the mission, by path, as of :func:`colift.load_mission`; they come last.
        ranges
            Low and high of what differs between worlds, by path; beside the task's own, in whose place it comes.
        world_seed
            Which worlds are drawn; others bring worlds that a learner has never seen.

        Raises
        ------
        UnknownNameError
            For a task that is not there.
        MissionError
            For options that do not go together.

        """
        if task not in TASKS:
            raise UnknownNameError("task", task, list(TASKS))
        drawn = {**TASKS[task].ranges, **(ranges or {})}
        found = cls(
            TASKS[task],
            drones,
            load,
            level,
            observation,
            period,
            dict(changes or {}),
            drawn,
            world_seed,
        )
        found.check()
        return found

    def check(self) -> None:
        """Refuse what does not go together.

        Raises
        ------
        MissionError
            With every mistake.

        """
        found = []
        for name, value, allowed in (
            ("load", self.load, ("point", "rigid")),
            ("level", self.level, tuple(LEVELS)),
            ("observation", self.observation, tuple(OBSERVATIONS)),
        ):
            if value not in allowed:
                found.append(Problem(name, repr(value), f"must be one of {', '.join(allowed)}"))
        if not isinstance(self.drones, int) or not 1 <= self.drones <= 64:
            found.append(
                Problem("drones", repr(self.drones), "must be a whole number from 1 to 64")
            )
        if self.observation == "part" and self.level != "cables":
            message = f'needs level = "cables", not {self.level!r}'
            found.append(Problem("observation", "'part'", message))
        if found:
            raise MissionError("environment", found)
        try:
            self.mission(0)
        except MissionError as error:  # which knows the period by what it is set to
            own = [
                replace(p, path="period") if p.path == "timing.recording" else p
                for p in error.problems
            ]
            raise MissionError("environment", own) from None

    def table(self, number: int) -> dict[str, Any]:
        """What world ``number`` changes of the task's mission."""
        rng = np.random.default_rng([self.seed, number])
        drawn = {
            path: np.asarray(rng.uniform(*bounds)).tolist() for path, bounds in self.ranges.items()
        }
        rigid = {**RIGID, **self.task.rigid} if self.load == "rigid" else {}
        base = {"drones.count": self.drones, **rigid}
        own = {"seed": number, "timing.recording": self.period}
        return layered(base, driven(self.level), own, drawn, self.changes)

    def mission(self, number: int) -> Mission:
        """The mission of world ``number``; a world is a mission, and may be flown as one.

        Raises
        ------
        MissionError
            Where the changes do not make a mission, or one whose changes compiled environments cannot make.

        """
        mission = load_mission(self.task.mission, self.table(number), must_fly=False)
        found = []
        if mission.events:
            found.append(Problem("events", "", "environments fly no events; use faults"))
        for layer, kind in (("detection", "none"), ("agents", "central")):
            if mission.kinds[layer] != kind:
                message = f'must be "{kind}": in an environment nobody regroups the team'
                found.append(Problem(f"{layer}.kind", mission.kinds[layer], message))
        if found:
            raise MissionError("environment", found)
        return mission

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Of an observation."""
        kind, rigid = OBSERVATIONS[self.observation], self.load == "rigid"
        return observed(kind, self.drones, rigid=rigid, boxes=len(self.task.boxes) > 0)

    def world(self, number: int) -> World:
        """Make world ``number`` ready."""
        mission = self.mission(number)
        flight, room = room_of(mission)
        keys = keys_of(room)
        numbers, seen = self.numbers(mission), np.zeros(self.shape, np.float32)
        due = due_of(mission, room)
        for _, place, value in due[due[:, 0] <= 0.0]:
            room.arena[int(place)] = value
        level = LEVELS[self.level]
        begin: Any = kernels.begin
        begin(
            level.number, OBSERVATIONS[self.observation], flight.periods, *room.arguments, *logs(flight, 1), room.eyes,
            numbers, np.zeros(level.width * self.drones), seen.reshape(-1),
        )  # fmt: skip
        return World(room.arena.copy(), keys, due, numbers, seen)

    def numbers(self, mission: Mission) -> Array:
        """:data:`~colift.learn.numbers.NUMBERS` of a mission."""
        task, team = self.task, mission.team
        start, _ = start_state(mission)
        weight = team.load_mass * team.gravity
        levers = team.levers @ matrix_of(start.load_attitude).T
        tensions = np.maximum(min_norm_tensions(start.directions, [0.0, 0.0, weight], levers), 0.0)
        motors = mission.actuation if isinstance(mission.actuation, Motors) else Motors()
        boxes = np.zeros((MOST_BOXES, 6))
        boxes[: len(task.boxes)] = task.boxes
        return NUMBERS.pack(
            team.n, weight=weight, length=float(team.cable_lengths.mean()), g=team.gravity,
            rigid=float(team.body is not None), reach=task.reach, least_height=task.least_height, scale=NEAR_SCALE,
            gap=task.gap, boxes=float(len(task.boxes)), box=boxes.ravel(), **{name: task.weights[name] for name in TERMS},
            pull=-tensions[:, None] * start.directions, thrust=team.hover_forces(tensions, start.directions),
            lever=motors.levers(team), ratio=motors.settled("torque_ratio", team),
            radius=np.where(np.isfinite(team.radii), team.radii, UNKNOWN_RADIUS * team.cable_lengths),
        )  # fmt: skip


def room_of(mission: Mission) -> tuple[Flight, Room]:
    """A flight of the mission, and a room in which compiled code flies it.

    Raises
    ------
    ColiftError
        Where a part is plain Python.

    """
    flight = Flight(mission)
    if not flight.compiled:
        plain = [layer for layer, wire in flight.wires._asdict().items() if not _compiled(wire)]
        raise ColiftError(
            f"environment: {', '.join(plain) or 'a disturbance'} is plain Python; environments fly compiled parts only"
        )
    eyes = Eyes(*(getattr(flight.bus, name) for name in Eyes._fields))
    (arguments, eyes), arena = gather((flight.circuit.arguments, eyes))
    return flight, Room(arguments, eyes, arena)


def _compiled(wire: Any) -> bool:
    return hasattr(wire.kernel, "py_func")


def keys_of(room: Room) -> NDArray[np.int64]:
    """Of the random numbers of each wire, then of each disturbance."""
    wires, _, _, disturbing, _ = room.arguments
    return np.array([wire.key for wire in (*wires, *disturbing)], dtype=np.int64)


def logs(flight: Flight, steps: int) -> tuple[Array, Array]:
    """Where the loop records so many steps; nobody looks there."""
    return np.zeros((steps + 1, flight.bus.row.size)), np.zeros((steps + 1, CYCLE_WIDTH))


def due_of(mission: Mission, room: Room) -> Array:
    """What faults change (d, 3): step, place in the arena, value."""
    n, found = mission.drones.count, []
    begin = (room.eyes.row.ctypes.data - room.arena.ctypes.data) // room.arena.itemsize
    for step, change in timetable(mission):
        assert isinstance(change, Change)
        where = columns(n)[change.signal]
        places = np.arange(where.start, where.stop).reshape(LEGEND[change.signal].shape_for(n))
        if change.drone is not None:
            row = change.drone % len(places)  # the load's is the last
            places = places[row : row + 1]
        values = np.broadcast_to(np.array(change.value, dtype=np.float64), places.shape)
        known = ~np.isnan(values)
        found += [
            (step, begin + at, to) for at, to in zip(places[known], values[known], strict=True)
        ]
    return np.array(found, dtype=np.float64).reshape(-1, 3)
