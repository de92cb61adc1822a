"""Going back in a flight: what follows is the same again, bit for bit."""

from __future__ import annotations

import numpy as np
import pytest

from colift.flight.flight import Flight
from colift.mission import load_mission


def same(a, b):
    assert a.outcome == b.outcome
    for name in a.arrays:
        if name != "allocator_time":
            np.testing.assert_array_equal(a[name], b[name], err_msg=name)


@pytest.mark.parametrize(
    "name", ["real-world", "cut-in-flight", "four-to-three", "three-to-four", "payload-step"]
)
def test_a_flight_goes_on_from_a_snapshot_as_it_did(name):
    mission = load_mission(name)
    whole = Flight(mission).run()
    flight = Flight(mission)
    flight.advance(3.0)
    before = flight.snapshot()
    same(flight.run(), whole)
    for _ in range(2):  # a snapshot can be used again, past departures and changes
        flight.restore(before)
        assert flight.time == pytest.approx(3.0)
        same(flight.run(), whole)


def test_what_was_changed_after_a_snapshot_is_as_it_was():
    flight = Flight(load_mission("hover", {"timing.duration": 2.0}))
    flight.advance(0.5)
    before = flight.snapshot()
    flight.advance(0.5)
    untouched = flight.bus.row.copy()
    flight.restore(before)
    flight.change("load.mass", 0.4)
    flight.change("allocation.mu", 0.9)
    flight.lose([1])
    flight.advance(0.5)
    assert flight.drones == [0, 2, 3]
    flight.restore(before)
    assert flight.drones == [0, 1, 2, 3]
    assert flight.load_mass == flight.mission.true_team.load_mass
    assert flight.parts["allocation"] == flight.mission.allocation
    flight.advance(0.5)
    np.testing.assert_array_equal(flight.bus.row, untouched)
