"""Plans that are changed in flight: the same up to where they may change, certified among what has moved, in bounded work."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from windows import window

from colift.flight.flight import Flight
from colift.mission.load import load_mission
from colift.plan import planner, replan
from colift.plan.mission import mission_of

BEGIN, MOVED = 5, 0.06


@pytest.fixture(scope="module")
def roomy():
    """A plan that keeps something in reserve."""
    limits = planner.Limits(room=0.02, most=1.25, rate=6.5)
    return planner.plan(window(), limits, seed=1, attempts=2, seconds=np.inf)


def moved(plan, by):
    obstacles = plan.scene.obstacles.copy()
    obstacles[:, 2] += by
    return obstacles


def test_nothing_changes_where_nothing_moved(roomy):
    again = replan.replan(roomy, BEGIN, roomy.scene.obstacles)
    assert np.array_equal(again.load_points, roomy.load_points)
    assert np.array_equal(again.pull_points, roomy.pull_points)


def test_it_goes_round_what_moved_and_is_the_same_before(roomy):
    obstacles = moved(roomy, MOVED)
    scene = replace(roomy.scene, obstacles=obstacles)
    old = planner.excess(
        scene, planner.Limits(), roomy.load_points, roomy.pull_points, roomy.duration, begin=BEGIN
    )
    assert old.max() > 0.0
    new = replan.replan(roomy, BEGIN, obstacles, planner.Limits())
    assert max(new.excess.values()) <= 0.0
    before, after = (plan.sample(50 * plan.intervals) for plan in (roomy, new))
    until = 50 * BEGIN + 1
    for name, values in before.items():
        assert np.array_equal(values[:until], after[name][:until])
    assert not np.array_equal(before["load"][until:], after["load"][until:])
    np.testing.assert_allclose(after["load"][-1, 0], roomy.scene.goal, atol=1e-12)


def test_it_gives_up_rather_than_hand_out_what_touches(roomy):
    at_the_goal = roomy.scene.obstacles.copy()
    at_the_goal[0, 1:4] = roomy.scene.goal
    assert replan.replan(roomy, BEGIN, at_the_goal, planner.Limits()) is None
    assert replan.replan(roomy, roomy.intervals - replan.LEAST + 1, roomy.scene.obstacles) is None


def test_a_flight_takes_the_new_plan_where_it_may_change(roomy):
    obstacles = moved(roomy, MOVED)
    new = replan.replan(roomy, BEGIN, obstacles, planner.Limits())
    old, after = (mission_of(plan) for plan in (roomy, new))
    # The obstacles are where they have moved to all the time; nobody knew.
    flight = Flight(load_mission(old | {"world": after["world"]}))
    knot = old["reference"]["hold"] + BEGIN * roomy.duration / roomy.intervals
    flight.advance(knot)
    flight.change("reference", after["reference"])
    flight.advance(old["timing"]["duration"] - knot)
    record = flight.recording()
    assert record.outcome == "completed"
    off = np.linalg.norm(record["load"][:, 0] - record["reference"][:, 0], axis=1)
    assert off.max() < 0.01
