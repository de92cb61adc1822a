"""The campaign behind ``colift sweep``: one mission over values of its fields and over seeds."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from colift.errors import MissionError, Problem
from colift.mission.load import layered, parse_override
from colift.study.campaign import judge
from colift.study.campaign.plan import Case, Label, without_seed

MAX_VALUES = 10_000
"""Most values of one field."""


@dataclass(frozen=True)
class Over:
    """A field of the mission by dotted path, and the values that it takes."""

    path: str
    values: tuple[Any, ...]

    @property
    def labels(self) -> tuple[Label, ...]:
        """The values as they are written into results: lists as text."""
        return tuple(v if isinstance(v, str | int | float) else str(v) for v in self.values)

    @property
    def numeric(self) -> bool:
        return all(type(value) in (int, float) for value in self.values)


def parse_over(text: str) -> Over:
    """``PATH=LOW:HIGH:COUNT``, the same with ``:log`` behind it, or ``PATH=VALUE,VALUE,...``.

    Raises
    ------
    MissionError
        If it is none of these.

    """
    path, separator, given = (part.strip() for part in text.partition("="))
    if not path or not separator or not given:
        raise _wrong(text, "must have the form PATH=LOW:HIGH:COUNT[:log] or PATH=VALUE,VALUE,...")
    if ":" not in given:
        values = [parse_override(f"{path}={value}")[1] for value in _split(given)]
        return Over(path, tuple(dict.fromkeys(map(_hashable, values))))
    try:
        low, high, count, *scale = given.split(":")
        first, last, number = float(low), float(high), int(count)
    except ValueError:
        message = "must be LOW:HIGH:COUNT: two numbers and a whole one"
        raise _wrong(text, message) from None
    if scale not in ([], ["log"]) or not (math.isfinite(first) and math.isfinite(last)):
        raise _wrong(text, "must have the form PATH=LOW:HIGH:COUNT or PATH=LOW:HIGH:COUNT:log")
    if not 2 <= number <= MAX_VALUES:
        raise _wrong(text, f"COUNT must be between 2 and {MAX_VALUES}")
    if scale and min(first, last) <= 0.0:
        raise _wrong(text, "LOW and HIGH must be greater than 0 on a logarithmic scale")
    points = (np.geomspace if scale else np.linspace)(first, last, number)
    return Over(path, tuple(float(f"{value:.12g}") for value in points))


def _split(text: str) -> Iterable[str]:
    """At commas, but not at those within brackets."""
    depth, begin = 0, 0
    for k, character in enumerate(text):
        depth += (character in "[{") - (character in "]}")
        if character == "," and depth == 0:
            yield text[begin:k]
            begin = k + 1
    yield text[begin:]


def _hashable(value: Any) -> Any:
    return tuple(map(_hashable, value)) if isinstance(value, list) else value


def _wrong(text: str, message: str) -> MissionError:
    return MissionError("--over", [Problem(text, "", message)])


def cases(
    mission: str | Path, overs: Sequence[Over], seeds: Iterable[int], changes: Mapping[str, Any]
) -> list[Case]:
    """Every combination of values, times seeds; ``changes`` are made in all of them."""
    changes = without_seed(changes)
    without_seed({over.path: over.values for over in overs})
    found = []
    for seed in seeds:
        choices = [zip(over.values, over.labels, strict=True) for over in overs]
        for choice in itertools.product(*choices):
            values = {over.path: value for over, (value, _) in zip(overs, choice, strict=True)}
            labels = {over.path: label for over, (_, label) in zip(overs, choice, strict=True)}
            labels["seed"] = seed
            found.append(Case(labels, mission, layered(changes, values), seed))
    return found


COLUMNS = {
    "tracking_rms_m": "tracking",
    "min_angle_deg": "least angle",
    "usual_angle_deg": "usual angle",
    "mean_total_tension_N": "tension",
    "slack_time_s": "slack",
}
"""The metrics of tables and figure, and how they are called there; the file holds all."""
RIGID = {
    "tracking_rms_m": "tracking",
    "attitude_max_deg": "attitude",
    "min_drone_distance_m": "apart",
    "mean_total_tension_N": "tension",
    "slack_time_s": "slack",
}
"""Those of rigid loads, whose cables may be parallel."""


@dataclass(frozen=True)
class Point:
    """The flights of one combination of values.

    Attributes
    ----------
    values : tuple
        Of the fields, in their order.
    fates : mapping
        Number of flights by what became of them, see :func:`colift.study.campaign.judge.fate`.
    reasons : list of str
        What was wrong in flights that were not held, the most frequent first, each once.
    spread : mapping
        Mean, least and largest of each metric over the seeds whose flight went to its end without a loss.

    """

    values: tuple[Any, ...]
    fates: Mapping[str, int]
    reasons: list[str]
    spread: Mapping[str, tuple[float, float, float]]

    @property
    def flights(self) -> int:
        return sum(self.fates.values())

    @property
    def held(self) -> int:
        """Flights that kept every criterion."""
        return self.fates.get("held", 0)

    @property
    def refused(self) -> bool:
        """Whether there can be no such flight."""
        return self.fates.get("refused", 0) == self.flights

    @property
    def level(self) -> str:
        """What the worst of its flights came to."""
        return next((fate for fate in judge.WORST_FIRST if self.fates.get(fate)), "missing")


def points(rows: Sequence[Mapping[str, Any]], overs: Sequence[Over]) -> list[Point]:
    """One summary a combination of values, in the order asked for."""
    grouped: dict[tuple[Any, ...], list[Mapping[str, Any]]] = {}
    for row in rows:
        grouped.setdefault(tuple(row[over.path] for over in overs), []).append(row)
    rigid = any(judge.load_of(row) == judge.RIGID for row in rows)
    shown = COLUMNS | RIGID if rigid else COLUMNS
    found = []
    for values, flights in grouped.items():
        fates = Counter(map(judge.fate, flights))
        ended = [row for row in flights if judge.fate(row) in ("held", "missed")]
        spread = {
            name: _spread([float(row.get(name, math.nan)) for row in ended]) for name in shown
        }
        wrong = Counter(
            str(row.get("error") or row.get("reasons") or row.get("outcome"))
            for row in flights
            if not judge.held(row)
        )
        found.append(Point(values, fates, [text for text, _ in wrong.most_common()], spread))
    return found


def _spread(values: Sequence[float]) -> tuple[float, float, float]:
    known = [value for value in values if not math.isnan(value)]
    if not known:
        return math.nan, math.nan, math.nan
    return sum(known) / len(known), min(known), max(known)
