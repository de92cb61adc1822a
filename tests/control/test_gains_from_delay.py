"""The rule that gives a delayed cascade its gains, against the phase margins that it promises."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from colift.control.attitude_control.delay_aware import DelayAware
from colift.control.tuning import (
    DOUBT,
    MOST_VELOCITY,
    RATE_MARGIN,
    SNAP,
    VELOCITY_MARGIN,
    Delays,
    turning,
)
from colift.team import Team

TEAM = Team.uniform(4)

settings_of_a_loop = st.fixed_dictionaries(
    {
        "delay": st.floats(0.0, 0.1),
        "period": st.floats(0.001, 0.05),
        "lag": st.floats(0.0, 0.1),
        "predicted": st.booleans(),
    }
)


def counted(found: Delays) -> float:
    """Delay that counts, s."""
    share = DOUBT if found.predicted else 1.0
    return share * (found.delay + found.lag) + 0.5 * found.period


@given(settings_of_a_loop)
def test_the_rate_loop_has_its_phase_margin(given_settings):
    found = Delays(**given_settings)
    w = found.bandwidths(TEAM).rate
    # Open loop K_d / (J s) exp(-s tau) at its crossover.
    loop = w / (1j * w) * cmath.exp(-1j * w * counted(found))
    assert abs(loop) == pytest.approx(1.0)
    assert math.pi + cmath.phase(loop) == pytest.approx(RATE_MARGIN, rel=1e-9)


@given(settings_of_a_loop)
def test_the_velocity_loop_has_its_phase_margin_behind_the_attitude(given_settings):
    found = Delays(**given_settings)
    band = found.bandwidths(TEAM)
    w = band.velocity
    loop = w / (1j * w) * cmath.exp(-1j * w * (counted(found) + 2.0 / band.rate))
    margin = math.pi + cmath.phase(loop)
    if w < MOST_VELOCITY:
        assert margin == pytest.approx(VELOCITY_MARGIN, rel=1e-9)
    else:
        assert w == MOST_VELOCITY
        assert margin > VELOCITY_MARGIN - 1e-9
    # (s^2 + w s + w^2 / 4) is critically damped: each outer loop at a quarter of its inner one.
    for outer, inner in ((band.attitude, band.rate), (band.position, band.velocity)):
        assert inner**2 - 4.0 * inner * outer == pytest.approx(0.0, abs=1e-6 * inner**2)


def test_more_delay_asks_for_slower_loops():
    slower = [Delays(delay=delay, predicted=False).bandwidths(TEAM) for delay in (0.0, 0.01, 0.03)]
    for name in ("rate", "attitude", "velocity", "position"):
        values = [getattr(band, name) for band in slower]
        assert values == sorted(values, reverse=True)
    assert Delays(delay=0.03).bandwidths(TEAM).rate > 1.5 * slower[-1].rate


def test_no_loop_asks_for_more_than_the_rotors_turn():
    """All torque is asked for at an error of SNAP or more: w^2 theta / 4 of angular acceleration."""
    quick, slow = (
        Team.uniform(2, max_thrust=10.0, arm=0.2),
        Team.uniform(2, max_thrust=10.0, arm=0.01, inertia=(0.02, 0.02, 0.04)),
    )
    part = Delays(delay=0.02, period=0.01)
    assert part.bandwidths(quick) == part.bandwidths(TEAM)
    rate = part.bandwidths(slow).rate
    assert rate < part.bandwidths(TEAM).rate
    assert 0.25 * rate**2 * SNAP == pytest.approx(turning(slow)[0].min())
    weightless = Team.uniform(2, max_thrust=10.0, arm=0.01, gravity=0.0)
    assert part.bandwidths(weightless) == part.bandwidths(TEAM)


# ---------------------------------------------------------------- the attitude in closed loop


def turn(part: DelayAware, delay: float, seconds: float = 2.0, angle: float = 0.5):
    """Roll angle over time of one drone that sees its attitude late; physics at 1 ms, control at 10 ms."""
    team = Team.uniform(1)
    J, h, every = team.inertias[0, 0], 1e-3, 10
    memory = part.memory(team)
    roll, rate, late = 0.0, 0.0, round(delay / h)
    past, out = [(0.0, 0.0)] * (late + 1), []
    torque = np.zeros((1, 3))
    wanted = np.array([[math.cos(0.5 * angle), math.sin(0.5 * angle), 0.0, 0.0]])
    for k in range(round(seconds / h)):
        seen, speed = past[-1 - late]
        if k % every == 0:
            q = np.array([[math.cos(0.5 * seen), math.sin(0.5 * seen), 0.0, 0.0]])
            part.call(
                team, memory, dt=every * h, estimated_attitudes=q,
                estimated_rates=[[speed, 0.0, 0.0]], desired_attitudes=wanted, torques=torque,
            )  # fmt: skip
        rate += h * torque[0, 0] / J
        roll += h * rate
        past.append((roll, rate))
        out.append(roll)
    return np.array(out)


@pytest.mark.parametrize("delay", [0.0, 0.02, 0.05])
@pytest.mark.parametrize("predicted", [True, False])
def test_a_step_of_the_attitude_is_followed_without_much_overshoot(delay, predicted):
    roll = turn(DelayAware(delay=delay, predicted=predicted), delay)
    assert roll.max() < 0.5 * 1.1
    assert abs(roll[-1] - 0.5) < 0.01


def test_a_prediction_answers_faster_than_caution():
    fast, slow = (turn(DelayAware(delay=0.05, predicted=p), 0.05) for p in (True, False))
    assert np.argmax(fast > 0.45) < 0.7 * np.argmax(slow > 0.45)


def test_gains_that_know_nothing_of_the_delay_diverge():
    roll = turn(DelayAware(delay=0.0), 0.05)
    assert np.abs(roll[-500:] - 0.5).max() > 0.3


def test_torques_stay_within_what_rotors_can_do():
    part, team = DelayAware(), Team.uniform(3)
    memory = part.memory(team)
    rng, tau = np.random.default_rng(0), np.zeros((3, 3))
    tilting, turning = (
        part.settled(name, team) for name in ("max_acceleration", "max_yaw_acceleration")
    )
    most = team.inertias * np.column_stack([tilting, tilting, turning])
    for _ in range(200):
        q = rng.normal(size=(2, 3, 4))
        q /= np.linalg.norm(q, axis=2, keepdims=True)
        part.call(
            team, memory, dt=0.01, estimated_attitudes=q[0],
            estimated_rates=rng.normal(size=(3, 3)) * 1e3, desired_attitudes=q[1], torques=tau,
        )  # fmt: skip
        assert np.isfinite(tau).all()
        assert (np.abs(tau) <= most * (1.0 + 1e-9)).all()
