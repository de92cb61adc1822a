"""One verdict: what is lost, what misses a criterion, what is worth a look, and the exit codes that follow."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

import colift
import terminal
from colift.mission import load_mission
from colift.record import metrics, verdict
from colift.record.verdict import criteria_of, judge, limits

SHORT = {"timing.duration": 0.3}


@pytest.fixture(scope="module")
def flight():
    return colift.run("hover", overrides={**SHORT, "plant.kind": "rigid-cables"})


def changed(flight, outcome="completed", **rows):
    """The flight with some rows of signals changed at its end, judged."""
    arrays = {name: values.copy() for name, values in flight.recording.arrays.items()}
    for name, change in rows.items():
        change(arrays[name])
    recording = replace(flight.recording, arrays=arrays, outcome=outcome)
    return judge(recording, metrics.compute(recording))


def moved(by):
    def move(load):
        load[-1, 0] += by

    return move


def test_a_flight_without_blemish_passes(flight):
    found = changed(flight)
    assert (found.level, found.reasons, found.ok) == ("pass", [], True)
    assert found.sentence.startswith("Pass: load within ")


@pytest.mark.parametrize(
    ("by", "level", "said"),
    [
        ([0.6, 0.0, 0.0], "fail", "tracking_max_m is 0.6"),
        ([0.0, 0.0, -1.1], "fail", "min_height_m is -0.09"),
        ([338.0, 0.0, 0.0], "lost", "the load was 338 m off its reference"),
        ([0.0, 0.0, -124.0], "lost", "m underground"),
    ],
)
def test_where_the_load_is_decides(flight, by, level, said):
    found = changed(flight, load=moved(by))
    assert found.level == level
    assert not found.ok
    assert said in found.sentence


def test_lost_is_also_a_load_that_no_cable_holds_and_a_flight_that_ended(flight):
    def release(attached):
        attached[-1] = 0.0

    assert "no cable holds" in changed(flight, attached=release).reasons[0]
    assert changed(flight, attached=release).level == "lost"
    assert changed(flight, outcome="diverged before t = 1 s").level == "lost"
    assert changed(flight, outcome="no drone left to carry at t = 1 s").level == "lost"
    down = changed(flight, outcome="descended from t = 1 s: too weak")
    assert (down.level, down.reasons) == ("fail", ["descended from t = 1 s: too weak"])


def test_a_drone_that_turns_over_fails_unless_something_broke_it(flight):
    def turn(attitudes):
        attitudes[-3, 2] = [0.0, 1.0, 0.0, 0.0]

    def weaken(health):
        health[-3, 2, 1] = 0.0

    assert changed(flight, attitudes=turn).level == "fail"
    assert changed(flight, attitudes=turn, motor_health=weaken).ok


def test_a_pushing_cable_is_named_on_rods_and_slack_elsewhere(flight):
    def push(slack):
        slack[-1, 0] = 0.25

    found = changed(flight, slack_times=push)
    assert found.level == "warn"
    assert found.reasons == [
        "cables pushed like rods for 0.25 s, which no cable does: fly on slack-cables"
    ]
    slack = colift.run("hover", overrides={**SHORT, "plant.kind": "slack-cables"})
    assert changed(slack, slack_times=push).reasons == ["cables slack for 0.25 s"]


def test_the_angle_is_judged_by_what_the_allocator_was_asked_for(flight):
    asked = load_mission("hover", {"allocation.min_angle_deg": 50.0})
    assert limits(asked).angle_deg == 50.0
    found = judge(replace(flight.recording, mission=asked), flight.metrics)
    assert found.level == "fail"
    assert "not >= 50" in found.reasons[0]
    own = load_mission("hover", {"criteria": {"min_angle_deg": {"min": 12.0}}})
    assert limits(own).angle_deg == 12.0
    promising_none = load_mission("hover", {"allocation.kind": "sqp"})
    assert limits(promising_none).angle_deg is None


@pytest.mark.parametrize(
    ("event", "angle"),
    [
        ({"field": "allocation.min_angle_deg", "value": 20.0}, 20.0),
        ({"field": "allocation", "value": {"kind": "safe", "min_angle_deg": 40.0}}, 30.0),
        ({"field": "allocation.kind", "value": "sqp"}, None),
    ],
)
def test_an_allocator_changed_in_flight_counts_with_the_least_it_was_asked_for(event, angle):
    mission = load_mission("hover", {"events": [{"at": 1.0, **event}]})
    assert limits(mission).angle_deg == angle


def test_a_mission_may_fly_far_from_its_reference_and_low_if_it_says_so():
    wide = {"tracking_max_m": {"max": 400.0}, "min_height_m": {"min": -200.0}}
    mission = load_mission("hover", {"criteria": wide, **SHORT})
    flown = colift.run(mission)
    far = replace(flown.recording)
    far.arrays["load"][-1, 0] += [338.0, 0.0, -150.0]
    assert judge(far, metrics.compute(far)).level == "pass"


def test_defaults_that_do_not_apply_are_left_out(flight):
    values = {**flight.metrics, "min_angle_deg": np.nan, "tracking_max_m": np.nan}
    found = judge(flight.recording, values)
    assert {each.metric for each in found.judged} == {"min_height_m", "max_tilt_deg"}
    assert set(criteria_of(flight.mission)) > {each.metric for each in found.judged}


def command(tmp_path, *arguments):
    return terminal.colift(*arguments, folder=tmp_path)


def test_a_released_load_is_lost_everywhere(tmp_path):
    """Terminal, exit code, JSON and report say the same of a load that was let go."""
    sets = ["--set", 'fault=[{kind="load-released", at=0.2}]', "--set", "timing.duration=3"]
    done = command(tmp_path, "run", "hover", *sets, "--json", "--no-report", "--out", "x")
    assert done.returncode == 3, done.stderr
    told = json.loads(done.stdout)["verdict"]
    assert told["level"] == "lost"
    assert told["reasons"][0] == "no cable holds the load at the end"
    printed = command(tmp_path, "report", "x/recording.h5", "--out", "y")
    assert "Lost: no cable holds the load at the end" in printed.stdout
    page = (tmp_path / "y" / "report.html").read_text()
    assert 'class="banner lost"' in page


def test_levels_are_ordered_from_good_to_bad():
    assert verdict.LEVELS == ("pass", "warn", "fail", "lost")
