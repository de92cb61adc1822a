"""Cables that go slack: the catch against closed forms and brute force, energy, order, and no pushing."""

from __future__ import annotations

from itertools import combinations, pairwise

import numpy as np
import pytest
from plant_rig import DOWN, E3, Rig, random_rig, rotation, slack_rig

import colift
from colift.team import Team
from colift.world.plant.slack_cables import NEAR, SlackCables, crossing


def stretch(rig):
    s = rig.observe()
    return np.linalg.norm(s["load"][0] - s["positions"], axis=1) - rig.team.cable_lengths


# ---------------------------------------------------------------- while taut, the rigid plant


def test_a_flight_without_slack_is_that_of_rigid_cables():
    settings = {"timing__duration": 3.0, "timing__recording": 0.01}
    rigid = colift.run("paper-spiral", **settings)
    slack = colift.run("paper-spiral", plant__kind="slack-cables", **settings)
    assert rigid.metrics["slack_time_s"] == slack.metrics["slack_time_s"] == 0.0
    for name in ("load", "directions", "tensions"):
        np.testing.assert_allclose(
            slack.recording[name], rigid.recording[name], rtol=0, atol=1e-9, err_msg=name
        )


def test_a_cable_does_not_push():
    """Where the rigid plant would report a negative tension, drone and load fall apart freely."""
    rig = Rig(Team.uniform(1), DOWN, SlackCables())
    rig.thrusts[:] = -1.0  # downward, onto the load
    rig.step(count=100)
    np.testing.assert_allclose(rig.tensions, 0.0)
    assert rig.slack_times[0] == pytest.approx(0.1)
    assert rig.load[1, 2] == pytest.approx(-0.981, rel=1e-12)
    assert rig.drones[0, 5] == pytest.approx(-0.1 * (9.81 + 1.0 / 0.5), rel=1e-12)


# ---------------------------------------------------------------- the catch


@pytest.mark.parametrize(("load", "drone"), [(0.3, 0.7), (2.0, 0.4)])
def test_two_bodies_are_caught_plastically_at_the_right_instant(load, drone):
    """Momentum stays, the common speed is that of the centre of mass, half mu v^2 is lost."""
    team = Team.uniform(1, load_mass=load, mass=drone, cable_length=1.3, gravity=0.0)
    rig = Rig(team, DOWN, SlackCables())
    rig.drones[0, 2] = 1.0  # 0.3 m of slack
    rig.drones[0, 5] = 2.0  # upward, away from the load
    energy = rig.energy()
    common = drone * 2.0 / (load + drone)
    rig.step(0.001, 149)
    assert rig.energy() == pytest.approx(energy, rel=1e-13)
    assert rig.load[1, 2] == 0.0
    rig.step(0.0033)  # the catch is at t = 0.15, within this step
    late = 0.149 + 0.0033 - 0.15
    np.testing.assert_allclose(rig.load[:, 2], [common * late, common], rtol=0, atol=1e-10)
    np.testing.assert_allclose(rig.drones[0, [2, 5]], [1.3 + common * late, common], atol=1e-10)
    reduced = load * drone / (load + drone)
    assert energy - rig.energy() == pytest.approx(0.5 * reduced * 2.0**2, rel=1e-9)
    assert rig.slack_times[0] == pytest.approx(0.15, abs=1e-9)


def test_sideways_speed_survives_the_catch():
    team = Team.uniform(1, load_mass=0.5, mass=2.0, cable_length=1.0, gravity=0.0)
    rig = Rig(team, DOWN, SlackCables())
    rig.load[:] = [[0.6, 0.0, 1.0], [0.0, 0.0, -1.0]]  # 1 m off the drone at t = 0.8
    rig.step(count=810)
    velocity = rig.load[1] - rig.drones[0, 3:6]
    assert np.linalg.norm(velocity) == pytest.approx(0.6, rel=1e-9)  # across the cable at the catch
    assert abs(rig.observe()["directions"][0] @ velocity) < 1e-12
    assert rig.tensions[0] == pytest.approx(0.4 * 0.6**2 / 1.0, rel=1e-9)  # reduced mass 0.4


def brute_force(team, alpha, closing):
    """Impulses by trying every set of pulling cables; the law has one answer only."""
    n = team.n
    matrix = alpha @ alpha.T / team.load_mass + np.diag(1.0 / team.masses)
    answers = []
    for size in range(n + 1):
        for chosen in combinations(range(n), size):
            P, kept = np.zeros(n), list(chosen)
            P[kept] = np.linalg.solve(matrix[np.ix_(kept, kept)], closing[kept])
            if P.min() >= 0.0 and (closing - matrix @ P).max() <= 1e-12:
                answers.append(P)
    assert len(answers) == 1
    return answers[0]


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_simultaneous_impulses_are_those_of_brute_force(n):
    partial = 0
    for seed in range(20):
        rig, rng = random_rig(1000 * n + seed, n, SlackCables(), gravity=0.0, spin=0.0)
        rig.drones[:, 3:6] += rng.normal(size=(n, 3))
        s = rig.observe()
        alpha = s["directions"]
        closing = np.sum(alpha * (s["load"][1] - s["velocities"]), axis=1)
        P = brute_force(rig.team, alpha, closing)
        partial += np.count_nonzero((P == 0.0) & (closing > 0.0)) + np.count_nonzero(
            (P > 0.0) & (closing < 0.0)
        )
        rig.step(1e-12)  # the catch, and hardly any motion
        wanted = s["velocities"] + P[:, None] * alpha / rig.team.masses[:, None]
        np.testing.assert_allclose(rig.drones[:, 3:6], wanted, rtol=0, atol=1e-9)
        np.testing.assert_allclose(
            rig.load[1], s["load"][1] - P @ alpha / rig.team.load_mass, rtol=0, atol=1e-9
        )
    assert n == 1 or partial > 0  # a jerk on one cable does pull or release others


def test_a_load_that_drops_into_its_cables_stops_there():
    """Four cables catch it together: the falling speed is gone, and it hangs."""
    team = Team.uniform(4, mass=1e7)
    directions = np.array([[0.6, 0, -0.8], [-0.6, 0, -0.8], [0, 0.6, -0.8], [0, -0.6, -0.8]])
    rig = Rig(team, directions, SlackCables())
    rig.thrusts[:] = 1e7 * 9.81
    rig.load[0, 2] += 0.2
    rig.step(count=1000)
    np.testing.assert_allclose(rig.load, 0.0, atol=1e-7)
    np.testing.assert_allclose(rig.tensions, 0.225 * 9.81 / (4 * 0.8), rtol=1e-6)
    np.testing.assert_allclose(rig.slack_times, np.sqrt(2 * 0.2 / 9.81), atol=1e-6)


# ---------------------------------------------------------------- invariants


@pytest.mark.parametrize("n", [1, 2, 4, 8])
def test_energy_is_never_gained_and_momentum_kept_over_many_catches(n):
    for seed in range(5):
        rig, _ = slack_rig(50 * n + seed, n, SlackCables(), gravity=9.81 if seed % 2 else 0.0)
        before, momentum = rig.energy(), rig.momentum()
        turning = rig.angular_momentum()
        catches, scale = 0, rig.kinetic_energy()
        weight = rig.team.gravity * (rig.team.load_mass + rig.team.masses.sum())
        for k in range(3000):
            rig.step()
            after = rig.energy()
            catches += after < before - 1e-6 * scale
            assert after - before < 1e-8 * max(scale, rig.kinetic_energy())
            before = after
            wanted = momentum - 0.001 * (k + 1) * weight * E3
            np.testing.assert_allclose(rig.momentum(), wanted, rtol=0, atol=1e-9 * max(1, weight))
        assert stretch(rig).max() < 1e-9
        assert catches >= 1
        if rig.team.gravity == 0.0:
            np.testing.assert_allclose(
                rig.angular_momentum(), turning, rtol=0, atol=1e-6 * np.abs(turning).max()
            )


def test_no_tension_is_negative_and_no_cable_longer_in_a_wild_flight():
    rig, rng = slack_rig(7, 4, SlackCables(), speed=1.0)
    shortest = 0.0
    for k in range(4000):
        if k % 100 == 0:
            rig.thrusts[:] = rng.uniform(0.0, 25.0, 4)
            rig.torques[:] = 0.05 * rng.normal(size=(4, 3))
        rig.step()
        assert rig.tensions.min() >= 0.0
        assert stretch(rig).max() < 1e-9
        shortest = min(shortest, stretch(rig).min())
    assert shortest < -0.1
    assert np.isfinite(rig.memory).all()


def test_free_fall_is_slack():
    rig, _ = slack_rig(11, 3, SlackCables(), speed=0.0)
    rig.step(count=500)
    np.testing.assert_allclose(rig.tensions, 0.0)
    np.testing.assert_allclose(rig.slack_times, 0.5)
    np.testing.assert_allclose(rig.load[1], -0.5 * 9.81 * E3, rtol=1e-12)


def test_order_four_across_catch_and_release():
    """Richardson over a flight in which a cable is caught and another goes slack within steps."""

    def flown(dt):
        directions = np.array([[0.0, 0.6, -0.8], [0.6, 0.0, -0.8]])
        rig = Rig(Team.uniform(2, mass=0.8), directions, SlackCables())
        rig.drones[0, :3] *= 0.9
        rig.drones[:, 3:6] = [[0.3, 0.0, 2.0], [0.0, 1.0, 0.0]]
        rig.drones[:, 10:13] = [[0.5, -0.3, 0.2], [-2.0, 1.0, 0.3]]
        rig.thrusts[:] = [11.0, 6.0]
        rig.step(dt, round(0.32 / dt))
        return rig.state.copy(), rig.slack_times.copy()

    answers = [flown(0.32 / count) for count in (20, 40, 80, 160)]
    assert np.all((answers[-1][1] > 0.01) & (answers[-1][1] < 0.31))
    changes = [np.linalg.norm(b[0] - a[0]) for a, b in pairwise(answers)]
    orders = np.log2(np.array(changes[:-1]) / changes[1:])
    assert np.all(orders > 3.5), orders


def test_a_cut_cable_is_never_caught():
    rig, _ = slack_rig(13, 2, SlackCables(), gravity=0.0)
    rig.drones[:, 3:6] *= 3.0
    rig.attached[0] = 0.0
    before = rig.drones[0, :6].copy()
    rig.step(count=3000)
    np.testing.assert_allclose(rig.drones[0, :3], before[:3] + 3.0 * before[3:], atol=1e-10)
    assert stretch(rig)[0] > 1.0
    assert rig.slack_times[0] == 0.0
    assert np.all(rotation(rig.drones[0, 6:10]) == np.eye(3))


# ---------------------------------------------------------------- the instant of an event


@pytest.mark.parametrize("dip", [0.0, -0.3, -3.0, -30.0])
def test_a_cubic_tells_when_a_length_is_passed(dip):
    """A cable that comes in first, at ``dip`` m/s, and runs out again: only the second crossing counts."""
    h, a = 1e-3, 1e5
    x1, v1 = dip * h + 0.5 * a * h * h - NEAR, dip + a * h
    assert x1 > 0.0
    s = crossing(-NEAR, dip * h, x1, v1 * h, 0.5 * NEAR, 0.0, 1.0)
    assert dip * s * h + 0.5 * a * (s * h) ** 2 == pytest.approx(1.5 * NEAR, abs=0.1 * NEAR)
    assert s > -dip / a / h
