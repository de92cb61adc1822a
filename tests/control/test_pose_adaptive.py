"""A rigid load that is told wrong: what is learned of it, that it stays in bounds, and what it is good for."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from colift.control.load_control.pose import Pose
from colift.control.load_control.pose_adaptive import LEARNING, MEMORY, PoseAdaptive
from colift.control.reference.figure_eight import FigureEight
from colift.flight.flight import Flight
from colift.kernel.math import inertial
from colift.kernel.ports import PORTS
from colift.mission import load_mission
from colift.record import metrics
from colift.team import Body, Team
from colift.team.geometry import Array, matrix_of
from colift.team.load import box_inertia, parallel_axis, usual_attachments

SIZE = np.array([0.6, 0.4, 0.2])
BOX = Body(inertia=box_inertia(0.5, SIZE), attachments=usual_attachments(4, SIZE), size=SIZE)
TEAM = replace(Team.uniform(4), load_mass=0.5, body=BOX)
TOLD = np.array([0.5, 0.0, 0.0, 0.0, *np.diag(BOX.inertia), 0.0, 0.0, 0.0])
PORT = PORTS["load_control"]


def wired(law: PoseAdaptive, team: Team = TEAM) -> tuple[Any, dict[str, Array]]:
    signals = PORT.signals(team.n)
    return PORT.wire(type(law).kernel, law.params(team), law.memory(team), signals), signals


def numbers_of(mass: float, centre: Array, inertia: Array) -> Array:
    about = inertia + mass * parallel_axis(centre)
    products = about[1, 2], about[0, 2], about[0, 1]
    return np.array([mass, *(mass * centre), *np.diag(about), *products])


def learned_by_a_body_that_gets_what_is_asked(
    law: PoseAdaptive, true: Any, seconds: float
) -> Array:
    """What is learned (steps, 10) of a true load (mass, centre, inertia) that turns through an eight; forces are observed at once."""
    (mass, centre, inertia), dt, up = true, 0.004, np.array([0.0, 0.0, TEAM.gravity])
    reference = FigureEight(roll_deg=40.0, pitch_deg=35.0, yaw_deg=60.0, period=3.0, ramp=2.0)
    wire, signals = wired(law)
    (x, v, *_), q, (W, *_) = reference.pose(TEAM)
    found = []
    for step in range(round(seconds / dt)):
        motion, attitude, rates = reference.pose(TEAM, step * dt)
        signals["reference"][:], signals["reference_attitude"][:] = motion, attitude
        signals["reference_rates"][:], signals["estimated_load"][:] = rates, (x, v)
        signals["estimated_load_attitude"][:], signals["estimated_load_rates"][:] = q, W
        PORT.invoke(wire, step, step * dt, dt)
        R, F = matrix_of(q), signals["force"]
        M = R.T @ signals["moment"] - np.cross(centre, R.T @ F)
        spin = np.linalg.solve(inertia, M - np.cross(W, inertia @ W))
        arm = np.cross(spin, centre) + np.cross(W, np.cross(W, centre))
        a = F / mass - up - R @ arm
        signals["estimated_forces"][-1] = TEAM.load_mass * (a + up) - F
        v = v + dt * a
        x, W = x + dt * v, W + dt * spin
        angle = max(float(np.linalg.norm(dt * W)), 1e-12)
        c, s = math.cos(0.5 * angle), math.sin(0.5 * angle) / angle * dt * W
        q = np.array([c * q[0] - s @ q[1:], *(c * q[1:] + q[0] * s + np.cross(q[1:], s))])
        found.append(MEMORY.view(wire.memory, "learned").copy())
    return np.array(found)


def test_mass_centre_and_inertia_are_learned_from_a_motion_that_turns_and_leans() -> None:
    inertia = box_inertia(0.6, SIZE) * 1.3
    inertia[0, 1] = inertia[1, 0] = 0.002
    true = 0.6, np.array([0.03, -0.02, 0.025]), inertia
    law = PoseAdaptive(
        place=2.0, integral=0.0, learning=2.0, inertia_learning=100.0, weighing=2.0
    )  # fmt: skip
    found = learned_by_a_body_that_gets_what_is_asked(law, true, 30.0)
    wrong = numbers_of(*true) - TOLD
    left = wrong - found[-1]
    assert abs(left[0]) < 0.01 * wrong[0]
    assert np.linalg.norm(left[1:4]) < 0.05 * np.linalg.norm(wrong[1:4])
    assert np.linalg.norm(left[4:]) < 0.2 * np.linalg.norm(wrong[4:])


def test_what_is_told_right_stays_as_it_is_told() -> None:
    true = 0.5, np.zeros(3), BOX.inertia
    found = learned_by_a_body_that_gets_what_is_asked(PoseAdaptive(place=2.0), true, 8.0)
    assert np.abs(found[:, :4]).max() < 0.005
    assert np.abs(found[:, 4:]).max() < 0.05 * BOX.inertia[0, 0]


def test_the_law_moves_a_load_of_any_numbers_as_told_ones() -> None:
    """What more a load with these numbers needs, and the slopes of the moment, by finite differences of the formulas."""
    rng = np.random.default_rng(4)
    theta, s, W, a, u = (rng.normal(size=k) for k in (10, 3, 3, 3, 3))
    F, M = (np.array(each) for each in inertial.needed(theta, tuple(W), tuple(a), tuple(u)))
    m, h = theta[0], theta[1:4]
    xx, yy, zz, yz, xz, xy = theta[4:]
    I = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])  # noqa: E741
    assert pytest.approx(m * u + np.cross(a, h) + np.cross(W, np.cross(W, h))) == F
    assert pytest.approx(I @ a + np.cross(W, I @ W) + np.cross(h, u)) == M
    slopes = inertial.slopes(tuple(s), tuple(W), tuple(a), tuple(u))
    for j, slope in enumerate(slopes):
        more = theta + np.eye(10)[j + 1]
        changed = np.array(inertial.needed(more, tuple(W), tuple(a), tuple(u))[1])
        assert s @ (changed - M) == pytest.approx(slope)


@pytest.mark.parametrize("size", [1.0, 1e3, 1e200, math.inf, math.nan])
def test_whatever_is_measured_what_is_learned_stays_in_bounds(size: float) -> None:
    law = PoseAdaptive(learning=5.0, inertia_learning=100.0, weighing=5.0)
    wire, signals = wired(law)
    own = law.params(TEAM)[-LEARNING.size(0) :]
    lower, upper = LEARNING.view(own, "lower"), LEARNING.view(own, "upper")
    rng = np.random.default_rng(5)
    for step in range(2000):
        for name in ("estimated_load_rates", "reference_rates", "estimated_forces", "reference"):
            signals[name][...] = size * rng.normal(size=signals[name].shape)
        attitude = rng.normal(size=4)
        signals["estimated_load_attitude"][:] = attitude / np.linalg.norm(attitude)
        PORT.invoke(wire, step, 0.01 * step, 0.01)
        found = MEMORY.view(wire.memory, "learned")
        assert ((lower <= found) & (found <= upper)).all()
        assert np.isfinite(signals["learned_load"]).all()
    assert 0.5 + lower[0] > 0.0


def test_a_bar_on_two_cables_teaches_nothing_by_its_turns_about_them() -> None:
    bar = np.array([1.2, 0.06, 0.06])
    body = Body(inertia=box_inertia(0.4, bar), attachments=usual_attachments(2, bar), size=bar)
    team = replace(Team.uniform(2), load_mass=0.4, body=body)
    for axis, moves in ((0, False), (1, True)):
        wire, signals = wired(PoseAdaptive(), team)
        signals["estimated_load_rates"][axis] = 0.3
        PORT.invoke(wire, 0, 0.0, 0.01)
        assert bool(np.any(MEMORY.view(wire.memory, "learned")[1:])) == moves


def test_without_learning_it_is_the_law_that_learns_nothing() -> None:
    still = PoseAdaptive(learning=0.0, weighing=0.0, integral=0.3)
    rng = np.random.default_rng(6)
    wires = [wired(still), (None, PORT.signals(4))]
    plain = Pose()
    signals = wires[1][1]
    wires[1] = (PORT.wire(Pose.kernel, plain.params(TEAM), plain.memory(TEAM), signals), signals)
    for name in ("estimated_load", "reference", "reference_rates", "estimated_load_rates"):
        values = 0.1 * rng.normal(size=signals[name].shape)
        for _, each in wires:
            each[name][...] = values
    for wire, _ in wires:
        for step in range(3):
            PORT.invoke(wire, step, 0.01 * step, 0.01)
    for name in ("force", "moment", "steady_force"):
        np.testing.assert_array_equal(wires[0][1][name], wires[1][1][name])


CALM = {
    "reference.period": 7.0,
    "sensing.kind": "noisy",
    "timing.duration": 30.0,
    "timing.delay": 0.02,
    **{
        f"timing.{layer}": 0.01
        for layer in ("load_control", "allocation", "position_control", "attitude_control")
    },
}


@pytest.mark.parametrize("seed", [91_001, 91_002])
@pytest.mark.parametrize("offset", [[0.03, 0.0, 0.0], [0.0, -0.03, 0.0]])
def test_a_centre_of_mass_told_3_cm_wrong_leaves_less_than_with_pose(
    offset: list[float], seed: int
) -> None:
    """Both in place and attitude, and not by luck: half of it, once it had the time to learn."""

    def errors(law: str) -> list[float]:
        changed = {"load_control.kind": law, "truth.centre_of_mass_offset": offset, "seed": seed}
        recording = Flight(load_mission("box-figure-eight", {**CALM, **changed})).run()
        late = recording.time > 15.0
        place, turn = metrics.tracking_error(recording), metrics.attitude_error(recording)
        return [float(np.sqrt(np.mean(np.sum(each[late] ** 2, axis=1)))) for each in (place, turn)]

    pose, adaptive = errors("pose"), errors("pose-adaptive")
    assert adaptive[0] < 0.5 * pose[0]
    assert adaptive[1] < 0.6 * pose[1]


def test_a_rigid_load_keeps_its_other_controllers_whichever_law_it_names() -> None:
    adaptive = load_mission("box-figure-eight", {"load_control.kind": "pose-adaptive"}).kinds
    plain = load_mission("box-figure-eight").kinds
    assert {**plain, "load_control": "pose-adaptive"} == dict(adaptive)


def test_the_recording_says_what_was_learned() -> None:
    """Most of it: the rest of the moment comes of drones that hold their places, and of the integral."""
    offset = [0.03, 0.0, 0.0]
    changed = {"load_control.kind": "pose-adaptive", "truth.centre_of_mass_offset": offset}
    recording = Flight(load_mission("box-figure-eight", {**CALM, **changed})).run()
    late = recording["learned_load"][recording.time > 20.0, 1]
    assert 0.75 < late.mean() / (0.5 * 0.03) < 1.05
