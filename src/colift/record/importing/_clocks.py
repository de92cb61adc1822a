"""Several drones' logs of one flight, each on its own clock, become one log on the first one's clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from colift.errors import FlightDataError
from colift.record.importing.base import Array, Log

COARSE, FINE = 0.02, 0.0005
"""Steps of the two searches for a clock's offset, s."""
LEAST_OVERLAP = 0.5
"""Least share of the shorter log that the two must have in common."""
WORST_FIT = 0.010
"""Largest distance between the aligned loads, m RMS: the logs of one flight differ by 1 to 3 mm, those of two by 18 and more."""
LEAST_MOVEMENT = 5.0
"""Least movement of the load, relative to the distance that is left, for an alignment to tell anything."""
SAME_DRONE = 0.02
"""Two drones whose median distance is less than this are one, m."""


@dataclass(frozen=True)
class Offset:
    """Seconds to add to a log's clock, and the distance left between the two loads, m RMS."""

    seconds: float
    residual: float


def offset(first: Log, other: Log) -> Offset:
    """Where ``other`` fits ``first`` best, by the load that both recorded.

    A search over all shifts with enough overlap, a finer one about the best, and the vertex of the
    parabola through its three lowest points.
    """
    first, other = _with_load(first), _with_load(other)
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
    return Offset(seconds, float(np.sqrt(_misfit(first, other, seconds))))


def merge(logs: Sequence[Log], names: Sequence[str]) -> tuple[Log, list[Offset]]:
    """One log of all drones, over the time that every log covers, and each clock's offset.

    Rows are the first log's; load and reference are as it has them. Other drones' values are
    interpolated linearly between their own rows.

    Raises
    ------
    FlightDataError
        If a log's load does not move as the first one's, or hardly moves at all; if two are of one drone.

    """
    first = logs[0]
    movement = float(np.sqrt(np.sum(np.var(_with_load(first).load[:, 0], axis=0))))
    offsets = [Offset(0.0, 0.0)]
    for log, name in zip(logs[1:], names[1:], strict=True):
        found = offset(first, log)
        if not found.residual <= WORST_FIT:
            raise FlightDataError(
                f"{name}: cannot be aligned with {names[0]}: the two loads stay {1e3 * found.residual:.0f} mm RMS "
                f"apart, and at most {1e3 * WORST_FIT:.0f} mm are one load's. Are the logs of the same flight?"
            )
        if movement < LEAST_MOVEMENT * found.residual:
            raise FlightDataError(
                f"{name}: cannot be aligned with {names[0]}: the load moves too little ({1e3 * movement:.0f} mm RMS) "
                "to tell whether the logs are of the same flight"
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
    _check_apart(drones["positions"], logs, names)
    findings = [
        replace(each, begin=each.begin + o.seconds - begin, end=each.end + o.seconds - begin)
        for log, o in zip(logs, offsets, strict=True)
        for each in log.findings
    ]
    attitude = None if first.load_attitude is None else first.load_attitude[rows]
    merged = Log(
        time - time[0], first.load[rows], first.reference[rows], drones, findings, attitude
    )
    return merged, offsets


def _check_apart(positions: Array, logs: Sequence[Log], names: Sequence[str]) -> None:
    """Refuse logs of the same drone, such as one given twice."""
    of = [name for log, name in zip(logs, names, strict=True) for _ in range(log.n)]
    for i in range(len(of)):
        apart = np.linalg.norm(positions[:, i + 1 :] - positions[:, i : i + 1], axis=-1)
        for j, distances in enumerate(apart.T, start=i + 1):
            known = distances[~np.isnan(distances)]
            if known.size and np.median(known) < SAME_DRONE:
                raise FlightDataError(
                    f"{of[j]}: is of the same drone as {of[i]}: their positions lie "
                    f"{1e3 * float(np.median(known)):.3g} mm apart"
                )


def _with_load(log: Log) -> Log:
    """Only the rows that have a position of the load."""
    rows = ~np.isnan(log.load[:, 0]).any(axis=1)
    return Log(log.time[rows], log.load[rows], log.reference[rows], {})


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
    """Linear between rows; NaN beside a row that is NaN."""
    columns = [np.interp(at, time, column) for column in values.T]
    return np.stack(columns, axis=-1)
