"""Controllers that cope: what they learn, observe and predict, each against what must come out."""

from __future__ import annotations

import math

import numpy as np
import pytest

import colift
from colift.control.attitude_control.delay_aware import DelayAware
from colift.control.estimation.predictor import Predictor, steady_gains
from colift.control.load_control.adaptive import Adaptive
from colift.control.position_control import disturbance_observer as observer
from colift.control.position_control.disturbance_observer import DisturbanceObserver
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.team import Team

PERIOD = 0.01
HOVER = {
    "name": "hover", "reference": {"kind": "hover"},
    "timing": {"duration": 20.0, "load_control": PERIOD, "allocation": PERIOD,
               "position_control": PERIOD, "attitude_control": PERIOD},
    "load_control": {"kind": "adaptive", "delay": 0.0},
    "position_control": {"kind": "disturbance-observer", "delay": 0.0},
    "attitude_control": {"kind": "delay-aware", "delay": 0.0},
}  # fmt: skip


UPRIGHT = np.array([[1.0, 0.0, 0.0, 0.0]])

# ---------------------------------------------------------------- the learned mass


@pytest.mark.parametrize("factor", [0.5, 0.8, 1.5])
def test_the_mass_of_the_load_is_learned(factor):
    flight = Flight(load_mission(HOVER, {"truth.load_mass_factor": factor}))
    flight.run()
    learned = 1.0 + flight.wires.load_control.memory[0]
    assert learned == pytest.approx(factor, rel=0.02)
    error = flight.bus.load[0] - flight.bus.reference[0]
    assert np.linalg.norm(error) < 2e-3


def test_the_learned_mass_stays_in_its_bounds_whatever_happens():
    part, team = Adaptive(lower=0.6, upper=1.4), Team.uniform(4)
    memory, force = part.memory(team), np.zeros(3)
    for direction, bound in ((-1.0, 1.4), (1.0, 0.6)):
        load = np.array([[0.3, -0.2, direction], [0.0, 0.0, 0.5 * direction]])
        for _ in range(
            2_000
        ):  # a disturbance that never ends: a second of it brings the estimate there
            part.call(team, memory, dt=PERIOD, estimated_load=load, force=force)
        assert 1.0 + memory[0] == pytest.approx(bound)
        lean = math.hypot(force[0], force[1]) / force[2]
        assert lean <= math.tan(math.radians(part.max_lean_deg)) * (1.0 + 1e-12)
        assert force[2] > 0.0


def test_without_an_error_the_law_is_weight_and_acceleration():
    part, team = Adaptive(), Team.uniform(4)
    force, reference = np.zeros(3), np.zeros((4, 3))
    reference[2] = [0.7, -0.4, 0.2]
    part.call(
        team, part.memory(team), dt=PERIOD, estimated_load=reference[:2], reference=reference,
        force=force,
    )  # fmt: skip
    np.testing.assert_allclose(force, team.load_mass * (reference[2] + [0.0, 0.0, team.gravity]))


# ---------------------------------------------------------------- the observed wind


def test_a_steady_wind_on_the_drones_leaves_no_error():
    wind = [{"kind": "wind", "speed": 6.0, "ramp": 1.0}, {"kind": "drag"}]
    with_it, without = (
        colift.run(HOVER, overrides={"disturbance": wind, **change}).recording
        for change in ({}, {"position_control.observer_limit": 0.0})
    )
    late = with_it.time > 3.0
    errors = [
        np.linalg.norm(r["load"][late, 0] - r["reference"][late, 0], axis=1).max()
        for r in (with_it, without)
    ]
    assert errors[0] < 2e-3
    assert errors[0] < 0.3 * errors[1]


class Observed:
    """The position controller of n drones that hang free of any load, and the forces that it observes."""

    def __init__(self, n: int, **settings: float) -> None:
        self.part, self.team = DisturbanceObserver(delay=0.0, **settings), Team.uniform(n)
        self.memory = self.part.memory(self.team)
        self.velocities = np.zeros((n, 3))
        self.thrusts = np.zeros(n)

    def fly(self, axes: np.ndarray, pushes: np.ndarray, offset: float = 0.0) -> np.ndarray:
        """One period with thrust along ``axes`` and forces ``pushes`` (n, 3); the observed forces (n, 3)."""
        n, g = self.team.n, self.team.gravity
        half = np.hstack([1.0 + axes[:, 2:], -axes[:, 1:2], axes[:, :1], np.zeros((n, 1))])
        q = half / np.linalg.norm(half, axis=1, keepdims=True)
        tilt, height = 0.6, 0.8
        turn = 2.0 * np.pi * np.arange(n) / n
        alpha = np.stack([tilt * np.cos(turn), tilt * np.sin(turn), np.full(n, -height)], axis=1)
        places = -self.team.cable_lengths[:, None] * alpha + [offset, 0.0, 0.0]
        writes, _ = self.part.call(
            self.team, self.memory, dt=PERIOD, estimated_positions=places,
            estimated_velocities=self.velocities, estimated_attitudes=q, received_directions=alpha,
            thrusts=self.thrusts,
        )  # fmt: skip
        self.u = writes.drone_forces
        pull = self.thrusts[:, None] * axes - self.team.masses[:, None] * [0.0, 0.0, g]
        self.velocities += PERIOD * (pull + pushes) / self.team.masses[:, None]
        self.wind = observer.MEMORY.view(self.memory, "wind")[0]
        return observer.MEMORY.view(self.memory, "force")


def test_a_drone_that_points_elsewhere_is_not_taken_for_one_in_the_wind():
    observed, angle = Observed(3), np.radians(25.0)
    axes = np.tile([np.sin(angle), 0.0, np.cos(angle)], (3, 1))
    for _ in range(30):
        forces = observed.fly(axes, np.zeros((3, 3)))
    assert np.linalg.norm(observed.velocities, axis=1).min() > 0.5  # it goes where it points
    assert np.abs(forces).max() < 1e-9


def test_the_wind_is_what_most_drones_feel():
    wind, lost = np.array([0.8, -0.5, 0.1]), np.array([0.0, 0.0, -2.3])
    for n in (3, 4, 8):
        observed = Observed(n)
        up, pushes = np.tile([0.0, 0.0, 1.0], (n, 1)), np.tile(wind, (n, 1))
        for _ in range(200):
            observed.fly(up, pushes)
        np.testing.assert_allclose(observed.wind, wind, atol=2e-2)
        pushes[1] += lost
        for _ in range(15):
            forces = observed.fly(up, pushes)
        assert forces[1, 2] < -0.6
        # A mean would go wrong by as much over n, or more.
        assert np.linalg.norm(observed.wind - wind) < 0.25 * abs(forces[1, 2]) / n


def test_a_drone_far_off_is_pulled_back_no_harder_than_it_can_turn():
    for offset in (0.5, 50.0):
        observed = Observed(1, max_push=3.0)
        observed.fly(np.array([[0.0, 0.0, 1.0]]), np.zeros((1, 3)), offset)
        m, g = observed.team.masses[0], observed.team.gravity
        np.testing.assert_allclose(observed.u[0], m * np.array([-3.0, 0.0, g]), atol=1e-9)


# ---------------------------------------------------------------- silent sensors


def test_an_attitude_is_turned_by_its_torques_while_the_rate_is_not_measured():
    ends, ages = [], np.zeros((2, 3))
    for coast in (0.1, 0.0):
        part, team = DelayAware(delay=0.0, coast=coast), Team.uniform(1)
        memory, tau = part.memory(team), np.zeros((1, 3))
        angle, rate = 0.3, 0.0
        seen = (angle, rate)
        for k in range(30):
            if k < 20:
                seen = (angle, rate)
            ages[0] = PERIOD * max(k - 19, 0)
            q = np.array([[np.cos(0.5 * seen[0]), np.sin(0.5 * seen[0]), 0.0, 0.0]])
            Omega = np.array([[seen[1], 0.0, 0.0]])
            part.call(
                team, memory, dt=PERIOD, estimated_attitudes=q, estimated_rates=Omega,
                estimated_ages=ages, desired_attitudes=UPRIGHT, torques=tau,
            )  # fmt: skip
            torque = tau[0, 0] / team.inertias[0, 0]
            angle += PERIOD * (rate + 0.5 * PERIOD * torque)
            rate += PERIOD * torque
        ends.append((abs(angle), abs(rate)))
    assert ends[0][0] < 0.1
    assert ends[0][1] < 0.7
    assert ends[1][1] > 4.0 * ends[0][1]  # nobody braked


def test_sampling_is_not_taken_for_silence():
    """What the estimator makes up for between two samples is not made up for twice."""
    team, torques = Team.uniform(1), []
    for held in (1, 8):
        part = DelayAware(delay=0.02)
        memory, tau = part.memory(team), np.zeros((1, 3))
        for k in range(200):
            angle = 0.1 * np.sin(0.02 * k)
            q = np.array([[np.cos(0.5 * angle), np.sin(0.5 * angle), 0.0, 0.0]])
            part.call(
                team, memory, estimated_attitudes=q, estimated_ages=np.full((2, 3), 1e-3 * (k % held)),
                desired_attitudes=UPRIGHT, torques=tau,
            )  # fmt: skip
        torques.append(tau[0, 0])
    assert torques[1] == pytest.approx(torques[0], rel=1e-6)


def test_a_silent_drone_is_carried_forward_and_then_left_standing():
    part = Predictor(delay=0.0, attitude_delay=0.0, coast=0.1)
    watched = Watched(part, 0)
    m, g = watched.team.masses[0], watched.team.gravity
    load, alpha = np.zeros((2, 3)), np.array([[0.0, 0.0, -1.0]])
    seen = []
    for k in range(1000):
        silent = 500 <= k < 900
        x = 1e-3 * (499 if silent else k)
        watched.look(
            k, load, np.array([[x, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0]]), np.array([m * g]),
            np.zeros(1), alpha, age=1e-3 * (k - 499) if silent else 0.0,
        )  # fmt: skip
        seen.append(watched.out[1][0, 0])
    assert seen[560] == pytest.approx(0.560, abs=2e-3)  # at the speed it had
    assert seen[620] == seen[890] == pytest.approx(0.600, abs=8e-3)
    assert seen[910] == pytest.approx(0.910, abs=2e-3)  # believed at once


# ---------------------------------------------------------------- the prediction


def test_steady_gains_solve_the_riccati_equation():
    T, position, velocity, walk = 0.005, 0.002, 0.02, 1.0
    K, surprise = steady_gains(T, position, velocity, walk)
    # A filter with these gains, simulated: its surprises have the promised size.
    rng, F = np.random.default_rng(0), np.array([[1, T, T * T / 2], [0, 1, T], [0, 0, 1.0]])
    truth, guess, seen = np.zeros(3), np.zeros(3), []
    for _ in range(60_000):
        jerk = rng.normal() * walk / math.sqrt(T)
        truth = F @ truth + np.array([T**3 / 6.0, T**2 / 2.0, T]) * jerk
        guess = F @ guess
        z = truth[:2] + rng.normal(size=2) * [position, velocity]
        seen.append(z - guess[:2])
        guess = guess + K @ seen[-1]
    assert np.std(seen[1000:], axis=0) == pytest.approx(surprise, rel=0.03)


class Watched:
    """A predictor and one drone beside a load at rest; both are measured ``late`` steps after they moved."""

    def __init__(self, part: Predictor, late: int, n: int = 1) -> None:
        self.part, self.late, self.team = part, late, Team.uniform(n)
        self.memory, self.params = part.memory(self.team), part.params(self.team)
        self.out = [np.zeros((2, 3)), np.zeros((n, 3)), np.zeros((n, 3)), np.zeros((n, 4)), np.zeros((n, 3))]  # fmt: skip

    def look(self, k, load, positions, velocities, thrusts, tensions, directions, age=0.0):
        names = ("load", "positions", "velocities", "attitudes", "rates")
        estimated = {f"estimated_{n}": out for n, out in zip(names, self.out, strict=True)}
        self.part.call(
            self.team, self.memory, params=self.params, step=k, measured_load=load, measured_positions=positions,
            measured_velocities=velocities, measured_attitudes=np.tile(UPRIGHT, (self.team.n, 1)),
            measured_ages=np.full((self.team.n + 1, 3), age), thrusts=thrusts,
            received_tensions=tensions, received_directions=directions, **estimated,
        )  # fmt: skip


def test_what_thrust_and_tension_explain_is_predicted_exactly():
    late, h = 20, 1e-3
    part = Predictor(delay=late * h, attitude_delay=0.0, period=0.005)
    watched = Watched(part, late)
    m, g = watched.team.masses[0], watched.team.gravity
    thrust, tension, alpha = m * g + 1.0, 0.3, np.array([[0.0, 0.6, -0.8]])
    acceleration = np.array([0.0, 0.0, thrust / m - g]) + tension * alpha[0] / m
    load_pull = -tension * alpha[0] / watched.team.load_mass - [0.0, 0.0, g]

    def at(k: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        t = k * h
        return 0.5 * t * t * acceleration, t * acceleration, 0.5 * t * t * load_pull, t * load_pull

    for k in range(1500):
        taken = max(k - late, 0) // 5 * 5
        x, v, xl, vl = at(taken)
        watched.look(
            k, np.array([xl, vl]), x[None], v[None], np.array([thrust]), np.array([tension]), alpha,
            age=h * (k - taken),
        )  # fmt: skip
    x, v, xl, vl = at(1499)
    np.testing.assert_allclose(watched.out[1][0], x, atol=2e-3)
    np.testing.assert_allclose(watched.out[2][0], v, atol=5e-3)
    np.testing.assert_allclose(watched.out[0], [xl, vl], atol=2e-2)
    # The measurement alone is far off.
    assert np.linalg.norm(at(1479)[2] - xl) > 0.1


def test_the_load_is_found_from_the_drones_alone():
    changes = {"estimation": {"kind": "predictor", "delay": 0.0, "attitude_delay": 0.0}}
    for source, limit in (("sensor", 0.02), ("cables", 0.03)):
        flight = Flight(load_mission(HOVER, {**changes, "estimation.load_from": source}))
        recording = flight.run()
        late = recording.time > 5.0
        off = recording["estimated_load"][late, 0] - recording["load"][late, 0]
        assert np.linalg.norm(off, axis=1).max() < limit, source


def test_absurd_measurements_leave_finite_estimates():
    part = Predictor()
    watched, rng = Watched(part, 0, n=3), np.random.default_rng(0)
    for k in range(500):
        size = 10.0 ** rng.uniform(-3.0, 6.0)
        watched.look(
            k, size * rng.normal(size=(2, 3)), size * rng.normal(size=(3, 3)),
            size * rng.normal(size=(3, 3)), size * rng.random(3), size * rng.random(3),
            rng.normal(size=(3, 3)),
        )  # fmt: skip
        assert all(np.isfinite(each).all() for each in watched.out)


# ---------------------------------------------------------------- all of them together


LAYERS_WITH_LAG = ("estimation", "load_control", "position_control", "attitude_control")
IDEAL_ROTORS = {
    "actuation": {"kind": "ideal"}, "disturbance.3.rotor_drag": 0.0,
    **{f"{layer}.lag": 0.0 for layer in LAYERS_WITH_LAG},
}  # fmt: skip


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_the_real_world_is_coped_with_on_ideal_rotors(seed, factor):
    """10 m/s of wind with gusts, 20 ms of delay at 100 Hz, noise and half the load unknown."""
    changes = {**IDEAL_ROTORS, "truth.load_mass_factor": factor}
    run = colift.run("real-world-adaptive", seed=seed, overrides=changes)
    assert run.verdict.ok, run.verdict.reasons
    assert {each.metric for each in run.verdict.judged if each.asked} == set(run.mission.criteria)


@pytest.mark.xfail(
    reason="on motors in the storm the load strays by up to 0.7 m: see docs/theory/control.md"
)
@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_on_real_motors_it_is_flown_but_not_always_within_its_criteria(factor):
    """docs/theory/control.md says how often; nobody is lost, and cables keep their angle."""
    for seed in range(1000, 1004):
        run = colift.run("real-world-adaptive", seed=seed, truth__load_mass_factor=factor)
        assert run.mission.kinds["actuation"] == "motors"
        assert run.verdict.level != "lost"
        assert run.metrics["tracking_max_m"] < 0.25
        assert run.metrics["min_angle_deg"] > 25.0
        assert run.metrics["lost_drones"] == 0.0


@pytest.mark.parametrize("kind", ["cable-cut", "drone-lost"])
def test_a_drone_lost_on_top_of_it_is_survived(kind):
    fault = [{"kind": kind, "at": 6.5, "drone": 1}]
    flight = Flight(
        load_mission("real-world-adaptive", {**IDEAL_ROTORS, "fault": fault, "seed": 3})
    )
    r = flight.run()
    assert r.outcome == "completed"
    assert [drone for _, drone in flight.membership.found] == [1]
    error = np.linalg.norm(r["load"][:, 0] - r["reference"][:, 0], axis=1)
    assert error[r.time > 9.5].max() < 0.15


def test_a_drone_whose_sensors_stand_still_is_let_go_before_it_does_harm():
    fault = [{"kind": "sensor-stuck", "at": 6.0, "drone": 2, "duration": 1e3}]
    changes = {**IDEAL_ROTORS, "fault": fault, "truth.load_mass_factor": 1.0}
    flight = Flight(load_mission("real-world-adaptive", changes))
    r = flight.run()
    assert r.outcome == "completed"
    ((when, drone),) = flight.membership.found
    assert drone == 2
    assert 0.06 < when - 6.0 < 0.2
    error = np.linalg.norm(r["load"][:, 0] - r["reference"][:, 0], axis=1)
    assert error.max() < 0.15
