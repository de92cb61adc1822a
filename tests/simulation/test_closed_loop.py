"""The simulation loop: repeatable, each layer at its rate, events, divergence, progress."""

from __future__ import annotations

import numpy as np
import pytest

import colift
from colift.flight import flight as flight_module
from colift.flight.flight import Flight, start_state
from colift.kernel.signals import HIDDEN, SIGNALS, columns, make_bus
from colift.mission import load_mission

G = 9.81


def arrays_of(recording):
    return {name: a for name, a in recording.arrays.items() if name != "allocator_time"}


def fly(name="figure-eight", **overrides):
    return Flight(load_mission(name, {"timing.duration": 2.0, **overrides})).run()


def test_same_mission_and_seed_give_identical_bits():
    first, second = arrays_of(fly(seed=5)), arrays_of(fly(seed=5))
    assert first.keys() == second.keys()
    for name in first:
        assert first[name].tobytes() == second[name].tobytes(), name


@pytest.mark.parametrize("chunk", [0.01, 0.137, 100.0])
def test_pausing_the_loop_does_not_change_the_numbers(monkeypatch, chunk):
    reference = arrays_of(fly())
    monkeypatch.setattr(flight_module, "CHUNK", chunk)
    paused = arrays_of(fly())
    for name in reference:
        np.testing.assert_array_equal(paused[name], reference[name])


def test_a_flown_flight_stays_as_it_is():
    flight = Flight(load_mission("hover", {"timing.duration": 1.5}))
    first = {name: a.copy() for name, a in arrays_of(flight.run()).items()}
    again = arrays_of(flight.run())
    for name in first:
        np.testing.assert_array_equal(again[name], first[name])


def test_rows_and_cycles_stand_at_their_instants():
    r = fly(**{"timing.recording": 0.02, "timing.allocation": 0.01, "timing.duration": 2.0})
    np.testing.assert_allclose(r.time, np.arange(101) * 0.02, atol=1e-12)
    np.testing.assert_allclose(r.cycle_time, np.arange(201) * 0.01, atol=1e-12)
    assert r.time[-1] == pytest.approx(2.0)
    assert all(len(r[s.name]) == 101 for s in SIGNALS)
    assert len(r["allocator_status"]) == len(r["allocator_time"]) == 201
    expected = r.mission.reference.sample(r.time)
    np.testing.assert_allclose(r["reference"], expected, atol=1e-12)


@pytest.mark.parametrize(
    ("layer", "signal"),
    [
        ("load_control", "force"),
        ("allocation", "desired_tensions"),
        ("position_control", "thrusts"),
        ("attitude_control", "torques"),
    ],
)
def test_a_layer_acts_at_its_own_rate(layer, signal):
    def changes(period):
        r = fly(**{f"timing.{layer}": period, "timing.recording": 0.001, "timing.duration": 0.5})
        moved = np.abs(np.diff(r[signal], axis=0)).reshape(500, -1).max(axis=1) > 0.0
        return np.flatnonzero(moved[99:]) + 100  # after the very start, where nothing moves yet

    slow = changes(0.010)
    np.testing.assert_array_equal(slow, np.arange(100, 501, 10))
    assert len(changes(0.001)) > 390


def test_controllers_are_told_their_period(monkeypatch):
    """An integral over 0.4 s of constant error is the same at 1 ms and at 10 ms."""
    errors = []
    for period in (0.001, 0.010):
        mission = load_mission(
            "hover",
            {
                "timing.load_control": period, "timing.duration": 0.2, "load_control.k_p": [0.0] * 3,
                "load_control.k_d": [0.0] * 3, "load_control.k_i": [1.0] * 3,
                "start.load_offset": [0.0, 0.0, 0.01],
            },
        )  # fmt: skip
        flight = Flight(mission)
        flight.run()
        errors.append(flight.wires.load_control.memory[2])
    assert errors[0] == pytest.approx(errors[1], rel=0.1)
    assert errors[0] > 1e-4


def test_events_change_the_truth_and_only_the_truth():
    """Hover with the ring: the load falls behind when it grows heavier, tensions grow with it."""
    overrides = {
        "timing.duration": 2.0, "timing.recording": 0.001, "allocation.kind": "ring",
        "events": [{"at": 1.0, "field": "load.mass", "value": 0.45}],
    }  # fmt: skip
    r = fly("payload-step", **overrides)
    plain = fly("payload-step", **{**overrides, "events": []})
    before, after = r.time < 1.0 - 1e-9, r.time > 1.0 - 1e-9
    for name in ("load", "tensions", "thrusts", "force"):
        np.testing.assert_array_equal(r[name][before], plain[name][before])
    first = np.flatnonzero(after)[0]
    assert r.time[first] == pytest.approx(1.0)
    # At that row: same state, same commands, another mass.
    np.testing.assert_allclose(r["load"][first], plain["load"][first], atol=1e-12)
    np.testing.assert_allclose(r["thrusts"][first], plain["thrusts"][first], atol=1e-12)
    assert (r["tensions"][first] > 1.3 * plain["tensions"][first]).all()
    assert r["load"][-1, 0, 2] < 1.0 - 0.01
    assert r.mission.load.mass == 0.225


def test_several_events_hold_from_their_time_on():
    events = [
        {"at": 1.0, "field": "load.mass", "value": 0.225},
        {"at": 0.5, "field": "load.mass", "value": 0.3},
    ]
    flight = Flight(load_mission("hover", {"timing.duration": 1.5, "events": events}))
    masses = []
    for _ in range(1500):
        flight.advance(0.001)
        masses.append(flight.wires.plant.params[0])
    assert masses == [0.225] * 500 + [0.3] * 500 + [0.225] * 500


def test_events_at_the_start_and_at_the_end_are_allowed():
    for at in (0.0, 0.5):
        events = [{"at": at, "field": "load.mass", "value": 0.3}]
        r = fly("hover", **{"timing.duration": 0.5, "events": events})
        assert len(r.time) == 101
        heavier = (
            r["tensions"][0].sum()
            > 1.15 * fly("hover", **{"timing.duration": 0.5})["tensions"][0].sum()
        )
        assert heavier == (at == 0.0)


def test_divergence_ends_the_flight():
    mission = load_mission(
        "hover",
        {
            "position_control.k_p": [1e9] * 3,
            "position_control.k_d": [0.0] * 3,
            "timing.duration": 60.0,
        },
    )
    seen = []
    r = Flight(mission).run(seen.append)
    assert r.outcome.startswith("diverged before t = ")
    assert r.time[-1] < 60.0
    assert len(r.time) == len(r["load"])
    assert seen[-1] < 1.0
    assert not np.isfinite(r["load"]).all()


def test_progress_is_called_up_to_one():
    seen = []
    colift.run("hover", timing__duration=3.5, progress=seen.append)
    assert len(seen) == 4
    assert seen == sorted(seen)
    assert seen[-1] == 1.0


def test_a_shorter_flight_is_the_beginning_of_a_longer_one():
    short, long = fly(**{"timing.duration": 0.7}), fly(**{"timing.duration": 1.4})
    for signal in SIGNALS:
        np.testing.assert_array_equal(long[signal.name][:141], short[signal.name])


def test_recording_less_often_picks_rows():
    dense, sparse = fly(**{"timing.recording": 0.001}), fly(**{"timing.recording": 0.01})
    for signal in SIGNALS:
        rows = dense[signal.name]
        picked = rows[::10]
        if signal.name in {"peak_tensions", "catch_impulses"}:  # largest since the row before
            picked = np.array(
                [rows[max(0, k - 9) : k + 1].max(axis=0) for k in range(0, len(rows), 10)]
            )
        np.testing.assert_array_equal(picked, sparse[signal.name])


def test_velocities_are_the_derivatives_of_positions():
    """Recorded states of a manoeuvre agree among themselves, whatever the plant."""
    r = fly(**{"timing.recording": 0.001})

    def slope(values):
        return (values[2:] - values[:-2]) / 0.002

    np.testing.assert_allclose(slope(r["load"][:, 0]), r["load"][1:-1, 1], atol=1e-5)
    np.testing.assert_allclose(slope(r["positions"]), r["velocities"][1:-1], atol=1e-3)
    np.testing.assert_allclose(slope(r["directions"]), r["direction_rates"][1:-1], atol=1e-3)
    spans = r["load"][:, :1] - r["positions"]
    np.testing.assert_allclose(spans, r["directions"], atol=1e-12)  # cables of 1 m


def test_slack_time_counts_every_step_without_tension():
    """A load thrown up is pushed by rods; the counter agrees with the recorded tensions."""
    r = fly(
        "hover",
        **{
            "plant.kind": "rigid-cables",
            "timing.duration": 0.5, "timing.recording": 0.001,
            "events": [{"at": 0.1, "field": "load.mass", "value": 1e-4}],
            "start.load_offset": [0.3, 0.0, 0.3],
        },
    )  # fmt: skip
    negative = np.cumsum(r["tensions"] < 0.0, axis=0) * 0.001
    np.testing.assert_allclose(r["slack_times"], negative, atol=1e-9)
    assert negative[-1].max() > 0.005


def test_allocator_time_is_measured():
    r = fly(**{"timing.duration": 0.5})
    assert (r["allocator_time"] > 0.0).all()
    assert np.median(r["allocator_time"]) < 1e-3


# ---------------------------------------------------------------- start and signals


@pytest.mark.parametrize("n", [1, 2, 3, 5, 8])
def test_start_is_in_balance(n):
    mission = load_mission("hover", {"drones.count": n, "start.load_offset": [0.1, 0.2, 0.3]})
    start, thrusts = start_state(mission)
    np.testing.assert_allclose(start.load_position, [0.1, 0.2, 1.3])
    np.testing.assert_allclose(np.linalg.norm(start.directions, axis=1), 1.0)
    w, x, y, z = start.attitudes.T
    axes = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=1)
    T = 0.225 * G / -start.directions[:, 2].sum()
    thrust = 0.5 * G * np.array([0.0, 0.0, 1.0]) - T * start.directions
    size = np.linalg.norm(thrust, axis=1)
    np.testing.assert_allclose(axes, thrust / size[:, None], atol=1e-12)
    np.testing.assert_allclose(thrusts, size, rtol=1e-12)
    # Observers begin with the thrust that acts.
    np.testing.assert_array_equal(Flight(mission).bus.thrusts, thrusts)


def test_start_directions_of_any_length():
    given = [[0.0, 3.0, -4.0], [1.0, 0.0, -1.0], [0.0, 0.0, -1e-3], [-1e5, 0.0, -1e5]]
    mission = load_mission("hover", {"start.directions": given})
    expected = np.array(given) / np.linalg.norm(given, axis=1, keepdims=True)
    np.testing.assert_allclose(start_state(mission)[0].directions, expected)


def test_without_gravity_and_weightless_cables_nothing_breaks():
    r = fly(
        "hover",
        **{
            "world.gravity": 0.0,
            "timing.duration": 0.2,
            "start.load_offset": [0.0] * 3,
            "allocation.kind": "sqp",
        },
    )
    assert all(np.isfinite(r[s.name]).all() for s in SIGNALS)


@pytest.mark.parametrize("n", [1, 4, 9])
def test_bus_holds_every_signal_once(n):
    bus, where = make_bus(n), columns(n)
    covered = np.zeros(bus.row.size, dtype=int)
    for k, signal in enumerate(SIGNALS):
        covered[where[signal.name]] += 1
        view = getattr(bus, signal.name)
        assert view.shape == signal.shape_for(n)
        view[...] = k
        assert (bus.row[where[signal.name]] == k).all()
    assert (covered == 1).all()
    names = ["row", *(signal.name for signal in (*HIDDEN, *SIGNALS))]
    assert list(bus._fields) == names
