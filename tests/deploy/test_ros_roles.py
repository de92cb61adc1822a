"""What the nodes do, without ROS: a team whose controllers see each other through topics only flies its missions."""

from __future__ import annotations

import numpy as np
import pytest
from ros_team import Together

from colift.deploy.ros.holding import EASE, REST, SILENT, Held
from colift.deploy.ros.layers import mission_for
from colift.deploy.ros.steering import Steering
from colift.errors import ColiftError
from colift.kernel.math.leaning import paced
from colift.kernel.status import Status
from colift.record import metrics


@pytest.mark.parametrize("takes", ["cables", "setpoints"])
@pytest.mark.parametrize(
    ("mission", "off", "least"),
    [("figure-eight", 0.005, 46.0), ("noisy-spiral", 0.03, 45.0), ("box-figure-eight", 0.012, 13.0)],
)  # fmt: skip
def test_a_team_flies_by_what_it_hears(mission, takes, off, least):
    team = Together(mission, {"timing.duration": 8.0}, takes)
    found = metrics.compute(team.fly())
    assert found["tracking_max_m"] < off
    assert found["min_angle_deg"] > least
    assert team.allocator.statuses == {Status.CONVERGED: 800}


@pytest.mark.parametrize("killed", [False, True])
@pytest.mark.parametrize("takes", ["cables", "setpoints"])
def test_a_silent_allocator_brings_the_load_to_rest_and_it_goes_on_afterwards(takes, killed):
    team = Together("figure-eight", {"timing.duration": 13.0}, takes)
    recording = team.fly(silent=(3.0, 8.0), killed=killed)
    side = team.cascade or team.world
    assert side.held.silences == 1
    speed, time = np.linalg.norm(recording["load"][:, 1], axis=1), recording.time
    assert speed[time < 3.0].max() > 0.3
    assert speed[(time > 6.5) & (time < 8.0)].max() < 0.02
    assert speed[time > 10.0].max() > 0.3
    found = metrics.compute(recording)
    assert found["tracking_max_m"] < 0.03
    # One that begins anew finds another of the formations that cost the same, within its limit of 30 degrees.
    assert found["min_angle_deg"] > (37.0 if killed else 40.0)


@pytest.mark.parametrize("mission", ["box-figure-eight", "agile-box", "two-drones-bar"])
@pytest.mark.parametrize("until", [3.3, 8.0])
def test_a_rigid_load_whose_moment_nobody_allocates_drifts_by_centimetres(mission, until):
    team = Together(mission, {"timing.duration": until + 3.0}, "cables")
    found = metrics.compute(team.fly(silent=(3.0, until)))
    assert found["tracking_max_m"] < (0.03 if until < 4.0 else 0.16)


def test_the_clock_of_the_reference_is_held_by_silence_alone():
    pace = np.array([0.0, 0.0, 1.0, 1.0, 0.0])
    period = 10_000_000
    late = SILENT * period
    held = Held(pace, np.ones(2), np.tile([0.0, 0.0, -1.0], (2, 1)), period)
    force = np.array([0.0, 0.0, 3.0])
    assert held.hear(0, 0, force)
    assert held.hear(1, 0, force)
    assert held.heard(0)
    assert not held.heard(1)
    assert held.tensions.tolist() == [3.0, 3.0]
    assert held.directions.tolist() == [[0.0, 0.0, -1.0]] * 2
    held.look(late)
    assert not held.silent
    held.hear(0, late, force)  # one drone of two
    assert list(held.look(late + period)) == pytest.approx([0.01, 0.06])
    assert held.silent
    assert held.silences == 1
    assert paced(pace, 100.0)[1] == pytest.approx(1.0)
    held.look(round(1e9 * REST) + period)
    begin = REST + 0.01
    assert paced(pace, begin + EASE)[1] == pytest.approx(0.0, abs=1e-12)
    assert not held.hear(0, period, force)  # older than what it has
    held.hear(0, 1_000_000_000, force)
    held.hear(1, 1_000_000_000, np.zeros(3))
    held.look(1_000_000_000)
    assert not held.silent
    assert paced(pace, begin + EASE)[1] == pytest.approx(0.0, abs=1e-12)  # it comes to rest first
    end = round(1e9 * (begin + EASE)) + 1
    held.hear(0, end, force)
    held.hear(1, end, np.zeros(3))
    held.look(end)
    assert paced(pace, 100.0)[1] == pytest.approx(1.0)
    assert held.tensions.tolist() == [3.0, 0.0]
    assert held.directions[1].tolist() == [0.0, 0.0, -1.0]  # without a force it stays


def test_an_allocator_begins_where_the_cables_hang():
    team = Together("hover", {"timing.duration": 1.0}, "cables")
    team.fly()
    load, drones = team.world.load(), team.world.drones()
    fresh = Together("hover", {"timing.duration": 1.0}, "cables").allocator
    fresh.begin(load, drones)
    assert np.allclose(fresh.bus.desired_directions, team.world.flight.bus.directions, atol=1e-4)
    fresh.begin(load, [None] * len(drones))  # not known: it stays


def test_missions_that_nodes_cannot_fly_are_refused_by_field():
    with pytest.raises(ColiftError, match=r"agents\.kind: must be .central."):
        mission_for("leaderless", {})
    with pytest.raises(ColiftError, match=r"events: drones\.lose at .* does not change"):
        mission_for("four-to-three", {})
    lifted, _ = mission_for("take-off-and-land", {})
    with pytest.raises(ColiftError, match=r"supervision\.kind: must be .none. for the cascade"):
        Steering(lifted)


def test_topics_have_one_period_and_it_is_said():
    mission, notes = mission_for("figure-eight", {})
    assert mission.timing.allocation == 0.01
    assert "timing.allocation = 0.01" in notes
    mission, notes = mission_for("real-world", {})
    assert notes == []
    mission, _ = mission_for("real-world", {}, 0.02)
    assert mission.timing.position_control == mission.timing.load_control == 0.02
