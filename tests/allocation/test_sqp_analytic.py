"""What is true of the paper's problem on paper, against the allocator's answers."""

from __future__ import annotations

import numpy as np
import pytest

from colift.control.allocation.paper import newton
from colift.control.allocation.sqp import Sqp, SqpAllocator
from colift.team.geometry import pairwise_angles, ring


def objective_of_alignment(a, n, mu, W):
    """J for M = diag(b, b, a) (n >= 3) or diag(0, b, a) (n = 2) with trace n."""
    b = 0.5 * (n - a) if n > 2 else n - a
    return 0.5 * W**2 / a + 0.5 * mu * (a**2 + (2.0 if n > 2 else 1.0) * b**2 - n)


def best_alignment(n, mu, W):
    """The closed form, through the polynomial's roots rather than the library's Newton loop."""
    if 2.0 * mu * n**3 <= W * W:
        return float(n)
    cubic = [3.0 * mu, -n * mu, 0.0, -W * W] if n > 2 else [4.0 * mu, -4.0 * mu, 0.0, -W * W]
    roots = np.roots(cubic)
    real = roots[np.abs(roots.imag) < 1e-9].real
    (root,) = real[real > 0.0]
    return float(root)


@pytest.mark.parametrize("n", [2, 3, 4, 5, 8, 16, 64])
@pytest.mark.parametrize("mu", [1e-3, 0.15, 1.35, 40.0])
@pytest.mark.parametrize("W", [0.5, 2.207, 9.0])
def test_closed_form_alignment_minimises_the_reduced_objective(n, mu, W):
    a = best_alignment(n, mu, W)
    # The library's scaled version gives the same a and J.
    assert newton.optimal_alignment(n, mu / W**2) == pytest.approx(a, rel=1e-9)
    J = objective_of_alignment(a, n, mu, W)
    assert W**2 * newton.optimal_objective(n, mu / W**2) == pytest.approx(J, rel=1e-12, abs=1e-12)
    # And no other alignment up to that of parallel cables does better.
    others = objective_of_alignment(np.linspace(1e-3 * n, n, 20_001), n, mu, W)
    assert others.min() >= J - 1e-12 * (1.0 + abs(J))


@pytest.mark.parametrize(("mu", "W"), [(0.15, 1.0), (0.15, 0.4), (1.0, 3.9), (0.05, 2.207)])
def test_two_cables_law_beats_every_pair_of_a_brute_force_scan(mu, W):
    # 4 mu a^2 (a - 1) = W^2. Two cables balance a force only in a plane with it: angles u, v on
    # either side of it, tensions by the sine rule.
    u, v = np.meshgrid(*[np.linspace(0.001, 3.0, 1200)] * 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        first, second = W * np.sin(v) / np.sin(u + v), W * np.sin(u) / np.sin(u + v)
        J = 0.5 * (first**2 + second**2) + mu * np.cos(u + v) ** 2
    J = np.where((first >= 0) & (second >= 0), J, np.inf)
    answer = SqpAllocator(2, mu).allocate([0.0, 0.0, W])
    assert answer.status.ok
    assert answer.objective <= J.min() + 1e-12
    assert answer.objective == pytest.approx(J.min(), abs=1e-4)
    a = float(np.sum(answer.directions[:, 2] ** 2))
    if a < 2.0 - 1e-6:
        assert 4.0 * mu * a**2 * (a - 1.0) == pytest.approx(W**2, rel=1e-6)
    else:
        assert 4.0 * np.sqrt(mu) <= W


@pytest.mark.parametrize("n", [3, 4, 5, 8, 16, 64])
@pytest.mark.parametrize("mu", [0.02, 0.15, 1.35])
@pytest.mark.parametrize("W", [0.7, 2.207])
def test_symmetric_ring_becomes_the_closed_form_optimum(n, mu, W):
    answer = SqpAllocator(n, mu).allocate([0.0, 0.0, W])
    a = best_alignment(n, mu, W)
    assert answer.status.ok
    assert abs(answer.optimality_gap) <= 1e-12 * (1.0 + abs(answer.objective))
    M = answer.directions.T @ answer.directions
    b = 0.5 * (n - a)
    # The objective is flat to second order about M*, which the tolerance of 1e-8 reaches to ~1e-7.
    np.testing.assert_allclose(M, np.diag([b, b, a]), atol=1e-6 * n)
    assert answer.tensions.sum() == pytest.approx(W / np.sqrt(a / n), rel=1e-6)
    np.testing.assert_allclose(answer.tensions, W / np.sqrt(a * n), rtol=1e-5)


@pytest.mark.parametrize("n", [2, 3, 4, 6, 8])
def test_cables_collapse_exactly_at_the_threshold_force(n):
    mu = 0.15
    threshold = np.sqrt(2.0 * mu * n**3)
    below = SqpAllocator(n, mu).allocate([0.0, 0.0, 0.98 * threshold])
    above = SqpAllocator(n, mu).allocate([0.0, 0.0, 1.02 * threshold])
    assert below.status.ok
    assert above.status.ok
    assert np.degrees(pairwise_angles(below.directions).max()) > 5.0
    assert np.degrees(pairwise_angles(above.directions).max()) < 0.01
    np.testing.assert_allclose(above.tensions, 1.02 * threshold / n, rtol=1e-6)
    assert abs(below.optimality_gap) <= 1e-10 * below.objective
    assert abs(above.optimality_gap) <= 1e-10 * above.objective


def test_the_papers_team_collapses_under_a_load_of_0_45_kg():
    def widest(load_mass):
        answer = SqpAllocator(4, 0.15).allocate([0.0, 0.0, load_mass * 9.81])
        return np.degrees(pairwise_angles(answer.directions).max())

    assert widest(0.440) > 5.0
    assert widest(0.450) < 0.01


@pytest.mark.parametrize("n", [1, 2, 4, 7])
@pytest.mark.parametrize(("c", "digits"), [(4.0, None), (0.125, None), (3.7, 1e-8), (1e5, 1e-8)])
def test_scaling_force_by_c_and_mu_by_c_squared_scales_tensions_only(n, c, digits):
    force = np.array([0.4, -0.3, 2.1])
    one = SqpAllocator(n, 0.15).allocate(force)
    other = SqpAllocator(n, 0.15 * c * c).allocate(c * force)
    if digits is None:  # powers of two scale without rounding
        assert np.array_equal(other.tensions, c * one.tensions)
        assert np.array_equal(other.directions, one.directions)
    else:
        np.testing.assert_allclose(other.tensions, c * one.tensions, rtol=digits)
        np.testing.assert_allclose(other.directions, one.directions, atol=digits)
    assert other.iterations == one.iterations


def reduced_objective(directions, mu, force):
    """J after eliminating the tensions: a function of M alone."""
    M = np.einsum("...ij,...ik->...jk", directions, directions)
    carried = np.linalg.solve(M, np.broadcast_to(force, M.shape[:-1])[..., None])[..., 0]
    n = directions.shape[-2]
    return 0.5 * carried @ force + 0.5 * mu * (np.sum(M * M, axis=(-2, -1)) - n)


def riemannian_hessian(directions, mu, force, step=1e-4):
    """Second differences of the reduced objective over the product of spheres (2n coordinates)."""
    n = len(directions)
    bases = np.array([np.linalg.svd(d[None, :])[2][1:] for d in directions])  # (n, 2, 3)

    def value(x):
        moved = directions + np.einsum("...ik,ikj->...ij", x.reshape(*x.shape[:-1], n, 2), bases)
        moved /= np.linalg.norm(moved, axis=-1, keepdims=True)
        return reduced_objective(moved, mu, force)

    e = step * np.eye(2 * n)
    p, q = e[:, None, :], e[None, :, :]
    return (value(p + q) - value(p - q) - value(q - p) + value(-p - q)) / (4.0 * step**2)


@pytest.mark.parametrize("n", [3, 4, 5, 6, 7, 8])
@pytest.mark.parametrize("start", [0, 1])
def test_the_optimum_has_2n_minus_5_flat_directions_and_no_falling_one(n, start):
    mu, force = 0.15, np.array([0.0, 0.0, 1.5])
    allocator = SqpAllocator(n, mu, tolerance=1e-10)
    rng = np.random.default_rng(start)
    allocator.reset(directions=ring(n, 0.6) + 0.2 * rng.normal(size=(n, 3)))
    answer = allocator.allocate(force)
    assert answer.status.ok
    assert abs(answer.optimality_gap) < 1e-10
    assert (answer.tensions > 0.01).all()
    eigenvalues = np.linalg.eigvalsh(riemannian_hessian(answer.directions, mu, force))
    flat = np.abs(eigenvalues) < 1e-6
    assert flat.sum() == 2 * n - 5
    assert eigenvalues[~flat].min() > 1e-3


def mirrored_quadruple(a, t):
    """Four cables with M = diag(b, b, a), mirror images in the xz-plane; t = 0: two coincide.

    Rows (s, +-t, -c) and (-p, +-q, -r). Unit norms, the diagonal of M and M_xz = 0 leave, with
    k = b / 2: p^2 = k (1 - k - t^2) / (2 - 3k). t = sqrt(k / 2) is the regular ring.
    """
    k = 0.25 * (4.0 - a)
    u = k * (1.0 - k - t * t) / (2.0 - 3.0 * k)
    s, c, p = np.sqrt(k - u), np.sqrt(1.0 - t * t - k + u), np.sqrt(u)
    q, r = np.sqrt(k - t * t), np.sqrt(1.0 - k + t * t - u)
    return np.array([[s, t, -c], [s, -t, -c], [-p, q, -r], [-p, -q, -r]])


def test_four_cables_are_exactly_as_good_in_a_ring_as_with_two_coincident():
    mu, W = 0.15, 2.207
    force = np.array([0.0, 0.0, W])
    a = best_alignment(4, mu, W)
    best = objective_of_alignment(a, 4, mu, W)
    closest = []
    for share in np.linspace(0.0, 1.0, 11):
        directions = mirrored_quadruple(a, share * np.sqrt(0.125 * (4.0 - a)))
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-15)
        tensions = -directions @ np.linalg.solve(directions.T @ directions, force)
        assert (tensions > 0.0).all()
        np.testing.assert_allclose(tensions @ directions, -force, atol=1e-14)
        assert Sqp(mu=mu).objective(tensions, directions) == pytest.approx(best, abs=1e-14)
        closest.append(np.degrees(pairwise_angles(directions).min()))
        # The allocator has nothing to improve and hardly moves, drones in collision or not.
        allocator = SqpAllocator(4, mu)
        allocator.reset(directions=directions, tensions=tensions)
        answer = allocator.allocate(force)
        assert answer.status.ok
        np.testing.assert_allclose(answer.directions, directions, atol=2e-3)
    assert closest[0] == 0.0
    assert closest[-1] == pytest.approx(46.4, abs=0.05)
    assert (np.diff(closest) > 0.0).all()


@pytest.mark.parametrize("n", [6, 8, 12])
def test_two_coincident_copies_of_a_smaller_ring_are_optimal(n):
    mu, W = 0.15, 2.207
    a = best_alignment(n, mu, W)
    half = ring(n // 2, np.arccos(np.sqrt(a / n)))
    directions = np.concatenate([half, half])
    tensions = np.full(n, W / np.sqrt(a * n))
    best = objective_of_alignment(a, n, mu, W)
    assert Sqp(mu=mu).objective(tensions, directions) == pytest.approx(best, abs=1e-13)
    allocator = SqpAllocator(n, mu)
    allocator.reset(directions=directions, tensions=tensions)
    answer = allocator.allocate([0.0, 0.0, W])
    assert answer.status.ok
    assert np.degrees(pairwise_angles(answer.directions).min()) < 1e-4


@pytest.mark.parametrize(
    ("mu", "angle", "total_10_s"), [(0.15, 46.4, 26.6), (0.75, 61.3, 31.9), (1.35, 64.3, 33.5)]
)
def test_errata_symmetric_optimum_predicts_the_papers_tension_integrals(mu, angle, total_10_s):
    # Hover of the paper's load: min angle of the regular ring, and J_T over 10 s (not 20 s).
    W = 0.225 * 9.81
    answer = SqpAllocator(4, mu).allocate([0.0, 0.0, W])
    assert np.degrees(pairwise_angles(answer.directions).min()) == pytest.approx(angle, abs=0.05)
    assert 10.0 * answer.tensions.sum() == pytest.approx(total_10_s, abs=0.05)
