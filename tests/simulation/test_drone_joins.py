"""A drone joins in flight: it hooks in, the others make room."""

from __future__ import annotations

import numpy as np
import pytest

import colift
from colift.errors import MissionError
from colift.team.geometry import pairwise_angles, ring, widest_gap


def event(at: float, change: str, drone: object) -> dict[str, object]:
    return {"at": at, "field": f"drones.{change}", "value": drone}


def flown(*events: dict[str, object], mission: str = "paper-spiral", **settings: object):
    return colift.run(
        mission, overrides={"events": list(events), "timing.duration": 6.0}, **settings
    )


def test_a_drone_is_nan_before_it_joins_and_flies_afterwards():
    r = flown(event(3.0, "join", 1), allocator="ring").recording
    before = r.time < 3.0
    for name in ("tensions", "positions", "desired_directions", "attitudes", "thrusts"):
        assert np.isnan(r[name][before][:, 1]).all(), name
        assert np.isfinite(r[name][~before]).all(), name
        assert np.isfinite(np.delete(r[name][before], 1, axis=1)).all(), name
    assert np.isfinite(r["load"]).all()


def test_nothing_jumps_when_a_drone_joins():
    r = flown(
        event(3.0, "join", 3), allocator="safe", position_control__kind="feed-forward"
    ).recording
    row = int(np.flatnonzero(r.time >= 3.0)[0])
    for name in ("positions", "directions", "attitudes", "velocities"):
        step = r[name][row, :3] - r[name][row - 1, :3]
        earlier = r[name][row - 1, :3] - r[name][row - 2, :3]
        assert np.abs(step - earlier).max() < 2e-3, name
    assert np.abs(r["load"][row, 1] - r["load"][row - 1, 1]).max() < 0.01
    assert r["velocities"][row, 3] == pytest.approx(r["load"][row, 1], abs=1e-6)
    reach = r["load"][row, 0] - r["positions"][row, 3]
    assert np.linalg.norm(reach) == pytest.approx(1.0, abs=1e-9)  # its cable is taut


def test_the_safe_allocator_makes_room():
    run = colift.run("three-to-four")
    r = run.recording
    angles = np.degrees(np.nanmin(pairwise_angles(r["directions"]), axis=1))
    assert angles[r.time < 8.0].min() > 30.0
    assert angles[r.time >= 10.0].min() > 30.0
    assert angles.min() > 25.0
    assert run.metrics["tracking_max_m"] < 0.05
    assert (r["tensions"][r.time > 10.0] > 0.04).all()


def test_a_lost_drone_may_come_back():
    run = flown(event(1.0, "lose", 2), event(3.0, "join", 2), allocator="safe")
    flying = np.isfinite(run.recording["tensions"][:, 2])
    t = run.recording.time
    assert list(flying) == list((t < 1.0) | (t >= 3.0))
    assert run.recording.outcome == "completed"


def test_values_per_drone_are_its_own():
    masses = [0.4, 0.5, 0.6, 0.7]
    run = flown(
        event(2.0, "join", 0),
        allocator="safe",
        drones__mass=masses,
        allocation__tension_max=[2.0, 3.0, 4.0, 5.0],
    )
    r = run.recording
    late = r.time > 5.0
    lift = r["thrusts"][late] / 9.81  # carries itself and a share of the load
    assert (lift.min(axis=0) > np.array(masses)).all()
    assert r["tensions"][late, 0].max() <= 2.0 + 0.5
    assert run.recording.outcome == "completed"


@pytest.mark.parametrize(
    "events",
    [[event(1.0, "join", 4)], [event(1.0, "join", True)], [event(2.0, "join", 0)] * 2],
)
def test_only_a_drone_that_does_not_fly_can_join(events):
    with pytest.raises(MissionError, match="do not fly then"):
        flown(*events)


@pytest.mark.parametrize("cone", [20.0, 40.0, 80.0])
def test_the_widest_gap_of_a_ring_is_its_centre_or_its_rim(cone: float):
    directions = ring(3, np.radians(cone))
    found = widest_gap(directions, np.radians(cone))
    angle = np.degrees(np.arccos((directions @ found).max()))
    rim = ring(6, np.radians(cone))[1]
    best = max(cone, np.degrees(np.arccos((directions @ rim).max())))
    assert angle == pytest.approx(best, abs=1.5)
