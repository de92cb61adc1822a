"""What the answers amount to, as tables of text and in plain words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from colift.study.judge.asking import ACTUAL, QUANTITIES, Judged
from colift.study.reproduction import THRESHOLD_DEG

BALANCED = 0.02
"""Largest RMS residual, relative to the mean force, of an answer that counts as one."""

_PRAISE = {
    "min_angle_deg": ("Widest apart", max),
    "tension_ratio": ("Least tension", min),
    "turn_rms_deg_s": ("Smoothest", min),
    "median_us": ("Fastest", min),
}


def findings(judged: Sequence[Judged]) -> list[str]:
    """Who is best at what and in how many flights, in plain words, from the numbers.

    Only answers that balance the force are compared: one that leaves out more than :data:`BALANCED` of it
    could always be cheaper.
    """
    asked = [[a for a in j.answers if a.allocator != ACTUAL] for j in judged]
    fair = [[a for a in answers if balances(a.numbers)] for answers in asked]
    sentences = []
    for name, (title, best) in _PRAISE.items():
        wins: Counter[str] = Counter()
        for answers in fair:
            values = {a.allocator: a.numbers[name] for a in answers if np.isfinite(a.numbers[name])}
            if values:
                target = best(values.values())
                wins.update(k for k, v in values.items() if abs(v - target) <= 1e-6 * abs(target))
        if wins:
            sentences.append(f"{title}: {_counted(wins, len(judged))}.")
    unfair = Counter(a.allocator for answers in asked for a in answers if not balances(a.numbers))
    if unfair:
        left = f"Left out more than {100 * BALANCED:g} % of the force"
        sentences.append(f"{left}: {_counted(unfair, len(judged))}.")
    return sentences


def _counted(wins: Counter[str], flights: int) -> str:
    return ", ".join(f"{kind} in {count} of {flights}" for kind, count in wins.most_common())


def balances(row: Mapping[str, float]) -> bool:
    """Whether an answer leaves out no more than :data:`BALANCED` of the force."""
    mean_force = row["mean_total_tension_N"] / row["tension_ratio"]
    return row["residual_rms_N"] <= BALANCED * mean_force


Tables = Iterator[tuple[str, list[str], list[list[str]]]]


def tables(judged: Sequence[Judged]) -> Tables:
    """What to print: the summary of several flights, or all of a single one."""
    if len(judged) > 1:
        yield from summary(judged)
    else:
        yield from flight_tables(judged[0])


def summary(judged: Sequence[Judged]) -> Tables:
    """One table a team size: every allocator over all flights."""
    header = ["allocator", "angle", "< 30", "T/F", "turn", "left", "not ok", "median", "worst"]
    for n in sorted({judgement.n for judgement in judged}):
        flights = [judgement for judgement in judged if judgement.n == n]
        rows = []
        for kind in dict.fromkeys(a.allocator for j in flights for a in j.answers):
            answers = [a for j in flights for a in j.answers if a.allocator == kind]
            value = {q: np.array([a.numbers[q] for a in answers]) for q in QUANTITIES}
            asked = sum(len(a.statuses) for a in answers)
            rows.append(
                [
                    kind,
                    shown(value["min_angle_deg"].min(), 1),
                    str(np.count_nonzero(value["min_angle_deg"] < THRESHOLD_DEG)),
                    shown(value["tension_ratio"].mean(), 3),
                    shown(np.sqrt(np.mean(value["turn_rms_deg_s"] ** 2)), 0),
                    shown(1e3 * np.sqrt(np.mean(value["residual_rms_N"] ** 2)), 2),
                    shown(100.0 * value["not_ok"].sum() / asked, 2) if asked else "-",
                    shown(np.median(value["median_us"]), 1),
                    shown(value["max_us"].max(), 0),
                ]
            )
        yield f"{n} drones, {len(flights)} flight{'s' * (len(flights) != 1)}", header, rows


NOTE = (
    "angle: smallest between two cables, degrees; drones, cable: smallest distance of two drones, and of a drone from another's "
    "cable, cm; < 30: flights with less than 30; T/F: mean sum of tensions "
    "over mean force; peak T: largest sum of tensions, N; turn: RMS rate of the directions, degrees/s; left: "
    "RMS force left out, mN; not ok: allocations not CONVERGED, %; times of one allocation, us."
)


def flight_tables(judgement: Judged) -> Tables:
    """One flight: every allocator's quality, and its times and statuses."""
    duration = float(judgement.answers[0].time[-1])
    quality, work = [], []
    for a in judgement.answers:
        v = a.numbers
        quality.append(
            [
                a.allocator,
                shown(v["min_angle_deg"], 1),
                shown(100.0 * v["min_drone_distance_m"], 0),
                shown(100.0 * v["min_cable_distance_m"], 0),
                shown(v["tension_ratio"], 3),
                shown(v["peak_total_tension_N"], 3),
                shown(v["turn_rms_deg_s"], 0),
                shown(v["turn_max_deg_s"], 0),
                shown(1e3 * v["residual_rms_N"], 2),
                shown(1e3 * v["residual_max_N"], 1),
            ]
        )
        if a.statuses:
            times = [shown(v[q], 1) for q in ("median_us", "p99_us", "max_us")]
            counts = ", ".join(f"{name} {count}" for name, count in a.status_counts.items())
            work.append([a.allocator, *times, counts])
    header = [
        "allocator",
        "angle",
        "drones",
        "cable",
        "T/F",
        "peak T",
        "turn",
        "largest",
        "left",
        "largest",
    ]
    yield f"{judgement.flight}: {judgement.n} drones, {duration:.1f} s", header, quality
    yield "Time of one allocation", ["allocator", "median", "99 %", "worst", "statuses"], work


def shown(value: float, digits: int) -> str:
    """A number with so many decimals; a dash for none."""
    return f"{value:.{digits}f}" if np.isfinite(value) else "-"
