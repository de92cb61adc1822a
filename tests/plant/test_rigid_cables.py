"""The rigid-cable plant: closed forms, conserved quantities, integrator order, and an oracle.

The oracle knows nothing of the plant's formulas: point masses in world coordinates, one holonomic
constraint a cable, Lagrange multipliers from one dense linear system.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from plant_rig import DOWN, E3, Rig, random_rig, rotation

import colift
from colift.team import Team
from colift.team.geometry import ring
from colift.world.plant._bodies import DRONE, LOAD
from colift.world.plant._rigid import derivative


def oracle(team, directions, direction_rates, attitudes, thrusts, external):
    """Accelerations of load and drones (n + 1, 3) and tensions (n,) from a dense KKT system."""
    n = team.n
    mass = np.repeat(np.append(team.masses, team.load_mass), 3)
    force = external.copy()
    force[:n] += [f * rotation(q) @ E3 for f, q in zip(thrusts, attitudes, strict=True)]
    force[:, 2] -= mass[::3] * team.gravity
    jacobian = np.zeros((n, 3 * n + 3))  # of |x_L - x_i|^2 / 2
    rows = np.zeros(n)
    for i, length in enumerate(team.cable_lengths):
        span = length * directions[i]
        jacobian[i, 3 * i : 3 * i + 3] = -span
        jacobian[i, 3 * n :] = span
        rows[i] = -np.sum((length * direction_rates[i]) ** 2)
    system = np.block([[np.diag(mass), jacobian.T], [jacobian, np.zeros((n, n))]])
    answer = np.linalg.solve(system, np.append(force.ravel(), rows))
    return answer[: 3 * n + 3].reshape(n + 1, 3), answer[3 * n + 3 :] * team.cable_lengths


# ---------------------------------------------------------------- oracle


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 6, 7, 8])
def test_accelerations_and_tensions_agree_with_maximal_coordinates(n):
    for seed in range(13):
        rig, rng = random_rig(100 * n + seed, n)
        team = rig.team
        rig.thrusts[:] = rng.uniform(0.0, 20.0, n)
        rig.torques[:] = rng.normal(size=(n, 3))
        rig.external[:] = rng.normal(size=(n + 1, 3))
        s = rig.observe()
        wanted, tensions = oracle(
            team, s["directions"], s["direction_rates"], s["attitudes"], rig.thrusts, rig.external
        )
        slope, T = np.zeros_like(rig.state), np.zeros(n)
        derivative(
            n, rig.state, rig.thrusts, rig.torques, rig.external, np.zeros(3), rig.attached,
            np.zeros(2 * n + 2), 0.0, rig.params, np.zeros(n), T, np.zeros(3 * n), np.zeros(n),
            rig.ground_forces, slope,
        )  # fmt: skip
        scale = max(1.0, np.abs(wanted).max())
        np.testing.assert_allclose(slope[3:6], wanted[n], rtol=0, atol=1e-10 * scale)
        np.testing.assert_allclose(
            T, tensions, rtol=0, atol=1e-10 * max(1.0, np.abs(tensions).max())
        )
        rates = slope[LOAD:].reshape(n, DRONE)
        np.testing.assert_allclose(rates[:, 3:6], wanted[:n], rtol=0, atol=1e-10 * scale)
        spin = rig.drones[:, 10:13]
        torque_balance = team.inertias * rates[:, 10:13] + np.cross(spin, team.inertias * spin)
        np.testing.assert_allclose(torque_balance, rig.torques, rtol=0, atol=1e-12)


def test_recorded_tensions_belong_to_the_state_of_their_row():
    """Every row of a manoeuvring flight satisfies the equations of motion by itself."""
    flown = colift.run("figure-eight", timing__duration=2.0, timing__recording=0.05, seed=0)
    r = flown.recording
    team = flown.mission.team
    assert len(r.time) == 41
    for k in range(len(r.time)):
        _, tensions = oracle(
            team, r["directions"][k], r["direction_rates"][k], r["attitudes"][k], r["thrusts"][k],
            r["external_forces"][k],
        )  # fmt: skip
        np.testing.assert_allclose(r["tensions"][k], tensions, rtol=0, atol=1e-9)
    assert np.ptp(r["tensions"]) > 0.05  # the flight does manoeuvre


# ---------------------------------------------------------------- closed forms


def test_free_fall_leaves_the_cables_without_tension():
    rig = Rig(Team.uniform(4), ring(4, 0.6))
    rig.step(count=1000)
    assert np.abs(rig.tensions).max() < 1e-12
    np.testing.assert_allclose(rig.state[2], -0.5 * 9.81, rtol=1e-10)
    np.testing.assert_allclose(rig.state[5], -9.81, rtol=1e-12)


@pytest.mark.parametrize("cone_deg", [10.0, 35.0, 70.0])
@pytest.mark.parametrize("n", [2, 3, 4, 7])
def test_hover_tensions(n, cone_deg):
    """T = m_L g / (n cos cone), held by thrusts of m g e3 - T alpha."""
    cone = np.radians(cone_deg)
    team = Team.uniform(n)
    directions = ring(n, cone)
    T = team.load_mass * team.gravity / (n * np.cos(cone))
    thrust = -T * directions + team.masses[:, None] * team.gravity * E3
    sizes = np.linalg.norm(thrust, axis=1)
    axes = thrust / sizes[:, None]
    half = np.arccos(axes[:, 2]) / 2.0
    turn = np.cross(E3, axes)
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    attitudes = np.column_stack([np.cos(half), np.sin(half)[:, None] * turn])
    rig = Rig(team, directions, attitudes=attitudes)
    rig.thrusts[:] = sizes
    rig.step()
    np.testing.assert_allclose(rig.tensions, T, rtol=1e-12)
    rig.step(count=200)
    np.testing.assert_allclose(rig.observe()["load"], 0.0, atol=1e-10)


def test_two_bodies_on_a_cable_in_free_fall_rotate_uniformly():
    """Relative angular rate constant, T = m_red L omega^2, whatever gravity does."""
    team = Team.uniform(1, load_mass=0.3, mass=0.7, cable_length=1.4)
    rate = 3.0
    rig = Rig(team, np.array([[1.0, 0.0, 0.0]]), spin=np.array([[0.0, rate, 0.0]]))
    reduced = 0.3 * 0.7 / (0.3 + 0.7)
    for _ in range(10):
        rig.step(count=100)
        np.testing.assert_allclose(rig.tensions, reduced * 1.4 * rate**2, rtol=1e-9)
        speed = np.linalg.norm(rig.observe()["direction_rates"])
        assert speed == pytest.approx(rate, rel=1e-9)
    # After 1 s the direction has turned by `rate` radians about y: x goes to -z.
    np.testing.assert_allclose(
        rig.observe()["directions"], [[np.cos(rate), 0.0, -np.sin(rate)]], atol=1e-9
    )


@pytest.mark.parametrize(("length", "gravity", "amplitude"), [(1.0, 9.81, 0.2), (2.5, 1.62, 0.4)])
def test_pendulum_period(length, gravity, amplitude):
    """A drone of enormous mass in exact hover: the load swings as a pendulum on a fixed point."""
    mass = 1e6
    team = Team.uniform(1, load_mass=0.2, mass=mass, cable_length=length, gravity=gravity)
    rig = Rig(team, np.array([[np.sin(amplitude), 0.0, -np.cos(amplitude)]]))
    rig.thrusts[:] = mass * gravity
    series = 1.0 + amplitude**2 / 16.0 + 11.0 * amplitude**4 / 3072.0
    period = 2.0 * np.pi * np.sqrt(length / gravity) * series
    crossings, before, time = [], amplitude, 0.0
    while len(crossings) < 3:
        rig.step()
        time += 0.001
        x, _, z = rig.observe()["directions"][0]
        angle = np.arctan2(x, -z)
        if before * angle < 0.0:
            crossings.append(time - 0.001 * angle / (angle - before))
        before = angle
    assert crossings[0] == pytest.approx(period / 4.0, rel=2e-5)
    assert crossings[2] - crossings[0] == pytest.approx(period, rel=2e-5)


def test_positive_thrust_pushes_along_body_z_up():
    rig = Rig(Team.uniform(1), DOWN)
    rig.thrusts[:] = 20.0
    rig.step(count=100)
    total = 0.5 + 0.225
    assert rig.state[5] == pytest.approx(0.1 * (20.0 / total - 9.81), rel=1e-9)
    assert rig.tensions[0] == pytest.approx(0.225 * 20.0 / total, rel=1e-9)


@pytest.mark.parametrize(
    ("axis", "thrust_goes_to"), [(0, [0.0, -1.0]), (1, [1.0, 0.0]), (2, [0.0, 0.0])]
)
def test_torque_turns_the_body_the_right_way(axis, thrust_goes_to):
    """Positive torque about x speeds Omega_x up and tilts the thrust to -y; about y, to +x."""
    rig = Rig(Team.uniform(1), DOWN)
    rig.torques[0, axis] = 0.01
    rig.step(count=100)
    s = rig.observe()
    expected = np.zeros(3)
    expected[axis] = 0.1 * 0.01 / rig.team.inertias[0, axis]
    np.testing.assert_allclose(s["rates"][0], expected, atol=1e-12)
    tilt = 0.5 * 0.1 * expected[axis]
    thrust = rotation(s["attitudes"][0]) @ E3
    np.testing.assert_allclose(thrust[:2], tilt * np.array(thrust_goes_to), atol=1e-5)
    # Under thrust the drone goes where its axis points.
    rig.torques[:] = 0.0
    rig.thrusts[:] = 8.0
    rig.step(count=300)
    moved = rig.observe()["velocities"][0, :2]
    assert np.sign(np.round(moved, 6)).tolist() == np.sign(thrust_goes_to).tolist()


def test_external_forces_act_on_drones_and_last_row_on_the_load():
    team = Team.uniform(2, gravity=0.0)
    rig = Rig(team, np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]))
    rig.external[2] = [0.3, 0.0, 0.0]
    rig.external[0] = [0.0, 0.2, 0.0]
    rig.step(count=10)
    np.testing.assert_allclose(rig.momentum(), [0.003, 0.002, 0.0], atol=1e-12)
    assert rig.state[3] > 0.0
    assert rig.observe()["velocities"][0, 1] > rig.observe()["velocities"][1, 1]


# ---------------------------------------------------------------- invariants


@pytest.mark.parametrize("n", [1, 2, 4, 8])
def test_energy_and_momentum_are_conserved_without_thrust(n):
    rig, _ = random_rig(n, n, gravity=9.81, spin=1.5)
    energy, momentum = rig.energy(), rig.momentum()
    kinetic = rig.kinetic_energy()
    fallen = 0.0
    for _ in range(10):
        rig.step(count=1000)
        fallen += 1.0
        assert abs(rig.energy() - energy) < 1e-6 * kinetic + 1e-9 * 9.81**2 * fallen**2
        weight = rig.team.load_mass + rig.team.masses.sum()
        np.testing.assert_allclose(
            rig.momentum(), momentum - weight * 9.81 * fallen * E3, rtol=0, atol=1e-5
        )


@pytest.mark.parametrize("n", [1, 2, 4, 8])
def test_angular_momentum_is_conserved_without_gravity(n):
    rig, _ = random_rig(10 + n, n, gravity=0.0, spin=3.0)
    before, momentum = rig.angular_momentum(), rig.momentum()
    rig.step(count=5000)
    np.testing.assert_allclose(
        rig.angular_momentum(), before, rtol=0, atol=1e-7 * np.abs(before).max()
    )
    np.testing.assert_allclose(rig.momentum(), momentum, rtol=0, atol=1e-7)
    assert abs(rig.angular_momentum()).max() > 0.1


def test_constraints_do_not_drift():
    rig, rng = random_rig(5, 6, spin=4.0)
    rig.thrusts[:] = rng.uniform(0.0, 10.0, 6)
    rig.torques[:] = 0.01 * rng.normal(size=(6, 3))
    for _ in range(20):
        rig.step(count=250)
        s = rig.observe()
        apart = s["load"][1] - s["velocities"]
        assert np.abs(np.linalg.norm(s["attitudes"], axis=1) - 1.0).max() <= 1e-12
        along = np.abs(np.sum(s["directions"] * apart, axis=1)).max()
        assert along <= 1e-12 * max(1.0, np.abs(apart).max())
        spans = np.linalg.norm(s["load"][0] - s["positions"], axis=1)
        np.testing.assert_allclose(spans, rig.team.cable_lengths, rtol=1e-12)


def test_gyroscopic_torque_does_no_work():
    """Torque-free tri-axial bodies: rotational energy, |J Omega| and J Omega in the world stay."""
    rig, _ = random_rig(3, 5, gravity=0.0, spin=0.0)
    rig.drones[:, 10:13] *= 6.0
    inertias = rig.team.inertias

    def energy():
        return 0.5 * np.sum(inertias * rig.observe()["rates"] ** 2, axis=1)

    energies, momenta, rates = energy(), rig.spin_momentum(), rig.observe()["rates"]
    for _ in range(5):
        rig.step(count=1000)
        np.testing.assert_allclose(energy(), energies, rtol=1e-7)
        np.testing.assert_allclose(
            rig.spin_momentum(), momenta, rtol=0, atol=1e-6 * np.linalg.norm(momenta, axis=1).max()
        )
    assert np.abs(rig.observe()["rates"] - rates).max() > 1.0  # and yet the bodies tumble


def test_rotation_about_a_principal_axis_is_uniform():
    rig = Rig(Team.uniform(1), DOWN, body_rates=[[0.0, 0.0, 2.0]])
    rig.step(count=500)
    np.testing.assert_allclose(
        rig.observe()["attitudes"][0], [np.cos(0.5), 0.0, 0.0, np.sin(0.5)], atol=1e-10
    )


def test_integrator_is_of_fourth_order():
    """Richardson: halving the step divides the change of the answer by 2^4, projection included."""

    def flown(dt):
        rig, rng = random_rig(21, 3, spin=1.0)
        rig.thrusts[:] = rng.uniform(2.0, 8.0, 3)
        rig.torques[:] = 0.02 * rng.normal(size=(3, 3))
        return rig.step(dt, round(0.4 / dt)).state.copy()

    answers = [flown(0.4 / count) for count in (40, 80, 160, 320)]
    changes = [np.linalg.norm(b - a) for a, b in pairwise(answers)]
    orders = np.log2(np.array(changes[:-1]) / changes[1:])
    assert np.all(np.abs(orders - 4.0) < 0.25), orders


def test_slack_time_counts_negative_tension():
    """Thrust down on a drone above the load pushes through the rod."""
    rig = Rig(Team.uniform(1), DOWN)
    rig.thrusts[:] = -1.0
    rig.step(count=50)
    assert rig.tensions[0] < 0.0
    assert rig.slack_times[0] == pytest.approx(0.05)
    rig.thrusts[:] = 1.0
    rig.step(count=50)
    assert rig.tensions[0] > 0.0
    assert rig.slack_times[0] == pytest.approx(0.05)


def test_a_cut_cable_frees_its_drone_and_leaves_the_others_taut():
    """The drone falls by its own weight, the rest moves as if it had never been there."""
    rig, rng = random_rig(31, 4, spin=1.0)
    rig.thrusts[:] = rng.uniform(2.0, 8.0, 4)
    rig.thrusts[2] = 0.0
    rig.step(count=200)
    rest, kept = Rig(rig.team.of([0, 1, 3]), rig.observe()["directions"][[0, 1, 3]]), [0, 1, 3]
    rest.load[:], rest.drones[:], rest.thrusts[:] = rig.load, rig.drones[kept], rig.thrusts[kept]
    before = rig.observe()
    rig.attached[2] = 0.0
    rig.step(count=500)
    rest.step(count=500)
    after = rig.observe()
    assert rig.tensions[2] == 0.0
    np.testing.assert_allclose(rig.load, rest.load, rtol=0, atol=1e-12)
    np.testing.assert_allclose(rig.drones[kept], rest.drones, rtol=0, atol=1e-12)
    flown = before["positions"][2] + 0.5 * before["velocities"][2] - 0.125 * 9.81 * E3
    np.testing.assert_allclose(after["positions"][2], flown, rtol=0, atol=1e-12)
    span = after["load"][0] - after["positions"][2]
    np.testing.assert_allclose(after["directions"][2], span / np.linalg.norm(span), atol=1e-14)


def test_with_all_cables_cut_the_load_is_a_projectile():
    rig, _ = random_rig(32, 3, spin=2.0)
    before = rig.load.copy()
    rig.attached[:] = 0.0
    rig.step(count=1000)
    np.testing.assert_allclose(rig.tensions, 0.0)
    np.testing.assert_allclose(rig.load[0], before[0] + before[1] - 0.5 * 9.81 * E3, atol=1e-11)
    np.testing.assert_allclose(rig.slack_times, 0.0)


def test_sixty_four_drones():
    rig, rng = random_rig(64, 64, spin=0.5)
    rig.thrusts[:] = rng.uniform(0.0, 10.0, 64)
    rig.step(count=200)
    assert np.isfinite(rig.state).all()
    settings = {"drones__count": 64, "load__mass": 4.0, "timing__duration": 0.2}
    flown = colift.run("hover", allocator="sqp", **settings)
    assert flown.recording.outcome == "completed"
    assert all(np.isfinite(a).all() for a in flown.recording.arrays.values() if a.ndim > 1)
