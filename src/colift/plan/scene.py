"""What a plan has to pass: start and goal, the team's formation, obstacles. Reads the public planning scenes (YAML) as they are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.errors import MissingExtraError, Problem, SceneError
from colift.extras import install
from colift.plan.distances import BOX, CYLINDER, WIDTH

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
        Rows of :mod:`colift.plan.distances`.

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
    try:
        import yaml  # type: ignore[import-untyped]
    except ImportError:
        raise MissingExtraError(
            f"{path}: reading YAML needs pyyaml; run: {install('scenes')}"
        ) from None
    try:
        table = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise SceneError(str(path), [Problem("", "", f"cannot be read: {error}")]) from None
    if not isinstance(table, Mapping):
        raise SceneError(str(path), [Problem("", type(table).__name__, "must be a table")])
    problems: list[Problem] = []
    environment = table.get("environment")
    listed = environment.get("obstacles", []) if isinstance(environment, Mapping) else None
    if not isinstance(listed, list):
        problems.append(Problem("environment.obstacles", repr(listed), "must be a list"))
        listed = []
    obstacles = np.zeros((len(listed), WIDTH))
    for k, entry in enumerate(listed):
        _obstacle(entry, f"environment.obstacles[{k}]", obstacles[k], problems)
    found = _robot(table, problems)
    if problems or found is None:
        raise SceneError(str(path), problems)
    start, goal, directions, lengths = found
    return Scene(path.stem, start, goal, directions, lengths, obstacles)


def _obstacle(entry: Any, path: str, row: Numbers, problems: list[Problem]) -> None:
    """Fill the row of one obstacle."""
    if not isinstance(entry, Mapping):
        problems.append(Problem(path, repr(entry), "must be a table"))
        return
    kind = entry.get("type")
    row[1:4] = _numbers(entry.get("center"), 3, f"{path}.center", problems, -math.inf)
    if kind == "box":
        row[0], row[4:7] = BOX, _numbers(entry.get("size"), 3, f"{path}.size", problems, 0.0) / 2
    elif kind == "sphere":
        row[7] = _numbers([entry.get("radius")], 1, f"{path}.radius", problems, 0.0)[0]
    elif kind == "cylinder":
        row[0] = CYLINDER
        row[4:6] = _numbers([entry.get("radius")], 1, f"{path}.radius", problems, 0.0)[0]
        row[6] = _numbers([entry.get("height")], 1, f"{path}.height", problems, 0.0)[0] / 2
    else:
        problems.append(Problem(f"{path}.type", repr(kind), "must be box, sphere or cylinder"))


def _numbers(value: Any, count: int, path: str, problems: list[Problem], above: float) -> Numbers:
    """So many numbers greater than ``above``; zeros, and a problem, where they are not that."""
    fits = isinstance(value, list) and len(value) == count
    fits = fits and all(type(v) in (int, float) and math.isfinite(v) and v > above for v in value)
    if not fits:
        bound = "" if math.isinf(above) else f" greater than {above:g}"
        problems.append(Problem(path, repr(value), f"must be {count} finite numbers{bound}"))
        return np.zeros(count)
    return np.array(value, dtype=float)


def _robot(
    table: Mapping[str, Any], problems: list[Problem]
) -> tuple[Numbers, Numbers, Numbers, Numbers] | None:
    """Start, goal, directions of the start and cables of the team."""
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
    lengths = _numbers(cables, n, "robots[0].l", problems, 0.0)
    width = 6 + 13 * n
    states = [
        _numbers(robot.get(end), width, f"robots[0].{end}", problems, -math.inf)
        for end in ("start", "goal")
    ]
    directions = -states[0][6 : 6 + 6 * n].reshape(n, 6)[:, :3]
    sizes = np.linalg.norm(directions, axis=1)
    if not problems and not np.allclose(sizes, 1.0, atol=1e-3):
        problems.append(
            Problem("robots[0].start", repr(sizes.tolist()), "cables must be unit vectors")
        )
    return states[0][:3], states[1][:3], directions / np.maximum(sizes, 1e-9)[:, None], lengths
