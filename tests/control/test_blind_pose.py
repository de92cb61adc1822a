"""The pose of a rigid load from drones and cables alone: found from a wrong start, kept in flight, and told what it cannot know."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from colift.control.estimation import _pose
from colift.control.estimation.predictor import MEMORY, Predictor
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.mission.warnings import warnings_of
from colift.record import metrics
from colift.record.recording import Recording
from colift.team import Body, Team
from colift.team.geometry import Array, matrix_of
from colift.team.load import box_inertia, from_to, usual_attachments
from colift.team.plan import plan

SIZE = np.array([0.6, 0.4, 0.2])
NOISY = {
    "estimation.load_from": "cables", "sensing.kind": "noisy", "timing.delay": 0.02, "reference.period": 6.4, "timing.duration": 14.0,
    "seed": 12, **{f"timing.{layer}": 0.01 for layer in ("load_control", "allocation", "position_control", "attitude_control")},
}  # fmt: skip


def box(n: int) -> Team:
    body = Body(inertia=box_inertia(0.5, SIZE), attachments=usual_attachments(n, SIZE), size=SIZE)
    return replace(Team.uniform(n), load_mass=0.5, body=body)


def hanging(team: Team, attitude: Array, place: Array) -> dict[str, Any]:
    """What is measured of drones that hold the load in this attitude at this place."""
    assert team.body is not None
    directions, tensions = plan(team, attitude)
    ends = place + team.body.attachments @ matrix_of(attitude).T
    return {
        "measured_attitudes": np.tile([1.0, 0.0, 0.0, 0.0], (team.n, 1)),
        "measured_positions": ends - team.cable_lengths[:, None] * directions,
        "measured_specific_forces": (tensions / team.masses)[:, None] * directions,
        "received_tensions": tensions, "received_directions": directions,
    }  # fmt: skip


def settle(part: Predictor, team: Team, seen: dict[str, Any], seconds: float = 20.0) -> Any:
    memory, dt = part.memory(team), part.period
    for step in range(round(seconds / dt)):
        writes, _ = part.call(team, memory, step=step, dt=dt, **seen)
    return writes


def known(recording: Recording) -> tuple[float, float]:
    """Root mean squares of what is known wrong of the load: m, rad."""
    late = recording.time >= 6.0
    place = (recording["estimated_load"] - recording["load"])[late, 0]
    pairs = zip(recording["load_attitude"], recording["estimated_load_attitude"], strict=True)
    turned = 2.0 * np.array([np.linalg.norm(from_to(*pair)[1:]) for pair in pairs])[late]
    return float(np.sqrt(np.mean(np.sum(place**2, axis=1)))), float(np.sqrt(np.mean(turned**2)))


@pytest.mark.parametrize("n", [3, 4, 6])
def test_a_load_that_leans_is_found_from_a_start_that_is_level(n: int) -> None:
    half = math.radians(4.0)
    attitude = np.array([math.cos(half), math.sin(half), 0.0, 0.0])
    place = np.array([1.0, -2.0, 3.0])
    team = box(n)
    found = settle(Predictor(load_from="cables"), team, hanging(team, attitude, place))
    assert np.linalg.norm(found.estimated_load[0] - place) < 2e-3
    assert np.linalg.norm(from_to(attitude, found.estimated_load_attitude)[1:]) < math.radians(0.5)
    assert np.abs(found.estimated_load_rates).max() < 0.02


@pytest.mark.parametrize("n", [3, 4, 6])
def test_a_box_flies_an_eight_that_nobody_sees_it_fly(n: int) -> None:
    recording = Flight(load_mission("box-figure-eight", {**NOISY, "drones.count": n})).run()
    assert recording.outcome == "completed"
    assert 100.0 * metrics.compute(recording)["tracking_rms_m"] < 1.5
    assert metrics.compute(recording)["attitude_rms_deg"] < 2.0
    place, turn = known(recording)
    assert 1e-4 < place < 0.01  # it is not its own tracking that is used
    assert math.radians(0.1) < turn < math.radians(2.5)


def test_what_is_foretold_in_hover_is_what_it_is_known_to_in_flight() -> None:
    mission = load_mission("box-figure-eight", {**NOISY, "reference": {"kind": "hover"}})
    assert isinstance(mission.estimation, Predictor)
    foretold = mission.estimation.covariance(mission.team)
    assert np.linalg.eigvalsh(foretold).min() > 0.0
    place, turn = known(Flight(mission).run())
    assert 0.3 < place / math.sqrt(np.trace(foretold[:3, :3])) < 2.5
    assert 0.3 < turn / math.sqrt(np.trace(foretold[3:, 3:])) < 2.5


def test_a_load_whose_tracking_is_lost_is_still_known() -> None:
    lost = [{"kind": "sensor-stuck", "body": "load", "at": 7.0, "duration": 3.0}]
    changes = {**NOISY, "estimation.load_from": "sensor", "fault": lost}
    recording = Flight(load_mission("box-figure-eight", changes)).run()
    assert recording.outcome == "completed"
    assert 100.0 * metrics.compute(recording)["tracking_rms_m"] < 1.5
    off = np.linalg.norm((recording["estimated_load"] - recording["load"])[:, 0], axis=1)
    during = (recording.time > 7.5) & (recording.time < 9.9)
    assert off[during].max() < 0.02
    assert off[recording.time > 10.2].max() < 0.005  # it is tracked again


def test_a_drone_that_is_lost_leaves_a_pose_that_is_known() -> None:
    cut = {"fault": [{"kind": "cable-cut", "at": 7.0, "drone": 2}], "detection.kind": "residuals"}
    changes = {**NOISY, **cut, "drones.count": 6, "reference": {"kind": "hover"}}
    recording = Flight(load_mission("box-figure-eight", changes)).run()
    assert recording.outcome == "completed"
    end = recording.time > 12.0
    assert np.linalg.norm((recording["estimated_load"] - recording["load"])[end, 0], axis=1).max() < 0.03  # fmt: skip


def test_of_a_bar_the_turn_about_its_line_is_told_to_be_left_to_the_laws_of_motion() -> None:
    mission = load_mission("two-drones-bar", {"estimation.load_from": "cables"})
    assert any("line through the ends" in str(each) and "(1, 0, 0)" in str(each) for each in warnings_of(mission))  # fmt: skip
    other = load_mission("box-figure-eight", NOISY)
    assert not any("load_from" in str(each) for each in warnings_of(other))


def test_a_load_on_one_point_is_refused() -> None:
    one = replace(Team.uniform(1), body=Body(inertia=box_inertia(0.2, SIZE), attachments=np.array([[0.0, 0.0, 0.1]]), size=SIZE))  # fmt: skip
    assert Predictor(load_from="cables").check(one)[0][0] == "load_from"
    assert not Predictor(load_from="cables").check(box(2))


@pytest.mark.parametrize("odd", [0.0, 1e6, math.nan, math.inf])
def test_whatever_is_felt_and_wanted_the_pose_is_a_number(odd: float) -> None:
    team, part, rng = box(4), Predictor(load_from="cables"), np.random.default_rng(4)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    seen = hanging(team, level, np.zeros(3))
    memory = part.memory(team)
    for step in range(400):
        wild = step % 7 == 3
        given = dict(seen)
        if wild:
            given["measured_specific_forces"] = odd * rng.normal(size=(4, 3))
            given["received_tensions"] = np.abs(odd) * np.ones(4) if math.isfinite(odd) else seen["received_tensions"]  # fmt: skip
        writes, _ = part.call(team, memory, step=step, dt=part.period, **given)
        assert np.isfinite(writes.estimated_load).all()
        assert np.isfinite(writes.estimated_load_attitude).all()
        assert np.linalg.norm(writes.estimated_load_attitude) == pytest.approx(1.0, abs=1e-6)


def test_the_pose_stands_in_the_memory_between_the_load_and_the_drones() -> None:
    part, team = Predictor(load_from="cables"), box(3)
    assert part.memory(team).size == part.layout().size(3)
    assert MEMORY.team["pose"] == _pose.POSE.size(0)
