"""Missions under stress: the conditions, the matrix, and what is made of flights that fail."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from html import escape
from pathlib import Path

import pytest

import colift
import terminal
from colift.errors import ColiftError, MissionError, UnknownNameError
from colift.mission import load_mission
from colift.show.report.stress import COLUMNS, SHARES, matrix_tables, write_stress
from colift.study import stress
from colift.study.campaign import engine
from colift.study.campaign.plan import plan
from colift.study.campaign.store import Store

SHORT = {"timing.duration": 7.0}


def flown(tmp_path, conditions, **options):
    given = {"allocators": [], "plants": [], "seeds": [0], "changes": SHORT, **options}
    planned = plan(stress.cases("real-world", conditions, **given))
    outcome = engine.run(planned, engine.Options(tmp_path / "c.sqlite", workers=1))
    return outcome.rows, {job.key: job.mission for _, job in planned}


@pytest.mark.parametrize("condition", stress.condition_names())
def test_every_condition_is_a_valid_world_for_every_seed(condition):
    for seed in (0, 5):
        for mission in ("real-world", "hover"):
            (case,) = stress.cases(mission, [condition], [], [], [seed])
            loaded = load_mission(case.mission, case.overrides)
            assert loaded.seed == seed
            faults = loaded.fault
            assert len(faults) == (condition not in stress.WEATHER)
            assert all(fault.at == stress.FAULT_AT for fault in faults)


def test_an_unknown_condition_is_named_with_the_nearest():
    with pytest.raises(UnknownNameError, match="did you mean 'wind'"):
        stress.cases("hover", ["wimd"], [], [], [0])


def test_a_fault_happens_in_the_weather_named_behind_it():
    (case,) = stress.cases("real-world", ["cable cut in all, load +50 %"], [], [], [0])
    loaded = load_mission(case.mission, case.overrides)
    assert loaded.truth.load_mass_factor == 1.5
    assert len(loaded.disturbance) == len(stress.WIND)
    assert len(loaded.fault) == 1
    assert loaded.criteria["lost_drones"].max == 1.0
    for wrong in ("cable cut in wimd", "cabel cut in wind", "wind in wind", " in wind"):
        with pytest.raises(UnknownNameError):
            stress.cases("hover", [wrong], [], [], [0])


def test_the_worst_weather_is_the_mission_that_was_made_for_it():
    """The mission and the condition are written apart, so that either may be changed; knowingly."""
    own = load_mission("real-world-adaptive")
    (case,) = stress.cases("real-world-adaptive", ["all, load +50 %"], [], [], [0])
    theirs = load_mission(case.mission, case.overrides)
    assert theirs.resolved() == own.resolved()


def test_a_star_is_every_fault():
    found = stress.expand("wind; * in all, load +50 %;cable cut")
    assert found[0] == "wind"
    assert found[-1] == "cable cut"
    assert found[1:-1] == [f"{fault} in all, load +50 %" for fault in stress.FAULTS]


def test_a_condition_replaces_the_whole_world():
    (case,) = stress.cases("real-world", ["calm"], [], [], [0])
    loaded = load_mission(case.mission, case.overrides)
    assert loaded.disturbance == []
    assert loaded.truth.load_mass_factor == 1.0
    assert loaded.kinds["sensing"] == "ideal"


def test_criteria_are_the_missions_and_the_defaults_of_every_verdict():
    (own,) = stress.cases("real-world", ["calm"], [], [], [0])
    assert own.load().criteria == load_mission("real-world").criteria
    (default,) = stress.cases("hover", ["calm"], [], [], [0])
    assert default.load().criteria == {}
    (broken,) = stress.cases("real-world", ["cable cut"], [], [], [0])
    assert broken.load().criteria["lost_drones"].max == 1.0
    for name, bound in own.load().criteria.items():
        assert name == "lost_drones" or broken.load().criteria[name] == bound
    (other,) = stress.cases("hover", ["calm"], [], [], [0], {"criteria.tracking_max_m.max": 0.02})
    assert other.load().criteria["tracking_max_m"].max == 0.02


LAYERS_WITH_LAG = ("estimation", "load_control", "position_control", "attitude_control")


def test_motors_fly_in_every_condition_and_their_lag_is_told():
    for condition in stress.condition_names():
        (case,) = stress.cases("real-world-adaptive", [condition], [], [], [0])
        loaded = case.load()
        assert loaded.kinds["actuation"] == "motors"
        for layer in LAYERS_WITH_LAG:
            assert getattr(loaded, layer).lag == loaded.actuation.time_constant == 0.02
        drags = [part.rotor_drag for part in loaded.disturbance if hasattr(part, "rotor_drag")]
        assert drags == [0.02] * (condition == "wind" or condition.startswith("all,"))


def test_a_mission_on_ideal_rotors_gets_motors_and_one_with_motors_keeps_its_own():
    ideal = load_mission(
        "real-world-adaptive", {"actuation": {}, "load_control.lag": 0.01}
    ).resolved()
    for layer in set(LAYERS_WITH_LAG) - {"load_control"}:
        ideal[layer]["lag"] = 0.0
    found = load_mission(ideal, stress.motors(load_mission(ideal)))
    assert found.kinds["actuation"] == "motors"
    told = [getattr(found, layer).lag for layer in LAYERS_WITH_LAG]
    assert told == [0.02, 0.01, 0.02, 0.02]  # what the mission says of a lag stays
    # Controllers that ask for no lag are told of none.
    assert stress.motors(load_mission("hover")) == {"actuation": {"kind": "motors"}}
    own = load_mission("hover", {"actuation": {"kind": "motors", "max_thrust": 4.0}})
    assert stress.motors(own) == {}


def test_a_weak_motor_on_ideal_rotors_is_refused_before_anything_is_flown():
    changes = {"actuation.kind": "ideal"}
    cases = stress.cases("real-world", ["calm", "one motor dead"], [], [], [0], changes)
    with pytest.raises(MissionError) as caught:
        plan(cases)
    (problem,) = caught.value.problems
    assert problem.path.endswith("fault.0.kind")
    assert 'actuation.kind = "ideal"' in problem.message


def test_what_is_set_is_what_is_flown_and_what_the_table_says():
    """A condition has its own world and kinds; all that is set comes after."""
    changes = {"actuation.kind": "motors", "plant.kind": "mujoco", "drones.count": 3}
    for case in stress.cases("real-world", ["calm", "cable cut"], [], [], [4], changes):
        loaded = case.load()
        assert loaded.kinds["actuation"] == "motors"
        assert (loaded.kinds["plant"], case.labels["plant"]) == ("mujoco", "mujoco")
        assert all(fault.drone == 1 for fault in loaded.fault)  # 4 modulo 3
    with pytest.raises(ColiftError, match="--plants varies"):
        stress.cases("real-world", ["calm"], [], ["slack-cables"], [0], changes)
    with pytest.raises(ColiftError, match="--first-seed"):
        stress.cases("real-world", ["calm"], [], [], [0], {"seed": 3})


def test_the_matrix_counts_every_flight(tmp_path):
    rows, _ = flown(
        tmp_path, ["calm", "wind"], plants=["rigid-cables", "slack-cables"], seeds=[0, 1],
        changes={"timing.duration": 2.0},
    )  # fmt: skip
    cells = stress.matrix(rows)
    assert list(cells) == ["calm", "wind"]
    assert all(cell.flown == 2 for row in cells.values() for cell in row.values())
    assert {row["level"] for row in rows} <= {"pass", "warn"}
    assert all(cell.passed == 2 for row in cells.values() for cell in row.values())
    places = [("safe", "rigid-cables"), ("safe", "slack-cables")]
    shared, *each = matrix_tables(rows)
    assert shared[:2] == (SHARES, ["condition", "safe rigid-cables", "safe slack-cables"])
    assert shared[2] == [[name, "2/2 (15-100 %)", "2/2 (15-100 %)"] for name in ("calm", "wind")]
    for (title, header, lines), place in zip(each, places, strict=True):
        assert title == ", ".join(place)
        assert header == COLUMNS
        mine = [
            r for r in rows if r["condition"] == "wind" and (r["allocator"], r["plant"]) == place
        ]
        assert cells["wind"][place].worst_m == max(r["tracking_max_m"] for r in mine)
        assert cells["wind"][place].least_deg == min(r["min_angle_deg"] for r in mine)
        assert lines[1][1:3] == ["2/2 (15-100 %)", "0"]


def test_a_failing_flight_has_a_reason_a_replay_and_a_mission_that_flies_it_again(tmp_path):
    rows, missions = flown(
        tmp_path, ["calm"], changes={"timing.duration": 2.0, "criteria.min_angle_deg.min": 60.0}
    )
    (row,) = rows
    assert row["level"] == "fail"
    assert stress.reason(row).startswith("min_angle_deg is ")
    assert "not >= 60" in stress.reason(row)
    page = write_stress(rows, missions, tmp_path, command="colift stress").read_text()
    assert 'href="failing/001.html"' in page
    assert escape(stress.reason(row)) in page
    assert "colift-data" in (tmp_path / "failing" / "001.html").read_text()
    again = colift.run(tmp_path / "failing" / "001.toml")
    assert again.metrics["tracking_max_m"] == row["tracking_max_m"]
    assert (again.verdict.level, "; ".join(again.verdict.reasons)) == (row["level"], row["reasons"])


def test_cells_tell_lost_missed_and_held_apart():
    """Numbers of a flight that was lost say nothing; its loss is counted."""

    def row(level, **numbers):
        usual = {"tracking_max_m": 0.05, "min_angle_deg": 40.0, "slack_time_s": 0.25}
        status = "flown" if level else "failed"
        return {
            "condition": "wind", "allocator": "safe", "plant": "slack-cables", "key": "k",
            "status": status, "level": level, "reasons": "far", "error": "" if level else "no",
            **(usual | numbers if level else {}),
        }  # fmt: skip

    rows = [
        row("pass"),
        row("warn", slack_time_s=0.5),
        row("fail", tracking_max_m=0.2),
        row("lost", tracking_max_m=118.0, min_angle_deg=0.003, slack_time_s=20.0),
        row(""),
    ]
    cell = stress.matrix(rows)["wind"]["safe", "slack-cables"]
    assert cell == stress.Cell(2, 2, 5, worst_m=0.2, least_deg=40.0, slack_s=0.5)
    assert [stress.reason(each) for each in rows] == ["", "", "far", "far", "no"]
    ((title, _, lines),) = matrix_tables(rows)
    assert title == "safe, slack-cables"
    assert lines == [["wind", "2/5 (5-86 %)", "2", "20.0", "40", "0.50"]]
    boxes = [
        row("pass", attitude_max_deg=1.25),
        row("fail", attitude_max_deg=7.0),
        row("lost", attitude_max_deg=90.0),
    ]
    ((_, header, lines),) = matrix_tables(boxes)
    assert (header[-1], lines[0][-1]) == ("attitude (deg)", "7.0")
    (nothing,) = matrix_tables(rows[3:])[0][2]
    assert nothing == ["wind", "0/2 (0-85 %)", "2", "-", "-", "-"]


STRESS = ("stress", "--conditions", "calm;delay")


def test_the_command_prints_json_and_is_strict_when_asked(tmp_path: Path) -> None:
    options = ["--seeds", "1", "--set", "timing.duration=1.0", "--out", str(tmp_path), "--json"]
    told = json.loads(terminal.colift(*STRESS, *options, check=True).stdout)
    assert (told["passed"], told["flights"]) == (2, 2)
    assert Path(told["files"]["report"]).is_file()
    hard = [*options, "--workers", "1", "--strict", "--set", "criteria.min_angle_deg.min=89.0"]
    done = terminal.colift(*STRESS, *hard)
    assert done.returncode == 4
    told = json.loads(done.stdout)
    assert [each["level"] for each in told["failing"]] == ["fail", "fail"]
    assert told["conditions"]["calm"][0]["interval"] == pytest.approx([0.0, 0.975])
    lax = [word for word in hard if word != "--strict"]
    assert terminal.colift(*STRESS, *lax).returncode == 0


def test_seeds_begin_where_they_are_told_to(tmp_path: Path) -> None:
    options = [
        "--seeds",
        "2",
        "--first-seed",
        "1000",
        "--workers",
        "1",
        "--set",
        "timing.duration=0.1",
    ]
    done = terminal.colift(*STRESS, *options, "--out", str(tmp_path), "--json", check=True)
    assert json.loads(done.stdout)["seeds"] == [1000, 1001]
    with Store(tmp_path / "campaign.sqlite") as store:
        assert {row["seed"] for row in store.rows()} == {1000, 1001}


@pytest.mark.slow
def test_nothing_is_lost_when_it_is_killed_half_way(tmp_path: Path) -> None:
    options = ["--seeds", "6", "--workers", "1", "--out", str(tmp_path), "--json"]
    file = tmp_path / "campaign.sqlite"

    def finished() -> int:
        if not file.exists():
            return 0
        with Store(file) as store:
            return len(store.finished())

    process = subprocess.Popen(
        [sys.executable, "-m", "colift", *STRESS, *options], stdout=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip
    deadline = time.monotonic() + 120.0
    while finished() < 3:
        assert process.poll() is None, "it ended before it could be killed"
        assert time.monotonic() < deadline
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    there = finished()
    assert there >= 3
    told = json.loads(terminal.colift(*STRESS, *options, check=True).stdout)
    assert told["flights"] == 12
    assert told["flown"] == 12 - there
