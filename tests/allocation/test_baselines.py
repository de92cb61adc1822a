"""The fixed patterns that the paper's allocator is compared with."""

from __future__ import annotations

import numpy as np
import pytest

from colift.control.allocation.base import Allocator, Status
from colift.control.allocation.common.fixed import FixedPattern
from colift.control.allocation.lopsided import Lopsided
from colift.control.allocation.paper.newton import rotate
from colift.control.allocation.ring import Ring
from colift.team.geometry import pairwise_angles

HOVER = np.array([0.0, 0.0, 0.225 * 9.81])


def test_errata_ring_of_35_deg_has_47_86_deg_between_neighbours():
    # The paper prints 47.8 and 47.9 deg as minimum angles: the initial formation, not an optimum.
    answer = Allocator(Ring(), 4).allocate(HOVER)
    assert np.degrees(pairwise_angles(answer.directions).min()) == pytest.approx(47.855, abs=0.005)


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 16])
def test_hover_on_a_ring_shares_the_weight_equally(n):
    answer = Allocator(Ring(cone_deg=25.0), n).allocate(HOVER)
    cosine = 1.0 if n == 1 else np.cos(np.radians(25.0))
    np.testing.assert_allclose(answer.tensions, HOVER[2] / (n * cosine), rtol=1e-13)
    assert answer.status.ok


def test_lopsided_pattern_has_the_papers_bad_angles_and_tension_ratio():
    answer = Allocator(Lopsided(), 4).allocate(HOVER)
    angles = np.degrees(np.sort(pairwise_angles(answer.directions)))
    assert 17.0 <= angles[0] <= angles[1] <= 28.0
    assert 2.5 <= answer.tensions.max() / answer.tensions.min() <= 3.3
    assert answer.status.ok


@pytest.mark.parametrize("pattern", [Ring(), Lopsided()])
@pytest.mark.parametrize("off", [1.0, 1e-3, 1e-5, 2e-6, 1e-6, 1e-7, 1e-9, 0.0])
def test_pattern_turns_rigidly_even_to_forces_almost_straight_down(pattern, off):
    upright = Allocator(pattern, 4).allocate(HOVER)
    force = HOVER[2] * np.array([0.8 * np.sin(off), 0.6 * np.sin(off), -np.cos(off)])
    answer = Allocator(pattern, 4).allocate(force)
    assert answer.status is Status.CONVERGED
    assert answer.force_residual <= 1e-12 * HOVER[2]
    np.testing.assert_allclose(
        answer.directions @ answer.directions.T,
        upright.directions @ upright.directions.T,
        rtol=0.0,
        atol=1e-13,
    )


@pytest.mark.parametrize("off", [np.pi, 2.0, 0.5, 0.3, 1e-3, 1e-5, 1e-7, 1e-9])
def test_rotation_between_two_forces_is_the_smallest_one(off):
    # off: angle between the new direction and the opposite of the old one.
    rng = np.random.default_rng(0)
    a = rng.normal(size=3)
    a /= np.linalg.norm(a)
    side = np.cross(a, rng.normal(size=3))
    side /= np.linalg.norm(side)
    b = -np.cos(off) * a + np.sin(off) * side
    axis = np.cross(a, side)  # of the rotation by pi - off
    vectors = np.concatenate([a, axis, rng.normal(size=3)])
    multiplier = vectors[6:].copy()
    third = vectors[6:].copy()
    rotate(3, *a, *b, vectors, multiplier)
    np.testing.assert_allclose(vectors[:3], b, atol=1e-14)
    np.testing.assert_allclose(vectors[3:6], axis, atol=1e-14)
    angle = np.pi - off
    rodrigues = (
        np.cos(angle) * third
        + np.sin(angle) * np.cross(axis, third)
        + (1.0 - np.cos(angle)) * (axis @ third) * axis
    )
    np.testing.assert_allclose(vectors[6:], rodrigues, atol=1e-6 if off < 1e-8 else 1e-8)
    np.testing.assert_allclose(multiplier, vectors[6:], atol=0.0)


class Onesided(FixedPattern):
    """Both drones on the same side: the load's weight would need one of them to push."""

    def pattern(self, n):
        tilt = np.radians([20.0, 50.0])
        return -np.column_stack([np.sin(tilt), np.zeros(2), np.cos(tilt)])


def test_a_pattern_that_would_need_to_push_says_so():
    answer = Allocator(Onesided(), 2).allocate(HOVER)
    assert answer.status is Status.CLAMPED
    assert answer.tensions[1] == 0.0
    assert answer.tensions[0] > 0.0
    assert answer.force_residual > 0.1 * HOVER[2]
