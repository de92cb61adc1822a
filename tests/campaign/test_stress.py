"""Missions under stress: the conditions, the matrix, and what is made of flights that fail."""

from __future__ import annotations

import json
import math
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

import colift
from colift.campaign import engine, stress
from colift.campaign.plan import plan
from colift.campaign.store import Store
from colift.errors import ColiftError, UnknownNameError
from colift.mission import load_mission
from colift.report.stress import matrix_tables, write_stress

SHORT = {"timing.duration": 7.0}


def flown(tmp_path, conditions, **options):
    given = {"allocators": [], "plants": [], "seeds": [0], "changes": SHORT, **options}
    planned = plan(stress.cases("real-world", conditions, **given))
    outcome = engine.run(planned, engine.Options(tmp_path / "c.sqlite", workers=1))
    return stress.verdicts(outcome.rows, {job.key: job.mission for _, job in planned})


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
    own = load_mission("real-world")
    (case,) = stress.cases("real-world", ["all, load +50 %"], [], [], [0])
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


def test_criteria_are_the_missions_or_sensible_ones():
    (own,) = stress.cases("real-world", ["calm"], [], [], [0])
    assert load_mission(own.mission, own.overrides).criteria["tracking_max_m"].max == 0.1
    (default,) = stress.cases("hover", ["calm"], [], [], [0])
    assert set(load_mission(default.mission, default.overrides).criteria) == set(
        stress.DEFAULT_CRITERIA
    )
    (broken,) = stress.cases("real-world", ["cable cut"], [], [], [0])
    assert load_mission(broken.mission, broken.overrides).criteria["lost_drones"].max == 1.0
    (other,) = stress.cases("hover", ["calm"], [], [], [0], {"criteria.tracking_max_m.max": 0.02})
    assert load_mission(other.mission, other.overrides).criteria["tracking_max_m"].max == 0.02


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
    found = flown(
        tmp_path, ["calm", "wind"], plants=["rigid-cables", "slack-cables"], seeds=[0, 1],
        changes={"timing.duration": 2.0},
    )  # fmt: skip
    cells = stress.matrix(found)
    assert list(cells) == ["calm", "wind"]
    assert all(cell.flown == 2 for row in cells.values() for cell in row.values())
    assert sum(cell.passed for row in cells.values() for cell in row.values()) == sum(
        verdict.passed for verdict in found
    )
    ((title, header, lines),) = matrix_tables(found)
    assert (title, header) == ("safe", ["condition", "rigid-cables", "slack-cables"])
    assert lines[0][1].startswith("2/2, ")
    errors = [
        verdict.row["tracking_max_m"]
        for verdict in found
        if verdict.row["condition"] == "wind" and verdict.row["plant"] == "rigid-cables"
    ]
    assert cells["wind"]["safe", "rigid-cables"].worst_m == max(errors)


def test_a_failing_flight_has_a_reason_a_replay_and_a_mission_that_flies_it_again(tmp_path):
    found = flown(
        tmp_path, ["calm"], changes={"timing.duration": 2.0, "criteria.min_angle_deg.min": 60.0}
    )
    (verdict,) = found
    assert not verdict.passed
    assert "min_angle_deg" in verdict.reason
    assert "not >= 60" in verdict.reason
    page = write_stress(found, tmp_path, command="colift stress").read_text()
    assert 'href="failing/001.html"' in page
    assert "colift-data" in (tmp_path / "failing" / "001.html").read_text()
    again = colift.run(tmp_path / "failing" / "001.toml")
    assert again.metrics["tracking_max_m"] == verdict.row["tracking_max_m"]


def test_a_lost_flight_counts_as_lost():
    row = {
        "status": "flown", "outcome": "diverged before t = 1 s", "tracking_max_m": 0.01,
        "min_angle_deg": 40.0, "min_height_m": 1.0, "condition": "wind", "allocator": "safe",
        "plant": "rigid-cables", "seed": 0, "key": "k",
    }  # fmt: skip
    mission = load_mission("hover", {"criteria": stress.DEFAULT_CRITERIA}).resolved()
    found = stress.verdicts([row], {"k": mission})
    cell = stress.matrix(found)["wind"]["safe", "rigid-cables"]
    assert (cell.passed, cell.flown, cell.worst_m) == (0, 1, math.inf)
    assert found[0].reason == "diverged before t = 1 s"
    assert matrix_tables(found) == [
        ("safe", ["condition", "rigid-cables"], [["wind", "0/1, lost"]])
    ]
    other = stress.verdicts([{**row, "allocator": "sqp"}], {"k": mission})
    assert [title for title, *_ in matrix_tables(found + other)] == ["rigid-cables"]


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-m", "colift", "stress", "--conditions", "calm;delay", *arguments]


def test_the_command_prints_json_and_is_strict_when_asked(tmp_path: Path) -> None:
    options = ["--seeds", "1", "--set", "timing.duration=1.0", "--out", str(tmp_path), "--json"]
    done = subprocess.run(command(*options), capture_output=True, text=True, check=True)
    told = json.loads(done.stdout)
    assert (told["passed"], told["flights"]) == (2, 2)
    assert Path(told["files"]["report"]).is_file()
    hard = [*options, "--strict", "--set", "criteria.min_angle_deg.min=89.0"]
    done = subprocess.run(command(*hard), capture_output=True, text=True, check=False)
    assert done.returncode == 4
    assert len(json.loads(done.stdout)["failing"]) == 2


def test_nothing_is_lost_when_it_is_killed_half_way(tmp_path: Path) -> None:
    options = ["--seeds", "6", "--workers", "1", "--out", str(tmp_path), "--json"]
    file = tmp_path / "campaign.sqlite"

    def finished() -> int:
        if not file.exists():
            return 0
        with Store(file) as store:
            return len(store.finished())

    process = subprocess.Popen(command(*options), stdout=subprocess.DEVNULL, start_new_session=True)
    deadline = time.monotonic() + 120.0
    while finished() < 3:
        assert process.poll() is None, "it ended before it could be killed"
        assert time.monotonic() < deadline
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    there = finished()
    assert there >= 3
    done = subprocess.run(command(*options), capture_output=True, text=True, check=True)
    told = json.loads(done.stdout)
    assert told["flights"] == 12
    assert told["flown"] == 12 - there
