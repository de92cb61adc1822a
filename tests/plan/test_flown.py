"""Plans that are flown: the reference tells them exactly, the allocator keeps to them, the plant follows."""

from __future__ import annotations

import numpy as np
import pytest

from colift.control.reference.plan import Plan
from colift.errors import MissionError, SettingError
from colift.flight.flight import Flight
from colift.mission.load import load_mission
from colift.plan import planner
from colift.plan.mission import mission_of, write
from colift.team import Team
from terminal import colift


@pytest.fixture(scope="module")
def mission(found):
    return mission_of(found)


def reference_of(table, **more):
    return Plan(**{k: v for k, v in table["reference"].items() if k != "kind"} | more)


def test_the_reference_tells_the_plan_with_exact_derivatives(found, mission):
    rows, team = found.sample(200), load_mission(mission).team
    reference = reference_of(mission, hold=0.0)
    units = np.array([1.0, 10.0, 100.0, 1000.0])
    for k, time in enumerate(rows["time"]):
        told, _ = reference.call(team, np.zeros(0), time=float(time))
        close = {"rtol": 0.0, "atol": 1e-8}
        np.testing.assert_allclose(
            told.reference / units[:, None], rows["load"][k, :4] / units[:, None], **close
        )
        np.testing.assert_allclose(
            told.nominal_forces / units[:3, None], -rows["forces"][k] / units[:3, None], **close
        )


def test_it_rests_before_and_after(found, mission):
    reference = reference_of(mission, hold=0.5)
    x = reference.sample(np.array([0.0, 0.5, 0.5 + found.duration, 99.0]), Team.uniform(3))
    np.testing.assert_allclose(x[:, 0], [found.scene.start] * 2 + [found.scene.goal] * 2, atol=1e-9)
    np.testing.assert_allclose(x[:, 1:], 0.0, atol=1e-6)


def test_a_team_of_others_is_led_along_the_path_without_pulls(mission):
    told, _ = reference_of(mission).call(Team.uniform(2), np.zeros(0), time=1.5)
    assert np.isnan(told.nominal_forces).all()
    assert np.isfinite(told.reference).all()


def test_a_file_is_read_and_kept_with_the_mission(found, mission, tmp_path):
    planner.save(found, tmp_path / "plan.npz")
    (tmp_path / "of.toml").write_text(
        'name = "m"\n[world]\nground = "none"\n[drones]\ncount = 3\n[reference]\nkind = "plan"\nfile = "plan.npz"\n'
    )
    kept = load_mission(tmp_path / "of.toml").resolved()["reference"]
    assert "file" not in kept
    assert kept["duration"] == found.duration
    np.testing.assert_allclose(kept["pull_points"], mission["reference"]["pull_points"], atol=1e-11)


@pytest.mark.parametrize("content", [None, b"no plan", b""])
def test_a_file_that_holds_no_plan_is_refused_by_name(content, tmp_path):
    file = tmp_path / "none.npz"
    if content is not None:
        file.write_bytes(content)
    with pytest.raises(SettingError, match=r"none\.npz.*cannot be read as a plan"):
        Plan(file=str(file))


@pytest.mark.parametrize(
    ("field", "value", "why"),
    [
        ("pull_points", [[[0.0, 0.0, 0.0]] * 3] * 7, "two fewer"),
        ("pull_points", [[[0.1, 0.0, 0.0]] * 3] * 25, "add up to nothing"),
        ("pull_points", [[[0.0, 0.0, 0.0]] * (2 + k % 2) for k in range(25)], "one vector a drone"),
        ("load_points", [[0.0, 0.0, 0.0]] * 7, "load_points"),
        ("duration", 0.0, "duration"),
    ],
)
def test_what_is_no_plan_is_refused(mission, field, value, why):
    with pytest.raises(SettingError, match=why):
        reference_of(mission, **{field: value})


def test_a_plan_for_others_is_refused_and_another_start_is_told(mission):
    drones = mission["drones"] | {"count": 4, "cable_length": 0.5}
    with pytest.raises(MissionError, match="plan 3 cables, but there are 4 drones"):
        load_mission(mission | {"drones": drones, "start": {}})
    found = load_mission(mission | {"start": {}})
    assert "start.directions" in " ".join(text for _, text in found.reference.warnings(found))
    as_planned = load_mission(mission)
    assert not list(as_planned.reference.warnings(as_planned))


def test_its_mission_lets_drones_lean_as_far_as_it_does(found, mission):
    thrusts = found.sample(400)["thrusts"]
    tilt = np.degrees(np.arccos(thrusts[..., 2] / np.linalg.norm(thrusts, axis=2))).max()
    assert tilt < load_mission(mission).position_control.max_tilt_deg


def flown(mission, changes):
    """Largest errors of the load and of the drones, m."""
    flight = Flight(load_mission(mission, changes))
    record, team = flight.run(), flight.mission.team
    assert record.time[-1] == pytest.approx(flight.mission.timing.duration)
    load, drones = [], []
    for k, time in enumerate(record.time):
        told, _ = flight.mission.reference.call(team, np.zeros(0), time=float(time))
        pulls = told.nominal_forces[:, 0]
        u = pulls / np.linalg.norm(pulls, axis=1, keepdims=True)
        x = told.reference[0] - team.cable_lengths[:, None] * u
        load.append(np.linalg.norm(record["load"][k, 0] - told.reference[0]))
        drones.append(np.linalg.norm(record["positions"][k] - x, axis=1).max())
    return max(load), max(drones)


def test_the_plan_is_flown_within_half_a_centimetre_where_motors_do_not_lag(mission):
    load, drones = flown(mission, {"actuation.kind": "ideal"})
    assert load < 0.005
    assert drones < 0.005


def test_lag_of_the_motors_leaves_it_by_little_more_than_a_centimetre(mission):
    assert max(flown(mission, {})) < 0.012


def test_two_commands_plan_and_fly(found, tmp_path):
    write(found, tmp_path / "flight.toml")
    done = colift(
        "run",
        str(tmp_path / "flight.toml"),
        "--no-report",
        "--json",
        "--out",
        str(tmp_path / "out"),
    )
    assert done.returncode == 0, done.stderr
