"""One agent a drone: the parallel environment of PettingZoo."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.errors import MissingExtraError
from colift.extras import install
from colift.learn.environments import WORLDS, Seen, TeamEnv, spaces

try:
    from gymnasium.spaces import Box
    from pettingzoo import ParallelEnv
except ImportError:
    raise MissingExtraError(f"colift.learn needs pettingzoo; run: {install('gym')}") from None


class DronesEnv(ParallelEnv):  # type: ignore[misc]
    """The drones of one team, each for itself: all get the team's reward, and an episode is over for all at once.

    Parameters
    ----------
    task : str
        See :data:`colift.learn.tasks.TASKS`.
    worlds : int
        Of how many worlds one is drawn for each episode.
    **options
        See :meth:`colift.learn.worlds.Setting.of`, but for the observation, which is each drone's own.

    """

    metadata: dict[str, Any] = {"name": "colift_v0", "render_modes": []}  # noqa: RUF012

    def __init__(self, task: str = "Hover", *, worlds: int = WORLDS, **options: Any) -> None:
        self.team = TeamEnv(task, worlds=worlds, observation="drone", **options)
        seen, action = spaces(self.team.setting)
        self.possible_agents = [f"drone_{i}" for i in range(self.team.setting.drones)]
        self.agents: list[str] = []
        # The same objects at each call, as seeds of spaces stay with them.
        self._seen, self._acts = (
            {
                agent: Box(space.low[i], space.high[i])
                for i, agent in enumerate(self.possible_agents)
            }
            for space in (seen, action)
        )
        self._last = np.zeros(seen.shape, np.float32)

    def observation_space(self, agent: str) -> Box:
        return self._seen[agent]

    def action_space(self, agent: str) -> Box:
        return self._acts[agent]

    def state(self) -> Seen:
        """What all drones see, for critics that know the whole."""
        return self._last.ravel()

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Seen], dict[str, dict[str, Any]]]:
        """Begin an episode: the first one of a seed, else the next."""
        self._last, told = self.team.reset(seed=seed)
        self.agents = [*self.possible_agents]
        return self._each(self._last), self._told(told)

    def step(
        self, actions: dict[str, NDArray[np.floating[Any]]]
    ) -> tuple[dict[str, Seen], dict[str, float], dict[str, bool], dict[str, bool], dict[str, Any]]:
        """Fly on for a period under the actions of all."""
        together = np.array([actions[agent] for agent in self.agents])
        self._last, reward, over, late, told = self.team.step(together)
        agents = self.agents
        found = (
            self._each(self._last), dict.fromkeys(agents, reward), dict.fromkeys(agents, over), dict.fromkeys(agents, late),
            self._told(told),
        )  # fmt: skip
        if over or late:
            self.agents = []
        return found

    def _each(self, rows: Seen) -> dict[str, Seen]:
        return dict(zip(self.possible_agents, rows, strict=True))

    def _told(self, told: dict[str, Any]) -> dict[str, dict[str, Any]]:
        return {agent: dict(told) for agent in self.possible_agents}
