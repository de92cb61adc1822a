"""Who flies, and what follows when a drone leaves: the part by itself, without a flight."""

from __future__ import annotations

import pytest

from colift.control.reference.descent import Descent
from colift.flight.membership import Membership
from colift.kernel.signals import make_bus
from colift.mission import load_mission

MISSION = load_mission("hover", {"drones.count": 3, "allocation.tension_max": 1.1})


@pytest.fixture
def team():
    bus = make_bus(3)
    bus.desired_directions[:] = MISSION.start_directions()
    bus.reference[:2] = [[1.0, 2.0, 3.0], [0.1, 0.0, 0.0]]
    parts = {layer: getattr(MISSION, layer) for layer in ("allocation", "actuation", "reference")}
    return Membership(MISSION.team), bus, parts


def moment(bus, parts, clock):
    return {
        "before": [0, 1, 2],
        "bus": bus,
        "parts": parts,
        "time": 4.0,
        "clock": clock,
        "end": 10.0,
    }


def test_three_carry_on_and_two_bring_it_down(team):
    membership, bus, parts = team
    now = moment(bus, parts, 3.0)
    assert membership.go_on([0, 1, 2], **now) == {}
    assert membership.descent == ""
    follows = membership.go_on([0, 2], **now)
    assert follows == {
        "reference": Descent(position=(1.0, 2.0, 3.0), velocity=(0.1, 0.0, 0.0), at=3.0)
    }
    assert membership.descent.startswith("descended from t = 4 s: ")
    assert "tension_max" in membership.descent


def test_who_descends_already_goes_on_descending(team):
    membership, bus, parts = team
    now = moment(bus, parts, 4.0)
    assert membership.go_on([0, 2], **now)
    reason = membership.descent
    assert membership.go_on([0], **now) == {}
    assert membership.descent == reason
