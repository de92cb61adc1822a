"""Environments for reinforcement learning: importing this registers them with Gymnasium, where that is installed.

::

    import colift.learn
    import gymnasium

    env = gymnasium.make("colift/Hover-v0", level="forces")
    many = gymnasium.make_vec("colift/Hover-v0", num_envs=256)
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import TYPE_CHECKING

from colift.lazy import lookup
from colift.learn.tasks import TASKS

if TYPE_CHECKING:
    from colift.learn.environments import TeamEnv, TeamVectorEnv
    from colift.learn.parallel import DronesEnv
    from colift.learn.teams import Teams
    from colift.learn.worlds import Setting

_HOMES = {
    "DronesEnv": "colift.learn.parallel",
    "Setting": "colift.learn.worlds",
    "TeamEnv": "colift.learn.environments",
    "TeamVectorEnv": "colift.learn.environments",
    "Teams": "colift.learn.teams",
}

__all__ = ["TASKS", "DronesEnv", "Setting", "TeamEnv", "TeamVectorEnv", "Teams"]

__getattr__ = lookup(__name__, _HOMES)


def _register() -> None:
    import gymnasium

    for name in TASKS:
        gymnasium.register(
            id=f"colift/{name}-v0",
            entry_point="colift.learn.environments:TeamEnv",
            vector_entry_point="colift.learn.environments:TeamVectorEnv",
            kwargs={"task": name},
        )


if find_spec("gymnasium") is not None:
    _register()
