"""The three controllers: the paper's laws where they are unambiguous, and what they must do."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import colift
from colift.control.attitude_control.manifold import Manifold
from colift.control.load_control.pid import Pid as LoadPid
from colift.control.position_control.pid import Pid as PositionPid
from colift.kernel.math import quaternion
from colift.team import Team
from colift.team.geometry import ring, zero_yaw_quaternion

E3 = np.array([0.0, 0.0, 1.0])
G = 9.81
component = st.floats(-1.0, 1.0)


def rotate(q, v):
    """R(q) v by the sandwich product."""
    w, x, y, z = quaternion.multiply(*quaternion.multiply(*q, 0.0, *v), q[0], -q[1], -q[2], -q[3])
    assert abs(w) < 1e-9
    return np.array([x, y, z])


def unit(*v):
    return np.array(v) / np.linalg.norm(v)


# ---------------------------------------------------------------- quaternions


def test_hamilton_product():
    assert quaternion.multiply(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0) == (
        0.0,
        0.0,
        0.0,
        1.0,
    )  # ij = k
    assert quaternion.multiply(0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, 0.0) == (0.0, 0.0, 0.0, -1.0)
    assert quaternion.multiply(0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0) == (-1.0, 0.0, 0.0, 0.0)


def test_rotation_about_x_by_the_right_hand():
    q = (np.cos(0.2), np.sin(0.2), 0.0, 0.0)
    np.testing.assert_allclose(rotate(q, E3), [0.0, -np.sin(0.4), np.cos(0.4)], atol=1e-15)


@given(w=component, x=component, y=component, z=component)
@settings(deadline=None)
def test_third_axis_is_the_rotated_e3(w, x, y, z):
    norm = np.linalg.norm([w, x, y, z])
    if norm > 1e-3:
        q = np.array([w, x, y, z]) / norm
        np.testing.assert_allclose(quaternion.third_axis(*q), rotate(q, E3), atol=1e-12)


@given(x=component, y=component, z=component)
@settings(deadline=None)
def test_wanted_attitude_turns_e3_into_the_thrust_direction_without_yaw(x, y, z):
    norm = np.linalg.norm([x, y, z])
    if norm < 1e-3 or z / norm < -0.999:
        return
    u = np.array([x, y, z]) / norm
    q = quaternion.from_thrust_direction(*u)
    np.testing.assert_allclose(np.linalg.norm(q), 1.0, atol=1e-12)
    np.testing.assert_allclose(rotate(q, E3), u, atol=1e-12)
    assert q[3] == 0.0  # no component about z: the rotation's axis is horizontal
    assert q[0] > 0.0
    np.testing.assert_allclose(zero_yaw_quaternion(u), q, atol=1e-12)


@pytest.mark.parametrize("near", [0.0, 1e-15, 1e-9, 1e-6])
def test_thrust_straight_down_is_guarded(near):
    q = quaternion.from_thrust_direction(*unit(near, 0.0, -1.0))
    assert np.isfinite(q).all()
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=1e-3)
    np.testing.assert_allclose(quaternion.third_axis(*q), -E3, atol=1e-3)


# ---------------------------------------------------------------- load control


def load_force(part, load, reference, *, memory=None, dt=0.01, team=None):
    team = team or Team.uniform(4)
    memory = part.memory(team) if memory is None else memory
    return part.call(team, memory, dt=dt, estimated_load=load, reference=reference)[0].force


def test_load_pid_without_error_carries_weight_and_acceleration():
    reference = np.zeros((4, 3))
    reference[2] = [0.5, -1.0, 2.0]
    force = load_force(LoadPid(), np.zeros((2, 3)), reference)
    np.testing.assert_allclose(force, 0.225 * np.array([0.5, -1.0, 2.0 + G]), rtol=1e-14)


def test_load_pid_gains_per_axis_and_error_signs():
    part = LoadPid(k_p=(1.0, 2.0, 3.0), k_d=(0.1, 0.2, 0.3), k_i=(10.0, 20.0, 30.0))
    load = np.array([[1.0, 1.0, 1.0], [1.0, 1.0, 1.0]])
    memory = np.zeros(3)
    force = load_force(part, load, np.zeros((4, 3)), memory=memory, dt=0.01)
    np.testing.assert_allclose(memory, 0.01)  # int e
    np.testing.assert_allclose(force, 0.225 * G * E3 - [1.2, 2.4, 3.6], rtol=1e-13)
    force = load_force(part, load, np.zeros((4, 3)), memory=memory, dt=0.01)
    np.testing.assert_allclose(force, 0.225 * G * E3 - [1.3, 2.6, 3.9], rtol=1e-13)


def test_load_pid_pushes_back_to_the_reference():
    for axis in range(3):
        load = np.zeros((2, 3))
        load[0, axis] = 0.1
        change = load_force(LoadPid(), load, np.zeros((4, 3))) - 0.225 * G * E3
        assert change[axis] < -0.5
        assert np.count_nonzero(np.abs(change) > 1e-12) == 1


def test_load_pid_integral_is_bounded():
    memory, load = np.zeros(3), np.ones((2, 3))
    part = LoadPid(integral_limit=0.05)
    for _ in range(20):
        load_force(part, load, np.zeros((4, 3)), memory=memory, dt=0.01)
    np.testing.assert_allclose(memory, 0.05)
    for _ in range(20):
        load_force(part, -load, np.zeros((4, 3)), memory=memory, dt=0.01)
    np.testing.assert_allclose(memory, -0.05)


def test_errata_printed_sign_of_the_load_law_pushes_the_load_down():
    """Erratum: the printed ``-m_L (g e3 + xdd_d)`` is the negative of what carries the load."""
    printed = LoadPid(sign="as-printed")
    reference = np.zeros((4, 3))
    reference[2] = [1.0, 0.0, 0.0]
    force = load_force(printed, np.zeros((2, 3)), reference)
    np.testing.assert_allclose(force, -0.225 * np.array([1.0, 0.0, G]), rtol=1e-14)
    # Feedback has the same sign in both: only the feed-forward is misprinted.
    load = np.full((2, 3), 0.1)
    at_rest = np.zeros((4, 3))
    np.testing.assert_allclose(
        load_force(printed, load, at_rest) + 0.225 * G * E3,
        load_force(LoadPid(), load, at_rest) - 0.225 * G * E3,
    )


def test_errata_printed_sign_drops_the_load():
    """On the paper's rods, on which drones below the load push."""
    settings_ = {"allocator": "sqp", "timing__duration": 0.5, "start__load_offset": [0.0, 0.0, 0.0]}
    settings_["plant__kind"] = "rigid-cables"
    right = colift.run("hover", **settings_).recording
    wrong = colift.run("hover", load_control__sign="as-printed", **settings_).recording
    assert right["load"][-1, 0, 2] == pytest.approx(1.0, abs=0.02)
    assert wrong["force"][0, 2] == pytest.approx(-0.225 * G)
    assert right["force"][0, 2] == pytest.approx(0.225 * G)
    assert wrong["load"][-1, 0, 2] < 0.95


# ---------------------------------------------------------------- position control


class Drones:
    """The position controller of n drones and its outputs."""

    def __init__(self, n=1, **settings):
        self.team = Team.uniform(n)
        self.part = PositionPid(**settings)
        self.memory = self.part.memory(self.team)
        self.forces, self.thrusts = np.zeros((n, 3)), np.zeros(n)
        self.attitudes, self.rates = np.zeros((n, 4)), np.zeros((n, 3))

    def __call__(self, x, v, reference, T, alpha, dt=0.001):
        self.part.call(
            self.team, self.memory, dt=dt, estimated_positions=x, estimated_velocities=v,
            estimated_attitudes=self.attitudes, estimated_rates=self.rates, wanted_ends=np.tile(reference[:3], (self.team.n, 1, 1)),
            received_tensions=T, received_directions=alpha, drone_forces=self.forces,
            thrusts=self.thrusts, desired_attitudes=self.attitudes, desired_rates=self.rates,
        )  # fmt: skip
        return self


NO_GAINS = {"k_p": (0.0,) * 3, "k_d": (0.0,) * 3, "k_i": (0.0,) * 3, "thrust_filter": 0.0}
DOWN = np.array([[0.0, 0.0, -1.0]])


def test_position_pid_in_equilibrium_balances_weight_and_cable():
    alpha = ring(3, 0.6)
    T = np.array([0.5, 1.0, 1.5])
    reference = np.zeros((4, 3))
    reference[0] = [1.0, 2.0, 3.0]
    reference[1] = [0.3, 0.2, 0.1]
    reference[2] = [0.1, -0.2, 0.3]
    x = reference[0] - alpha
    out = Drones(3)(x, np.tile(reference[1], (3, 1)), reference, T, alpha)
    # Newton's law of the drone: u + T alpha - m g e3 = m a.
    net = out.forces + T[:, None] * alpha - 0.5 * G * E3
    np.testing.assert_allclose(net, 0.5 * np.tile(reference[2], (3, 1)), atol=1e-12)
    np.testing.assert_allclose(out.thrusts, np.linalg.norm(out.forces, axis=1))
    for q, u in zip(out.attitudes, out.forces, strict=True):
        np.testing.assert_allclose(rotate(q, E3), u / np.linalg.norm(u), atol=1e-12)
    np.testing.assert_allclose(out.rates, 0.0, atol=1e-12)


def test_position_pid_gains_act_against_the_errors():
    gains = {"k_p": (1.0, 2.0, 3.0), "k_d": (4.0, 5.0, 6.0), "k_i": (7.0, 8.0, 9.0)}
    alpha, reference = DOWN, np.zeros((4, 3))
    home, still = np.array([[0.0, 0.0, 1.0]]), np.zeros((1, 3))
    weight = 0.5 * G * E3
    moved = Drones(**gains)(home + 0.1, still, reference, np.zeros(1), alpha, dt=0.1).forces[0]
    np.testing.assert_allclose(moved - weight, [-0.17, -0.28, -0.39], rtol=1e-12)
    fast = Drones(**gains)(home, still + 0.1, reference, np.zeros(1), alpha, dt=0.1).forces[0]
    np.testing.assert_allclose(fast - weight, [-0.4, -0.5, -0.6], rtol=1e-12)


def test_position_pid_integral_is_bounded_for_each_drone():
    out = Drones(2, k_p=(0.0,) * 3, k_d=(0.0,) * 3, k_i=(1.0,) * 3, integral_limit=0.2)
    x = np.array([[1.0, 0.0, 1.0], [0.0, -1.0, 1.0]])
    for _ in range(50):
        out(x, np.zeros((2, 3)), np.zeros((4, 3)), np.zeros(2), np.tile(DOWN, (2, 1)), dt=0.01)
    np.testing.assert_allclose(out.forces, [[-0.2, 0.0, 0.5 * G], [0.0, 0.2, 0.5 * G]], atol=1e-12)


def attitude_path(t):
    """A smooth path of the wanted acceleration that tilts the thrust by up to 60 degrees."""
    return np.array([9.0 * np.sin(1.3 * t), 7.0 * np.cos(0.9 * t), 3.0 * np.sin(2.0 * t)])


@pytest.mark.parametrize("t", [0.3, 1.1, 2.4, 4.0])
def test_wanted_body_rate_is_the_rate_of_the_wanted_attitude(t):
    """Omega_id = 2 Im(q* dq/dt) of the attitudes that the controller itself wants."""
    out, dt = Drones(**NO_GAINS), 1e-6

    def at(time):
        reference = np.zeros((4, 3))
        reference[2] = attitude_path(time)
        out(np.array([[0.0, 0.0, 1.0]]), np.zeros((1, 3)), reference, np.zeros(1), DOWN, dt)
        return out.attitudes[0].copy(), out.rates[0].copy()

    before, _ = at(t - dt)
    middle, rates = at(t)
    after, _ = at(t + dt)
    slope = (after - before) / (2.0 * dt)
    w, x, y, z = quaternion.multiply(middle[0], *-middle[1:], *slope)
    np.testing.assert_allclose(w, 0.0, atol=1e-6)
    np.testing.assert_allclose(rates, 2.0 * np.array([x, y, z]), atol=1e-4)
    assert np.linalg.norm(rates) > 0.2


def test_wanted_velocity_includes_the_filtered_rate_of_the_directions():
    """A ring that turns steadily: the wanted drone velocity tends to -L alpha_dot."""
    out = Drones(k_p=(0.0,) * 3, k_d=(1.0,) * 3, k_i=(0.0,) * 3, direction_filter=0.05)
    rate, cone, dt = 0.4, 0.6, 0.001

    def alpha(t):
        return -np.array(
            [[np.sin(cone) * np.cos(rate * t), np.sin(cone) * np.sin(rate * t), np.cos(cone)]]
        )

    def alpha_dot(t):
        return (alpha(t + 1e-5) - alpha(t - 1e-5)) / 2e-5

    for k in range(1000):
        time = k * dt
        out(np.zeros((1, 3)), -alpha_dot(time), np.zeros((4, 3)), np.zeros(1), alpha(time), dt)
    residual = out.forces[0] - 0.5 * G * E3  # -k_d (v - v_wanted)
    lag = rate**2 * np.sin(cone) * 0.05
    assert np.linalg.norm(residual) < 1.1 * lag
    plain = Drones(k_p=(0.0,) * 3, k_d=(1.0,) * 3, k_i=(0.0,) * 3, direction_rates=False)
    plain(np.zeros((1, 3)), -alpha_dot(time), np.zeros((4, 3)), np.zeros(1), alpha(time), dt)
    np.testing.assert_allclose(plain.forces[0] - 0.5 * G * E3, alpha_dot(time)[0], atol=1e-9)


@pytest.mark.parametrize("acceleration", [-G, -2.0 * G, -1e6])
def test_thrust_of_zero_or_straight_down_gives_finite_commands(acceleration):
    out = Drones(**NO_GAINS)
    reference = np.zeros((4, 3))
    for k in range(5):
        reference[2] = [1e-9 * k, 0.0, acceleration]
        out(np.array([[0.0, 0.0, 1.0]]), np.zeros((1, 3)), reference, np.zeros(1), DOWN)
        for values in (out.forces, out.thrusts, out.attitudes, out.rates, out.memory):
            assert np.isfinite(values).all()
        assert np.linalg.norm(out.attitudes[0]) == pytest.approx(1.0, abs=1e-3)
        assert np.abs(out.rates).max() < 1e4


# ---------------------------------------------------------------- attitude control


def torque(q, Omega, q_d, Omega_d, **settings):
    part, team = Manifold(**settings), Team.uniform(1)
    writes, _ = part.call(
        team, part.memory(team), estimated_attitudes=[q], estimated_rates=[Omega],
        desired_attitudes=[q_d], desired_rates=[Omega_d],
    )  # fmt: skip
    return writes.torques[0]


ONE = (1.0, 0.0, 0.0, 0.0)
ZERO = (0.0, 0.0, 0.0)


def random_quaternion(rng):
    return unit(*rng.normal(size=4))


def test_no_error_no_torque():
    rng = np.random.default_rng(1)
    q, rate = random_quaternion(rng), rng.normal(size=3)
    np.testing.assert_allclose(torque(q, rate, q, rate), 0.0, atol=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_torque_turns_back_by_the_shorter_way(axis, sign):
    """A body turned by +-0.2 rad about an axis is pushed back about that axis, and damped."""
    q = np.array([np.cos(0.1), 0.0, 0.0, 0.0])
    q[1 + axis] = sign * np.sin(0.1)
    tau = torque(q, ZERO, ONE, ZERO)
    assert sign * tau[axis] < 0.0
    assert np.count_nonzero(np.abs(tau) > 1e-12) == 1
    rate = np.zeros(3)
    rate[axis] = sign
    assert sign * torque(ONE, rate, ONE, ZERO)[axis] < 0.0
    assert sign * torque(ONE, ZERO, ONE, rate)[axis] > 0.0


def test_q_and_minus_q_give_the_same_torque():
    rng = np.random.default_rng(2)
    for _ in range(100):
        q, q_d = random_quaternion(rng), random_quaternion(rng)
        Omega, Omega_d = rng.normal(size=3), rng.normal(size=3)
        tau = torque(q, Omega, q_d, Omega_d)
        np.testing.assert_array_equal(torque(-q, Omega, q_d, Omega_d), tau)
        np.testing.assert_array_equal(torque(q, Omega, -q_d, Omega_d), tau)


def test_error_depends_on_the_relative_attitude_only():
    rng = np.random.default_rng(3)
    for _ in range(20):
        q, q_d, turn = (random_quaternion(rng) for _ in range(3))
        turned = [quaternion.multiply(*turn, *p) for p in (q, q_d)]
        np.testing.assert_allclose(
            torque(turned[0], ZERO, turned[1], ZERO), torque(q, ZERO, q_d, ZERO), atol=1e-12
        )


def test_robust_term_saturates_at_beta():
    """Far out the law is linear plus beta; close in its slope is K_d + beta gamma."""
    gains = {
        "rho": (1.0,) * 3,
        "k_d": (1.0, 2.0, 3.0),
        "beta": (0.5, 0.6, 0.7),
        "gamma": (4.0,) * 3,
    }
    near, far = np.full(3, 0.01), np.full(3, 5.0)
    slope = np.array([1.0 + 0.5 * 4.0, 2.0 + 0.6 * 4.0, 3.0 + 0.7 * 4.0])
    np.testing.assert_allclose(torque(ONE, near, ONE, ZERO, **gains), -slope * 0.01, rtol=1e-12)
    expected = -(np.array([1.0, 2.0, 3.0]) * 5.0 + [0.5, 0.6, 0.7])
    np.testing.assert_allclose(torque(ONE, far, ONE, ZERO, **gains), expected, rtol=1e-12)
    np.testing.assert_allclose(torque(ONE, -far, ONE, ZERO, **gains), -expected, rtol=1e-12)
    edge = np.full(3, 0.25)
    np.testing.assert_allclose(torque(ONE, edge, ONE, ZERO, **gains), [-0.75, -1.1, -1.45])


# ---------------------------------------------------------------- closed loop


def test_hover_is_an_equilibrium_of_the_whole_loop():
    """Started in balance nothing moves, and the thrusts are |m g e3 - T alpha|."""
    run = colift.run(
        "hover", allocator="ring", cone_deg=35.0, timing__duration=2.0, start__load_offset=[0.0] * 3
    )
    r = run.recording
    T = 0.225 * G / (4.0 * np.cos(np.radians(35.0)))
    thrust = np.linalg.norm(0.5 * G * E3 - T * r["directions"][0], axis=1)
    np.testing.assert_allclose(r["thrusts"], np.tile(thrust, (len(r.time), 1)), rtol=1e-9)
    np.testing.assert_allclose(r["tensions"], T, rtol=1e-9)
    np.testing.assert_allclose(r["torques"], 0.0, atol=1e-9)
    assert run.metrics["tracking_max_m"] < 1e-10


SOFT = {
    "load_control__k_p": [2.0] * 3,
    "load_control__k_d": [1.0] * 3,
    "load_control__k_i": [0.2] * 3,
}
"""Small teams are not stable at the paper's load gains: the lateral loop gain grows with L k_p / W."""


@pytest.mark.parametrize(("n", "gains"), [(1, SOFT), (2, SOFT), (3, SOFT), (4, {})])
def test_a_perturbed_team_returns(n, gains):
    offset = [0.1, -0.05, 0.03]
    run = colift.run(
        "hover", drones__count=n, timing__duration=10.0, start__load_offset=offset, **gains
    )
    assert run.recording.outcome == "completed"
    error = np.linalg.norm(run.recording["load"][:, 0] - [0.0, 0.0, 1.0], axis=1)
    assert error[0] == pytest.approx(np.linalg.norm(offset))
    assert error[run.recording.time > 5.0].max() < 0.2 * error[0]


@pytest.mark.parametrize("mission", ["paper-spiral", "figure-eight"])
def test_yaw_stays_zero(mission):
    """The attitude's axis stays horizontal: no spin about the body's z axis builds up."""
    r = colift.run(mission, timing__duration=10.0).recording
    w, x, y, z = np.moveaxis(r["attitudes"], -1, 0)
    yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    wanted = r["desired_attitudes"]
    wanted_yaw = np.arctan2(2.0 * wanted[..., 1] * wanted[..., 2], 1.0 - 2.0 * wanted[..., 2] ** 2)
    assert np.abs(yaw - wanted_yaw).max() < 2e-3
    assert np.abs(z).max() < 2e-3
    assert np.abs(x).max() > 0.02  # and yet the drones do tilt
