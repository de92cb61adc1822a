"""What is swept, and what the sweep comes to."""

from __future__ import annotations

import math
from typing import Any

import pytest

from colift.errors import ColiftError, MissionError
from colift.show.report.campaign import not_held, sweep_tables
from colift.show.report.campaign_figures import Swept
from colift.study.campaign.plan import HEADING, OFFSET
from colift.study.sweep import COLUMNS, Over, cases, parse_over, points


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


def test_points_gather_seeds_and_tell_held_missed_and_lost_apart() -> None:
    def row(mass: float, angle: float, level: str = "pass", why: str = "") -> dict[str, Any]:
        numbers = dict.fromkeys(COLUMNS, 1.0) | {"min_angle_deg": angle}
        return {"load.mass": mass, "status": "flown", "level": level, "reasons": why, **numbers}

    def error(mass: float, status: str) -> dict[str, Any]:
        return {"load.mass": mass, "status": status, "level": "", "error": f"{status}!"}

    rows = [
        row(1.0, 30.0),
        row(1.0, 50.0, "warn", "slack"),
        row(1.0, 10.0, "fail", "too near"),
        row(1.0, 0.003, "lost", "too far"),
        row(1.0, 0.002, "lost", "too far"),
        row(2.0, math.nan),
        error(2.0, "failed"),
        error(3.0, "refused"),
    ]
    overs = [Over("load.mass", (1.0, 2.0, 3.0))]
    first, second, third = points(rows, overs)
    assert (first.values, first.flights, first.held, first.level) == ((1.0,), 5, 2, "lost")
    assert first.fates == {"held": 2, "missed": 1, "lost": 2}
    assert first.reasons == ["too far", "too near"]
    assert first.spread["min_angle_deg"] == (
        30.0,
        10.0,
        50.0,
    )  # a lost flight's numbers are nothing
    assert (second.flights, second.held, second.level) == (2, 1, "failed")
    assert all(math.isnan(value) for value in second.spread["min_angle_deg"])
    assert (third.level, third.refused, third.reasons) == ("refused", True, ["refused!"])

    tables = sweep_tables(Swept(rows, overs))
    assert [title for title, *_ in tables] == ["Mean", "Least", "Largest"]
    header, lines = tables[0][1:]
    assert header[:2] == ["mass", "held (95 %)"]
    assert [line[1] for line in lines] == ["2/5 (5-86 %)", "1/2 (1-99 %)", "refused"]
    assert lines[2][2:] == ["-"] * len(COLUMNS)
    box = [
        {
            **row(1.0, 30.0),
            "attitude_max_deg": 2.5,
            "attitude_rms_deg": 1.0,
            "min_drone_distance_m": 0.75,
        }
    ]
    (_, header, lines) = sweep_tables(Swept(box, overs))[0]
    assert header[3:5] == ["attitude (deg)", "apart (m)"]
    assert lines[0][3:5] == ["2.5", "0.75"]
    assert not_held(Swept(rows, overs)) == [
        "load.mass 1.0: 2 held, 1 missed, 2 lost: too far (and 1 more)",
        "load.mass 2.0: 1 held, 1 failed: failed!",
        "load.mass 3.0: cannot be flown: refused!",
    ]
    alone = sweep_tables(Swept([rows[0], rows[5], rows[7]], overs))
    assert [line[1] for line in alone[0][2]] == ["held", "held", "refused"]
