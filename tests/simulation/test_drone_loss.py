"""A drone leaves in flight: its cable is cut, the others carry on."""

from __future__ import annotations

import numpy as np
import pytest

import colift
from colift.control.observation.momentum import Momentum
from colift.errors import MissionError
from colift.team import Team


def flown(mission="paper-spiral", *losses, **settings):
    events = [{"at": at, "field": "drones.lose", "value": drone} for at, drone in losses]
    return colift.run(mission, overrides={"events": events, "timing.duration": 6.0}, **settings)


def test_the_rest_of_the_flight_has_the_others_signals_and_nan_for_the_lost():
    r = flown("paper-spiral", (3.0, 1), allocator="ring").recording
    gone = r.time >= 3.0
    for name in ("tensions", "positions", "desired_directions", "attitudes", "thrusts"):
        assert np.isnan(r[name][gone][:, 1]).all(), name
        assert np.isfinite(r[name][~gone]).all(), name
        assert np.isfinite(np.delete(r[name][gone], 1, axis=1)).all(), name
    assert np.isfinite(r["load"]).all()


def test_positions_do_not_jump_when_the_cable_is_cut():
    r = flown("paper-spiral", (3.0, 0), allocator="ring").recording
    row = int(np.flatnonzero(r.time >= 3.0)[0])
    for name in ("positions", "directions", "attitudes", "velocities"):
        step = r[name][row, 1:] - r[name][row - 1, 1:]
        earlier = r[name][row - 1, 1:] - r[name][row - 2, 1:]
        assert np.abs(step - earlier).max() < 2e-3, name


def test_the_cut_takes_that_cables_force_from_the_load_and_no_momentum():
    """The velocity is the same before and after; the acceleration is what the other cables give."""
    mission = {"timing__recording": 0.001, "start__load_offset": [0.0, 0.0, 0.0]}
    r = flown("hover", (1.0, 2), allocator="ring", **mission).recording
    row = int(np.flatnonzero(r.time >= 1.0)[0])
    assert np.abs(r["load"][row, 1] - r["load"][row - 1, 1]).max() < 1e-4
    others = [0, 1, 3]
    pull = -(r["tensions"][row, others, None] * r["directions"][row, others]).sum(axis=0)
    acceleration = pull / 0.225 - [0.0, 0.0, 9.81]
    measured = (r["load"][row + 1, 1] - r["load"][row, 1]) / 0.001
    assert measured == pytest.approx(acceleration, abs=0.05)
    assert np.linalg.norm(acceleration) > 1.0  # the lost cable is felt


def test_two_losses_one_after_the_other_name_drones_by_their_first_number():
    r = flown("eight-drones", (1.0, 2), (2.0, 5), allocator="ring").recording
    assert r.outcome == "completed"
    flying = np.isfinite(r["tensions"])
    assert flying[0].sum() == 8
    assert list(np.flatnonzero(~flying[-1])) == [2, 5]


def test_metrics_and_report_take_the_gap(tmp_path):
    from colift.show.report.html import write_report

    run = flown("paper-spiral", (3.0, 3), allocator="ring")
    unknown = {name for name, value in run.metrics.items() if not np.isfinite(value)}
    # Short; nothing to detect; rods push when the drone leaves, where cables would have caught; no limit of thrust; no
    # distance asked for above each other; nothing is lifted off the ground or in the way; a point has no attitude.
    lifts = {
        "dragged_m", "lift_peak", "lifted_m", "placement_m", "setbacks", "touch_height_m", "touch_peak", "weighed_mass_kg",
    }  # fmt: skip
    assert unknown == lifts | {
        "tension_integral_10s_Ns", "detection_delay_s", "max_catch_impulse_Ns", "peak_thrust_fraction",
        "min_downwash_distance_m", "min_load_distance_m", "min_clearance_m", "attitude_rms_deg", "attitude_max_deg", "yaw_max_deg",
        "max_missing_moment_Nm",
    }  # fmt: skip
    assert write_report(run.recording, tmp_path, metrics=run.metrics).stat().st_size > 1e4


@pytest.mark.parametrize("losses", [[(1.0, 4)], [(1.0, -1)], [(1.0, 0), (2.0, 0)], [(1.0, True)]])
def test_only_a_flying_drone_can_be_lost(losses):
    with pytest.raises(MissionError, match="one of the drones that fly then"):
        flown("paper-spiral", *losses)


def test_the_last_drone_cannot_be_lost():
    with pytest.raises(MissionError, match="not the last one"):
        flown("paper-spiral", (1.0, 0), (2.0, 1), (3.0, 2), (4.0, 3))


def test_who_leaves_in_motion_is_no_blow_to_the_load():
    """The observer of the whole momentum knows what the lost drone has carried of it; who joins brings its own along."""
    team, part = Team.uniform(3), Momentum()
    memory, v = part.memory(team), np.tile([1.5, -1.0, 0.5], (3, 1))
    load = np.array([[0.0, 0.0, 1.0], v[0]])

    def observed(team, memory):
        x = np.array([[np.cos(a), np.sin(a), 1.7] for a in range(team.n)])
        level = np.tile([1.0, 0.0, 0.0, 0.0], (team.n, 1))
        thrust = 9.81 * (team.load_mass + team.masses.sum()) / team.n
        for _ in range(3):
            found = part.call(
                team, memory, dt=0.01, estimated_velocities=v[: team.n], estimated_load=load, estimated_positions=x,
                estimated_ends=np.tile(load, (team.n, 1, 1)), estimated_attitudes=level, thrusts=np.full(team.n, thrust),
                received_tensions=np.full(team.n, 1.0),
            )[0]  # fmt: skip
        return found.estimated_forces.sum(axis=0)

    assert np.abs(observed(team, memory)).max() < 1e-9
    two = team.of([0, 2])
    left = part.carry_over(memory, part.memory(two), np.array([0, 2]))
    assert np.abs(observed(two, left)).max() < 0.1  # the momentum of 0.5 kg would be 10 N
    again = part.carry_over(left, part.memory(team), np.array([0, -1, 1]))
    assert np.abs(observed(team, again)).max() < 0.1
