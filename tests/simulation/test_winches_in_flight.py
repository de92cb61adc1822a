"""Winches in a flight: the load stays while its cables change, drones leave meanwhile, snapshots go back."""

from __future__ import annotations

import numpy as np
import pytest

from colift.flight.flight import Flight
from colift.mission import load_mission

WOUND = {
    "sensing.kind": "noisy",
    "timing.duration": 4.0,
    "events": [{"at": 0.5, "field": "drones.cable_length", "value": [1.5, 1.0, 0.8, 1.0], "rate": 0.8}],
}  # fmt: skip


@pytest.fixture(scope="module")
def flown():
    flight = Flight(load_mission("real-world", {**WOUND, "disturbance": []}))
    return flight, flight.run()


def test_the_load_stays_and_all_know_the_lengths(flown):
    flight, run = flown
    assert run.outcome == "completed"
    apart = np.linalg.norm(run["positions"] - run["load"][:, None, 0], axis=2)
    taut = run["tensions"] > 0.0
    np.testing.assert_allclose(apart[taut], (1.0 + run["reeled"][:, :, 0])[taut], atol=1e-6)
    np.testing.assert_allclose(run["reeled"][-1, :, 0], [0.5, 0.0, -0.2, 0.0], atol=1e-12)
    assert np.linalg.norm(run["load"][:, 0] - run["reference"][:, 0], axis=1).max() < 0.1
    assert run["found_lengths"].max() == 0.0
    told = flight._told("allocation").cable_lengths
    np.testing.assert_allclose(told, [1.5, 1.0, 0.8, 1.0], atol=1e-12)
    assert flight._told("position_control") is flight._legs[-1].team


def test_a_drone_leaves_while_winches_turn_and_a_snapshot_goes_back():
    flight = Flight(load_mission("real-world", {**WOUND, "disturbance": []}))
    flight.advance(0.8)
    before = flight.snapshot()
    flight.advance(1.5)
    there = flight.bus.row.copy()
    flight.restore(before)
    flight.advance(1.5)
    np.testing.assert_array_equal(flight.bus.row, there)
    flight.restore(before)
    flight.lose([1])
    flight.advance(2.5)
    np.testing.assert_allclose(flight.bus.reeled[:, 0], [0.5, -0.2, 0.0], atol=1e-12)
    told = flight._told("allocation").cable_lengths
    np.testing.assert_allclose(told, [1.5, 0.8, 1.0], atol=1e-12)
    apart = np.linalg.norm(flight.bus.positions - flight.bus.load[0], axis=1)
    assert (apart <= told + 1e-9).all()
