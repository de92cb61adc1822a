"""The moments of a flight: what the mission, chance and a pilot did, what broke, and what followed."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import colift
from colift.flight.flight import Flight
from colift.mission.load import load_mission
from colift.record.moments import KINDS, Moment, Watch, find_moments
from colift.record.recording import Recording
from colift.show.live.endless import flown_mission
from colift.show.report.marks import MARKS


def fly(mission: str = "paper-spiral", duration: float = 2.0, **tables: Any) -> Recording:
    table = load_mission(mission).resolved() | {"events": [], "fault": []} | tables
    return colift.run(table, overrides={"timing.duration": duration}).recording


@pytest.fixture(scope="module")
def spiral() -> Recording:
    return fly()


def change(recording: Recording, **signals: Any) -> Recording:
    """The recording with some signals replaced: by functions of their values."""
    arrays = dict(recording.arrays)
    for name, function in signals.items():
        arrays[name] = function(arrays[name].copy())
    return replace(recording, arrays=arrays)


def told(recording: Recording, *kinds: str) -> list[tuple[float, str]]:
    """Times and texts, of these kinds or of all."""
    found = find_moments(recording)
    return [(round(m.time, 3), m.text) for m in found if not kinds or m.kind in kinds]


def test_an_uneventful_flight_has_no_moments(spiral: Recording) -> None:
    assert find_moments(spiral) == []


def test_every_kind_has_a_word_and_a_mark_of_its_own() -> None:
    assert list(MARKS) == list(KINDS)
    assert len({mark.shape for mark in MARKS.values()}) == len(KINDS) == len(set(KINDS.values()))


# ---------------------------------------------------------------- what followed


def test_slack_fallback_and_angle_are_found_with_their_numbers(spiral: Recording) -> None:
    def slack(times: Any) -> Any:
        times[:, 1] += np.clip(spiral.time - 0.5, 0.0, 0.2)
        return times

    def narrow(directions: Any) -> Any:
        directions[300:320, 1] = directions[300:320, 0]
        return directions

    def failing(status: Any) -> Any:
        status[1200:1203] = 4
        return status

    found = find_moments(
        change(spiral, slack_times=slack, directions=narrow, allocator_status=failing)
    )
    assert [(m.kind, round(m.time, 3), m.drone) for m in found] == [
        ("slack", 0.505, 1), ("fallback", 1.2, None), ("angle", 1.5, None),
    ]  # fmt: skip
    assert found[0].text == "Cable 1 slack for 0.2 s"
    assert found[1].text == "Allocator: numerical failure, 3 cycles"
    assert found[2].text == "Cables 0 and 1 closer than 30 deg for 0.1 s, down to 0.0 deg"


def test_what_lasts_to_the_end_says_so_and_a_short_pause_does_not_end_it(spiral: Recording) -> None:
    def narrow(directions: Any) -> Any:
        directions[100:120, 3] = directions[130:140, 3] = directions[130:, 3] = np.nan
        directions[100:110, 2] = directions[130:140, 2] = directions[300:, 2] = [0.0, 0.0, -1.0]
        directions[100:110, 1] = directions[130:140, 1] = directions[300:, 1] = [0.0, 0.0, -1.0]
        return directions

    assert told(change(spiral, directions=narrow), "angle") == [
        (0.5, "Cables 1 and 2 closer than 30 deg for 0.2 s, down to 0.0 deg"),
        (1.5, "Cables 1 and 2 closer than 30 deg to the end, down to 0.0 deg"),
    ]


def test_a_cut_cable_is_neither_slack_nor_close_to_another(spiral: Recording) -> None:
    def cut(attached: Any) -> Any:
        attached[200:, 1] = 0.0
        return attached

    def slack(times: Any) -> Any:
        times[200:, 1] += spiral.time[200:] - 1.0
        return times

    def narrow(directions: Any) -> Any:
        directions[200:, 1] = directions[200:, 0]
        return directions

    broken = change(spiral, attached=cut, slack_times=slack, directions=narrow)
    assert find_moments(broken) == [Moment(spiral.time[200], "fault", "Cable of drone 1 cut", 1)]


# ---------------------------------------------------------------- what broke


def test_a_cut_that_nobody_is_told_of_and_the_departure_that_follows() -> None:
    fault = [{"kind": "cable-cut", "at": 1.0, "drone": 2}]
    recording = fly("cut-in-flight", 2.0, fault=fault)
    gone = recording.time[np.isnan(recording["attached"][:, 2])][0]
    assert 1.0 < gone < 1.3
    assert told(recording, "fault", "departure") == [
        (1.0, "Cable of drone 2 cut"),
        (round(gone, 3), "Drone 2 is judged lost and leaves the team"),
    ]


@pytest.mark.parametrize(
    ("fault", "text"),
    [
        ({"kind": "cable-cut"}, "Cable of drone 1 cut"),
        ({"kind": "drone-lost"}, "All motors of drone 1 stopped"),
        ({"kind": "motor-degraded", "motor": 3, "health": 0.25}, "Motor 3 of drone 1 weak, down to 25 %"),
        ({"kind": "battery-low", "health": 0.9, "duration": 0.3}, "Motors of drone 1 weak, down to 90 %"),
        ({"kind": "sensor-stuck", "duration": 0.3}, "Sensors of drone 1 stuck for 0.3 s"),
        ({"kind": "sensor-stuck", "body": "load", "duration": 0.3}, "Sensors of the load stuck for 0.3 s"),
        ({"kind": "sensor-stuck", "duration": 0.002}, "Fault: sensor stuck"),
        ({"kind": "allocator-silent", "duration": 0.3}, "Allocator silent for 0.3 s"),
        ({"kind": "load-released"}, "All cables cut, the load is released"),
    ],
)  # fmt: skip
def test_every_fault_is_one_moment(fault: dict[str, Any], text: str) -> None:
    at = 1.001 if fault.get("duration") == 0.002 else 1.0  # falls between two rows
    world = {"fault": [{"at": at, "drone": 1, **fault}], "detection": {"kind": "none"}}
    recording = fly("cut-in-flight", **world)
    assert told(recording, "fault") == [(at, text)]


def test_cables_that_break_at_once_are_one_moment() -> None:
    cuts = [{"kind": "cable-cut", "at": 1.0, "drone": drone} for drone in (0, 2)]
    assert told(fly(fault=cuts), "fault") == [(1.0, "2 cables cut at once")]


def test_faults_of_chance_are_found_at_their_time_and_drone() -> None:
    recording = fly(fault=[{"kind": "cable-cut"}], duration=5.0)
    drawn = recording.mission.fault[0].drawn(np.random.default_rng([0, 0]), 4, 5.0)
    (found,) = (m for m in find_moments(recording) if m.kind == "fault")
    assert found.drone == drawn.drone
    assert found.time == pytest.approx(drawn.at, abs=0.0051)


def test_a_silent_allocator_is_a_fault_and_no_fallback() -> None:
    recording = fly(fault=[{"kind": "allocator-silent", "at": 1.0, "duration": 0.5}])
    assert (recording["allocator_status"] == 9).sum() == 500
    assert told(recording, "fallback") == []


# ---------------------------------------------------------------- what was asked for


def test_who_is_told_to_leave_and_who_joins() -> None:
    left = fly(events=[{"at": 1.0, "field": "drones.lose", "value": 0}])
    assert told(left, "fault", "departure", "join") == [
        (1.0, "Cable of drone 0 cut"), (1.0, "Drone 0 leaves the team"),
    ]  # fmt: skip
    joined = fly(events=[{"at": 1.0, "field": "drones.join", "value": 3}])
    assert told(joined, "fault", "departure", "join") == [(1.0, "Drone 3 joins")]


def test_changes_of_the_mission_are_moments() -> None:
    changes = [
        {"at": 0.5, "field": "load.mass", "value": 0.3},
        {"at": 1.0, "field": "allocation.kind", "value": "ring"},
        {"at": 1.5, "field": "reference", "value": {"kind": "hover"}},
    ]
    assert told(fly(events=changes), "change") == [
        (0.5, "load.mass = 0.3"), (1.0, "allocation.kind = ring"), (1.5, "reference: hover"),
    ]  # fmt: skip


def test_commands_are_told_in_their_own_words_and_not_again_as_changes() -> None:
    masses = [(0.4, 0.25), (0.6, 0.28), (0.8, 0.3)]  # one turn of a knob
    events = [{"at": at, "field": "load.mass", "value": kg} for at, kg in masses]
    events += [
        {"at": 1.0, "field": "drones.lose", "value": 2},
        {"at": 1.5, "field": "load.mass", "value": 0.2},
    ]
    said = [(0.8, "True mass of the load 0.3 kg"), (1.0, "Cable of drone 2 cut")]
    recording = replace(fly(events=events), commands=said)
    assert told(recording, "command", "change", "fault", "departure") == [
        *said, (1.0, "Drone 2 leaves the team"), (1.5, "load.mass = 0.2"),
    ]  # fmt: skip


# ---------------------------------------------------------------- how it ended


def test_a_diverged_flight_ends_in_a_moment(spiral: Recording) -> None:
    last = find_moments(replace(spiral, outcome="diverged before t = 2 s"))[-1]
    assert last == Moment(2.0, "outcome", "Diverged before t = 2 s")


def test_a_descent_is_told_when_it_begins() -> None:
    outcome = "descended from t = 1.25 s: 2 drones cannot hold; the rest may"
    flight = replace(fly(), outcome=outcome)
    assert told(flight) == [(1.25, "The load is brought down: 2 drones cannot hold; the rest may")]


def test_a_real_flight_has_gaps_and_no_departures(spiral: Recording) -> None:
    from colift.mission.schema import RealFlight

    def lost(positions: Any) -> Any:
        positions[100:120, 3] = np.nan
        return positions

    flight = RealFlight(name="real", drones={"count": 4}, timing=spiral.mission.timing)
    real = replace(change(spiral, positions=lost), mission=flight)
    assert find_moments(real) == [Moment(0.5, "gap", "Drone 3 not measured for 0.1 s", 3)]


def test_signals_that_are_absent_are_no_moments(spiral: Recording) -> None:
    kept = ("load", "reference", "positions")
    assert find_moments(replace(spiral, arrays={k: spiral[k] for k in kept})) == []


# ---------------------------------------------------------------- while it flies


@pytest.mark.parametrize(
    ("mission", "tables"),
    [
        ("cut-in-flight", {"fault": [{"kind": "cable-cut", "at": 1.0, "drone": 2}]}),
        ("noisy-spiral", {
            "fault": [{"kind": "sensor-stuck", "at": 0.5, "duration": 0.1, "drone": 1}],
            "events": [
                {"at": 1.0, "field": "drones.lose", "value": 0},
                {"at": 1.2, "field": "load.mass", "value": 0.3},
                {"at": 1.5, "field": "drones.join", "value": 0},
            ],
        }),
    ],
)  # fmt: skip
def test_a_live_flight_has_the_moments_of_its_recording(
    mission: str, tables: dict[str, Any]
) -> None:
    table = load_mission(mission).resolved() | {"events": [], "fault": []} | tables
    flight = Flight(load_mission(table, {"timing.duration": 2.0}))
    watch, live = Watch(), []
    while flight.time < 2.001 - 1e-9:
        flight.advance(0.02)
        recent = flight.recording(since=watch.seen)
        live += watch.look(recent, [drone for _, drone in flight.membership.found])
    whole = replace(flight.recording(), mission=flown_mission(flight.mission, flight, []))
    later = find_moments(whole)
    assert len(later) >= 3
    assert [(m.time, m.kind, m.drone) for m in live] == [(m.time, m.kind, m.drone) for m in later]
    for now, then in zip(live, later, strict=True):
        if now.kind != "angle":  # whose pair may change
            assert then.text.startswith(now.text)
    json.dumps([moment._asdict() for moment in live], allow_nan=False)
