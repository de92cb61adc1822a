"""The environments of Gymnasium: one team, and many in one call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.errors import ColiftError, MissingExtraError
from colift.extras import install
from colift.flight.flight import Flight
from colift.learn.kernels import LIMIT, Eyes, command
from colift.learn.levels import LEVELS
from colift.learn.tasks import ENDS
from colift.learn.teams import Teams
from colift.learn.worlds import Setting
from colift.record.recording import Recording

try:
    import gymnasium
    from gymnasium.spaces import Box
    from gymnasium.vector import AutoresetMode, VectorEnv
    from gymnasium.vector.utils import batch_space
except ImportError:
    raise MissingExtraError(f"colift.learn needs gymnasium; run: {install('gym')}") from None

Seen = NDArray[np.float32]
WORLDS = 64
"""Worlds of an environment, unless it is told."""


def spaces(setting: Setting) -> tuple[Any, Any]:
    """What is observed and what is commanded; a row for each drone where each observes for itself."""
    n, width = setting.drones, LEVELS[setting.level].width
    shape = (n * width,) if setting.observation == "central" else (n, width)
    return Box(-LIMIT, LIMIT, setting.shape, np.float32), Box(-1.0, 1.0, shape, np.float32)


class TeamEnv(gymnasium.Env[Seen, NDArray[np.floating[Any]]]):
    """One team at a task; ``gymnasium.make("colift/Hover-v0")``.

    Parameters
    ----------
    task : str
        See :data:`colift.learn.tasks.TASKS`.
    worlds : int
        Of how many worlds one is drawn for each episode.
    **options
        See :meth:`colift.learn.worlds.Setting.of`.

    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    def __init__(self, task: str = "Hover", *, worlds: int = WORLDS, **options: Any) -> None:
        self.setting = Setting.of(task, **options)
        self.observation_space, self.action_space = spaces(self.setting)
        self._teams = Teams(self.setting, 1, worlds=worlds, threads=1)
        self._seed, self._episode, self.world = -1, 0, -1
        self._flies = False
        self._flown: list[NDArray[np.float64]] = []

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Seen, dict[str, Any]]:
        """Begin an episode: the first one of a seed, else the next."""
        super().reset(seed=seed)
        if seed is not None or self._seed < 0:
            self._seed = int(self.np_random.integers(2**31)) if seed is None else seed
            self._episode = 0
        else:
            self._episode += 1
        self.world = self._teams.begin_alone(self._seed, self._episode)
        self._flies, self._flown = True, []
        return self._teams.seen[0].copy(), {"world": self.world}

    def step(
        self, action: NDArray[np.floating[Any]]
    ) -> tuple[Seen, float, bool, bool, dict[str, Any]]:
        """Fly on for a period under an action.

        Raises
        ------
        ColiftError
            Before an episode has begun, and after its end.

        """
        if not self._flies:
            raise ColiftError("step: the episode has ended or not begun; call reset first")
        teams = self._teams
        self._flown.append(np.array(action, dtype=np.float64).ravel())
        teams.step(self._flown[-1])
        over, late = int(teams.over[0]), bool(teams.late[0])
        self._flies = not (over or late)
        seen = teams.seen[0] if self._flies else teams.final[0]
        info = {"world": self.world} | ({"end": ENDS[over][0]} if over else {})
        return seen.copy(), float(teams.reward[0]), over > 0, late, info

    def replay(self) -> Recording:
        """The episode so far, flown once more by :class:`~colift.flight.flight.Flight`: to look at, to judge, to keep."""
        mission = self.setting.mission(self.world)
        flight, numbers = Flight(mission), self.setting.numbers(mission)
        eyes = Eyes(*(getattr(flight.bus, name) for name in Eyes._fields))
        level = LEVELS[self.setting.level]
        command(level.number, np.zeros(level.width * self.setting.drones), numbers, eyes)
        flight.advance(mission.timing.step)
        for action in self._flown:
            command(level.number, action, numbers, eyes)
            flight.advance(self.setting.period)
        return flight.recording()


class TeamVectorEnv(VectorEnv[Seen, NDArray[np.floating[Any]], NDArray[Any]]):
    """Many teams at one task, in compiled code; ``gymnasium.make_vec("colift/Hover-v0", num_envs=256)``.

    A team whose episode ends begins its next one in the same step; ``final_obs`` in what is told has what was seen at the end.
    Each is the same in every number as :class:`TeamEnv` with its seed.

    Parameters
    ----------
    task : str
        See :data:`colift.learn.tasks.TASKS`.
    num_envs : int
        Number of teams.
    worlds : int
        Of how many worlds one is drawn for each episode; all are made ready at the first reset.
    threads : int, optional
        None: one a core.
    **options
        See :meth:`colift.learn.worlds.Setting.of`.

    """

    def __init__(
        self,
        task: str = "Hover",
        num_envs: int = 64,
        *,
        worlds: int = WORLDS,
        threads: int | None = None,
        **options: Any,
    ) -> None:
        self.setting = Setting.of(task, **options)
        self.num_envs = num_envs
        self.metadata = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}
        self.single_observation_space, self.single_action_space = spaces(self.setting)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.teams = Teams(self.setting, num_envs, worlds=worlds, threads=threads)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Seen, dict[str, Any]]:
        """Begin anew: team i with seed ``seed + i``, or the one of its own in a list."""
        super().reset(seed=seed if isinstance(seed, int) else None)
        if seed is None:
            seeds = self.np_random.integers(2**31, size=self.num_envs)
        elif isinstance(seed, int):
            seeds = seed + np.arange(self.num_envs)
        else:
            drawn = self.np_random.integers(2**31, size=self.num_envs).tolist()
            seeds = np.array(
                [new if own is None else own for own, new in zip(seed, drawn, strict=True)]
            )
        self.teams.reset(seeds)
        return self.teams.seen.copy(), self._told()

    def step(
        self, actions: NDArray[np.floating[Any]]
    ) -> tuple[Seen, NDArray[Any], NDArray[Any], NDArray[Any], dict[str, Any]]:
        """Fly all teams on for a period."""
        teams = self.teams
        teams.step(actions)
        over, late = teams.over > 0, teams.late > 0
        told, ended = self._told(), over | late
        if ended.any():
            told |= {"final_obs": teams.final.copy(), "_final_obs": ended}
            told |= {"end": teams.over.copy(), "_end": over}
        return teams.seen.copy(), teams.reward.copy(), over, late, told

    def _told(self) -> dict[str, Any]:
        return {"world": self.teams.world.copy(), "_world": np.ones(self.num_envs, dtype=bool)}
