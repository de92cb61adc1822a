"""What a log says against what a flight can be: units and frames doubted, gaps and swapped drones found."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from colift.errors import FlightDataError
from colift.record.ends import ends_of
from colift.record.importing.base import Array, Finding, Log, Reading

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}

PERIODS = (1e-4, 0.9)
"""Shortest and longest usual time between two rows of a log, s; 1 would be the step of a log in ms at 1 kHz."""
LONGEST = 1e6
"""Longest flight, s."""
CABLES = (5e-3, 30.0)
"""Shortest and longest cable that nobody doubts, m."""
FASTEST = 30.0
"""Speed that no body of such a flight reaches, m/s."""
FASTEST_FROM_ZERO = 5.0
"""The same, m/s, for a body that would come from exactly (0, 0, 0) or go there: a gap filled with zeros."""
STEP = 0.05
"""Distance between two rows, m, that is never doubted, however close their times."""
EXCURSION = 1.0
"""Longest time, s, for which a body that jumps away and back is taken not to have been measured."""
OUTSIDE = 1e6
"""Farthest position, m."""
SWAPPED = 0.4
"""Drones count as taken for each other where each lies closer to another's last place than this share of its jump."""
UNIT_QUATERNION = 0.02
"""Largest deviation of a quaternion's length from one."""

Rows = NDArray[np.bool_]


def doubt_time(path: Path, stamps: Array, told: Reading) -> None:
    """Refuse time stamps that are hardly in seconds, or not in the unit that was told.

    Raises
    ------
    FlightDataError
        With the suspicion and the option that reads them.

    """
    period = float(np.median(np.diff(stamps)))
    length = float(stamps[-1] - stamps[0])
    if told.time_unit is not None:
        if length * SECONDS[told.time_unit] > LONGEST:
            raise FlightDataError(
                f"{path}: column t spans {length * SECONDS[told.time_unit]:.3g} s in {told.time_unit}"
            )
        if told.time_unit != "s" and period * SECONDS[told.time_unit] < PERIODS[0]:
            raise FlightDataError(
                f"{path}: column t: rows {period * SECONDS[told.time_unit]:.3g} s apart in {told.time_unit}; "
                "leave out --time-unit, or give another one"
            )
        return
    if PERIODS[0] <= period <= PERIODS[1] and length <= LONGEST:
        return
    found = [u for u, s in SECONDS.items() if u != "s" and 5e-4 <= period * s <= 0.5]
    if not found:
        raise FlightDataError(
            f"{path}: column t: rows {period:.3g} s apart; if that is right, give --time-unit s"
        )
    what = " or ".join(f"--time-unit {u} (rows {period * SECONDS[u]:.3g} s apart)" for u in found)
    raise FlightDataError(
        f"{path}: column t: rows {period:.3g} s apart in seconds; is it in another unit? Give {what}, "
        "or --time-unit s if it is right"
    )


def doubt(label: str, log: Log, told: Reading) -> None:
    """Refuse a flight whose frame or unit of length is hardly the one that was told or documented.

    Raises
    ------
    FlightDataError
        With the suspicion and the option that reads it.

    """
    ends = ends_of(_placed(log.load[:, :1]), log.n)[:, :, 0]
    apart = ends - _placed(log.drones["positions"])
    with np.errstate(over="ignore"):
        cables = np.linalg.norm(apart, axis=-1)
    usual = _median(cables)
    if usual < CABLES[0]:
        raise FlightDataError(
            f"{label}: drones {1e3 * usual:.3g} mm from the load; "
            + ("leave out --unit mm" if told.unit == "mm" else "is it a log of a slung load?")
        )
    if usual > CABLES[1] and told.unit is None:
        raise FlightDataError(
            f"{label}: cables of {usual:.4g} m; are positions in millimetres? Give --unit mm (cables of "
            f"{1e-3 * usual:.3g} m), or --unit m if it is right"
        )
    below = _median(apart[..., 2])
    if told.frame != "enu" and below > 0.0:
        other = "is z up? Leave out --frame ned" if told.frame else "is z down? Give --frame ned"
        raise FlightDataError(
            f"{label}: the drones fly {below:.3g} m below the load; {other}, or give --frame enu if it is right"
        )
    speeds = _speed_ratio(log)
    if not 1.0 / 30.0 < speeds < 30.0:
        raise FlightDataError(
            f"{label}: positions change {speeds:.3g} times as fast as the velocities say: is the unit of "
            "positions, velocities or time another one than the documented? See --unit and --time-unit"
        )


def _placed(positions: Array) -> Array:
    """Without those at exactly (0, 0, 0), where a body that was not seen is often put."""
    return np.where(np.all(positions == 0.0, axis=-1, keepdims=True), np.nan, positions)


def clean(log: Log, names: list[str]) -> Log:
    """The log with NaN where a position cannot be, and with what was found; ``names`` are the drones'."""
    findings = list(log.findings)
    load, positions = log.load.copy(), log.drones["positions"].copy()
    velocities, attitudes = log.drones["velocities"].copy(), log.drones["attitudes"].copy()
    bodies = [("load", load[:, 0], load[:, 1])]
    bodies += [(name, positions[:, i], velocities[:, i]) for i, name in enumerate(names)]
    for name, position, _ in bodies:
        _no_number(position, "not recorded", name, log.time, findings)
        with np.errstate(invalid="ignore"):
            far = np.max(np.abs(position), axis=1) > OUTSIDE
        _leave_out(position, far, f"beyond {OUTSIDE:g} m", name, log.time, findings)
        zeros = _filled_with_zeros(log.time, position)
        why = "zeros, where it cannot have been (a gap that was filled)"
        _leave_out(position, zeros, why, name, log.time, findings)
    swaps = list(_swaps(log.time, positions, names))
    findings += swaps
    exchange = np.isin(log.time, [swap.begin for swap in swaps])
    exchange[1:] |= np.isin(log.time[:-1], [swap.end for swap in swaps])
    for name, position, _ in bodies:
        away, jumps = _excursions(log.time, position, exchange)
        why = f"jumps away and back faster than {FASTEST:g} m/s"
        _leave_out(position, away, why, name, log.time, findings)
        for k in jumps:
            findings.append(
                Finding(
                    "jump", name, 1, log.time[k], log.time[k], f"moves faster than {FASTEST:g} m/s"
                )
            )
    for _, position, velocity in bodies:
        velocity[np.isnan(position).any(axis=1)] = np.nan
    turned = None if log.load_attitude is None else log.load_attitude.copy()
    of = [(name, attitudes[:, i]) for i, name in enumerate(names)]
    for name, attitude in [*of, *([] if turned is None else [("load", turned)])]:
        length = np.linalg.norm(attitude, axis=1)
        odd: Rows = np.asarray(np.abs(length - 1.0) > UNIT_QUATERNION)
        _leave_out(attitude, odd, "no unit quaternion", f"attitude of {name}", log.time, findings)
        attitude /= np.where(odd, np.nan, length)[:, None]
    drones = {
        **log.drones,
        "positions": positions,
        "velocities": velocities,
        "attitudes": attitudes,
    }
    return replace(log, load=load, drones=drones, findings=findings, load_attitude=turned)


def _no_number(values: Array, why: str, name: str, time: Array, findings: list[Finding]) -> None:
    """Make rows that are only partly recorded NaN as a whole, and note those that are not."""
    missing: Rows = np.asarray(np.isnan(values).any(axis=1))
    if not missing.all():  # a body that was never recorded has no gaps
        _leave_out(values, missing, why, name, time, findings)


def _leave_out(
    values: Array, rows: Rows, why: str, name: str, time: Array, findings: list[Finding]
) -> None:
    values[rows] = np.nan
    for first, last in stretches(rows):
        findings.append(Finding("gap", name, last - first + 1, time[first], time[last], why))


def stretches(where: Rows) -> list[tuple[int, int]]:
    """First and last row of each stretch in which ``where`` holds."""
    edges = np.diff(np.concatenate([[False], where, [False]]).astype(int))
    return list(
        zip(
            np.flatnonzero(edges == 1).tolist(),
            (np.flatnonzero(edges == -1) - 1).tolist(),
            strict=True,
        )
    )


def _filled_with_zeros(time: Array, position: Array) -> Rows:
    """Rows at exactly (0, 0, 0) that the body cannot have come from or gone to."""
    zeros = np.all(position == 0.0, axis=1)
    known = ~zeros & ~np.isnan(position).any(axis=1)
    filled = np.zeros(len(time), dtype=bool)
    for first, last in stretches(zeros):
        before, after = np.flatnonzero(known[:first])[-1:], np.flatnonzero(known[last:])[:1] + last
        pairs = [(k, first) for k in before] + [(k, last) for k in after]
        away = [
            np.linalg.norm(position[k]) > STEP + FASTEST_FROM_ZERO * abs(time[row] - time[k])
            for k, row in pairs
        ]
        filled[first : last + 1] = any(away)
    if zeros.all():
        filled[:] = True
    return filled


def _excursions(time: Array, position: Array, exchange: Rows) -> tuple[Rows, list[int]]:
    """Rows of short stretches that a body jumps to and back from, and rows that it jumps to for longer.

    In rows of ``exchange`` it may jump: it is taken for another one, or for itself again.
    """
    away = np.zeros(len(time), dtype=bool)
    known = np.flatnonzero(~np.isnan(position).any(axis=1))
    if len(known) < 2:
        return away, []
    place, at = position[known], time[known]

    def reachable(a: int, b: int) -> bool:
        return bool(np.linalg.norm(place[b] - place[a]) <= STEP + FASTEST * (at[b] - at[a]))

    far = np.linalg.norm(np.diff(place, axis=0), axis=1) > STEP + FASTEST * np.diff(at)
    far &= ~exchange[known[1:]]
    starts = [0, *(np.flatnonzero(far) + 1).tolist(), len(known)]
    last, jumps, k = starts[1] - 1, [], 1
    while k < len(starts) - 1:
        begin = starts[k]
        soon = [m for m in range(k + 1, len(starts) - 1) if at[starts[m]] - at[begin] <= EXCURSION]
        back = next((m for m in soon if reachable(last, starts[m])), None)
        if back is not None:
            away[known[begin : starts[back]]] = True
            k = back
        else:
            jumps.append(int(known[begin]))
        last = starts[k + 1] - 1
        k += 1
    return away, jumps


def _swaps(time: Array, positions: Array, names: list[str]) -> Iterator[Finding]:
    """Stretches in which motion capture took drones for each other."""
    rows, n = positions.shape[:2]
    if n < 2:
        return
    identity = np.arange(n)
    is_now, since = identity.copy(), 0
    place = positions[0].copy()  # of the drones by their numbers in the log, where last seen
    for k in range(1, rows):
        here = positions[k]
        seen = ~np.isnan(here).any(axis=1)
        own = np.linalg.norm(here - place, axis=1)
        moved = np.flatnonzero(seen & (own > STEP))
        if len(moved) > 1:
            apart = np.linalg.norm(here[moved, None] - place[None, moved], axis=2)
            apart[np.isnan(apart)] = np.inf
            nearest = moved[apart.argmin(axis=1)]
            fits = apart.min(axis=1) < SWAPPED * own[moved]
            taken = {int(i): int(j) for i, j, ok in zip(moved, nearest, fits, strict=True) if ok}
            if len(taken) > 1 and set(taken) == set(taken.values()):
                if not np.array_equal(is_now, identity):
                    yield _swap(time, names, is_now, since, k - 1)
                after = is_now.copy()
                for i, j in taken.items():
                    after[i] = is_now[j]
                is_now, since = after, k
        place[seen] = here[seen]
    if not np.array_equal(is_now, identity):
        yield _swap(time, names, is_now, since, rows - 1)


def _swap(
    time: Array, names: list[str], is_now: NDArray[np.int64], first: int, last: int
) -> Finding:
    moved = [names[i] for i, j in enumerate(is_now) if i != j]
    who = f"{', '.join(moved[:-1])} and {moved[-1]}"
    why = "taken for each other (they exchange their places from one row to the next)"
    return Finding("swap", who, last - first + 1, time[first], time[last], why)


def _speed_ratio(log: Log) -> float:
    """Median of how fast positions change over what velocities say, while moving; 1 where that is not known."""
    span = np.diff(log.time)
    ratios = []
    for position, velocity in [
        (log.load[:, 0], log.load[:, 1]),
        *zip(
            log.drones["positions"].swapaxes(0, 1),
            log.drones["velocities"].swapaxes(0, 1),
            strict=True,
        ),
    ]:
        with np.errstate(all="ignore"):
            fast = np.linalg.norm(np.diff(position, axis=0), axis=1) / span
            said = np.linalg.norm(velocity[1:] + velocity[:-1], axis=1) / 2.0
            moving = (said > 0.05) & (fast > 0.0) & np.isfinite(fast)
            ratios.append(fast[moving] / said[moving])
    every = np.concatenate(ratios)
    return float(np.median(every)) if len(every) >= 20 else 1.0


def _median(values: Array) -> float:
    """Of the numbers among them; NaN where there are none."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else float("nan")
