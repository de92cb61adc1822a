"""The allocator against other ways to compute the same: dense algebra, differences, SciPy."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from colift.control.allocation.paper import newton
from colift.control.allocation.sqp import SqpAllocator
from colift.team.geometry import ring


def lagrangian(n, mu, force, T, alpha, lam):
    """Paper eq. 7 with the multiplier of the force balance, pair by pair; takes complex numbers."""
    value = 0.5 * (T @ T) + lam @ (T @ alpha + force)
    for i in range(n):
        for j in range(i):
            value += mu * (alpha[i] @ alpha[j]) ** 2
    return value


class Point:
    """A point near a ring whose blocks ``C_i`` are positive definite, off the force balance."""

    def __init__(self, n: int, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self.n = n
        self.mu = 0.1 / n**3
        self.force = np.array([0.1, -0.2, 1.0])
        self.force /= np.linalg.norm(self.force)
        alpha = ring(n, 0.5) + 0.05 * rng.normal(size=(n, 3))
        self.alpha = alpha / np.linalg.norm(alpha, axis=1)[:, None]
        self.T = rng.uniform(0.9, 1.2, n) / n
        self.lam = 0.5 * self.force / n + 0.04 / n**2 * rng.normal(size=3)
        self.M = np.zeros(6)
        self.flat = self.alpha.ravel().copy()
        self.J = newton.measure(n, self.mu, self.T, self.flat, self.M)

    def assemble(self, delta=1e-14):
        rows, S = np.zeros(newton.ROW * self.n), np.zeros(newton.SYSTEM)
        smallest = newton.assemble(
            self.n, *self.force, self.mu, self.T, self.flat, self.M, self.lam, delta, rows, S
        )
        return smallest, rows, S

    def gradient(self, bases, y):
        """Gradient of the Lagrangian in (dT, xi), by complex steps: exact to rounding."""
        n = self.n

        def value(z):
            T = self.T + z[:n]
            xi = z[n:].reshape(n, 2)
            alpha = self.alpha + np.einsum("ik,ikj->ij", xi, bases)
            alpha = alpha / np.sqrt(1.0 + np.sum(xi * xi, axis=1))[:, None]
            return lagrangian(n, self.mu, self.force, T, alpha, self.lam)

        h = 1e-20
        return np.array([value(y + 1j * h * e).imag / h for e in np.eye(3 * n)])


@pytest.mark.parametrize("n", [3, 4, 7])
@pytest.mark.parametrize("seed", [0, 1])
def test_newton_step_solves_the_dense_kkt_system(n, seed):
    point = Point(n, seed)
    smallest, rows, S = point.assemble()
    assert smallest > 1e-3 / n**2  # nothing is convexified: the step is Newton's own
    newton.solve_system(S)
    slope, largest = newton.newton_step(
        n, point.T, point.flat, point.mu, point.M, point.lam, rows, S
    )
    rows = rows.reshape(n, newton.ROW)
    bases = rows[:, :6].reshape(n, 2, 3)
    orthonormal = np.concatenate([bases, point.alpha[:, None]], axis=1)
    assert_allclose(
        orthonormal @ orthonormal.transpose(0, 2, 1), np.tile(np.eye(3), (n, 1, 1)), atol=1e-15
    )
    dT, xi, lam = rows[:, 26], rows[:, 8:10], S[64:67]

    size = 3 * n
    h = 1e-5
    H = np.array(
        [
            (point.gradient(bases, h * e) - point.gradient(bases, -h * e)) / (2.0 * h)
            for e in np.eye(size)
        ]
    )
    A = np.concatenate(
        [point.alpha.T, np.einsum("i,ikj->jik", point.T, bases).reshape(3, 2 * n)], axis=1
    )
    gradient = point.gradient(bases, np.zeros(size))
    imbalance = point.T @ point.alpha + point.force
    kkt = np.block([[H, A.T], [A, np.zeros((3, 3))]])
    dense = np.linalg.solve(kkt, -np.concatenate([gradient, imbalance]))
    step = np.concatenate([dT, xi.ravel()])
    assert_allclose(step, dense[:size], rtol=1e-5, atol=1e-6 * np.abs(dense[:size]).max())
    assert_allclose(lam - point.lam, dense[size:], rtol=1e-5, atol=1e-6)
    # The linearised force balance holds to rounding; the slope is that of J along the step.
    assert_allclose(A @ step, -imbalance, atol=1e-13)
    objective_gradient = gradient - A.T @ point.lam
    assert slope == pytest.approx(objective_gradient @ step, rel=1e-9)
    assert largest == pytest.approx(np.max(np.sum(xi**2, axis=1)), rel=1e-14)


@pytest.mark.parametrize("n", [1, 2, 4, 9])
def test_measure_is_the_papers_objective(n):
    point = Point(n, 5)
    zero = np.zeros(3)
    expected = lagrangian(n, point.mu, point.force, point.T, point.alpha, zero)
    assert pytest.approx(expected, rel=1e-14) == point.J
    M = point.alpha.T @ point.alpha
    assert_allclose(point.M, M[np.triu_indices(3)], atol=1e-15)


@pytest.mark.parametrize("n", [2, 4, 7])
def test_kkt_residual_is_the_largest_gradient_of_the_lagrangian_per_cable(n):
    point = Point(n, 2)
    bases = np.array([np.linalg.svd(d[None, :])[2][1:] for d in point.alpha])
    g = point.gradient(bases, np.zeros(3 * n))
    # Along a cable relative to the mean tension 1 / n, across it to T^2 and mu |M|.
    along, across = n * g[:n], g[n:].reshape(n, 2) / (1.0 / n**2 + point.mu * n)
    worst = np.max(np.sqrt(along**2 + np.sum(across**2, axis=1)))
    residual = newton.kkt_residual(n, point.mu, point.T, point.flat, point.M, point.lam)
    assert residual == pytest.approx(worst, rel=1e-12)


@pytest.mark.parametrize("broken", ["T", "flat", "lam"])
@pytest.mark.parametrize("where", [0, -1])
def test_kkt_residual_does_not_hide_nan(broken, where):
    point = Point(4, 0)
    getattr(point, broken)[where] = np.nan
    J = newton.measure(4, point.mu, point.T, point.flat, point.M)
    residual = newton.kkt_residual(4, point.mu, point.T, point.flat, point.M, point.lam)
    assert np.isnan(J + residual)


def kkt_violation(answer, mu, force):
    """Stationarity in plain NumPy with the least-squares multiplier of the taut cables, N."""
    T, alpha = answer.tensions, answer.directions
    n = len(T)
    gram = alpha @ alpha.T - np.eye(n)
    pull = 2.0 * mu * gram @ alpha  # dJ/dalpha
    rows, right = [], []
    for i in range(n):
        basis = np.linalg.svd(alpha[i][None, :])[2][1:]
        rows.append(T[i] * basis)
        right.append(-basis @ pull[i])
        if T[i] > 0.0:
            rows.append(alpha[i][None, :])
            right.append(np.array([-T[i]]))
    A, b = np.concatenate(rows), np.concatenate(right)
    lam = np.linalg.lstsq(A, b, rcond=None)[0]
    return max(
        float(np.abs(A @ lam - b).max()),
        float(np.linalg.norm(T @ alpha + force)),
        float(np.abs(np.linalg.norm(alpha, axis=1) - 1.0).max()),
        float(-np.minimum(0.0, (T + alpha @ lam)[T == 0.0]).min(initial=0.0)),
    )


@pytest.mark.parametrize("n", [2, 3, 4, 8, 16])
@pytest.mark.parametrize("mu", [0.02, 0.15, 1.35])
def test_answers_satisfy_the_kkt_conditions_evaluated_independently(n, mu):
    rng = np.random.default_rng(n)
    for _ in range(10):
        allocator = SqpAllocator(n, mu)
        allocator.reset(directions=rng.normal(size=(n, 3)))
        force = np.array([0.0, 0.0, 2.2]) + rng.normal(size=3)
        answer = allocator.allocate(force)
        assert answer.status.ok
        assert kkt_violation(answer, mu, force) <= 1e-7


@pytest.mark.parametrize("mu", [0.05, 0.15, 1.35])
def test_slsqp_on_the_papers_16_variables_finds_nothing_better(mu):
    optimize = pytest.importorskip("scipy.optimize")
    n = 4
    rng = np.random.default_rng(int(100 * mu))
    agreed = 0
    for _ in range(5):
        force = np.array([0.0, 0.0, 2.2]) + 0.5 * rng.normal(size=3)
        start = ring(n, 0.6) + 0.2 * rng.normal(size=(n, 3))
        start /= np.linalg.norm(start, axis=1)[:, None]
        allocator = SqpAllocator(n, mu)
        allocator.reset(directions=start)
        ours = allocator.allocate(force)

        def J(x):
            alpha = x[n:].reshape(n, 3)
            G = alpha @ alpha.T
            return 0.5 * x[:n] @ x[:n] + 0.5 * mu * (np.sum(G * G) - np.sum(np.diag(G) ** 2))

        theirs = optimize.minimize(
            J,
            np.concatenate([np.full(n, np.linalg.norm(force) / n), start.ravel()]),
            method="SLSQP",
            bounds=[(0.0, None)] * n + [(None, None)] * (3 * n),
            constraints=[
                {"type": "eq", "fun": lambda x, F=force: x[:n] @ x[n:].reshape(n, 3) + F},
                {"type": "eq", "fun": lambda x: np.sum(x[n:].reshape(n, 3) ** 2, axis=1) - 1.0},
            ],
            options={"ftol": 1e-12, "maxiter": 500},
        )
        assert ours.status.ok
        assert ours.objective <= theirs.fun + 1e-6
        agreed += theirs.success and abs(ours.objective - theirs.fun) <= 1e-6
    assert agreed >= 3  # the peer did its work: the comparison is not empty
