"""Motors: the mixer inverts, limits are kept in a fixed order, the lag is a first-order lag."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record import metrics
from colift.team import Team
from colift.world.actuation.ideal import Ideal
from colift.world.actuation.motors import Motors, mix

ARM, RATIO = 0.2, 0.016
LEVER = ARM / np.sqrt(2.0)
PLACES = LEVER * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]], dtype=float)
SPIN = np.array([1.0, -1.0, 1.0, -1.0])
IDEAL = {"time_constant": 0.0, "noise": 0.0, "max_rate": 1e6}


def effect(thrusts, centre=(0.0, 0.0, 0.0)):
    """Thrust and torques (4,) of four motors, from r x F."""
    forces = np.outer(thrusts, [0.0, 0.0, 1.0])
    torque = np.cross(PLACES - centre, forces).sum(axis=0)
    return np.array([np.sum(thrusts), torque[0], torque[1], RATIO * SPIN @ thrusts + torque[2]])


def mixed(f, tau, low=0.0, high=3.0):
    out = np.zeros(4)
    mix(f, *tau, LEVER, RATIO, low, high, out)
    return out


class Rotors:
    """One kind of motors on n drones."""

    def __init__(self, part, n=1, *, dt=0.001, key=5):
        self.part, self.n, self.dt, self.key = part, n, dt, key
        self.team, self.memory = Team.uniform(n), part.memory(Team.uniform(n))
        self.health = np.ones((n, 4))
        self.saturated_times = np.zeros(n)

    def act(self, f, tau=(0.0, 0.0, 0.0), step=0):
        acting, _ = self.part.call(
            self.team, self.memory, step=step, key=self.key, dt=self.dt,
            thrusts=np.full(self.n, float(f)), torques=np.tile(tau, (self.n, 1)),
            motor_health=self.health, saturated_times=self.saturated_times,
        )  # fmt: skip
        return np.column_stack([acting.applied_thrusts, acting.applied_torques])


@settings(deadline=None)
@given(st.lists(st.floats(0.0, 3.0), min_size=4, max_size=4))
def test_mixer_inverts_what_four_motors_do(thrusts):
    f, *tau = effect(np.array(thrusts))
    np.testing.assert_allclose(mixed(f, tau), thrusts, atol=1e-9)
    np.testing.assert_allclose(Rotors(Motors(**IDEAL)).act(f, tau)[0], [f, *tau], atol=1e-9)


@settings(deadline=None)
@given(
    st.floats(-5.0, 20.0),
    st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0), st.floats(-1.0, 1.0)),
    st.floats(0.0, 0.5),
)
def test_saturation_gives_up_yaw_then_thrust_then_roll_and_pitch(f, tau, low):
    high = 3.0
    out = mixed(f, tau, low, high)
    assert (out >= low - 1e-12).all()
    assert (out <= high + 1e-12).all()
    f_0, x, y, z = effect(out)
    exact = np.linalg.solve(np.column_stack([effect(row) for row in np.eye(4)]), [f, *tau])
    if exact.min() >= low - 1e-10 and exact.max() <= high + 1e-10:
        np.testing.assert_allclose(out, exact, atol=1e-8)
        return
    # Yaw only if there is room: never beyond or against what is wanted.
    assert z * tau[2] >= -1e-12
    assert abs(z) <= abs(tau[2]) + 1e-12
    # Roll and pitch: in their ratio, whole where the range of a motor and the wanted thrust allow.
    half = 0.25 * (abs(tau[0]) + abs(tau[1])) / LEVER
    common = np.clip(0.25 * f, low, high)
    room = min(0.5 * (high - low), common - low)
    share = min(1.0, room / half) if half > 0.0 else 1.0
    np.testing.assert_allclose([x, y], [share * tau[0], share * tau[1]], atol=1e-9)
    # Thrust: lowered to make room for them, never raised, and whatever yaw wants.
    np.testing.assert_allclose(f_0, 4.0 * min(common, high - share * half), atol=1e-9)


def test_yaw_takes_what_is_left():
    f, x, y, z = effect(mixed(11.0, (0.0, 0.0, 1.0)))
    np.testing.assert_allclose([f, x, y], [11.0, 0.0, 0.0], atol=1e-12)
    assert z == pytest.approx(
        4 * 0.25 * RATIO
    )  # a quarter of a newton is left of each motor's three
    assert effect(mixed(12.0, (0.0, 0.0, 1.0)))[3] == pytest.approx(0.0, abs=1e-12)


def test_step_response_is_first_order():
    rotors = Rotors(Motors(time_constant=0.03, noise=0.0, max_rate=1e6))
    assert rotors.act(4.0)[0, 0] == pytest.approx(4.0)  # in balance at the start
    found = np.array([rotors.act(6.0, (0.1, 0.0, 0.0))[0] for _ in range(200)])
    rise = 1.0 - np.exp(-0.001 * np.arange(1, 201) / 0.03)
    np.testing.assert_allclose(found[:, 0], 4.0 + 2.0 * rise, rtol=1e-12)
    np.testing.assert_allclose(found[:, 1], 0.1 * rise, rtol=1e-9)
    coarse = Rotors(Motors(time_constant=0.03, noise=0.0, max_rate=1e6), dt=0.01)
    coarse.act(4.0)
    steps = np.array([coarse.act(6.0)[0, 0] for _ in range(20)])
    np.testing.assert_allclose(steps, found[9::10, 0], rtol=1e-12)


def test_rate_limit():
    rotors = Rotors(Motors(time_constant=0.0, noise=0.0, max_rate=50.0))
    rotors.act(4.0)
    found = np.array([rotors.act(8.0)[0, 0] for _ in range(30)])
    np.testing.assert_allclose(found, np.minimum(4.0 + 0.2 * np.arange(1, 31), 8.0), rtol=1e-12)


@pytest.mark.parametrize("dt", [0.001, 0.004])
def test_motor_noise_has_its_size_and_the_motors_bandwidth_at_any_step(dt):
    rotors = Rotors(Motors(noise=0.05, time_constant=0.02), 60, dt=dt)
    f = np.array([rotors.act(6.0, step=k)[:, 0] for k in range(1500)])[300:] - 6.0
    assert f.std() == pytest.approx(2.0 * 0.05, rel=0.05)  # of four motors
    lag = round(0.02 / dt)
    correlation = (f[lag:] * f[:-lag]).mean() / f.var()
    assert correlation == pytest.approx(np.exp(-1.0), abs=0.05)


def test_a_dead_motor_takes_its_thrust_and_its_torque():
    rotors = Rotors(Motors(**IDEAL))
    rotors.health[0] = [0.0, 1.0, 0.5, 1.0]
    np.testing.assert_allclose(rotors.act(4.0)[0], effect([0.0, 1.0, 0.5, 1.0]), atol=1e-12)


def test_an_offset_centre_of_gravity_turns_thrust_into_torque():
    found = Rotors(Motors(**IDEAL, centre_offset=(0.01, -0.02))).act(5.0)[0]
    np.testing.assert_allclose(found, effect(np.full(4, 1.25), (0.01, -0.02, 0.0)), atol=1e-12)
    np.testing.assert_allclose(found[1:3], [5.0 * 0.02, 5.0 * 0.01], atol=1e-12)


def test_time_at_the_limits_is_counted_for_each_drone():
    rotors = Rotors(Motors(max_thrust=[3.0, 1.5]), 2)
    for f, tau in [(6.0, (0.0, 0.0, 0.0)), (6.1, (0.0, 0.0, 0.0)), (1.0, (0.2, 0.0, 0.0))]:
        rotors.act(
            f, tau
        )  # the second drone's 6 N are all it has; 0.2 N m want 0.35 N of each motor
    np.testing.assert_allclose(rotors.saturated_times, [0.001, 0.002], rtol=1e-12)
    rotors.act(0.0)
    rotors.act(-0.1)
    rotors.act(8.0, (0.0, 0.0, 0.1))  # yaw alone is given up
    np.testing.assert_allclose(rotors.saturated_times, [0.003, 0.004], rtol=1e-12)
    ideal = Rotors(Ideal())
    ideal.act(1e3)
    assert ideal.saturated_times[0] == 0.0


def test_saturation_in_flight_is_counted_and_can_be_a_criterion():
    """Against the commands of every step, by the inverse of what four motors do."""
    criteria = {"criteria": {"saturated_time_s": {"max": 0.1}}}
    settings = {"timing.duration": 1.0, "timing.recording": 0.001, **criteria}
    recording = Flight(load_mission("noisy-spiral", settings)).run()
    commands = np.concatenate([recording["thrusts"][..., None], recording["torques"]], axis=2)
    exact = commands @ np.linalg.inv(np.column_stack([effect(row) for row in np.eye(4)])).T
    beyond = ((exact < -1e-9) | (exact > 3.0 + 1e-9)).any(axis=2)
    assert beyond.any(axis=0).all()
    assert not beyond.all(axis=0).any()
    counted = 0.001 * np.cumsum(beyond, axis=0)
    np.testing.assert_allclose(recording["saturated_times"], counted, rtol=0, atol=1e-12)
    value = metrics.compute(recording)["saturated_time_s"]
    assert value == pytest.approx(counted[-1].sum())
    assert value > 0.1
    assert not recording.mission.criteria["saturated_time_s"].holds(value)


def test_default_motors_suit_the_papers_drone():
    part = Motors().filled(Team.uniform(1))
    assert part.check(Team.uniform(4)) == []
    assert 4.0 * part.max_thrust > 2.0 * 0.5 * 9.81


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        ({"actuation.max_thrust": 1.2}, r"must exceed 1\.226 N: drone 0 weighs 4\.905 N"),
        ({"actuation.max_thrust": [3.0, 3.0]}, r"2 values; must be one value or one for each of 4"),
        ({"load.mass": 3.0, "allocation.tension_max": 20.0}, r"4 drones lift less than 2\.893 kg"),
        ({"actuation.min_thrust": 3.0}, r"min_thrust.*below max_thrust = 3 N"),
        ({"actuation.time_constant": -0.1}, r"time_constant"),
        ({"actuation.arm_length": 0.0}, r"arm_length"),
    ],
)
def test_motors_that_cannot_lift_are_refused_with_what_would_do(changes, problem):
    table = {"name": "t", "reference": {"kind": "hover"}, "actuation": {"kind": "motors"}}
    with pytest.raises(MissionError, match=problem):
        load_mission(table, changes)
