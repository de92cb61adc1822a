"""Whole flights as CSV: one row a time, the load, its reference and every drone in columns.

Columns, in SI units and the world frame: ``t``; ``load_{x,y,z}``, ``load_v{x,y,z}``;
``ref_{x,y,z}``, ``ref_v{x,y,z}``; and for drone K = 0, 1, ...: ``uavK_{x,y,z}``, ``uavK_v{x,y,z}``,
``uavK_fd{x,y,z}`` (total force wanted on the load, as this drone computed it) and
``uavK_mu{x,y,z}`` (this cable's share of it). Time and positions are required, the rest may be absent; an
empty cell or ``nan`` is a number that was not recorded.
"""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from colift.errors import FlightDataError
from colift.importing.base import DRONE_COLUMNS, Array, Log

_AXES = "xyz"
_DRONE = {"positions": "", "velocities": "v", "commands": "fd", "shares": "mu"}


def recognises(head: bytes, path: Path) -> bool:
    """Whether the first line is a header with a time and commas."""
    first = head.partition(b"\n")[0].strip().lower()
    return path.suffix.lower() == ".csv" or first.startswith(b"t,")


def read(path: Path) -> Log:
    """Read one file.

    Raises
    ------
    FlightDataError
        For a missing, unknown or doubled column, a cell that is no number, a row of another length, a
        time that does not increase; with column and line.

    """
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            lines = csv.reader(file)
            header = [name.strip() for name in next(lines, [])]
            n = _check_header(path, header)
            values = np.array(list(_rows(path, header, lines)), dtype=float)
    except (UnicodeDecodeError, csv.Error) as error:
        raise FlightDataError(f"{path}: is not a CSV file in UTF-8: {error}") from error
    if len(values) < 2:
        raise FlightDataError(
            f"{path}: holds {len(values)} rows of numbers; a flight has at least 2"
        )
    column = {name: values[:, k] for k, name in enumerate(header)}
    late = np.flatnonzero(np.diff(column["t"]) <= 0.0)
    if late.size:
        row = int(late[0]) + 1
        raise FlightDataError(
            f"{path}: column t, line {row + 2}: time {column['t'][row]:g} s does not come after "
            f"{column['t'][row - 1]:g} s"
        )
    missing = np.full(len(values), np.nan)

    def vectors(prefix: str) -> Array:
        return np.stack([column.get(prefix + axis, missing) for axis in _AXES], axis=-1)

    drones = {
        name: np.stack([vectors(f"uav{k}_{_DRONE[name]}") for k in range(n)], axis=1)
        if name in _DRONE
        else np.full((len(values), n, width), np.nan)
        for name, width in DRONE_COLUMNS.items()
    }
    return Log(
        time=column["t"] - column["t"][0],
        load=np.stack([vectors("load_"), vectors("load_v")], axis=1),
        reference=np.stack([vectors("ref_"), vectors("ref_v")], axis=1),
        drones=drones,
    )


def _names(n: int) -> tuple[list[str], list[str]]:
    """Columns that a file of n drones must have, and those that it may have."""
    must = ["t", *(f"load_{axis}" for axis in _AXES)]
    may = [f"{prefix}{axis}" for prefix in ("load_v", "ref_", "ref_v") for axis in _AXES]
    for k in range(n):
        must += [f"uav{k}_{axis}" for axis in _AXES]
        may += [f"uav{k}_{_DRONE[name]}{axis}" for name in list(_DRONE)[1:] for axis in _AXES]
    return must, may


def _check_header(path: Path, header: list[str]) -> int:
    """Number of drones in a header that has all it needs and nothing else."""
    found = [int(match[1]) for name in header if (match := re.match(r"uav(\d{1,4})_", name))]
    n = max(found, default=0) + 1
    must, may = _names(n)
    for name in must:
        if name not in header:
            raise FlightDataError(f"{path}: column {name} is missing")
    for name in header:
        if name not in must and name not in may:
            raise FlightDataError(
                f"{path}: unknown column {name!r} (columns: {', '.join(must + may)})"
            )
        if header.count(name) > 1:
            raise FlightDataError(f"{path}: column {name} stands there twice")
    for name in may:
        others = [name[:-1] + axis for axis in _AXES]
        if any(other in header for other in others) and name not in header:
            raise FlightDataError(f"{path}: column {name} is missing beside {others[0][:-1]}*")
    return n


def _rows(path: Path, header: list[str], lines: Iterator[list[str]]) -> Iterator[list[float]]:
    needed = set(_names(sum(name.endswith("_x") for name in header) - 1)[0])
    for number, cells in enumerate(lines, start=2):
        if not cells:
            continue
        if len(cells) != len(header):
            raise FlightDataError(
                f"{path}: line {number} has {len(cells)} cells; the header has {len(header)}"
            )
        row = []
        for name, cell in zip(header, cells, strict=True):
            try:
                value = float(cell) if cell.strip() else math.nan
            except ValueError:
                raise FlightDataError(
                    f"{path}: column {name}, line {number}: {cell!r} is not a number"
                ) from None
            if math.isinf(value) or (math.isnan(value) and name in needed):
                raise FlightDataError(
                    f"{path}: column {name}, line {number}: {cell!r} must be a finite number"
                )
            row.append(value)
        yield row
