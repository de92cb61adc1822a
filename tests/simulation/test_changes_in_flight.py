"""Parts and sections that take the place of others in flight, and what a long flight forgets."""

from __future__ import annotations

import numpy as np
import pytest

from colift.control.reference.guided import Guided
from colift.errors import ColiftError, MissionError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.world.disturbance.push import Push

TABLE = {
    "name": "test",
    "reference": {"kind": "hover"},
    "timing": {"duration": 2.0},
    "disturbance": [{"kind": "push"}],
}
GUIDED = {"kind": "guided", "begin": 1.0, "target": [0.2, 0.0, 1.0]}


def event(at, field, value):
    return {"at": at, "field": field, "value": value}


def flown(*events, **overrides):
    return Flight(load_mission({**TABLE, "events": list(events)}, overrides)).run()


def test_another_reference_takes_over_and_the_load_follows():
    r = flown(event(1.0, "reference", GUIDED))
    before = r.time < 1.0
    np.testing.assert_array_equal(r["reference"][before, 0], [[0.0, 0.0, 1.0]] * before.sum())
    np.testing.assert_allclose(r["reference"][-1, 0], [0.2, 0.0, 1.0], atol=0.02)
    assert np.linalg.norm(r["load"][-1, 0] - r["reference"][-1, 0]) < 0.02
    assert np.abs(np.diff(r["load"][:, 0], axis=0)).max() < 0.01


def test_a_section_in_an_event_is_the_same_as_its_settings_one_by_one():
    force = [0.5, 0.0, 0.0]
    whole = flown(
        event(1.0, "disturbance.0", {"kind": "push", "force": force, "at": 1.0, "duration": 0.3})
    )
    single = flown(
        event(1.0, "disturbance.0.force", force),
        event(1.0, "disturbance.0.at", 1.0),
        event(1.0, "disturbance.0.duration", 0.3),
    )
    np.testing.assert_array_equal(whole["load"], single["load"])
    pushed = np.flatnonzero(whole["external_forces"][:, -1, 0])
    assert whole.time[pushed[[0, -1]]] == pytest.approx([1.0, 1.295])


def test_a_part_of_the_same_kind_keeps_its_memory_another_forgets():
    flight = Flight(load_mission(TABLE))
    flight.advance(0.5)
    memory = flight.wires.allocation.memory.copy()
    flight.change("allocation", {"kind": "safe", "mu": 0.4})
    assert flight.parts["allocation"].mu == 0.4
    np.testing.assert_array_equal(flight.wires.allocation.memory, memory)
    assert flight.wires.allocation.params[0] == 0.4
    flight.change("allocation", {"kind": "sqp", "mu": 0.3})
    assert flight.parts["allocation"].mu == 0.3
    assert len(flight.snapshot().legs) == 2


@pytest.mark.parametrize(
    ("path", "value", "says"),
    [
        ("plant", {"kind": "rigid-cables"}, "plant"),
        ("disturbance.1", {"kind": "push"}, "no such setting"),
        ("disturbance.0", {"kind": "wind"}, "same kind"),
        ("references", {"kind": "hover"}, "no such setting"),
        ("reference", {"kind": "hovr"}, "did you mean 'hover'"),
        ("reference", {"kind": "hover", "position": "up"}, "position"),
    ],
)
def test_what_cannot_take_a_place_is_refused_and_nothing_changes(path, value, says):
    flight = Flight(load_mission(TABLE))
    before = dict(flight.parts)
    with pytest.raises((ColiftError, ValueError), match=says):
        flight.change(path, value)
    assert flight.parts == before


@pytest.mark.parametrize(
    ("mistake", "says"),
    [
        (event(1.0, "reference", {"kind": "sprial"}), "did you mean 'spiral'"),
        (event(1.0, "reference", {"kind": "guided", "max_speed": -1.0}), "reference.max_speed"),
        (event(1.0, "reference", 3), "must be a table with a kind"),
        (event(1.0, "reference.target", [0, 0, 0]), "events.0.field"),
        (event(1.0, "disturbance.3", {"kind": "push"}), "no such section"),
        (event(1.0, "disturbance.0", {"kind": "wind"}), "same kind"),
        (event(1.0, "disturbance.0.force", [0.0]), "disturbance.0.force"),
        (event(1.0, "load_control.kind", "pid"), "the whole section load_control"),
        (event(1.0, "plant", {"kind": "rigid-cables"}), "events.0.field"),
    ],
)
def test_mistakes_in_events_are_found_before_the_flight(mistake, says):
    with pytest.raises(MissionError, match=says):
        load_mission({**TABLE, "events": [mistake]})


def test_events_see_the_parts_that_earlier_events_put_in_place():
    good = [event(0.5, "allocation.kind", "ring"), event(1.0, "allocation.cone_deg", 40.0)]
    load_mission({**TABLE, "events": good})
    with pytest.raises(MissionError, match="cone_deg"):
        load_mission({**TABLE, "events": good[1:]})


# ---------------------------------------------------------------- parts of the recording


@pytest.fixture(scope="module")
def in_stretches():
    """A flight of 1.2 s in stretches of 0.05 s, a drone lost on the way, and the same in one go."""
    table = {**TABLE, "timing": {"duration": 1.2, "recording": 0.007, "allocation": 0.003}}
    table["events"] = [event(0.4, "drones.lose", 1)]
    flight = Flight(load_mission(table))
    while flight.time < 1.2:
        flight.advance(0.05)
    return flight, flight.recording()


@pytest.mark.parametrize("since", [0.0, 0.1, 0.333, 0.4, 0.401, 0.999])
def test_the_end_of_a_recording_is_the_end_of_the_whole(in_stretches, since):
    flight, whole = in_stretches
    part = flight.recording(since=since)
    rows, cycles = whole.time >= since - 1e-9, whole.cycle_time >= since - 1e-9
    np.testing.assert_array_equal(part.time, whole.time[rows])
    np.testing.assert_array_equal(part.cycle_time, whole.cycle_time[cycles])
    for name, values in part.arrays.items():
        kept = cycles if name.startswith("allocator_") and name != "allocator_up" else rows
        np.testing.assert_array_equal(values, whole[name][kept], err_msg=name)


def test_what_is_forgotten_is_gone_and_the_rest_is_whole():
    flight = Flight(load_mission({**TABLE, "events": [event(0.4, "drones.lose", 1)]}))
    for _ in range(20):
        flight.advance(0.05)
    whole = flight.recording()
    flight.forget(0.5)
    kept = flight.recording()
    assert len(flight.snapshot().legs) == 1
    assert kept.time[0] == pytest.approx(0.5)
    for name in ("load", "tensions", "allocator_status"):
        np.testing.assert_array_equal(kept[name], whole[name][-len(kept[name]) :])
    flight.forget(10.0)
    assert len(flight.recording().time) == 0
    flight.advance(0.05)
    assert flight.recording().time[0] == pytest.approx(1.0)


def test_parts_are_those_that_fly():
    flight = Flight(load_mission(TABLE))
    assert isinstance(flight.parts["disturbance.0"], Push)
    flight.change("reference", GUIDED)
    assert isinstance(flight.parts["reference"], Guided)
    flight.change("load.mass", 0.3)
    assert flight.load_mass == 0.3
