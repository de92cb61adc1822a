"""Who is best at what: summaries and plain words, computed from rows of results and from nothing else.

A row is one flight as a mapping: ``allocator`` (or ``agents``), ``status``, ``level`` (of its verdict), ``outcome`` and metrics by
name, wherever it comes from. Rows without ``status`` count as flown, those without a verdict as held if their
``outcome`` is ``"completed"`` or not there; a metric that no row has is left out.
"""

from __future__ import annotations

import math
import statistics
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from colift.kernel.math import shares


@dataclass(frozen=True)
class Criterion:
    """One column of a comparison.

    Attributes
    ----------
    metric : str
        As in :mod:`colift.record.metrics`.
    title, unit : str
        For people; a value is multiplied by ``scale`` to be in ``unit``.
    gather : callable
        Makes one number of the flights'.
    how : str
        What ``gather`` does, in a word or two.
    high : bool
        Whether more is better.
    tie : (float, float)
        Two values tie when they differ by at most this much, in ``unit``, or by this part of the better one.
    ranked : bool
        Whether a winner is named; not where chance decides.
    group : str
        One of :data:`GROUPS`.
    load : str
        The kind of load of which it says something; empty for all.

    """

    metric: str
    title: str
    unit: str
    gather: Callable[[Sequence[float]], float]
    how: str
    tie: tuple[float, float] = (0.0, 0.02)
    high: bool = False
    scale: float = 1.0
    ranked: bool = True
    group: str = "Load and cables"
    load: str = ""

    def value(self, flights: Iterable[Mapping[str, Any]]) -> float:
        """The flights' number in ``unit``; NaN without any."""
        own = [flight for flight in flights if self.load in ("", load_of(flight))]
        found = [float(flight.get(self.metric, math.nan)) for flight in own]
        found = [number for number in found if not math.isnan(number)]
        return self.scale * self.gather(found) if found else math.nan

    def interval(self, flights: Iterable[Mapping[str, Any]]) -> tuple[float, float] | None:
        """What chance leaves open of a mean, in ``unit``: 95 %, with the missions as they are; None of what is no mean, or flown once."""
        if self.how != "mean":
            return None
        found: dict[str, list[float]] = {}
        for flight in flights:
            value = self.scale * float(flight.get(self.metric, math.nan))
            if self.load in ("", load_of(flight)) and not math.isnan(value):
                found.setdefault(str(flight.get("mission")), []).append(value)
        return shares.mean_interval(list(found.values()))

    def text(self, value: float) -> str:
        """A value for people, without unit."""
        if math.isnan(value):
            return "-"
        return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.3g}"

    def rule(self) -> str:
        """When a value ties with the best, in words."""
        fixed, part = self.tie
        unit = "" if self.unit == "1" else f" {self.unit}"
        ways = [f"{fixed:g}{unit}"] * (fixed > 0.0) + [f"{100.0 * part:g} %"] * (part > 0.0)
        return f"within {' or '.join(ways)}" if ways else "when equal"

    def ties(self, value: float, best: float) -> bool:
        """Whether ``value`` is as good as the best."""
        return abs(value - best) <= max(self.tie[0], self.tie[1] * abs(best))


POINT, RIGID = "point", "rigid"
"""Kinds of loads."""


def load_of(flight: Mapping[str, Any]) -> str:
    """Kind of a flight's load: only a rigid one has an attitude to be judged."""
    return POINT if math.isnan(float(flight.get("attitude_rms_deg", math.nan))) else RIGID


GROUPS = ("Load and cables", "Tension", "The allocator itself")
"""Groups of criteria that are shown as one table where there is little room."""

CRITERIA = (
    Criterion("tracking_rms_m", "tracking RMS", "cm", statistics.fmean, "mean", (0.05, 0.05), scale=100.0),
    Criterion("tracking_max_m", "tracking max", "cm", max, "worst", (0.1, 0.05), scale=100.0),
    Criterion("attitude_rms_deg", "attitude RMS", "deg", statistics.fmean, "mean", (0.05, 0.05), load=RIGID),
    Criterion("attitude_max_deg", "attitude max", "deg", max, "worst", (0.1, 0.05), load=RIGID),
    Criterion("min_desired_angle_deg", "wanted angle", "deg", min, "worst", (1.0, 0.0), high=True, load=POINT),
    Criterion("min_angle_deg", "actual angle", "deg", min, "worst", (1.0, 0.0), high=True, load=POINT),
    Criterion("min_drone_distance_m", "drone distance", "m", min, "worst", (0.01, 0.0), high=True, load=RIGID),
    Criterion("slack_time_s", "slack", "s", sum, "total", (0.01, 0.02), group=GROUPS[1]),
    Criterion("peak_tension_N", "peak tension", "N", max, "worst", group=GROUPS[1]),
    Criterion("tension_integral_Ns", "tension integral", "N s", statistics.fmean, "mean", (0.0, 0.01), group=GROUPS[1]),
    Criterion("energy_imbalance", "power spread", "1", statistics.fmean, "mean", (0.01, 0.0), group=GROUPS[1]),
    Criterion("allocator_median_us", "time median", "us", statistics.median, "median", (0.1, 0.2), group=GROUPS[2]),
    Criterion("allocator_p99_us", "time p99", "us", statistics.median, "median", (0.1, 0.2), group=GROUPS[2]),
    Criterion("allocator_max_us", "time worst", "us", max, "worst", ranked=False, group=GROUPS[2]),
    Criterion("allocator_limited", "reduced", "cycles", sum, "total", ranked=False, group=GROUPS[2]),
    Criterion("max_missing_moment_Nm", "missing moment", "N m", max, "worst", ranked=False, group=GROUPS[2], load=RIGID),
    Criterion("allocator_failures", "not ok", "cycles", sum, "total", (0.0, 0.0), group=GROUPS[2]),
)  # fmt: skip
"""The columns of ``colift compare``; the allocator's time is the kernel's alone."""

ANGLE, DISTANCE, EFFORT = (
    next(c for c in CRITERIA if c.metric == name)
    for name in ("min_angle_deg", "min_drone_distance_m", "tension_integral_Ns")
)
"""Separation of cables on a point, of drones around a rigid load, and the tension that either costs."""


@dataclass(frozen=True)
class Contestant:
    """What the flights of one allocator, or of one kind of agents, come to.

    Attributes
    ----------
    name : str
    flights, held, missed, lost, failed, refused : int
        All; every criterion kept to the end; a criterion missed; load or team lost; ended in an error; not
        possible to set up.
    values : mapping
        Criterion's metric to its value over the flights held; NaN where none was.
    intervals : mapping
        For those that are means the 95 % interval over the seeds of each mission; where there are two flights of one.

    """

    name: str
    flights: int
    held: int
    missed: int
    lost: int
    failed: int
    refused: int
    values: Mapping[str, float]
    intervals: Mapping[str, tuple[float, float]]

    @property
    def ranked(self) -> bool:
        """Only who held every flight is compared: a dropped load is light, and cables that meet are cheap."""
        return self.held == self.flights > 0


def fate(row: Mapping[str, Any]) -> str:
    """What became of a flight: held, missed (a criterion), lost, failed, refused, or missing."""
    status = str(row.get("status") or "flown")
    if status != "flown":
        return status
    if row.get("level"):
        return {"fail": "missed", "lost": "lost"}.get(str(row["level"]), "held")
    return "held" if row.get("outcome", "completed") == "completed" else "lost"


WORST_FIRST = ("refused", "failed", "lost", "missed", "held")
"""What can become of a flight that was to be flown."""


def held(row: Mapping[str, Any]) -> bool:
    """Whether the flight kept every criterion to its end."""
    return fate(row) == "held"


def criteria_of(rows: Iterable[Mapping[str, Any]]) -> list[Criterion]:
    """The criteria that the rows have numbers for."""
    rows = list(rows)
    names = {name for row in rows for name in row}
    loads = {"", *(load_of(row) for row in rows if str(row.get("status") or "flown") == "flown")}
    return [c for c in CRITERIA if c.metric in names and c.load in loads]


def compared(rows: Iterable[Mapping[str, Any]]) -> str:
    """The column in which contestants are named: ``agents`` or ``allocator``."""
    return "agents" if any("agents" in row for row in rows) else "allocator"


def name_of(row: Mapping[str, Any]) -> str:
    """Of the contestant that flew."""
    return str(row[compared([row])])


def contestants(rows: Sequence[Mapping[str, Any]]) -> list[Contestant]:
    """One summary an allocator, or a kind of agents, in the order of first mention; runs that are missing do not count."""
    rows = [row for row in rows if row.get("status") != "missing"]
    found, criteria = [], criteria_of(rows)
    for name in dict.fromkeys(map(name_of, rows)):
        own = [row for row in rows if name_of(row) == name]
        good = [row for row in own if held(row)]
        fates = Counter(map(fate, own))
        found.append(
            Contestant(
                name=name,
                flights=len(own),
                **{each: fates[each] for each in _FATES},
                values={c.metric: c.value(good) for c in criteria},
                intervals={c.metric: each for c in criteria if (each := c.interval(good))},
            )
        )
    return found


def winners(criterion: Criterion, field: Sequence[Contestant]) -> list[str]:
    """Who is best, with those that tie, best first; nobody where nobody has a number."""
    numbers = _ranking(criterion, field)
    return [name for name, value in numbers if criterion.ties(value, numbers[0][1])]


def undominated(field: Sequence[Contestant]) -> list[str]:
    """Who is not beaten at separation and at tension by one and the same other.

    Beaten is who is clearly behind in one of the two and at best level in the other.
    """
    angles = any(not math.isnan(c.values.get(ANGLE.metric, math.nan)) for c in field)
    both = (ANGLE if angles else DISTANCE, EFFORT)

    def value(c: Contestant, criterion: Criterion) -> float:
        return c.values.get(criterion.metric, math.nan)

    def beats(other: Contestant, c: Contestant) -> bool:
        level = [k.ties(value(c, k), value(other, k)) for k in both]
        ahead = [(value(other, k) > value(c, k)) == k.high for k in both]
        return not all(level) and all(map(max, level, ahead))

    entered = [c for c in field if c.ranked and not any(math.isnan(value(c, k)) for k in both)]
    return [c.name for c in entered if not any(beats(other, c) for other in entered)]


def words(
    field: Sequence[Contestant],
    criteria: Sequence[Criterion] = CRITERIA,
    who: str = "allocators",
) -> list[str]:
    """What the numbers say, a sentence each: who dropped out, who leads at what, who ties."""
    ranked = [c for c in field if c.ranked]
    said = [_held_words(field, who)]
    said += [
        f"{c.name} is not ranked: of {c.flights} flights {_trouble(c)}."
        for c in field
        if not c.ranked
    ]
    if len(ranked) < 2:
        return [*said, "Fewer than two are left to rank."]
    leads = dict.fromkeys((c.name for c in ranked), 0)
    counted = 0
    for criterion in criteria:
        numbers = _ranking(criterion, ranked)
        if not criterion.ranked or len(numbers) < 2:
            continue
        best = winners(criterion, ranked)
        said.append(_criterion_words(criterion, numbers, best))
        if len(best) < len(numbers):
            counted += 1
            for name in best:
                leads[name] += 1
    free = undominated(field)
    if free:
        said.append(
            f"Separation against tension: {_list(free)} "
            f"{'is' if len(free) == 1 else 'are'} not beaten at both by any one other."
        )
    order = sorted(leads.items(), key=lambda item: -item[1])
    tally = ", ".join(f"{name} {count}" for name, count in order)
    said.append(
        f"First or level with the first, of the {counted} criteria on which they differ: {tally}. "
        "How much each criterion counts is for the reader to say."
    )
    return said


_FATES = {
    "held": "were held to the end within every criterion",
    "missed": "missed a criterion",
    "lost": "lost the load or the team",
    "failed": "ended in an error",
    "refused": "could not be set up",
}
"""What can become of a flight, in words that follow a number of flights."""


def _held_words(field: Sequence[Contestant], who: str) -> str:
    flights = sum(c.flights for c in field)
    counts = {each: sum(getattr(c, each) for c in field) for each in _FATES}
    if counts["held"] == flights:
        return (
            f"All {len(field)} {who} held all of their flights within every criterion "
            f"({flights} in total)."
        )
    others = [
        f"{count} {_FATES[each]}" for each, count in counts.items() if count and each != "held"
    ]
    return f"{counts['held']} of {flights} flights {_FATES['held']}; {', '.join(others)}."


def _trouble(contestant: Contestant) -> str:
    counts = {each: getattr(contestant, each) for each in _FATES if each != "held"}
    return _list([f"{count} {_FATES[each]}" for each, count in counts.items() if count])


def _criterion_words(
    criterion: Criterion, numbers: Sequence[tuple[str, float]], best: Sequence[str]
) -> str:
    unit = "" if criterion.unit == "1" else f" {criterion.unit}"
    what = f"{criterion.title[:1].upper()}{criterion.title[1:]} ({criterion.how})"
    first, last = criterion.text(numbers[0][1]) + unit, criterion.text(numbers[-1][1]) + unit
    if len(best) == len(numbers):
        same = first if first == last else f"{first} to {last}"
        return f"{what}: no difference worth the name ({same})."
    end = f"last {numbers[-1][0]}, {last}"
    if len(best) == 1:
        second, value = numbers[1]
        after = "" if len(numbers) == 2 else f" before {second} ({criterion.text(value)}{unit})"
        return f"{what}: {best[0]} leads with {first}{after}; {end}."
    return f"{what}: {_list(best)} are level at {first}; {end}."


def _ranking(criterion: Criterion, field: Iterable[Contestant]) -> list[tuple[str, float]]:
    numbers = [(c.name, c.values.get(criterion.metric, math.nan)) for c in field if c.ranked]
    sign = -1.0 if criterion.high else 1.0
    return sorted((n for n in numbers if not math.isnan(n[1])), key=lambda n: sign * n[1])


def _list(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"
