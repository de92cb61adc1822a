"""How a load goes over to the attitude in which it hangs on fewer cables, and the reference's clock to another pace."""

from __future__ import annotations

import numpy as np
import pytest

from colift.kernel.math import leaning
from colift.team.geometry import matrix_of


def unit(*q):
    return np.array(q) / np.linalg.norm(q)


BEFORE, AFTER = unit(0.9, 0.3, -0.2, 0.1), unit(0.98, -0.1, 0.05, 0.0)
LEAN = leaning.lean_of(BEFORE, AFTER, 0.3, 1.4)


def pose(t, lean=LEAN):
    """Of a reference that yaws with 0.5 rad/s."""
    attitude, rates = np.array([np.cos(0.25 * t), 0.0, 0.0, np.sin(0.25 * t)]), np.zeros((3, 3))
    rates[0, 2] = 0.5
    share = leaning.leaned(lean, t, attitude, rates)
    return attitude, rates, share


@pytest.mark.parametrize("t", [0.31, 0.6, 1.0, 1.5, 1.69, 2.0])
def test_rates_are_the_derivatives_of_the_attitude(t):
    h = 1e-4
    before, now, after = (pose(t + k * h) for k in (-1, 0, 1))
    slope = matrix_of(now[0]).T @ (matrix_of(after[0]) - matrix_of(before[0])) / (2.0 * h)
    assert now[1][0] == pytest.approx([slope[2, 1], slope[0, 2], slope[1, 0]], abs=1e-6)
    assert (after[1][:2] - before[1][:2]) / (2.0 * h) == pytest.approx(now[1][1:], abs=2e-5)


def test_it_begins_and_ends_at_rest():
    attitude, rates, share = pose(0.3)
    assert share == 0.0
    first = matrix_of([np.cos(0.075), 0.0, 0.0, np.sin(0.075)]) @ matrix_of(BEFORE)
    assert matrix_of(attitude) == pytest.approx(first)
    assert rates[0] == pytest.approx(matrix_of(BEFORE).T @ [0.0, 0.0, 0.5])
    attitude, rates, share = pose(1.7)
    assert share == 1.0
    last = matrix_of([np.cos(0.425), 0.0, 0.0, np.sin(0.425)]) @ matrix_of(AFTER)
    assert matrix_of(attitude) == pytest.approx(last)
    assert rates[0] == pytest.approx(matrix_of(AFTER).T @ [0.0, 0.0, 0.5])
    assert rates[1:] == pytest.approx(np.zeros((2, 3)), abs=1e-9)


def test_the_clock_goes_over_to_its_pace_without_a_step():
    pace = leaning.PACE.pack(0, clock=0.0, begin=0.0, before=1.0, after=1.0, duration=0.0)
    assert leaning.paced(pace, 3.0) == (3.0, 1.0, 0.0, 0.0)
    leaning.run_at(pace, 1.0, 4.0)
    assert leaning.paced(pace, 5.0) == (5.0, 1.0, 0.0, 0.0)
    leaning.run_at(pace, 0.4, 4.0)
    assert leaning.paced(pace, 4.0) == pytest.approx((4.0, 1.0, 0.0, 0.0))
    h = 1e-5
    for t in (4.2, 4.7, 6.0):
        before, now, after = (leaning.paced(pace, t + k * h) for k in (-1, 0, 1))
        slopes = [(b - a) / (2.0 * h) for a, b in zip(before, after, strict=True)]
        assert slopes[:3] == pytest.approx(now[1:], abs=1e-5)
    assert leaning.paced(pace, 9.0)[1] == pytest.approx(0.4)
