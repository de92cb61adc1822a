"""The paper's problem, with optional limits, for general-purpose solvers (paper eq. 14).

Variables ``z = (T, alpha)``: tensions (n,) and directions (n, 3), row by row. The force is a unit vector,
so tensions are in shares of it and ``mu`` is that of the paper over its square.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from colift.control.allocation.base import AllocatorPart, Status
from colift.control.allocation.common.plain import Outcome, Problem, balanced
from colift.control.allocation.paper import newton
from colift.errors import MissingExtraError
from colift.kernel.layout import Layout
from colift.part import Vector
from colift.team import Team
from colift.team.geometry import Array


def paper_objective(mu: float, tensions: Array, directions: Array) -> float:
    """``1/2 sum T_i^2 + mu sum_{i<j} (alpha_i . alpha_j)^2``, N^2."""
    gram = directions @ directions.T
    pairs = 0.5 * (np.sum(gram * gram) - len(tensions))
    return float(0.5 * tensions @ tensions + mu * pairs)


class Limits(NamedTuple):
    """Bounds on tensions, on the cosine of every pair and of every cable with the upward vertical."""

    tension_min: float = 0.0
    tension_max: float = math.inf
    cosine_max: float = 1.0
    height_max: float = 1.0
    """Of ``alpha_z``: ``-cos(cone)``."""

    @property
    def pairs(self) -> bool:
        return self.cosine_max < 1.0

    @property
    def cone(self) -> bool:
        return self.height_max < 1.0


FLAT = 1e-6
"""Curvature, relative to that of a tension or to ``mu``, down to which a direction counts as flat."""
KICKS = 5
"""Times that a solver is sent on from a saddle."""
KICK = 0.05
"""Length of the step off a saddle."""

FREE = Limits()
"""No limits but that tensions are not negative: the paper's problem."""


class TensionProblem:
    """Objective, constraints and their derivatives for n cables in NumPy; see the module."""

    def __init__(self, n: int, mu: float, force: Array, limits: Limits = FREE) -> None:
        self.n, self.mu, self.force, self.limits = n, mu, force, limits
        self.near, self.far = np.triu_indices(n, k=1)

    def split(self, z: Array) -> tuple[Array, Array]:
        return z[: self.n], z[self.n :].reshape(self.n, 3)

    def objective(self, z: Array) -> float:
        return paper_objective(self.mu, *self.split(z))

    def gradient(self, z: Array) -> Array:
        T, alpha = self.split(z)
        squares = np.sum(alpha * alpha, axis=1, keepdims=True)
        slope = 2.0 * self.mu * (alpha @ (alpha.T @ alpha) - squares * alpha)
        return np.concatenate([T, slope.ravel()])

    def equalities(self, z: Array) -> Array:
        """Force balance (3,) and unit norms (n,), zero where they hold."""
        T, alpha = self.split(z)
        return np.concatenate([T @ alpha + self.force, np.sum(alpha * alpha, axis=1) - 1.0])

    def equalities_jacobian(self, z: Array) -> Array:
        T, alpha = self.split(z)
        rows = np.zeros((3 + self.n, 4 * self.n))
        rows[:3, : self.n] = alpha.T
        rows[:3, self.n :] = np.kron(T, np.eye(3))
        for i in range(self.n):
            rows[3 + i, self.n + 3 * i : self.n + 3 * i + 3] = 2.0 * alpha[i]
        return rows

    def inequalities(self, z: Array) -> Array:
        """Room within the limits of pairs and cone, not negative where they hold."""
        _, alpha = self.split(z)
        room = [np.zeros(0)]
        if self.limits.pairs:
            cosines = np.sum(alpha[self.near] * alpha[self.far], axis=1)
            room.append(self.limits.cosine_max - cosines)
        if self.limits.cone:
            room.append(self.limits.height_max - alpha[:, 2])
        return np.concatenate(room)

    def inequalities_jacobian(self, z: Array) -> Array:
        n = self.n
        _, alpha = self.split(z)
        pairs = np.zeros((len(self.near) if self.limits.pairs else 0, n, 3))
        for row, i, j in zip(range(len(pairs)), self.near, self.far, strict=False):
            pairs[row, i], pairs[row, j] = -alpha[j], -alpha[i]
        cone = np.zeros((n if self.limits.cone else 0, n, 3))
        cone[range(len(cone)), range(len(cone)), 2] = -1.0
        rows = np.concatenate([pairs, cone]).reshape(-1, 3 * n)
        return np.hstack([np.zeros((len(rows), n)), rows])

    def bounds(self) -> list[tuple[float, float]]:
        low, high = self.limits.tension_min, self.limits.tension_max
        return [(low, high)] * self.n + [(-math.inf, math.inf)] * (3 * self.n)

    def violation(self, z: Array) -> float:
        """Largest violation of any constraint."""
        T = z[: self.n]
        return float(
            max(
                np.abs(self.equalities(z)).max(),
                np.max(-self.inequalities(z), initial=0.0),
                np.max(self.limits.tension_min - T),
                np.max(T - self.limits.tension_max),
            )
        )

    def stationarity(self, z: Array) -> float:
        """Largest slope of the objective that no constraint at work explains (least squares)."""
        slope, rows, multipliers, _ = self._multipliers(z)
        return float(np.abs(slope - rows.T @ multipliers).max(initial=0.0))

    def _multipliers(self, z: Array) -> tuple[Array, Array, Array, NDArray[np.bool_]]:
        """Slope, constraints at work, their multipliers; of the variables that no bound holds, the last."""
        T = z[: self.n]
        work: NDArray[np.bool_] = self.inequalities(z) < 1e-6
        rows = np.vstack([self.equalities_jacobian(z), self.inequalities_jacobian(z)[work]])
        free = np.ones(4 * self.n, dtype=bool)
        room = np.minimum(T - self.limits.tension_min, self.limits.tension_max - T)
        free[: self.n] = room > 1e-9
        slope, rows = self.gradient(z)[free], rows[:, free]
        multipliers: Array = np.linalg.lstsq(rows.T, slope, rcond=None)[0].astype(float, copy=False)
        return slope, rows, multipliers, free

    def descent(self, z: Array) -> Array | None:
        """A unit direction from the stationary point ``z`` in which the objective falls to second order.

        It leaves the constraints at work as they are; none where ``z`` is a minimum to second order.
        """
        _, rows, multipliers, free = self._multipliers(z)
        if not free.any():
            return None
        curvature = self._lagrangian_hessian(z, multipliers)[np.ix_(free, free)]
        _, sizes, right = np.linalg.svd(rows)
        along = right[np.count_nonzero(sizes > 1e-9 * max(float(sizes[0]), 1.0)) :].T
        if along.shape[1] == 0:
            return None
        values, vectors = np.linalg.eigh(along.T @ curvature @ along)
        if values[0] >= -FLAT * max(1.0, self.mu):
            return None
        direction = np.zeros(4 * self.n)
        direction[free] = along @ vectors[:, 0]
        return direction

    def _lagrangian_hessian(self, z: Array, multipliers: Array) -> Array:
        """Second derivative of objective less multipliers times constraints at work."""
        n = self.n
        _, alpha = self.split(z)
        gram, eye = alpha @ alpha.T, np.eye(3)
        # Of c_ij^2: 2 alpha_j alpha_j^T on the diagonal, 2 (c_ij I + alpha_j alpha_i^T) beside it.
        blocks = gram[:, :, None, None] * eye + alpha[None, :, :, None] * alpha[:, None, None, :]
        balance, norms = multipliers[:3], multipliers[3 : 3 + n]
        own = alpha.T @ alpha - alpha[:, :, None] * alpha[:, None, :]
        blocks[range(n), range(n)] = own
        blocks *= 2.0 * self.mu
        blocks[range(n), range(n)] -= 2.0 * norms[:, None, None] * eye
        work = self.inequalities(z) < 1e-6
        pairs = np.flatnonzero(work[: len(self.near)]) if self.limits.pairs else np.zeros(0, int)
        for pair, multiplier in zip(pairs, multipliers[3 + n :], strict=False):
            i, j = self.near[pair], self.far[pair]
            blocks[i, j] += multiplier * eye
            blocks[j, i] += multiplier * eye
        hessian = np.zeros((4 * n, 4 * n))
        hessian[:n, :n] = np.eye(n)
        hessian[n:, n:] = blocks.transpose(0, 2, 1, 3).reshape(3 * n, 3 * n)
        hessian[:n, n:] = -np.kron(np.eye(n), balance)
        hessian[n:, :n] = hessian[:n, n:].T
        return hessian


_NO_LIMIT = 1e300  # N

PARAMS = Layout(
    team={"mu": 1, "tolerance": 1, "iterations": 1, "least": 1, "most": 1, "cosine": 1, "height": 1}
)
"""Tensions ``least`` and ``most``; ``cosine`` and ``height`` as in :class:`Limits`."""
P = PARAMS.at

Degrees = Annotated[float, Field(gt=0.0, lt=150.0)]


class Oracle(AllocatorPart):
    """Settings of the slow, general solvers: the paper's problem, and the limits one may add."""

    mu: Annotated[float, Field(ge=0.0)] = 0.15
    """Weight of the alignment penalty, N^2."""
    tolerance: Annotated[float, Field(ge=1e-10, le=1e-3)] = 1e-6
    """KKT residual, in units of the force, at which an answer is called converged."""
    max_iterations: Annotated[int, Field(ge=1, le=10000)] = 200
    """Most iterations in one call."""
    min_angle_deg: Degrees | None = None
    """Least angle between any two cables, degrees; none: not limited, as in the paper."""
    max_cone_deg: Annotated[float, Field(gt=0.0, lt=90.0)] | None = None
    """Largest angle between a cable and the vertical, degrees; none: not limited, as in the paper."""
    tension_min: Annotated[float, Field(ge=0.0, le=1e6)] = 0.0
    """Least tension, N."""
    tension_max: Annotated[float, Field(gt=0.0, le=1e6)] | None = None
    """Largest tension, N; none: not limited, as in the paper."""

    def params(self, team: Team) -> Vector:
        if message := self.missing():
            raise MissingExtraError(message)
        most, angle, cone = self.tension_max, self.min_angle_deg, self.max_cone_deg
        return PARAMS.pack(
            team.n,
            mu=self.mu,
            tolerance=self.tolerance,
            iterations=self.max_iterations,
            least=self.tension_min,
            most=_NO_LIMIT if most is None else most,
            cosine=1.0 if angle is None else math.cos(math.radians(angle)),
            height=1.0 if cone is None else -math.cos(math.radians(cone)),
        )

    def objective(self, tensions: NDArray[np.float64], directions: NDArray[np.float64]) -> float:
        return paper_objective(self.mu, tensions, directions)


def tension_problem(problem: Problem) -> TensionProblem:
    """What the kernel's parameters ask for, in units of the force."""
    params, scale = problem.params, problem.size
    most = math.inf if params[P.most] >= _NO_LIMIT else params[P.most] / scale
    limits = Limits(params[P.least] / scale, most, params[P.cosine], params[P.height])
    return TensionProblem(len(problem.shares), params[P.mu] / scale**2, problem.force, limits)


def beyond_saddles(
    asked: TensionProblem, z: Array, tolerance: float, solve: Callable[[Array], tuple[Array, int]]
) -> tuple[Array, int]:
    """The point ``z`` of a solver, sent on from there while it is a saddle; and further iterations.

    Symmetric starts, such as coincident cables, end at saddles: every solver there is content with a slope
    of zero. ``solve`` starts anew from a point and tells its own and its iterations.
    """
    further = 0
    for _ in range(KICKS):
        if not (
            asked.violation(z) <= 1e-4 and asked.stationarity(z) <= tolerance * max(1, asked.mu)
        ):
            break
        direction = asked.descent(z)
        if direction is None:
            break
        found, iterations = solve(z + KICK * direction)
        further += iterations
        if not (asked.violation(found) <= 1e-4 and asked.objective(found) < asked.objective(z)):
            break
        z = found
    return z, further


def outcome_of(asked: TensionProblem, z: Array, tolerance: float, iterations: int) -> Outcome:
    """Judge a solver's point by what it is, not by what the solver says."""
    if not asked.violation(z) <= 1e-4:
        raise RuntimeError("no point within the constraints")
    T, alpha = asked.split(z)
    pulls = balanced(np.maximum(T, 0.0)[:, None] * alpha, asked.force)
    T = np.linalg.norm(pulls, axis=1)
    alpha = np.where(T[:, None] > 0.0, pulls, alpha)
    alpha /= np.linalg.norm(alpha, axis=1, keepdims=True)
    z = np.concatenate([T, alpha.ravel()])
    residual = asked.stationarity(z) / max(1.0, asked.mu)
    converged = residual <= tolerance and asked.descent(z) is None
    status = Status.CONVERGED if converged else Status.ITERATION_LIMIT
    objective = asked.objective(z)
    gap = objective - newton.optimal_objective(asked.n, asked.mu)
    return Outcome(pulls, status, iterations, residual, objective, gap)
