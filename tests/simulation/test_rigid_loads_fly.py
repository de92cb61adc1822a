"""A rigid load with an attitude: what is wanted, who flies it, what is refused."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from colift.control.reference.figure_eight import FigureEight
from colift.control.reference.waypoints import Waypoints
from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.mission.mission import Mission
from colift.mission.planned import Planned, planned
from colift.mission.warnings import warnings_of
from colift.record import metrics
from colift.record.verdict import criteria_of
from colift.team import Body, Team
from colift.team.geometry import matrix_of
from colift.team.plan import hung, shares

BOX: dict[str, Any] = {
    "name": "box",
    "load": {"kind": "rigid", "mass": 0.5, "size": [0.6, 0.4, 0.2]},
    "reference": {"kind": "hover", "position": [0.0, 0.0, 1.5]},
    "timing": {"duration": 2.0},
}


TURNING = {
    "figure-eight": FigureEight(roll_deg=20.0, pitch_deg=-15.0, yaw_deg=70.0, ramp=2.0, period=3.0),
    "leaning": FigureEight(lean=0.8, ramp=5.0, period=4.5),
    "waypoints": Waypoints(
        points=[(0.0, 0.0, 1.0)] * 3,
        attitudes_deg=[(0.0, 0.0, 0.0), (30.0, -20.0, 200.0), (-10.0, 25.0, 360.0)],
        travel=2.0,
        hold=0.5,
    ),
}


@pytest.mark.parametrize("name", TURNING)
def test_rates_are_the_derivatives_of_the_wanted_attitude(name: str) -> None:
    reference, team, h, fastest = TURNING[name], Team.uniform(3), 1e-4, 0.0
    for t in (0.7, 1.9, 4.2):
        turn = [matrix_of(reference.pose(team, t + k * h)[1]) for k in (-1, 0, 1)]
        slope = turn[1].T @ (turn[2] - turn[0]) / (2.0 * h)
        rates = [reference.pose(team, t + k * h)[2] for k in (-1, 0, 1)]
        spin = np.array([slope[2, 1], slope[0, 2], slope[1, 0]])
        assert rates[1][0] == pytest.approx(spin, abs=1e-5)
        assert (rates[2][:2] - rates[0][:2]) / (2.0 * h) == pytest.approx(rates[1][1:], abs=1e-4)
        fastest = max(fastest, np.abs(rates[1]).max())
    assert fastest > 1.0


@pytest.mark.parametrize("name", TURNING)
def test_an_upright_reference_keeps_its_heading_at_rest_and_nothing_else(name: str) -> None:
    upright, team = TURNING[name].upright(), Team.uniform(3)
    for t in (0.0, 1.3, 2.6, 4.0, 5.2):
        motion, attitude, rates = upright.pose(team, t)
        assert attitude[1:3] == pytest.approx([0.0, 0.0], abs=1e-15)
        assert rates[:, :2] == pytest.approx(np.zeros((3, 2)), abs=1e-12)
        np.testing.assert_array_equal(motion, TURNING[name].pose(team, t)[0])


def test_a_load_that_leans_points_along_the_force() -> None:
    eight, team = FigureEight(lean=1.0, ramp=2.0, period=5.0), Team.uniform(3)
    for t in (2.0, 3.3, 4.9):
        motion, attitude, _ = eight.pose(team, t)
        force = motion[2] + [0.0, 0.0, team.gravity]
        upward = matrix_of(attitude)[:, 2]
        assert upward == pytest.approx(force / np.linalg.norm(force), abs=1e-12)
    assert eight.pose(team, 0.0)[1] == pytest.approx([1.0, 0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match=r"lean = 0\.5 says the attitude"):
        FigureEight(lean=0.5, yaw_deg=10.0)


def test_each_waypoint_is_reached_with_its_attitude_at_rest_and_without_a_jump() -> None:
    reference, team = TURNING["waypoints"], Team.uniform(3)
    for k, (roll, pitch, yaw) in enumerate(reference.attitudes_deg):
        for t in (2.5 * k + 0.01, 2.5 * k + 0.49):
            _, attitude, rates = reference.pose(team, t)
            cr, cp, cy = np.cos(np.radians([roll, pitch, yaw]))
            sr, sp, _ = np.sin(np.radians([roll, pitch, yaw]))
            R = matrix_of(attitude)
            assert R[2] == pytest.approx([-sp, cp * sr, cp * cr], abs=1e-9)
            assert R[0, 0] == pytest.approx(cy * cp, abs=1e-9)
            assert np.abs(rates).max() < 1e-9
    for step in (1e-3, 1e-4):
        for corner in (0.5, 2.5, 3.0):
            poses = [reference.pose(team, corner + k * step) for k in range(-20, 21)]
            rows = np.array([[*attitude, *rates.ravel()] for _, attitude, rates in poses])
            assert np.abs(np.diff(rows, axis=0)).max() < 1e3 * step


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            {"attitudes_deg": [[0.0, 0.0, 9.0]]},
            "attitudes_deg has 1 attitudes, and must have none or one for each of the 2 points",
        ),
        ({"attitudes_deg": [[0.0, 70.0, 0.0]] * 2}, r"attitudes_deg.*60 \(found 70"),
        ({"attitudes_deg": [[0.0, 9.0]] * 2}, "attitudes_deg"),
    ],
)
def test_attitudes_of_waypoints_that_cannot_be_meant_are_refused(
    change: dict[str, Any], says: str
) -> None:
    with pytest.raises(MissionError, match=says):
        load_mission({**BOX, "reference": {"kind": "waypoints", **change}})


def test_a_tilted_box_with_its_centre_of_mass_aside_hovers() -> None:
    """Force and moment balance where nothing is symmetric; what is wrong with the told inertia costs nothing at rest."""
    load = {**BOX["load"], "centre_of_mass": [0.05, -0.03, 0.02]}
    reference = {**BOX["reference"], "attitude_deg": [8.0, -5.0, 30.0]}
    truth = {"load_inertia_factor": 1.3}
    mission = load_mission({**BOX, "load": load, "reference": reference, "truth": truth})
    recording = Flight(mission).run()
    found = metrics.compute(recording)
    assert found["tracking_max_m"] < 1e-3
    assert found["attitude_max_deg"] < 0.3
    assert found["slack_time_s"] == 0.0


def test_a_push_of_the_centre_of_mass_that_nobody_told_is_integrated_away() -> None:
    offset = {"centre_of_mass_offset": [0.02, 0.01, 0.0]}
    recording = Flight(load_mission({**BOX, "truth": offset, "timing": {"duration": 12.0}})).run()
    error = np.degrees(np.linalg.norm(metrics.attitude_error(recording), axis=1))
    late = error[recording.time > 11.0].max()
    assert error.max() > 0.5
    assert late < 0.3 * error.max()


def test_noise_delay_and_wrong_attachments() -> None:
    periods = ("load_control", "allocation", "position_control", "attitude_control")
    timing = {"duration": 10.0, "delay": 0.02, **dict.fromkeys(periods, 0.01)}
    mission = load_mission(
        "box-figure-eight",
        {
            **{f"timing.{name}": value for name, value in timing.items()},
            "sensing.kind": "noisy",
            "truth.attachment_offset": [[0.01, 0, 0], [0, -0.01, 0], [-0.01, 0, 0], [0, 0, 0.01]],
        },
    )
    found = metrics.compute(Flight(mission).run())
    assert found["tracking_max_m"] < 0.08
    assert found["attitude_max_deg"] < 8.0
    assert found["slack_time_s"] == 0.0


def test_the_angle_between_two_attitudes_and_its_part_about_the_vertical() -> None:
    recording = Flight(load_mission(BOX)).run()
    half = math.radians(10.0)
    recording["load_attitude"][:] = [math.cos(half), 0.0, 0.0, -math.sin(half)]
    recording["reference_attitude"][:] = [1.0, 0.0, 0.0, 0.0]
    found = metrics.compute(recording)
    for name in ("attitude_rms_deg", "attitude_max_deg", "yaw_max_deg"):
        assert found[name] == pytest.approx(20.0)
    point = metrics.compute(Flight(load_mission("hover", {"timing.duration": 0.5})).run())
    names = ("attitude_rms_deg", "attitude_max_deg", "yaw_max_deg", "max_missing_moment_Nm")
    assert all(math.isnan(point[name]) for name in names)


def test_the_moment_that_an_allocator_leaves_out_is_recorded() -> None:
    """A bar on two cables, whose centre of mass does not hang below the line through their ends."""
    load = {**BOX["load"], "centre_of_mass": [0.0, 0.01, 0.0]}
    flight = {**BOX, "load": load, "drones": {"count": 2}, "timing": {"duration": 0.2}}
    recording = Flight(load_mission(flight)).run()
    known = recording["allocator_moment_residual"]
    ends = recording.mission.team.levers  # level at first
    pulls = (recording["desired_tensions"][..., None] * recording["desired_directions"])[1]
    left = np.cross(ends, pulls).sum(axis=0) + recording["moment"][1]
    assert known[1] == pytest.approx(np.linalg.norm(left), rel=0.05)
    assert metrics.compute(recording)["max_missing_moment_Nm"] == known.max() > 0.01


@pytest.mark.parametrize(("n", "period"), [(3, 6.4), (4, 5.4), (6, 6.4)])
def test_at_100_Hz_no_error_follows_what_the_load_is_wanted_to_do(n: int, period: float) -> None:
    """What is held for a period acts as late as it was led, and is observed as late: whatever is half a period off shows as an error in proportion to the motion."""
    layers = ("load_control", "allocation", "position_control", "attitude_control")
    slow = {f"timing.{name}": 0.01 for name in layers}
    slow |= {"drones.count": n, "reference.period": period, "seed": 3}
    recording = Flight(load_mission("box-figure-eight", slow)).run()
    when = recording.time >= 6.0
    errors, wanted = metrics.tracking_error(recording)[when], recording["reference"][when]
    assert float(np.sqrt(np.mean(np.sum(errors**2, axis=1)))) < 0.002
    for k in range(2):
        slopes, *_ = np.linalg.lstsq(wanted[:, 1:, k], errors[:, k], rcond=None)
        assert abs(slopes[1]) < 0.0005  # m per m/s^2
    late = {**slow, "sensing.kind": "noisy", "timing.delay": 0.02}
    recording = Flight(load_mission("box-figure-eight", late)).run()
    errors = metrics.tracking_error(recording)[recording.time >= 6.0]
    assert float(np.sqrt(np.mean(np.sum(errors**2, axis=1)))) < 0.0035


def test_how_often_the_allocator_answers_is_all_but_the_same_to_a_load() -> None:
    """What passes to the drones without a filter is free of the steps of answers that are held."""
    errors = []
    for period in (0.001, 0.002, 0.005):
        timing = {"timing.allocation": period, "timing.duration": 6.0}
        found = metrics.compute(Flight(load_mission("box-figure-eight", timing)).run())
        errors.append(found["tracking_max_m"])
    assert max(errors) < 1.1 * min(errors) < 0.02


def planned_by(mission: Mission, times: np.ndarray) -> Planned:
    """What is planned of a mission's first team."""
    hover = shares(mission.team, *mission.allocation.formation(mission.team))
    poses = [mission.reference.pose(mission.team, float(time)) for time in times]
    found = planned(mission.team, mission.position_control, times, poses, [hover] * len(times))
    assert found is not None
    return found


def test_a_motion_that_asks_too_much_is_refused_with_drone_moment_and_numbers() -> None:
    with pytest.raises(MissionError, match=r"asks drone 2 at 3\.\d* s to turn its thrust with 6\d"):
        load_mission("box-figure-eight", {"drones.count": 3, "reference.ramp": 3.0})


def test_in_hover_the_plan_holds_the_weight_and_turns_nobody() -> None:
    mission = load_mission(BOX)
    times = np.linspace(0.0, 1.0, 20)
    found = planned_by(mission, times)
    assert np.all(found.tensions.sum(axis=1) > 0.5 * 9.81)
    assert np.nanmax(found.turning) < 1e-9


def test_position_control_leads_the_cables_as_was_planned_before_the_flight() -> None:
    mission = load_mission("box-figure-eight")
    flight = Flight(mission)
    flight.advance(6.5)
    state = flight.wires.position_control.memory[-9 * 4 :].reshape(4, 3, 3)
    times = flight.time + 1e-3 * np.arange(-3, 1)  # the last step began a millisecond ago
    before = planned_by(mission, times)
    assert np.linalg.norm(state[:, 0], axis=1) == pytest.approx(before.tensions[2], rel=1e-6)


def test_a_new_reference_that_asks_for_no_attitude_gets_none() -> None:
    stay = {"kind": "hover", "position": [0.0, 0.0, 1.5]}
    event = {"at": 6.5, "field": "reference", "value": stay}
    flight = Flight(load_mission("box-figure-eight", {"events": [event]}))
    flight.advance(6.49)
    assert np.abs(flight.bus.reference_rates[0]).max() > 0.1
    flight.advance(0.02)
    assert flight.bus.reference_attitude.tolist() == [1.0, 0.0, 0.0, 0.0]
    assert not flight.bus.reference_rates.any()


def test_drones_whose_cables_end_apart_do_not_touch_at_the_start() -> None:
    """On a point, four cables that lean by 30 degrees would bring drones of this size together; on the box's corners they are apart."""
    drones = {"count": 4, "vehicle": "s500", "cable_length": 0.8}
    assert load_mission({**BOX, "drones": drones, "allocation": {"min_distance": 0.8}})
    small = {**BOX["load"], "size": [0.02, 0.02, 0.02]}
    with pytest.raises(MissionError, match=r"must leave the drones .* apart"):
        load_mission({**BOX, "load": small, "drones": {**drones, "radius": 0.8}})


def test_a_box_that_loses_a_corner_goes_on_leaning_so_that_the_corner_sinks() -> None:
    event = {"at": 1.0, "field": "drones.lose", "value": 1}
    mission = load_mission({**BOX, "events": [event], "timing": {"duration": 8.0}})
    flight = Flight(mission)
    recording = flight.run()
    assert recording.outcome == "completed"
    assert math.degrees(flight.membership.outlook.lean) == pytest.approx(10.0)
    corner = matrix_of(recording["load_attitude"][-1]) @ [-0.3, 0.2, 0.1]
    assert corner[2] < 0.1 - 0.3 * math.sin(math.radians(8.0))  # the second one
    found = metrics.compute(recording)
    assert found["tracking_max_m"] < 0.1
    assert found["attitude_max_deg"] < 10.0
    told = [(moment.time, moment.text) for moment in recording.moments if moment.kind == "change"]
    assert told == [(1.0, f"The load {flight.membership.outlook}")]
    assert "leaning by 10 degrees" in told[0][1]


def test_a_team_that_is_put_together_anew_in_full_motion_flies_on_as_if_nothing_were() -> None:
    """Cables that are led turn as they did: the plan's derivatives are known only after some cycles, and are no correction."""
    flight = Flight(load_mission("box-figure-eight", {"timing.duration": 10.0}))
    flight.advance(6.5)
    flight.regroup(flight.drones)
    flight.advance(3.5)
    recording = flight.recording(since=6.5)
    assert np.degrees(np.linalg.norm(metrics.attitude_error(recording), axis=1)).max() < 0.5
    assert np.linalg.norm(metrics.tracking_error(recording), axis=1).max() < 0.005


def test_a_reference_that_asks_too_much_of_fewer_drones_slows_down() -> None:
    event = {"at": 4.0, "field": "drones.lose", "value": 1}
    change = {"drones.count": 6, "reference.period": 7.6, "events": [event], "timing.duration": 9.0}
    flight = Flight(load_mission("box-figure-eight", change))
    recording = flight.run()
    pace = flight.membership.outlook.pace
    assert 0.2 <= pace < 1.0
    rate = recording["clock"][:, 1]
    assert rate[recording.time < 4.0] == pytest.approx(1.0)
    assert rate[recording.time > 5.1] == pytest.approx(pace)
    slope = np.gradient(recording["reference"], recording.time, axis=0)
    calm = np.abs(recording.time - 4.0) > 0.05
    for order in range(2):  # velocity and acceleration are those of the way that is flown
        off = slope[:, order] - recording["reference"][:, order + 1]
        assert np.abs(off[calm][2:-2]).max() < 0.02
    assert "at " + f"{pace:.0%} of the pace" in str(flight.membership.outlook)


def test_two_cables_do_not_hold_a_box_and_it_comes_down() -> None:
    events = [{"at": 1.0 + i, "field": "drones.lose", "value": i} for i in range(2)]
    recording = Flight(load_mission({**BOX, "events": events})).run()
    assert recording.outcome.startswith("descended from t = 2 s: 2 cables do not hold the attitude")


@pytest.mark.parametrize("drone", [0, 1, 2])
def test_a_box_that_falls_into_two_cables_comes_to_rest_below_them_before_it_goes_down(
    drone: int,
) -> None:
    layers = ("load_control", "allocation", "position_control", "attitude_control")
    changes: dict[str, Any] = {
        "drones.count": 3, "reference.period": 6.4, "sensing.kind": "noisy", "timing.delay": 0.02, "timing.duration": 24.0, "seed": 6,
        "fault": [{"kind": "cable-cut", "at": 7.0, "drone": drone}], "detection.kind": "residuals",
        **{f"timing.{name}": 0.01 for name in layers},
    }  # fmt: skip
    recording = Flight(load_mission("box-figure-eight", changes)).run()
    assert recording.outcome.startswith("descended")
    rest = [other for other in range(3) if other != drone]
    ends = recording.mission.team.body.attachments[rest]
    turned = np.array([matrix_of(q) for q in recording["load_attitude"]])
    line = turned @ (ends[1] - ends[0])
    foot = turned @ (
        ends[0]
        - (ends[1] - ends[0]) * (ends[0] @ (ends[1] - ends[0])) / np.sum((ends[1] - ends[0]) ** 2)
    )
    hangs = np.degrees(np.arccos(foot[:, 2] / np.linalg.norm(foot, axis=1)))
    level = np.degrees(np.arcsin(np.abs(line[:, 2]) / np.linalg.norm(line, axis=1)))
    after = recording.time > 7.3
    assert hangs[after].max() > 30.0  # it did fall
    before = (recording.time > 12.5) & (recording.time < 13.5)
    assert hangs[before].max() < 20.0
    assert level[before].max() < 5.0
    assert recording["load"][before, 0, 2].min() > 1.0
    apart = np.linalg.norm(np.diff(recording["positions"][:, rest], axis=1), axis=2)
    assert apart[after].min() > 0.6
    found = metrics.compute(recording)
    assert found["touch_speed_mps"] < 1.0
    assert abs(recording["load"][-1, 1]).max() < 0.1  # it lies


def test_what_hangs_on_two_cables_has_its_weight_below_the_line_through_their_ends() -> None:
    rng = np.random.default_rng(5)
    for _ in range(50):
        ends, centre = rng.normal(size=(2, 3)), rng.normal(size=3)
        body = Body(inertia=np.diag([0.02, 0.03, 0.04]), attachments=ends, centre=centre)
        team = replace(Team.uniform(2), body=body)
        turned = body.arms @ matrix_of(hung(team)).T
        line = turned[1] - turned[0]
        foot = turned[0] - line * (turned[0] @ line) / (line @ line)
        assert abs(line[2]) < 1e-12
        np.testing.assert_allclose(foot[:2], 0.0, atol=1e-12)
        assert foot[2] > 0.0
        across = body.arms[1] - body.arms[0]
        assert line[0] * across[1] == pytest.approx(line[1] * across[0])  # its heading stays
    assert hung(
        replace(Team.uniform(2), body=Body(np.eye(3), np.array([[0.1, 0, 0], [-0.1, 0, 0]])))
    ).tolist() == [1, 0, 0, 0]


def test_an_attitude_that_nobody_can_hold_is_warned_of_and_judged() -> None:
    bar = {"kind": "rigid", "mass": 0.5, "size": [1.2, 0.1, 0.1]}
    mission = load_mission({**BOX, "load": bar, "drones": {"count": 2}})
    assert any("swings freely" in str(each) for each in warnings_of(mission))
    assert criteria_of(mission)["attitude_max_deg"].max == 20.0
    assert "attitude_max_deg" not in criteria_of(load_mission("hover"))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"allocation": {"kind": "safe"}}, "shares forces only"),
        ({"load_control": {"kind": "pid"}}, "wants no moment"),
        ({"load": {"kind": "rigid", "mass": 0.5}}, r"load\.size.*required"),
        ({"load": {"mass": 0.5, "size": [1.0, 1.0, 1.0]}}, "is of a rigid load"),
        ({"load": {"kind": "rigid", "size": [1.0, 0.0, 0.0]}}, r"load\.inertia.*without width"),
        ({"load": {**BOX["load"], "inertia": [1.0, 1.0, 3.0]}}, "none exceeds the sum"),
        ({"load": {**BOX["load"], "attachments": [[0.0, 0.0, 0.0]] * 3}}, "attachments"),
    ],
)
def test_what_a_rigid_load_cannot_fly_with_is_refused(change: dict[str, Any], says: str) -> None:
    with pytest.raises(MissionError, match=says):
        load_mission({**BOX, **change})


def test_a_point_load_is_asked_for_no_attitude() -> None:
    with pytest.raises(MissionError, match=r"reference\.yaw_deg.*turns the load, which is a point"):
        load_mission("figure-eight", {"reference.yaw_deg": 20.0})
    turns = {"reference.attitudes_deg": [[0.0, 0.0, 9.0]] * 5}
    with pytest.raises(MissionError, match=r"attitudes_deg.*turns the load, which is a point"):
        load_mission("point-to-point", turns)
