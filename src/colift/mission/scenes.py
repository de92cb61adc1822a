"""Obstacles of the public planning scenes (YAML files of dynobench), as rows of :mod:`colift.team.obstacles`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from colift.errors import MissingExtraError, Problem, SceneError
from colift.extras import install
from colift.team.obstacles import BOX, CYLINDER, WIDTH, Array


def read_scene(path: Path) -> Mapping[str, Any]:
    """The file's table.

    Raises
    ------
    SceneError
        It cannot be read, or holds no table.
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
    return table


def obstacles_of(table: Mapping[str, Any], problems: list[Problem]) -> Array:
    """The scene's obstacles (m, 8); what is wrong with them is added to ``problems``."""
    environment = table.get("environment")
    listed = environment.get("obstacles", []) if isinstance(environment, Mapping) else None
    if not isinstance(listed, list):
        problems.append(Problem("environment.obstacles", repr(listed), "must be a list"))
        listed = []
    rows = np.zeros((len(listed), WIDTH))
    for k, entry in enumerate(listed):
        _obstacle(entry, f"environment.obstacles[{k}]", rows[k], problems)
    return rows


def _obstacle(entry: Any, path: str, row: Array, problems: list[Problem]) -> None:
    """Fill the row of one obstacle."""
    if not isinstance(entry, Mapping):
        problems.append(Problem(path, repr(entry), "must be a table"))
        return
    kind = entry.get("type")
    row[1:4] = numbers(entry.get("center"), 3, f"{path}.center", problems, -math.inf)
    if kind == "box":
        row[0], row[4:7] = BOX, numbers(entry.get("size"), 3, f"{path}.size", problems, 0.0) / 2
    elif kind == "sphere":
        row[7] = numbers([entry.get("radius")], 1, f"{path}.radius", problems, 0.0)[0]
    elif kind == "cylinder":
        row[0] = CYLINDER
        row[4:6] = numbers([entry.get("radius")], 1, f"{path}.radius", problems, 0.0)[0]
        row[6] = numbers([entry.get("height")], 1, f"{path}.height", problems, 0.0)[0] / 2
    else:
        problems.append(Problem(f"{path}.type", repr(kind), "must be box, sphere or cylinder"))


def numbers(value: Any, count: int, path: str, problems: list[Problem], above: float) -> Array:
    """So many numbers greater than ``above``; zeros, and a problem, where they are not that."""
    fits = isinstance(value, list) and len(value) == count
    fits = fits and all(type(v) in (int, float) and math.isfinite(v) and v > above for v in value)
    if not fits:
        bound = "" if math.isinf(above) else f" greater than {above:g}"
        problems.append(Problem(path, repr(value), f"must be {count} finite numbers{bound}"))
        return np.zeros(count)
    return np.array(value, dtype=float)


def obstacle_of(row: list[float]) -> dict[str, Any]:
    """An obstacle of a mission, from its row."""
    kind, centre, half, radius = row[0], row[1:4], row[4:7], row[7]
    if kind == CYLINDER:
        return {"kind": "cylinder", "centre": centre, "radius": half[0], "height": 2.0 * half[2]}
    if radius > 0.0:
        return {"kind": "sphere", "centre": centre, "radius": radius}
    return {"kind": "box", "centre": centre, "size": [2.0 * each for each in half]}
