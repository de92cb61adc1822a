"""The reference that is flown by hand: smooth where plans meet, within its limits, at its target in the end."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from colift.control.reference.base import ReferencePart
from colift.control.reference.figure_eight import FigureEight
from colift.control.reference.guided import Guided
from colift.control.reference.spiral import Spiral
from colift.kernel.math.turning import angles_of
from colift.mission import load_mission
from colift.team import Team
from colift.team.geometry import matrix_of

BOX = load_mission("box-figure-eight").team
STILL = np.array([[1.0, -2.0, 1.5], *np.zeros((3, 3))])
coordinates = st.floats(-20.0, 20.0)
triples = st.tuples(coordinates, coordinates, coordinates)
speeds = st.tuples(*[st.floats(-0.8, 0.8)] * 3)


def at(part: Guided, *times: float) -> np.ndarray:
    return part.sample(np.array(times))


def over(part: Guided, begin: float) -> np.ndarray:
    return part.sample(np.linspace(begin, begin + 60.0, 3001))


@given(target=triples)
@settings(max_examples=60, deadline=None)
def test_it_comes_to_rest_at_its_target_within_its_limits(target):
    part = Guided().towards(target, 3.0, STILL)
    rows = over(part, 3.0)
    np.testing.assert_allclose(rows[0], STILL, atol=1e-9)
    np.testing.assert_allclose(at(part, 1e4)[0], [target, *np.zeros((3, 3))], atol=1e-6)
    assert np.linalg.norm(rows[:, 1], axis=1).max() <= 1.001 * part.max_speed
    assert np.linalg.norm(rows[:, 2], axis=1).max() <= 1.01 * part.max_acceleration


@given(velocity=speeds)
@settings(max_examples=60, deadline=None)
def test_it_takes_up_a_steady_velocity(velocity):
    part = Guided().along(velocity, 0.0, STILL)
    rows = over(part, 0.0)
    late = at(part, 100.0, 101.0)
    np.testing.assert_allclose(late[1, 0] - late[0, 0], velocity, atol=1e-9)
    np.testing.assert_allclose(late[:, 1], [velocity] * 2, atol=1e-9)
    np.testing.assert_allclose(late[:, 2:], 0.0, atol=1e-9)
    assert np.linalg.norm(rows[:, 2], axis=1).max() <= 1.01 * part.max_acceleration


@given(first=speeds, second=speeds, target=triples, wait=st.floats(0.02, 3.0))
@settings(max_examples=60, deadline=None)
def test_a_new_plan_keeps_position_velocity_acceleration_and_jerk(first, second, target, wait):
    part, time = Guided().along(first, 2.0, STILL), 2.0
    for plan, wanted in (("along", second), ("towards", target), ("along", first)):
        time += wait
        before = at(part, time)[0]
        part = getattr(part, plan)(wanted, time, before)
        np.testing.assert_allclose(at(part, time)[0], before, atol=1e-8)
        assert np.isfinite(at(part, *np.linspace(time, time + 60.0, 301))).all()


def test_it_takes_over_from_a_spiral_in_full_motion():
    spiral = Spiral()
    state = spiral.sample(np.array([7.3]))[0]
    part = Guided().towards((0.0, 0.0, 2.0), 7.3, state)
    np.testing.assert_allclose(at(part, 7.3)[0], state, atol=1e-9)
    rows = over(part, 7.3)
    np.testing.assert_allclose(rows[-1, 0], [0.0, 0.0, 2.0], atol=1e-6)
    assert np.linalg.norm(rows[:, 1], axis=1).max() < 1.01 * part.max_speed


def test_where_the_start_is_beyond_the_limits_it_ends_at_rest_all_the_same():
    fast = np.array([[0.0, 0.0, 1.0], [9.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.0, 0.0, 0.0]])
    part = Guided().towards((5.0, 5.0, 5.0), 0.0, fast)
    np.testing.assert_allclose(at(part, 1e4)[0], [[5.0, 5.0, 5.0], *np.zeros((3, 3))], atol=1e-6)


# ---------------------------------------------------------------- a rigid load turns

LEANS = st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0), st.floats(-400.0, 400.0))


def poses(part: ReferencePart, times: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    return [part.pose(BOX, float(t))[1:] for t in times]


def slope(of: Callable[[float], np.ndarray], t: float, step: float = 1e-3) -> np.ndarray:
    near, far = of(t + step) - of(t - step), of(t + 2.0 * step) - of(t - 2.0 * step)
    return (8.0 * near - far) / (12.0 * step)


def spun(part: ReferencePart, t: float) -> np.ndarray:
    """Rates in the load's frame that the attitude's own change shows."""
    rotation = matrix_of(part.pose(BOX, t)[1])
    turning = rotation.T @ slope(lambda at: matrix_of(part.pose(BOX, at)[1]), t)
    return np.array([turning[2, 1], turning[0, 2], turning[1, 0]])


@given(wanted=LEANS)
@settings(max_examples=40, deadline=None)
def test_it_turns_to_rest_at_an_attitude_within_its_limits_wherever_the_place_goes(wanted):
    part = Guided().along((0.5, 0.0, 0.0), 1.0, STILL).turned(wanted, 3.0, np.zeros((4, 3)))
    rates = np.array(
        [slope(lambda t: angles_of(*part.pose(BOX, t)[1:])[0, :2], 3.0 + s) for s in (0.3, 1.0)]
    )
    assert np.degrees(np.abs(rates)).max() <= 1.01 * part.max_turn_deg
    attitude, still = poses(part, np.array([200.0]))[0]
    turned = Rotation.from_euler("ZYX", wanted[::-1], degrees=True).as_matrix()
    np.testing.assert_allclose(matrix_of(attitude), turned, atol=1e-9)
    np.testing.assert_allclose(still, 0.0, atol=1e-9)
    np.testing.assert_allclose(part.pose(BOX, 100.0)[0][1], [0.5, 0.0, 0.0], atol=1e-9)


@given(first=LEANS, second=LEANS, wait=st.floats(0.05, 3.0))
@settings(max_examples=40, deadline=None)
def test_a_new_turn_keeps_attitude_rates_and_both_of_their_derivatives(first, second, wait):
    part = Guided().turned(first, 2.0, np.zeros((4, 3)))
    time = 2.0 + wait
    before = part.pose(BOX, time)[1:]
    after = part.turned(second, time, angles_of(*before)).pose(BOX, time)[1:]
    np.testing.assert_allclose(matrix_of(after[0]), matrix_of(before[0]), atol=1e-9)
    np.testing.assert_allclose(after[1], before[1], atol=1e-8)


@given(wanted=LEANS, t=st.floats(0.1, 4.0))
@settings(max_examples=40, deadline=None)
def test_rates_are_those_of_the_attitude_and_each_row_the_derivative_of_the_one_above(wanted, t):
    part = Guided().turned(wanted, 0.0, np.zeros((4, 3)))
    rates = part.pose(BOX, t)[2]
    np.testing.assert_allclose(rates[0], spun(part, t), atol=1e-7)
    np.testing.assert_allclose(rates[1:], slope(lambda at: part.pose(BOX, at)[2], t)[:2], atol=1e-6)


def test_it_takes_over_from_a_leaning_figure_eight_in_full_motion():
    eight = FigureEight(period=5.4, ramp=2.0, roll_deg=10.0, pitch_deg=10.0, yaw_deg=45.0)
    _, attitude, rates = eight.pose(BOX, 7.3)
    assert np.abs(rates).min() > 1e-3
    part = Guided().turned((0.0, 0.0, 90.0), 7.3, angles_of(attitude, rates))
    np.testing.assert_allclose(matrix_of(part.pose(BOX, 7.3)[1]), matrix_of(attitude), atol=1e-9)
    np.testing.assert_allclose(part.pose(BOX, 7.3)[2], rates, atol=1e-9)


def test_a_point_does_not_turn_and_a_load_can_be_kept_upright():
    part = Guided().turned((10.0, -5.0, 30.0), 0.0, np.full((4, 3), 0.1))
    assert {name for name, _ in part.check(Team.uniform(4))} == {"attitude_deg", "turn_start_deg"}
    assert part.check(BOX) == []
    upright = [
        matrix_of(attitude) for attitude, _ in poses(part.upright(), np.linspace(0.0, 9.0, 19))
    ]
    np.testing.assert_allclose(
        [rotation[2] for rotation in upright], [[0.0, 0.0, 1.0]] * 19, atol=1e-12
    )


def test_nothing_is_shorter_than_it_may_be():
    part = Guided(least_time=3.0).turned((0.0, 0.0, 1.0), 0.0, np.zeros((4, 3)))
    part = part.towards((1.0, -2.0, 1.51), 0.0, STILL)
    assert np.linalg.norm(at(part, 2.9)[0, 1]) > 0.0
    assert np.linalg.norm(part.pose(BOX, 2.9)[2][0]) > 0.0
    np.testing.assert_allclose(at(part, 3.1)[0, 1], 0.0, atol=1e-9)


def test_angles_stay_bounded_where_there_are_none():
    straight_up = np.array([np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0])
    assert np.isfinite(angles_of(straight_up, np.ones((3, 3)))).all()


@pytest.mark.parametrize(
    "settings",
    [
        {"max_speed": 0.0},
        {"target": (0.0, 1e9, 0.0)},
        {"begin": -1.0},
        {"attitude_deg": (61.0, 0.0, 0.0)},
        {"max_turn_deg": 0.0},
    ],
)
def test_refuses_settings_out_of_range(settings):
    with pytest.raises(ValueError, match=next(iter(settings))):
        Guided(**settings)
