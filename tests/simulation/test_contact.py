"""Contact between drones, cables and load ends a flight, where the drones' radii are known."""

from __future__ import annotations

import math

import numpy as np
import pytest

import colift
from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record.moments import find_moments
from colift.team.contact import FLAT, Boxes, first_contact

HOVER = {
    "name": "test",
    "reference": {"kind": "hover"},
    "timing": {"duration": 3.0},
    "allocation": {"kind": "min-norm"},
}


def still(positions, *, end=(0.0, 0.0, 0.0), attached=None, lengths=None, radii=None):
    """One row of drones about a load at the origin."""
    at = np.array(positions, dtype=float)
    n = len(at)
    return first_contact(
        np.full(n, 0.2) if radii is None else np.array(radii),
        np.linalg.norm(at - end, axis=1) if lengths is None else np.array(lengths),
        at[None],
        np.broadcast_to(np.array(end), (1, n, 3)),
        np.ones((1, n)) if attached is None else np.array(attached)[None],
    )


def test_drones_touch_at_their_radii_beside_and_at_half_of_it_above_each_other() -> None:
    for apart, touch in ((0.39, True), (0.41, False)):
        beside = still([[0.0, 0.0, 2.0], [apart, 0.0, 2.0]], attached=[0.0, 0.0])
        above = still([[0.0, 0.0, 2.0], [0.0, 0.0, 2.0 + FLAT * apart]], attached=[0.0, 0.0])
        for found in (beside, above):
            assert found == ((0, "drones {0} and {1} touched") if touch else None)


def test_a_drone_touches_anothers_cable_not_its_own() -> None:
    """On equal heights: the cable of drone 1 passes drone 0 at 0.6 of its height, sideways."""
    for off, touch in ((0.15, True), (0.25, False)):
        positions = [[0.9 + off, 0.0, 0.9], [1.5, 0.0, 1.5], [-1.0, 0.0, 1.0]]
        sideways = [[0.9, off, 0.9], *positions[1:]]
        assert still(sideways) == (
            (0, "drone {0} touched the cable of drone {1}") if touch else None
        )
        assert still(sideways, attached=[1.0, 0.0, 1.0]) is None
        assert still(sideways, lengths=[1.3, 2.5, 1.5]) is None  # slack: it hangs elsewhere
        assert still(sideways, radii=[math.nan, 0.2, 0.2]) is None


def test_a_drone_touches_the_load() -> None:
    assert still([[0.1, 0.0, 0.0], [1.0, 0.0, 1.0]], lengths=[1.0, 1.4]) == (
        0,
        "drone {0} touched the load",
    )


def test_a_drone_touches_the_box_of_a_rigid_load_wherever_it_comes_near() -> None:
    """A box that is turned by a right angle about the vertical: what was its length is across."""
    size, half = np.array([1.0, 0.4, 0.2]), math.sqrt(0.5)
    for q, reach in (((1.0, 0.0, 0.0, 0.0), 0.5), ((half, 0.0, 0.0, half), 0.2)):
        boxes = Boxes(size, np.zeros((1, 3)), np.array([q]))
        for beyond, touch in ((0.19, True), (0.21, False)):
            at = np.array([[[reach + beyond, 0.0, 0.05], [0.0, 0.0, 3.0]]])
            np.testing.assert_allclose(boxes.away(at)[0, 0], [beyond, 0.0, 0.0], atol=1e-12)
            found = first_contact(
                np.full(2, 0.2), np.ones(2), at, np.zeros((1, 2, 3)), np.zeros((1, 2)), boxes
            )
            assert found == ((0, "drone {0} touched the load") if touch else None)
    above = np.array([[[0.3, 0.0, 0.1 + 0.09]]])  # drones are half as tall
    boxes = Boxes(size, np.zeros((1, 3)), np.array([[1.0, 0.0, 0.0, 0.0]]))
    assert first_contact(
        np.full(1, 0.2), np.ones(1), above, np.zeros((1, 1, 3)), np.zeros((1, 1)), boxes
    )
    inside = np.array([[[0.4, -0.1, 0.0]]])
    assert not boxes.away(inside).any()


def test_a_flight_ends_where_a_drone_comes_down_on_its_box() -> None:
    """One drone's motors stop above the box: it falls on it, and nobody flies through."""
    load = {
        "kind": "rigid",
        "mass": 0.5,
        "size": [1.6, 1.2, 0.2],
        "attachments": [[0.3, 0.2, 0.1], [-0.3, 0.2, 0.1], [-0.3, -0.2, 0.1], [0.3, -0.2, 0.1]],
    }
    falls = {
        "name": "falls", "load": load, "drones": {"radius": 0.15, "mass": 0.5, "max_thrust": 12.0, "arm": 0.1}, "reference": {"kind": "hover"},
        "timing": {"duration": 4.0}, "fault": [{"kind": "drone-lost", "drone": 1, "at": 1.0}],
    }  # fmt: skip
    run = colift.run(falls)
    assert "drone 1 touched the load" in run.recording.outcome
    assert run.metrics["min_load_distance_m"] < 0.2
    whole = colift.run({**falls, "fault": []})
    assert whole.recording.outcome == "completed"
    assert whole.metrics["min_load_distance_m"] == pytest.approx(
        float(np.min(whole.recording["positions"][:, :, 2] - whole.recording["load"][:, :1, 2]))
        - 0.1,
        abs=0.02,
    )  # straight above it


def test_the_first_of_many_rows_counts() -> None:
    rows = 5000
    apart = np.linspace(1.0, 0.0, rows)
    positions = np.zeros((rows, 2, 3))
    positions[:, :, 2] = 1.0
    positions[:, 1, 0] = apart
    found = first_contact(
        np.full(2, 0.2), np.ones(2), positions, np.zeros((rows, 2, 3)), np.zeros((rows, 2))
    )
    assert found is not None
    assert found[0] == np.flatnonzero(apart < 0.4)[0]


def colliding(**drones):
    """Two drones whose wanted cables draw together: a ring that narrows in flight."""
    return {
        **HOVER,
        "drones": {"count": 2, **drones},
        "start": {"cone_deg": 25.0},
        "allocation": {"kind": "ring", "cone_deg": 10.0},
    }


def test_a_flight_ends_at_the_first_contact_and_says_who_and_when() -> None:
    free = colift.run(colliding())
    assert free.recording.outcome == "completed"
    nearest = np.linalg.norm(np.diff(free.recording["positions"], axis=1), axis=2)[:, 0]
    touched = float(nearest[0]) - 0.02  # across, both at one height
    run = colift.run(colliding(radius=0.5 * touched))
    recording = run.recording
    row = int(np.flatnonzero(nearest < touched)[0])
    when = free.recording.time[row]
    assert recording.outcome == f"drones 0 and 1 touched at t = {when:g} s"
    assert recording.time[-1] == when
    assert run.verdict.level == "lost"
    assert run.verdict.reasons[0] == recording.outcome
    assert len(recording.cycle_time) == np.count_nonzero(free.recording.cycle_time <= when)
    rows = slice(0, len(recording.time))
    np.testing.assert_array_equal(recording["positions"], free.recording["positions"][rows])
    assert find_moments(recording)[-1].kind == "outcome"
    assert run.metrics["min_drone_distance_m"] < touched


def test_a_flight_that_has_ended_flies_on_no_more_and_goes_back_before_the_contact() -> None:
    run = colift.run(colliding())
    apart = np.linalg.norm(np.diff(run.recording["positions"], axis=1), axis=2)[:, 0]
    flight = Flight(load_mission(colliding(radius=0.5 * (float(apart[0]) - 0.02))))
    before = flight.snapshot()
    flight.advance(2.0)
    ended, time = flight.outcome, flight.time
    assert "touched" in ended
    flight.advance(1.0)
    assert flight.time == time
    flight.restore(before)
    assert flight.outcome == "completed"
    flight.advance(2.0)
    assert (flight.outcome, flight.time) == (ended, time)


def test_drones_that_touch_from_the_start_are_refused() -> None:
    with pytest.raises(MissionError, match=r"start.cone_deg: .*drones 0 and 1 touch"):
        load_mission({**HOVER, "drones": {"count": 4, "radius": 0.5}, "start": {"cone_deg": 35.0}})


def test_a_team_of_unknown_size_touches_nothing() -> None:
    start = {"start": {"cone_deg": 1.0}, "allocation": {"kind": "ring", "cone_deg": 1.0}}
    assert colift.run({**HOVER, **start}).recording.outcome == "completed"


def test_the_safe_allocator_keeps_drones_of_known_size_apart_in_flight() -> None:
    """A start nearer than asked is led apart; metrics and criteria know the distances."""
    mission = {
        **HOVER,
        "allocation": {"kind": "safe", "min_angle_deg": 10.0},
        "drones": {"count": 4, "radius": 0.15, "cable_length": [0.6, 1.2, 0.6, 1.2]},
        "start": {"cone_deg": 25.0},
    }
    derived = colift.run(mission)
    assert derived.recording.outcome == "completed"
    assert "min_distance" not in derived.mission.resolved()["allocation"]
    assert "min_cable_distance_m" not in {j.metric for j in derived.verdict.judged}
    end = derived.recording["positions"][-1]
    away = (end[:, None] - end[None])[np.triu_indices(4, 1)] / [1.0, 1.0, 2.0]
    assert np.linalg.norm(away, axis=1).min() > 2.4 * 0.15 - 0.02
    metrics = derived.metrics
    flown = derived.recording["positions"]
    away = (flown[:, :, None] - flown[:, None])[:, *np.triu_indices(4, 1)] / [1.0, 1.0, 2.0]
    nearest = np.linalg.norm(away, axis=2).min()
    assert metrics["min_downwash_distance_m"] == pytest.approx(nearest)
    assert metrics["min_downwash_distance_m"] <= metrics["min_drone_distance_m"]
    given = colift.run(
        mission, overrides={"allocation.min_distance": 0.36, "allocation.cable_distance": 0.18}
    )
    np.testing.assert_array_equal(given.recording["positions"], derived.recording["positions"])
    bounds = {j.metric: j.bound for j in given.verdict.judged}
    assert bounds["min_downwash_distance_m"] == bounds["min_drone_distance_m"] == ">= 0.36"
    assert bounds["min_cable_distance_m"] == ">= 0.18"
