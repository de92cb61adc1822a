"""Who wins at what, from rows that are made up."""

from __future__ import annotations

import math
from typing import Any

import pytest

from colift.study.campaign import judge


def row(allocator: str, **values: Any) -> dict[str, Any]:
    return {"allocator": allocator, "tracking_max_m": 0.01, **values}


def said(rows: list[dict[str, Any]]) -> list[str]:
    return judge.words(judge.contestants(rows), judge.criteria_of(rows))


def about(rows: list[dict[str, Any]], title: str) -> str:
    (sentence,) = (text for text in said(rows) if text.startswith(title))
    return sentence


def test_the_best_is_named_with_the_second_and_the_last() -> None:
    rows = [
        row("a", min_angle_deg=30.0),
        row("b", min_angle_deg=45.0),
        row("c", min_angle_deg=20.0),
    ]
    expected = "Actual angle (worst): b leads with 45 deg before a (30 deg); last c, 20 deg."
    assert about(rows, "Actual angle") == expected


def test_the_worst_flight_counts_for_angles_and_the_mean_for_effort() -> None:
    rows = [
        row("a", min_angle_deg=50.0, tension_integral_Ns=10.0),
        row("a", min_angle_deg=10.0, tension_integral_Ns=20.0),
        row("b", min_angle_deg=30.0, tension_integral_Ns=14.0),
    ]
    a, _ = judge.contestants(rows)
    assert (a.values["min_angle_deg"], a.values["tension_integral_Ns"]) == (10.0, 15.0)
    assert about(rows, "Actual angle").startswith("Actual angle (worst): b leads")
    assert about(rows, "Tension integral").startswith("Tension integral (mean): b leads")


def test_less_than_the_resolution_is_a_tie() -> None:
    rows = [
        row("a", min_angle_deg=44.2),
        row("b", min_angle_deg=45.0),
        row("c", min_angle_deg=20.0),
    ]
    assert "b and a are level at 45 deg; last c" in about(rows, "Actual angle")
    level = [row("a", slack_time_s=0.0), row("b", slack_time_s=0.0)]
    assert about(level, "Slack") == "Slack (total): no difference worth the name (0 s)."


def test_who_drops_the_load_or_misses_a_criterion_is_named_and_not_ranked() -> None:
    rows = [
        row("light", tension_integral_Ns=1.0, level="lost"),
        row("diverged", tension_integral_Ns=1.0, outcome="diverged before t = 3 s"),  # no verdict
        row("near", tension_integral_Ns=2.0, level="fail"),
        row("broken", status="failed", error="ValueError: no"),
        row("other", status="refused", error="allocation.mu: unknown key"),
        row("a", tension_integral_Ns=20.0, level="warn"),
        row("b", tension_integral_Ns=10.0, level="pass"),
    ]
    text = said(rows)
    assert text[0] == (
        "2 of 7 flights were held to the end within every criterion; 1 missed a criterion, "
        "2 lost the load or the team, 1 ended in an error, 1 could not be set up."
    )
    assert "light is not ranked: of 1 flights 1 lost the load or the team." in text
    assert "diverged is not ranked: of 1 flights 1 lost the load or the team." in text
    assert "near is not ranked: of 1 flights 1 missed a criterion." in text
    assert "broken is not ranked: of 1 flights 1 ended in an error." in text
    assert "other is not ranked: of 1 flights 1 could not be set up." in text
    assert about(rows, "Tension integral").startswith(
        "Tension integral (mean): b leads with 10 N s"
    )
    assert all(math.isnan(c.values["tension_integral_Ns"]) for c in judge.contestants(rows)[:5])


def test_one_flight_missed_of_many_is_enough_not_to_be_ranked() -> None:
    rows = [row("a"), row("a", level="fail"), row("a", level="lost"), row("b"), row("c")]
    a, *_ = judge.contestants(rows)
    assert (a.flights, a.held, a.missed, a.lost, a.failed, a.ranked) == (3, 1, 1, 1, 0, False)
    assert (
        "a is not ranked: of 3 flights 1 missed a criterion and 1 lost the load or the team."
        in (said(rows))
    )


def test_nobody_left_is_said() -> None:
    lost = row("a", outcome="diverged before t = 1 s", min_angle_deg=3.0)
    assert said([lost, row("b", min_angle_deg=40.0)])[-1] == "Fewer than two are left to rank."


def test_nan_is_no_value_and_wins_nothing() -> None:
    rows = [
        row(name, min_angle_deg=angle) for name, angle in (("a", math.nan), ("b", 9.0), ("c", 5.0))
    ]
    assert "b leads" in about(rows, "Actual angle")
    assert "a" not in about(rows, "Actual angle").split(": ", 1)[1].replace(" and ", " ").split()


@pytest.mark.parametrize(
    ("pairs", "free"),
    [
        ({"a": (40.0, 10.0), "b": (30.0, 12.0)}, ["a"]),
        ({"a": (40.0, 12.0), "b": (30.0, 10.0)}, ["a", "b"]),
        ({"a": (40.0, 10.0), "b": (40.0, 10.0)}, ["a", "b"]),
        ({"a": (40.0, 10.0), "b": (40.0, 11.0), "c": (50.0, 20.0)}, ["a", "c"]),
        ({"a": (40.0, 10.0), "b": (39.5, 10.05)}, ["a", "b"]),  # level in both
        ({"a": (40.0, 10.0), "b": (40.5, 12.0)}, ["a"]),  # half a degree is no reason
    ],
)
def test_undominated_are_those_nobody_beats_at_both(
    pairs: dict[str, tuple[float, float]], free: list[str]
) -> None:
    rows = [
        row(name, min_angle_deg=angle, tension_integral_Ns=effort)
        for name, (angle, effort) in pairs.items()
    ]
    assert judge.undominated(judge.contestants(rows)) == free


def test_the_tally_counts_only_criteria_on_which_they_differ() -> None:
    rows = [
        row("a", min_angle_deg=40.0, peak_tension_N=1.0, slack_time_s=0.0),
        row("b", min_angle_deg=20.0, peak_tension_N=2.0, slack_time_s=0.0),
    ]
    assert "of the 2 criteria on which they differ: a 2, b 0." in said(rows)[-1]


def test_rows_of_anything_else_need_only_an_allocator_and_numbers() -> None:
    rows = [
        {"allocator": "a", "mission": "a real flight", "min_angle_deg": 30.0},
        {"allocator": "b", "mission": "a real flight", "min_angle_deg": 50.0},
        {"allocator": "b", "mission": "not flown yet", "status": "missing"},
    ]
    assert [c.metric for c in judge.criteria_of(rows)] == ["min_angle_deg"]
    assert said(rows)[0] == (
        "All 2 allocators held all of their flights within every criterion (2 in total)."
    )


def test_angles_are_of_points_and_distances_of_rigid_loads() -> None:
    """Parallel cables on a box count for no angle, nor do the distances on a point."""
    point = [row(name, min_angle_deg=40.0, min_drone_distance_m=0.1) for name in "ab"]
    box = [
        row(name, min_angle_deg=0.0, min_drone_distance_m=far, attitude_rms_deg=0.5)
        for name, far in (("a", 0.8), ("b", 0.6))
    ]
    assert {c.metric for c in judge.criteria_of(point)} == {"tracking_max_m", "min_angle_deg"}
    alone = {c.metric for c in judge.criteria_of(box)}
    assert alone == {"tracking_max_m", "min_drone_distance_m", "attitude_rms_deg"}
    assert "a leads with 0.8 m" in about(box, "Drone distance")
    a, b = judge.contestants([*point, *box])
    assert a.values["min_angle_deg"] == b.values["min_angle_deg"] == 40.0
    assert (a.values["min_drone_distance_m"], b.values["min_drone_distance_m"]) == (0.8, 0.6)
    costly = [{**r, "tension_integral_Ns": size} for r, size in zip(box, (2.0, 1.0), strict=True)]
    assert judge.undominated(judge.contestants(costly)) == ["a", "b"]
    assert judge.undominated(
        judge.contestants([{**r, "tension_integral_Ns": 1.0} for r in box])
    ) == ["a"]
