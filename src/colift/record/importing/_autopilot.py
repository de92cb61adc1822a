"""What logs of autopilots share: series of numbers, each at times of its own, become the log of one drone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from colift.errors import FlightDataError, MissingExtraError
from colift.extras import install
from colift.record.importing._axes import upright
from colift.record.importing.base import DRONE_COLUMNS, Array, Log

FRESH = 0.25
"""Longest time between two rows of a series over which it is interpolated, s."""
WIDTHS = {
    "position": 3, "velocity": 3, "attitude": 4, "rates": 3, "load": 3, "load_velocity": 3, "share": 3, "force": 3,
}  # fmt: skip
"""Series and their numbers: of the drone its place and velocity (north, east, down), attitude (wxyz), and rates (forward, right, down); of the
load its place and velocity; the force of the drone's cable on it, and of all cables, as wanted, N."""

Series = Mapping[str, tuple[Array, Array]]
"""Times, s, and rows of each series."""


def read_with(
    series_of: Callable[[Path], Series],
    path: Path,
    system: str,
    package: str,
    hints: Mapping[str, str],
) -> Log:
    """Read one file of this system with a function that needs this package (extra ``logs``).

    Raises
    ------
    FlightDataError
        For one that is damaged, or without place of drone or load.
    MissingExtraError
        Without the package.

    """
    try:
        series = series_of(path)
    except ImportError:
        raise MissingExtraError(
            f"logs of {system} need the package {package}, the extra logs; run: {install('logs')}"
        ) from None
    except Exception as error:  # a damaged file makes the reader fail in any way
        raise FlightDataError(f"{path}: cannot be read as a log of {system}: {error}") from error
    return log_of(path, series, hints)


def log_of(path: Path, series: Series, hints: Mapping[str, str]) -> Log:
    """The log of one drone, at the times of its place; ``hints`` say what in the file its place and the load's are read from.

    Raises
    ------
    FlightDataError
        Where one of the two is missing.

    """
    for name in ("position", "load"):
        if name not in series or len(series[name][0]) < 2:
            raise FlightDataError(f"{path}: tells no place of the {'load' if name == 'load' else 'drone'}: there is no {hints[name]}")  # fmt: skip
    time = np.unique(series["position"][0])
    found = {name: _at(time, series.get(name), width) for name, width in WIDTHS.items()}
    unknown = {name: np.full((len(time), 1, width), np.nan) for name, width in DRONE_COLUMNS.items()}  # fmt: skip
    known = {
        "positions": "position", "velocities": "velocity", "attitudes": "attitude", "rates": "rates",
        "commands": "force", "shares": "share",
    }  # fmt: skip
    log = Log(
        time=time - time[0],
        load=np.stack([found["load"], found["load_velocity"]], axis=1),
        reference=np.full((len(time), 2, 3), np.nan),
        drones={**unknown, **{name: found[of][:, None] for name, of in known.items()}},
    )
    return upright(log)


def _at(time: Array, series: tuple[Array, Array] | None, width: int) -> Array:
    """A series at other times, interpolated; NaN where it was silent for long. Quaternions are those of the row before."""
    if series is None or len(series[0]) < 2:
        return np.full((len(time), width), np.nan)
    times, first = np.unique(series[0], return_index=True)
    rows = series[1][first]
    after = np.clip(np.searchsorted(times, time, side="right"), 1, len(times) - 1)
    if width == 4:
        found = rows[after - 1]
    else:
        found = np.stack([np.interp(time, times, rows[:, k]) for k in range(width)], axis=1)
    known = (time >= times[0] - 1e-9) & (time <= times[-1] + 1e-9)
    known &= times[after] - times[after - 1] <= FRESH
    return np.where(known[:, None], found, np.nan)
