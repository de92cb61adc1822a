"""Several drones' logs of one flight, each on its own clock, become one log on the first one's clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from colift.errors import FlightDataError
from colift.importing.base import Array, Log

COARSE, FINE = 0.02, 0.0005
"""Steps of the two searches for a clock's offset, s."""
LEAST_OVERLAP = 0.5
"""Least share of the shorter log that the two must have in common."""
WORST_FIT = 0.2
"""Largest distance between the aligned loads, relative to how far the load moves about."""


@dataclass(frozen=True)
class Offset:
    """Seconds to add to a log's clock, and the distance left between the two loads, m RMS."""

    seconds: float
    residual: float


def offset(first: Log, other: Log) -> Offset | None:
    """Where ``other`` fits ``first`` best, by the load that both recorded; None where nothing fits.

    A search over all shifts with enough overlap, a finer one about the best, and the vertex of the
    parabola through its three lowest points.
    """
    length = min(np.ptp(first.time), np.ptp(other.time))
    low = first.time[0] + LEAST_OVERLAP * length - other.time[-1]
    high = first.time[-1] - LEAST_OVERLAP * length - other.time[0]
    shifts = np.arange(low, high + COARSE, COARSE)
    every = max(1, len(first.time) // 400)
    best = shifts[np.argmin([_misfit(first, other, shift, every) for shift in shifts])]
    shifts = best + FINE * np.arange(-2 * round(COARSE / FINE), 2 * round(COARSE / FINE) + 1)
    misfits = np.array([_misfit(first, other, shift) for shift in shifts])
    k = int(np.clip(np.argmin(misfits), 1, len(shifts) - 2))
    left, middle, right = misfits[k - 1 : k + 2]
    bend = left - 2.0 * middle + right
    vertex = FINE * 0.5 * (left - right) / bend if bend > 0.0 else 0.0
    seconds = float(shifts[k] + np.clip(vertex, -FINE, FINE))
    residual = float(np.sqrt(_misfit(first, other, seconds)))
    movement = float(np.sqrt(np.sum(np.var(first.load[:, 0], axis=0))))
    return Offset(seconds, residual) if residual <= WORST_FIT * movement else None


def merge(logs: Sequence[Log], names: Sequence[str]) -> tuple[Log, list[Offset]]:
    """One log of all drones, over the time that every log covers, and each clock's offset.

    Rows are the first log's; load and reference are as it has them. Other drones' values are
    interpolated linearly between their own rows.

    Raises
    ------
    FlightDataError
        If a log's load does not move as the first one's, or hardly moves at all.

    """
    first = logs[0]
    offsets = [Offset(0.0, 0.0)]
    for log, name in zip(logs[1:], names[1:], strict=True):
        found = offset(first, log)
        if found is None:
            raise FlightDataError(
                f"{name}: cannot be aligned with {names[0]}: the load does not move alike in both, or too "
                "little to tell. Are they of the same flight?"
            )
        offsets.append(found)
    begin = max(log.time[0] + o.seconds for log, o in zip(logs, offsets, strict=True))
    end = min(log.time[-1] + o.seconds for log, o in zip(logs, offsets, strict=True))
    rows = (first.time >= begin) & (first.time <= end)
    time = first.time[rows]
    drones = {
        name: np.concatenate(
            [
                log.drones[name][rows] if log is first
                else _resample(log, name, time - o.seconds)
                for log, o in zip(logs, offsets, strict=True)
            ],
            axis=1,
        )
        for name in first.drones
    }  # fmt: skip
    return Log(time - time[0], first.load[rows], first.reference[rows], drones), offsets


def _misfit(first: Log, other: Log, shift: float, every: int = 1) -> float:
    """Mean squared distance of the two loads over the time in common, m^2."""
    there = first.time[::every] - shift
    common = (there >= other.time[0]) & (there <= other.time[-1])
    seen = _interpolate(there[common], other.time, other.load[:, 0])
    apart = first.load[::every, 0][common] - seen
    return float(np.mean(np.sum(apart * apart, axis=1))) if common.any() else float("inf")


def _resample(log: Log, name: str, time: Array) -> Array:
    values = log.drones[name]
    if name == "attitudes":  # q and -q are one attitude: no jump between rows
        turns = np.sum(values[1:] * values[:-1], axis=-1) < 0.0
        values = values.copy()
        values[1:] *= np.where(np.cumsum(turns, axis=0) % 2, -1.0, 1.0)[..., None]
    found = _interpolate(time, log.time, values.reshape(len(log.time), -1))
    found = found.reshape(len(time), *values.shape[1:])
    return found / np.linalg.norm(found, axis=-1, keepdims=True) if name == "attitudes" else found


def _interpolate(at: Array, time: Array, values: Array) -> Array:
    return np.stack([np.interp(at, time, column) for column in values.T], axis=-1)
