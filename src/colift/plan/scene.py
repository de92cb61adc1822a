"""What a plan has to pass: start and goal, the team's formation, obstacles. Reads the public planning scenes (YAML) as they are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.errors import Problem, SceneError
from colift.mission.scenes import numbers, obstacles_of, read_scene

Numbers = NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """A task: world frame, m.

    Attributes
    ----------
    start, goal : (3,) arrays
        Of the load, at rest.
    directions : (n, 3) array
        Unit vectors from the load to the drones at both ends, those of the file's start; None: a cone.
    lengths : (n,) array
        Of the cables.
    obstacles : (m, 8) array
        Rows of :mod:`colift.team.obstacles`.

    """

    name: str
    start: Numbers
    goal: Numbers
    directions: Numbers | None
    lengths: Numbers
    obstacles: Numbers


def load_scene(path: Path) -> Scene:
    """Read a scene.

    Raises
    ------
    SceneError
        With every field that is wrong, and the file.
    MissingExtraError
        Without a reader of YAML.

    """
    table = read_scene(path)
    problems: list[Problem] = []
    obstacles = obstacles_of(table, problems)
    found = _robot(table, problems)
    if problems or found is None:
        raise SceneError(str(path), problems)
    start, goal, directions, lengths = found
    return Scene(path.stem, start, goal, directions, lengths, obstacles)


def _robot(
    table: Mapping[str, Any], problems: list[Problem]
) -> tuple[Numbers, Numbers, Numbers | None, Numbers] | None:
    """Start, goal, directions of the start and cables of the team; no directions where both ends are places of the load alone."""
    robots = table.get("robots")
    if not isinstance(robots, list) or len(robots) != 1 or not isinstance(robots[0], Mapping):
        problems.append(
            Problem("robots", repr(robots)[:60], "must be one team that carries a point load")
        )
        return None
    robot = robots[0]
    cables = robot.get("l")
    n = len(cables) if isinstance(cables, list) else 0
    if not 2 <= n <= 64:
        problems.append(Problem("robots[0].l", repr(cables), "must be 2 to 64 lengths of cables"))
        return None
    lengths = numbers(cables, n, "robots[0].l", problems, 0.0)
    ends = [(robot.get(end), f"robots[0].{end}") for end in ("start", "goal")]
    alone = all(isinstance(value, list) and len(value) == 3 for value, _ in ends)
    width = 3 if alone else 6 + 13 * n
    states = [numbers(value, width, path, problems, -math.inf) for value, path in ends]
    if alone:
        return states[0], states[1], None, lengths
    directions = -states[0][6 : 6 + 6 * n].reshape(n, 6)[:, :3]
    sizes = np.linalg.norm(directions, axis=1)
    if not problems and not np.allclose(sizes, 1.0, atol=1e-3):
        problems.append(
            Problem("robots[0].start", repr(sizes.tolist()), "cables must be unit vectors")
        )
    return states[0][:3], states[1][:3], directions / np.maximum(sizes, 1e-9)[:, None], lengths
