"""Criteria of a mission: which flights pass, and what is said of those that do not."""

from __future__ import annotations

import json

import pytest

import colift
import terminal
from colift.errors import MissionError
from colift.mission import load_mission

SHORT = {"timing.duration": 0.3}


def judged(criteria):
    run = colift.run("hover", overrides={**SHORT, "criteria": criteria})
    return run.verdict


def test_a_mission_without_criteria_is_judged_by_the_defaults():
    verdict = judged({})
    assert [(each.metric, each.bound, each.asked) for each in verdict.judged] == [
        ("tracking_max_m", "<= 0.5", False),
        ("min_height_m", ">= -0.02", False),
        ("max_tilt_deg", "<= 90", False),
        ("min_angle_deg", ">= 30", False),  # what its allocator is asked for
    ]
    assert verdict.level == "pass"
    assert verdict.reasons == []


def test_each_criterion_gets_its_verdict():
    verdict = judged(
        {
            "tracking_max_m": {"max": 0.05},
            "min_angle_deg": {"min": 20.0, "max": 89.0},
            "peak_tension_N": {"max": 0.01},
            "tension_integral_10s_Ns": {"max": 1e9},  # not a number in a flight of 0.3 s
        }
    )
    own = [each for each in verdict.judged if each.asked]
    assert [each.metric for each in own[:2]] == ["tracking_max_m", "min_angle_deg"]
    assert [each.holds for each in own] == [True, True, False, False]
    assert own[1].bound == ">= 20 and <= 89"
    assert len(verdict.judged) == len(own) + 2  # height and tilt have defaults
    assert verdict.level == "fail"
    assert len(verdict.reasons) == 2
    assert verdict.reasons[0].startswith("peak_tension_N is 0.")


@pytest.mark.parametrize(
    ("criteria", "message"),
    [
        (
            {"traking_max_m": {"max": 1.0}},
            r"criteria\.traking_max_m.*did you mean 'tracking_max_m'",
        ),
        ({"tracking_max_m": {}}, r"criteria\.tracking_max_m: must give min, max or both"),
        ({"min_angle_deg": {"min": 2.0, "max": 1.0}}, r"criteria\.min_angle_deg\.min: .*max = 1"),
        ({"min_angle_deg": 3.0}, r"criteria\.min_angle_deg: must be a table"),
    ],
)
def test_mistakes_are_told_before_the_flight(criteria, message):
    with pytest.raises(MissionError, match=message):
        load_mission("hover", {"criteria": criteria})


@pytest.mark.parametrize(("limit", "code"), [(0.5, 0), (1e-9, 4)])
def test_the_command_ends_with_the_verdict(tmp_path, limit, code):
    command = ["run", "hover", "--no-report", "--json"]
    sets = ["--set", "timing.duration=0.3", "--set", f"criteria.tracking_max_m.max={limit}"]
    done = terminal.colift(*command, *sets, "--out", str(tmp_path))
    assert done.returncode == code, done.stderr
    said = json.loads(done.stdout)
    assert {each["metric"]: each["holds"] for each in said["criteria"]}["tracking_max_m"] is (
        code == 0
    )
    assert said["verdict"]["level"] == ("pass" if code == 0 else "fail")
    assert len(said["verdict"]["reasons"]) == (code != 0)
