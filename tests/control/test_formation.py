"""Observers of momentum, the load on the formation, and the pendulum below one or two drones."""

from __future__ import annotations

import math

import numpy as np
import pytest

import colift
from colift.catalogue import vehicle_names
from colift.control.load_control.balance import Balance
from colift.control.observation.momentum import Momentum
from colift.control.tuning import pendulum_gains
from colift.flight.flight import Flight
from colift.kernel.math import rotors
from colift.mission import load_mission
from colift.record import metrics
from colift.team import Team
from colift.team.vehicles import Vehicle

G = 9.81
TOLD = {"delay": 0.0, "period": 0.01}
CONTROLLERS = {
    "load_control": {"kind": "balance"},
    "observation": {"kind": "momentum"},
    "position_control": {"kind": "formation"},
    "attitude_control": {"kind": "delay-aware"},
}
REAL = {
    "sensing": {"kind": "noisy"},
    "estimation": {"kind": "predictor"},
    "actuation": {"kind": "motors"},
}
PERIODS = dict.fromkeys(
    ("load_control", "allocation", "position_control", "attitude_control"), 0.01
)

LATE = {"duration": 12.0, "delay": 0.02, **PERIODS}


def fly(n=4, duration=15.0, reference="hover", push=(0.0, 0.0, 0.0), **sections):
    table = {
        "name": "test",
        "drones": {"count": n},
        "reference": {"kind": reference},
        "timing": {"duration": duration, **PERIODS},
        "actuation": {"kind": "ideal"},
        **CONTROLLERS,
    }
    if n <= 2:
        table["allocation"] = {"max_rate": 1.0, "min_angle_deg": 20.0}
    if any(push):
        table["disturbance"] = [{"kind": "push", "force": list(push), "duration": 1e3}]
    return Flight(load_mission({**table, **sections})).run()


def off(recording):
    """Distance from the reference (rows,), m."""
    return np.linalg.norm(metrics.tracking_error(recording), axis=1)


def settled(recording):
    """Largest distance from the reference in the last fifth of a flight, m."""
    return off(recording)[-len(recording.time) // 5 :].max()


@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_a_wrong_mass_of_the_load_leaves_no_error(n):
    flight = fly(n, truth={"load_mass_factor": 1.4})
    assert settled(flight) < 2e-3
    missing = flight["estimated_forces"][-1].sum(axis=0)
    np.testing.assert_allclose(missing, [0.0, 0.0, -0.4 * 0.225 * G], atol=0.01)


@pytest.mark.parametrize("n", [1, 2, 4])
def test_a_steady_push_on_the_load_is_found_and_leant_against(n):
    flight = fly(n, push=(0.4, -0.2, 0.0))
    assert settled(flight) < 3e-3
    np.testing.assert_allclose(
        flight["estimated_forces"][-1].sum(axis=0), [0.4, -0.2, 0.0], atol=0.01
    )
    np.testing.assert_allclose(flight["estimated_forces"][-1, -1, :2], [0.4, -0.2], atol=0.05)
    # The formation leans: the wanted force is what the load is pushed by, the other way round.
    np.testing.assert_allclose(flight["force"][-1, :2], [-0.4, 0.2], atol=0.05)


@pytest.mark.parametrize("n", [1, 2])
def test_a_load_that_starts_off_its_place_swings_no_more_after_two_periods(n):
    flight = fly(n, duration=8.0, start={"load_offset": [0.2, -0.1, 0.0]})
    period = 2.0 * math.pi * math.sqrt(1.0 / G)
    error = off(flight)
    assert error[0] > 0.2
    assert error[flight.time > 3.0 * period].max() < 0.02


@pytest.mark.parametrize("n", [1, 2])
def test_one_and_two_drones_fly_a_figure_eight(n):
    flight = fly(n, duration=20.0, reference="figure-eight")
    assert off(flight).max() < 0.02


def test_a_drone_with_slow_motors_flies_a_figure_eight():
    """Its loops are slow; what the load's jerk asks for must not wait for them."""
    lag = {"max_thrust": 520.0, "mass": 19.4, "arm": 0.7, "motor_lag": 0.08, "count": 1}
    flight = fly(
        1,
        duration=15.0,
        reference="figure-eight",
        drones={**lag, "cable_length": 1.8},
        load={"mass": 10.5},
        actuation={"kind": "motors"},
    )
    assert off(flight).max() < 0.12


def test_heavy_drones_hold_a_light_load():
    """What is misjudged of their thrust is many times the load's weight."""
    body = {"mass": 18.0, "max_thrust": 360.0, "arm": 0.6, "count": 8, "cable_length": 3.6}
    flight = fly(8, duration=12.0, drones=body, load={"mass": 1.1}, timing=LATE, allocation={})
    assert off(flight).max() < 0.02
    assert float(metrics.compute(flight)["slack_time_s"]) == 0.0


def test_a_light_load_on_long_cables_does_not_rock_its_drones():
    """Cables that answer fast move heavy drones far, for what is misjudged of that very motion."""
    body = {"mass": 20.0, "max_thrust": 370.0, "arm": 0.6, "count": 6, "cable_length": 14.5}
    flight = fly(6, duration=20.0, drones=body, load={"mass": 1.8}, actuation={"kind": "motors"})
    assert off(flight).max() < 0.02


@pytest.mark.parametrize(("height", "band"), [(0.3, 9.0), (1.0, 9.0), (10.0, 7.0), (0.5, 3.0)])
def test_pendulum_gains_place_the_four_poles(height, band):
    k1, k2, k3, k4 = pendulum_gains(G, height, band)
    wp = math.sqrt(G / height)
    # Drone error y, its rate, load error x, its rate.
    A = [[0, 1, 0, 0], [-k2, -k1, -k4, -k3], [0, 0, 0, 1], [wp**2, 0, -(wp**2), 0]]
    slow = min(1.0, 0.4 * band / wp)
    b = min(2.0 * slow * wp, 0.3 * band)
    wanted = np.polymul([1.0, slow * wp, wp**2], [1.0, b, b**2])
    np.testing.assert_allclose(np.poly(np.array(A, dtype=float)), wanted, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("speed", [0.0, 3.0, 10.0])
def test_thrust_for_a_force_and_the_drag_of_the_rotors_are_inverse(speed):
    force, wind = (1.0, -2.0, 6.0), (speed, 0.3 * speed, -0.1 * speed)
    thrust = np.array(rotors.thrust_for(*force, 0.05, wind))
    size = np.linalg.norm(thrust)
    drag = np.array(rotors.drag(size, thrust / size, 0.05, wind))
    np.testing.assert_allclose(thrust + drag, force, atol=2e-3 * np.linalg.norm(force))


def test_balance_carries_weight_and_acceleration_less_what_pushes_the_load():
    part, team = Balance(**TOLD), Team.uniform(4)
    reference = np.zeros((4, 3))
    reference[2] = [0.5, 0.0, 1.0]
    forces, memory = np.zeros((5, 3)), part.memory(team)
    forces[4] = [0.1, 0.0, -0.3]
    for _ in range(1000):
        writes, _ = part.call(
            team, memory, dt=0.01, reference=reference, estimated_forces=forces
        )  # fmt: skip
    weight = 0.225 * (np.array([0.5, 0.0, 1.0]) + [0.0, 0.0, G])
    np.testing.assert_allclose(writes.force, weight - forces[4], rtol=1e-6)


def test_forces_are_bounded_and_do_not_wind_up():
    part, team = Momentum(limit=0.5, **TOLD), Team.uniform(4)
    memory = part.memory(team)
    state = {"estimated_attitudes": np.tile([1.0, 0.0, 0.0, 0.0], (4, 1))}
    state["estimated_positions"] = np.array([[1.0, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1]])
    for k in range(400):
        # All fall freely sideways at 5 g: far beyond the bound.
        speeds = np.tile([5.0 * G * 0.01 * k, 0.0, 0.0], (4, 1))
        writes, _ = part.call(team, memory, dt=0.01, estimated_velocities=speeds, **state)
        own = np.linalg.norm(writes.estimated_forces[:4], axis=1)
        assert own.max() <= 0.5 * 0.5 * G * (1.0 + 1e-9)
        total = np.linalg.norm(writes.estimated_forces.sum(axis=0))
        assert total <= 0.5 * 4 * 0.5 * G * (1.0 + 1e-9)
    held = speeds.copy()
    for _ in range(300):
        thrusts = np.full(4, 0.5 * G + 0.25 * 0.225 * G)
        writes, _ = part.call(
            team, memory, dt=0.01, estimated_velocities=held, thrusts=thrusts, **state
        )  # fmt: skip
    assert np.linalg.norm(writes.estimated_forces.sum(axis=0)) < 0.05


@pytest.mark.parametrize("vehicle", vehicle_names())
@pytest.mark.parametrize("n", [1, 3])
def test_every_vehicle_holds_a_load_with_gains_of_its_own(vehicle, n):
    """Only the vehicle, the cables and the load are given; motors, noise and 20 ms of delay."""
    mass, radius = Vehicle.named(vehicle).mass, Team.uniform(1, vehicle=vehicle).radii[0]
    allocation = {"mu_scaling": "weight"} | ({"max_rate": 1.0} if n == 1 else {"max_rate": 0.2})
    flight = fly(
        n,
        drones={"vehicle": vehicle, "count": n, "cable_length": float(np.fmax(1.5, 3.5 * radius))},
        load={"mass": 0.3 * mass},
        truth={"load_mass_factor": 1.2},
        timing={"duration": 20.0, "delay": 0.02, **PERIODS},
        allocation=allocation,
        **REAL,
    )
    assert flight.outcome == "completed"
    assert settled(flight) < 0.02


def test_what_the_mission_has_is_what_controllers_are_told():
    table = {
        "name": "test",
        "drones": {"vehicle": "x500", "count": 3},
        "reference": {"kind": "hover"},
        "timing": {"delay": 0.03, **PERIODS},
        **CONTROLLERS,
        **REAL,
    }
    mission = load_mission(table)
    drone = Vehicle.named("x500").numbers()
    for layer in CONTROLLERS:
        part = getattr(mission, layer)
        assert (part.delay, part.period) == (0.03, 0.01)
        assert part.lag == drone["motor_lag"]
    assert mission.position_control.max_thrust == pytest.approx(0.95 * drone["max_thrust"])
    told = load_mission(table, {"position_control.lag": 0.005, "timing.delay": 0.01})
    assert told.position_control.lag == 0.005
    assert told.observation.delay == 0.01
    # The resolved mission says it all, and flies the same.
    assert load_mission(mission.resolved()).resolved() == mission.resolved()


@pytest.mark.parametrize("factor", [1.0, 1.5])
def test_the_real_world_is_flown_on_motors(factor):
    """10 m/s of wind with gusts, 20 ms of delay at 100 Hz, noise, rotors that drag, and half the load unknown."""
    for seed in range(3000, 3003):
        run = colift.run("real-world", seed=seed, truth__load_mass_factor=factor)
        assert run.mission.kinds["position_control"] == "formation"
        assert run.mission.kinds["actuation"] == "motors"
        assert run.verdict.ok, run.verdict.reasons
        assert {each.metric for each in run.verdict.judged if each.asked} == set(
            run.mission.criteria
        )
