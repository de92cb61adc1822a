"""Only the load's model says where the cables end; all else asks for these ends."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import colift
from colift.control.detection.residuals import Residuals
from colift.control.position_control import disturbance_observer, feed_forward, pid
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record.ends import cable_ends
from colift.record.metrics import compute
from colift.team import Team
from colift.world.disturbance.downwash import Downwash
from colift.world.disturbance.drag import Drag

UPRIGHT = np.array([1.0, 0.0, 0.0, 0.0])
N = 3
TEAM = Team.uniform(N)
OUT = 0.3 * np.array([[1.0, 0.0, 0.0], [-0.5, 0.8, 0.1], [-0.5, -0.8, -0.2]])
"""Where the cables would end on a wide load, from its middle."""


def wide(load, places=OUT):
    """The ends (n, K, 3) on a wide load that does not turn."""
    ends = np.tile(load, (len(places), 1, 1))
    ends[:, 0] += places
    return ends


@pytest.mark.parametrize("name", ["hover", "four-to-three", "real-world"])
def test_a_point_load_has_one_end_for_all_cables(name):
    flight = Flight(load_mission(name, {"timing.duration": 10.0}))
    for duration in (0.3, 8.5):
        flight.advance(duration)
        bus = flight.bus
        for ends, load in (
            (bus.ends, bus.load), (bus.estimated_ends, bus.estimated_load),
            (bus.wanted_ends, bus.reference),
        ):  # fmt: skip
            np.testing.assert_array_equal(ends, np.broadcast_to(load, ends.shape))
        spans = bus.ends[:, 0] - bus.positions
        lengths = np.linalg.norm(spans, axis=1, keepdims=True)
        np.testing.assert_allclose(bus.directions, spans / lengths, rtol=0, atol=1e-15)


def test_a_change_of_the_team_keeps_the_ends_of_those_that_stay():
    flight = Flight(load_mission("hover"))
    flight.advance(0.2)
    before = flight.bus.ends.copy(), flight.bus.wanted_ends.copy()
    flight.lose([1])
    np.testing.assert_array_equal(flight.bus.ends, before[0][[0, 2, 3]])
    np.testing.assert_array_equal(flight.bus.wanted_ends, before[1][[0, 2, 3]])


@pytest.mark.parametrize(
    "part", [pid.Pid(), feed_forward.FeedForward(), disturbance_observer.DisturbanceObserver()],
    ids=["pid", "feed-forward", "disturbance-observer"],
)  # fmt: skip
def test_a_drone_flies_to_the_end_of_its_own_cable(part):
    """Drones and their ends moved alike: the commands do not change."""
    rng = np.random.default_rng(4)
    wanted = rng.normal(size=(3, 3))
    alpha = rng.normal(size=(N, 3)) - [0.0, 0.0, 3.0]
    alpha /= np.linalg.norm(alpha, axis=1, keepdims=True)
    x = wanted[0] - TEAM.cable_lengths[:, None] * alpha + 0.05 * rng.normal(size=(N, 3))
    tensions = np.full(N, 0.8)

    def commanded(ends, positions):
        writes, _ = part.call(
            TEAM, part.memory(TEAM), dt=0.01, wanted_ends=ends, estimated_positions=positions,
            estimated_attitudes=np.tile(UPRIGHT, (N, 1)), received_tensions=tensions,
            received_directions=alpha,
        )  # fmt: skip
        return writes.drone_forces.copy()

    point = commanded(np.tile(wanted, (N, 1, 1)), x)
    np.testing.assert_allclose(commanded(wide(wanted), x + OUT), point, rtol=0, atol=1e-12)
    assert np.abs(commanded(wide(wanted), x) - point).max() > 0.1


@pytest.mark.parametrize(
    "part", [Drag(load_area=0.0), Downwash(load_area=0.0)], ids=["drag", "wash"]
)
def test_the_air_pushes_on_cables_where_they_are(part):
    """Drones and ends moved by the same vector feel the same; the load's place says nothing of the cables."""
    rng = np.random.default_rng(5)
    load, x = (
        rng.normal(size=(2, 3)),
        np.array([[0.0, 0.0, 1.0], [0.3, 0.1, 0.6], [-0.2, 0.2, 0.8]]),
    )
    velocities = rng.normal(size=(N, 3))
    shift = np.array([5.0, -2.0, 1.0])

    def forces(place, ends):
        spans = ends[:, 0] - x
        writes, _ = part.call(
            TEAM, part.memory(TEAM), load=place, ends=ends, positions=x, velocities=velocities,
            attitudes=np.tile(UPRIGHT, (N, 1)), attached=np.ones(N),
            directions=spans / np.linalg.norm(spans, axis=1, keepdims=True),
            applied_thrusts=np.full(N, 5.0), wind=np.array([3.0, 1.0, 0.0]),
        )  # fmt: skip
        return writes.external_forces.copy()

    ends = wide(load)
    moved = load + [shift, np.zeros(3)]
    found = forces(load, ends)
    assert np.abs(found).max() > 1e-3
    np.testing.assert_array_equal(forces(moved, ends), found)
    assert np.abs(forces(load, wide(load, 2.0 * OUT)) - found).max() > 1e-4


def test_detection_watches_the_distance_to_the_end_of_the_cable():
    def lost(ends_move):
        part, carrying = Residuals(), np.ones(N)
        memory, x = part.memory(TEAM), OUT + [0.0, 0.0, 1.0]
        for step in range(600):
            ends = wide(np.zeros((2, 3)))
            if ends_move and step > 500:
                ends[0, 0, 2] -= 0.002 * (step - 500)
                ends[0, 1, 2] = -0.4
            part.call(
                TEAM, memory, dt=0.005, estimated_ends=ends, estimated_positions=x,
                estimated_attitudes=np.tile(UPRIGHT, (N, 1)), carrying=carrying,
                thrusts=TEAM.masses * TEAM.gravity,
            )  # fmt: skip
        return np.flatnonzero(carrying == 0.0).tolist()

    assert lost(ends_move=False) == []
    assert lost(ends_move=True) == [0]


def test_recorded_ends_are_believed_and_others_follow_from_the_load():
    recording = colift.run("hover", timing__duration=0.1).recording
    ends = cable_ends(recording)
    assert "ends" not in recording
    assert ends.shape == (len(recording.time), recording.n, 2, 3)
    np.testing.assert_array_equal(ends[:, 3], recording["load"])
    apart = ends.copy()
    apart[:, :, 0] = recording["positions"] - [0.0, 0.0, 0.5]  # all cables hang straight down
    known = replace(recording, arrays={**recording.arrays, "ends": apart})
    np.testing.assert_array_equal(cable_ends(known), apart)
    metrics = compute(known)
    assert metrics["min_cable_distance_m"] == pytest.approx(metrics["min_drone_distance_m"])
    assert compute(recording)["min_cable_distance_m"] < metrics["min_cable_distance_m"] - 0.05
