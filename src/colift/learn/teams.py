"""Many teams that fly at once, each in a world of its own, in compiled code and without Python between them."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from colift.errors import SettingError
from colift.kernel.math.noise import uniforms
from colift.learn import kernels
from colift.learn.levels import LEVELS, OBSERVATIONS
from colift.learn.worlds import Setting, World, logs, room_of

Array = NDArray[np.float64]
Progress = Callable[[float], None]

CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def world_of(seed: int, episode: int, worlds: int) -> int:
    """In which of the worlds an episode is flown, by the seed of its team."""
    return int(uniforms(seed, episode, 0)[0] * worlds)


class Teams:
    """So many teams of a setting; :meth:`reset`, then :meth:`step` as often as wanted.

    Parameters
    ----------
    setting : Setting
    count : int
        Of the teams.
    worlds : int
        Of the worlds, in one of which each episode is flown.
    threads : int, optional
        None: one a core.

    Attributes
    ----------
    seen : (count, ...) array
        What is observed.
    final : (count, ...) array
        What was observed at the end of the last episode of each.
    reward : (count,) array
    over : (count,) array
        Why an episode ended before its time with the last step (:data:`colift.learn.tasks.ENDS`), or 0.
    late : (count,) array
        1 where it ended as its time was up.
    world : (count,) array
        In which each flies.

    """

    def __init__(
        self, setting: Setting, count: int, *, worlds: int, threads: int | None = None
    ) -> None:
        self.setting = setting
        self._worlds: dict[int, World] = {}
        self.worlds = worlds
        mission = setting.mission(0)
        flight, room = room_of(mission)
        self._every = flight.periods
        self.skip = round(setting.period / mission.timing.step)
        self._last = mission.timing.steps
        rooms = max(1, min(CORES if threads is None else threads, count))
        found = [(flight, room), *(room_of(mission) for _ in range(rooms - 1))]
        self._rooms = [(room, logs(flight, self.skip)) for flight, room in found]
        self._pool = ThreadPoolExecutor(rooms) if rooms > 1 else None
        bounds = np.linspace(0, count, rooms + 1).round().astype(int)
        self._parts = [*zip(bounds[:-1].tolist(), bounds[1:].tolist(), strict=True)]
        self.count, self.shape = count, setting.shape
        level = LEVELS[setting.level]
        self.actions = setting.drones * level.width
        self._codes = level.number, OBSERVATIONS[setting.observation]
        self._teams = np.zeros((count, room.arena.size))
        self._steps = np.zeros(count, np.int64)
        self._seeds, self._episodes = np.zeros(count, np.int64), np.zeros(count, np.int64)
        self.world = np.zeros(count, np.int64)
        self.seen, self.final = (np.zeros((count, *self.shape), np.float32) for _ in range(2))
        self.reward = np.zeros(count)
        self.over, self.late = np.zeros(count, np.int64), np.zeros(count, np.int64)
        self._bank: tuple[Array, ...] = ()

    def ready(self, progress: Progress | None = None) -> None:
        """Make all worlds ready, which takes a while."""
        if self._bank:
            return
        for number in range(self.worlds):
            self.world_at(number)
            if progress is not None:
                progress((number + 1) / self.worlds)
        self._bank = self._stacked(range(self.worlds))

    def world_at(self, number: int) -> World:
        """One of the worlds, made ready once."""
        if number not in self._worlds:
            self._worlds[number] = self.setting.world(number)
        return self._worlds[number]

    def _stacked(self, numbers: Any) -> tuple[Array, ...]:
        worlds = [self.world_at(number) for number in numbers]
        most = max(len(world.due) for world in worlds)
        due = np.full((len(worlds), most, 3), -1.0)
        for row, world in zip(due, worlds, strict=True):
            row[: len(world.due)] = world.due
        arenas, keys, _, numbers_, first = (np.array(each) for each in zip(*worlds, strict=True))
        return arenas, keys, due, numbers_, first.reshape(len(worlds), -1)

    def reset(self, seeds: ArrayLike, which: NDArray[np.bool_] | None = None) -> None:
        """Begin anew, each team with the episodes that its seed (count,) brings."""
        self.ready()
        chosen = np.arange(self.count) if which is None else np.flatnonzero(which)
        self._seeds[chosen] = np.broadcast_to(np.asarray(seeds, np.int64), self.count)[chosen]
        for i in chosen.tolist():
            self._begin(i, 0, world_of(int(self._seeds[i]), 0, self.worlds))

    def begin_alone(self, seed: int, episode: int) -> int:
        """Begin an episode of the only team, for which one world is enough; its number."""
        number = world_of(seed, episode, self.worlds)
        self._bank = self._stacked([number])
        self._begin(0, episode, 0)
        return number

    def _begin(self, i: int, episode: int, world: int) -> None:
        arenas, _, _, _, first = self._bank
        self._episodes[i], self.world[i], self._steps[i] = episode, world, 1
        self._teams[i], self.seen[i] = arenas[world], first[world].reshape(self.shape)

    def step(self, actions: ArrayLike) -> None:
        """Fly all teams on by a period of their actions (count, drones * width)."""
        action = np.ascontiguousarray(actions, dtype=np.float64).reshape(self.count, -1)
        if action.shape[1] != self.actions:
            raise SettingError.of(
                "action", f"shape {np.shape(actions)}", f"must have {self.actions} numbers a team"
            )
        bank, keys, due, numbers, first = self._bank
        seen, final = self.seen.reshape(self.count, -1), self.final.reshape(self.count, -1)

        fly: Any = kernels.fly

        def part(number: int) -> None:
            (begin, end), (room, log) = self._parts[number], self._rooms[number]
            fly(
                begin, end, *self._codes, self.skip, self._last, self._every, *room.arguments, *log, room.eyes, room.arena,
                bank, keys, due, numbers, first, self._teams, self.world, self._steps, self._seeds, self._episodes,
                action, seen, final, self.reward, self.over, self.late,
            )  # fmt: skip

        if self._pool is None:
            part(0)
        else:
            list(self._pool.map(part, range(len(self._parts))))
