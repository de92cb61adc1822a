"""What is swept, and what the sweep comes to."""

from __future__ import annotations

import math
from typing import Any

import pytest

from colift.campaign.plan import HEADING, OFFSET
from colift.campaign.sweep import METRICS, Over, cases, parse_over, points
from colift.errors import ColiftError, MissionError


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("load.mass=1:2:3", (1.0, 1.5, 2.0)),
        ("load.mass=2:1:3", (2.0, 1.5, 1.0)),
        ("load.mass=0.01:1:3:log", (0.01, 0.1, 1.0)),
        ("load.mass=0.1,0.3", (0.1, 0.3)),
        ("load.mass=0.1", (0.1,)),
        ("allocation.kind=sqp,safe,sqp", ("sqp", "safe")),
        ("reference.centre=[0,0,1],[0,0,2]", ((0, 0, 1), (0, 0, 2))),
    ],
)
def test_values_of_a_field(text: str, values: tuple[Any, ...]) -> None:
    assert parse_over(text) == Over(text.partition("=")[0], values)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("load.mass", "must have the form"),
        ("=1:2:3", "must have the form"),
        ("load.mass=1:2", "must be LOW:HIGH:COUNT"),
        ("load.mass=a:2:3", "two numbers and a whole one"),
        ("load.mass=1:2:1", "between 2 and"),
        ("load.mass=1:2:3:lin", "must have the form"),
        ("load.mass=1:inf:3", "must have the form"),
        ("load.mass=0:2:3:log", "greater than 0"),
    ],
)
def test_a_mistake_is_named(text: str, says: str) -> None:
    with pytest.raises(MissionError, match=says):
        parse_over(text)


def test_a_sweep_is_the_grid_of_its_values_times_seeds() -> None:
    overs = [parse_over("load.mass=0.1,0.2"), parse_over("allocation.kind=sqp,safe")]
    found = cases("hover", overs, range(3), {"timing.duration": 1.0})
    assert len(found) == 12
    assert len({tuple(case.labels.items()) for case in found}) == 12
    assert found[0].labels == {"load.mass": 0.1, "allocation.kind": "sqp", "seed": 0}
    assert found[0].overrides == {
        "timing.duration": 1.0, "load.mass": 0.1, "allocation.kind": "sqp"
    }  # fmt: skip
    first, last = found[0].load(), found[-1].load()
    assert (first.seed, last.seed) == (0, 2)
    assert first.start.heading_deg == 0.0 != last.start.heading_deg


def test_seeds_start_a_little_off_what_is_swept_and_set() -> None:
    over = [parse_over("start.heading_deg=20,40")]
    start = {"start": {"cone_deg": 50.0, "load_offset": [0.5, 0.0, 0.0]}}
    for case in cases("hover", over, range(1000, 1003), start):
        loaded = case.load()
        assert loaded.seed == case.seed == case.labels["seed"] >= 1000
        off = loaded.start.heading_deg - float(case.labels["start.heading_deg"])
        assert 0.0 < abs(off) <= HEADING
        assert 0.0 < abs(loaded.start.load_offset[0] - 0.5) <= OFFSET
        assert loaded.start.cone_deg == 50.0
    for overs, changes in (([parse_over("seed=1,2")], {}), (over, {"seed": 3})):
        with pytest.raises(ColiftError, match="--first-seed"):
            cases("hover", overs, [0], changes)


def test_what_is_swept_wins_over_what_is_set() -> None:
    (case, _) = cases("hover", [parse_over("load.mass=0.1,0.2")], [0], {"load.mass": 9.0})
    assert case.overrides["load.mass"] == 0.1


def test_points_gather_seeds_and_leave_out_what_did_not_end_well() -> None:
    def row(mass: float, angle: float, outcome: str = "completed") -> dict[str, Any]:
        numbers = dict.fromkeys(METRICS, 1.0) | {"min_angle_deg": angle}
        return {"load.mass": mass, "status": "flown", "outcome": outcome, **numbers}

    rows = [
        row(1.0, 30.0),
        row(1.0, 50.0),
        row(1.0, 1.0, "diverged before t = 1 s"),
        row(2.0, math.nan),
    ]
    rows.append({"load.mass": 2.0, "status": "failed", "outcome": "", "error": "no"})
    first, second = points(rows, [Over("load.mass", (1.0, 2.0))])
    assert (first.values, first.flights, first.completed) == ((1.0,), 3, 2)
    assert first.spread["min_angle_deg"] == (40.0, 30.0, 50.0)
    assert (second.flights, second.completed) == (2, 1)
    assert all(math.isnan(value) for value in second.spread["min_angle_deg"])
