"""Every reference: each row the derivative of the one above, no jump up to the jerk, rest at start."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colift import part
from colift.control.reference.waypoints import Waypoints
from colift.kernel.math.smooth import phase, rest_to_rest

NAMES = part.names("reference")
STEP = 1e-4
rng = np.random.default_rng(0)
TIMES = np.concatenate([rng.uniform(0.0, 3.0, 200), rng.uniform(0.0, 25.0, 300)])


@pytest.fixture(params=NAMES)
def reference(request):
    return part.find("reference", request.param)()


def test_there_are_references():
    assert {"hover", "spiral", "figure-eight", "waypoints"} <= set(NAMES)


def test_each_row_is_the_derivative_of_the_row_above(reference):
    times = TIMES + 2 * STEP
    ahead, behind = reference.sample(times + STEP), reference.sample(times - STEP)
    further, before = reference.sample(times + 2 * STEP), reference.sample(times - 2 * STEP)
    slope = (8.0 * (ahead - behind) - (further - before)) / (12.0 * STEP)
    here = reference.sample(times)
    # Where the jerk has a corner its difference quotient is not a derivative: rows 0 to 2 only.
    np.testing.assert_allclose(here[:, 1:], slope[:, :3], rtol=0, atol=1e-6)


def test_starts_at_rest_and_stays_there_before_the_start(reference):
    first = reference.sample(np.array([0.0, 1e-12, -1.0]))
    np.testing.assert_allclose(first[:, 1:], 0.0, atol=1e-9)
    np.testing.assert_allclose(first[0, 0], first[2, 0], atol=1e-9)


def test_no_jump_up_to_the_jerk(reference):
    """Over a fine grid that steps across every ramp and leg, changes shrink with the step."""
    for step in (1e-3, 1e-4):
        times = np.concatenate([centre + step * np.arange(-20, 21) for centre in range(1, 21)])
        rows = reference.sample(times).reshape(20, 41, 4, 3)
        change = np.abs(np.diff(rows, axis=1)).max(axis=(0, 1, 3))
        assert (change < 60.0 * step).all(), change


def test_references_differ_from_a_standstill():
    moving = [n for n in NAMES if np.ptp(part.find("reference", n)().sample(TIMES)[:, 0]) > 1.0]
    assert {"spiral", "figure-eight", "waypoints"} <= set(moving)


# ---------------------------------------------------------------- shapes


def test_spiral_is_a_climbing_circle():
    spiral = part.find("reference", "spiral")(radius=2.0, period=6.0, climb_rate=0.3, ramp=1.5)
    rows = spiral.sample(np.linspace(2.0, 20.0, 500))
    np.testing.assert_allclose(np.hypot(rows[:, 0, 0], rows[:, 0, 1]), 2.0, rtol=1e-12)
    np.testing.assert_allclose(rows[:, 1, 2], 0.3, rtol=1e-12)
    rate = 2.0 * np.pi / 6.0
    np.testing.assert_allclose(np.linalg.norm(rows[:, 1, :2], axis=1), 2.0 * rate, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(rows[:, 2], axis=1), 2.0 * rate**2, rtol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(rows[:, 3], axis=1), 2.0 * rate**3, rtol=1e-12)
    turn = rows[:, 0, 0] * rows[:, 1, 1] - rows[:, 0, 1] * rows[:, 1, 0]
    assert (turn > 0.0).all()  # anticlockwise from above


def test_spiral_repeats_after_one_period_but_for_the_climb():
    spiral = part.find("reference", "spiral")(period=7.0, climb_rate=0.2)
    a, b = spiral.sample(np.array([5.0, 12.0]))
    np.testing.assert_allclose(b[0] - a[0], [0.0, 0.0, 1.4], atol=1e-12)
    np.testing.assert_allclose(b[1:], a[1:], atol=1e-12)


def test_figure_eight_crosses_its_centre_and_reaches_its_extent():
    eight = part.find("reference", "figure-eight")(centre=(1.0, 2.0, 3.0), length=1.5, width=0.75)
    rows = eight.sample(np.linspace(4.0, 12.0, 8001))[:, 0] - [1.0, 2.0, 3.0]
    np.testing.assert_allclose(np.abs(rows).max(axis=0), [1.5, 0.75, 0.0], atol=1e-5)
    np.testing.assert_allclose(rows[0], rows[-1], atol=1e-9)
    crossings = np.linalg.norm(rows, axis=1) < 2e-3
    assert np.count_nonzero(np.diff(crossings.astype(int)) == 1) == 2


def test_a_figure_eight_may_rise_and_fall():
    eight = part.find("reference", "figure-eight")(height=0.35)
    test_each_row_is_the_derivative_of_the_row_above(eight)
    test_starts_at_rest_and_stays_there_before_the_start(eight)
    rows = eight.sample(np.linspace(4.0, 12.0, 8001))[:, 0] - eight.centre
    np.testing.assert_allclose(np.abs(rows).max(axis=0), [1.5, 0.75, 0.35], atol=1e-5)
    np.testing.assert_allclose(rows[:, 2], 0.35 / 1.5 * rows[:, 0], atol=1e-12)


def test_waypoints_are_visited_at_rest_and_joined_by_straight_lines():
    points = [(0.0, 0.0, 1.0), (2.0, 1.0, 1.5), (2.0, -1.0, 1.5)]
    plan = Waypoints(points=points, travel=3.0, hold=0.5)
    for k, point in enumerate(points):
        rest = plan.sample(np.array([3.5 * k + 0.01, 3.5 * k + 0.49]))
        np.testing.assert_allclose(rest[:, 0], [point, point], atol=1e-9)
        np.testing.assert_allclose(rest[:, 1:], 0.0, atol=1e-9)
    leg = plan.sample(np.linspace(0.5, 3.5, 50))[:, 0] - points[0]
    direction = np.subtract(points[1], points[0])
    np.testing.assert_allclose(np.cross(leg, direction), 0.0, atol=1e-12)
    half = plan.sample(np.array([2.0]))[0]
    np.testing.assert_allclose(half[0], np.add(points[0], points[1]) / 2.0, atol=1e-12)
    np.testing.assert_allclose(half[2], 0.0, atol=1e-12)  # symmetric: no acceleration half way
    np.testing.assert_allclose(plan.sample(np.array([1e6]))[0, 0], points[-1])


def test_waypoints_without_hold_and_with_one_point():
    np.testing.assert_allclose(
        Waypoints(points=[(1.0, 2.0, 3.0)]).sample(TIMES)[:, 0], [[1, 2, 3]] * 500
    )
    hasty = Waypoints(
        points=[(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0)], travel=1.0, hold=0.0
    )
    np.testing.assert_allclose(
        hasty.sample(np.array([0.0, 1.0, 2.0, 3.0]))[:, 0],
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [1, 1, 0]],
        atol=1e-12,
    )


# ---------------------------------------------------------------- ramps


@given(
    s=st.floats(0.0, 1.0),
    duration=st.floats(0.1, 20.0),
    rate=st.floats(-5.0, 5.0),
)
@settings(deadline=None, max_examples=200)
def test_phase_is_three_times_differentiable(s, duration, rate):
    t, h = s * duration, 1e-4 * duration
    p = phase(t, duration, rate)
    ahead, behind = phase(t + h, duration, rate), phase(t - h, duration, rate)
    # Central differences; the third derivative has a corner at both ends, where they are O(h).
    for k in range(3):
        scale = max(abs(rate), 1e-3) * duration ** (-k)
        assert abs((ahead[k] - behind[k]) / (2.0 * h) - p[k + 1]) < 1e-2 * scale


def test_phase_ends():
    assert phase(0.0, 2.0, 3.0) == (0.0, 0.0, 0.0, 0.0)
    end = phase(2.0, 2.0, 3.0)
    assert end == (3.0, 3.0, 0.0, 0.0)  # half of the ramp's time is lost
    np.testing.assert_allclose(phase(2.0 * (1.0 - 1e-9), 2.0, 3.0), end, atol=1e-6)
    rates = [phase(t, 2.0, 3.0)[1] for t in np.linspace(0.0, 2.0, 201)]
    assert (np.diff(rates) >= 0.0).all()
    assert max(rates) == 3.0  # no overshoot


def test_septic_is_symmetric_monotone_and_flat_at_its_ends():
    assert rest_to_rest(-0.5) == (0.0, 0.0, 0.0, 0.0)
    assert rest_to_rest(1.5) == (1.0, 0.0, 0.0, 0.0)
    assert rest_to_rest(0.5)[0] == pytest.approx(0.5)
    assert rest_to_rest(0.5)[1] == pytest.approx(35.0 / 16.0)  # the peak of 140 s^3 (1 - s)^3
    grid = np.array([rest_to_rest(s) for s in np.linspace(0.0, 1.0, 1001)])
    assert (np.diff(grid[:, 0]) >= 0.0).all()
    assert grid[:, 1].max() == pytest.approx(35.0 / 16.0)
    np.testing.assert_allclose(grid[:, 0] + grid[::-1, 0], 1.0, atol=1e-12)
    for end in (1e-6, 1.0 - 1e-6):
        np.testing.assert_allclose(rest_to_rest(end)[1:], 0.0, atol=1e-2)
    slope = np.gradient(grid[:, 0], 1e-3)
    np.testing.assert_allclose(slope[1:-1], grid[1:-1, 1], atol=1e-4)
