"""The reference that is flown by hand: smooth where plans meet, within its limits, at its target in the end."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colift.control.reference.guided import Guided
from colift.control.reference.spiral import Spiral

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


@pytest.mark.parametrize(
    "settings", [{"max_speed": 0.0}, {"target": (0.0, 1e9, 0.0)}, {"begin": -1.0}]
)
def test_refuses_settings_out_of_range(settings):
    with pytest.raises(ValueError, match=next(iter(settings))):
        Guided(**settings)
