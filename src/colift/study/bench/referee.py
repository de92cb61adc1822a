"""One referee for all solvers: what an answer is worth, from the answer alone.

Nothing that a solver says about itself is believed, and nothing of the solvers' code is used but the
closed-form optimum. Slopes and tensions are measured relative to the terms that must cancel: a mean
tension ``W / n`` along a cable, ``1 / n^2 + mu n / W^2`` across it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from colift.control.allocation.paper.newton import optimal_objective
from colift.study.bench.problems import Problem
from colift.team.geometry import Array, pairwise_angles

AT_WORK = 1e-6
"""A limit with less room than this (in mean tensions, or of a cosine) may push."""
LARGEST_DENSE = 64
"""Most cables for which multipliers of pairs are sought."""

TOLERANCES = {
    "balance": 1e-6,
    "norm": 1e-8,
    "stationarity": 1e-3,
    "gap": 1e-4,
    "angle_deg": 0.1,
    "tension": 1e-6,
    "cone_deg": 0.1,
}
"""Above these a fault is called one. A slope of 1e-3 is what SLSQP leaves with an ``ftol`` of 1e-10."""
FAULTS = {
    "balance": "unbalanced",
    "norm": "not unit",
    "stationarity": "not stationary",
    "gap": "not optimal",
    "angle_deg": "too close",
    "tension": "tension",
    "cone_deg": "cone",
}


class Verdict(NamedTuple):
    """Measures of one answer; none is ever better than zero but by rounding.

    Attributes
    ----------
    balance : error of the force balance over the force.
    norm : largest error of a direction's length.
    stationarity : KKT residual, the largest relative slope of the cost that no multiplier of the right
        sign explains; NaN where not sought.
    gap : cost above the closed-form optimum without limits, relative to it.
    angle_deg : by how much the closest pair falls short of the least angle.
    tension : largest excess over a bound of tensions, in mean tensions.
    cone_deg : by how much a cable leaves the cone.

    """

    balance: float
    norm: float
    stationarity: float
    gap: float
    angle_deg: float
    tension: float
    cone_deg: float

    def faults(self, problem: Problem) -> tuple[str, ...]:
        """What is wrong, in words; the safe problem has no closed form, so only its limits are judged."""
        judged = [name for name in self._fields if name in FAULTS]
        if problem.name == "safe":
            judged = [name for name in judged if name not in ("stationarity", "gap")]
        values = self._asdict()
        return tuple(
            FAULTS[name]
            for name in judged
            if not values[name] <= TOLERANCES[name]  # true of NaN, which is a fault as well
        )


def cost(mu: float, T: Array, alpha: Array) -> float:
    """``1/2 sum T_i^2 + mu sum_{i<j} (alpha_i . alpha_j)^2`` by the moments, which costs O(n)."""
    M = alpha.T @ alpha
    squares = np.sum(alpha * alpha, axis=1)
    return float(0.5 * T @ T + 0.5 * mu * (np.sum(M * M) - np.sum(squares * squares)))


def judge(problem: Problem, force: Array, tensions: Array, directions: Array) -> Verdict:
    """Measure the answer ``tensions`` (n,) N, ``directions`` (n, 3) to ``force`` (3,) N."""
    n, limits = problem.n, problem.limits
    W = float(np.linalg.norm(force))
    T, mu = tensions / W, problem.mu / W**2
    low, high = limits.tension_min / W, limits.tension_max / W
    lengths = np.linalg.norm(directions, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        alpha = directions / lengths[:, None]
        beyond = float(np.max(np.maximum(low - T, T - high)))
    short = out = 0.0
    if limits.pairs:
        least_angle = math.degrees(math.acos(limits.cosine_max))
        short = max(0.0, least_angle - math.degrees(float(np.min(_angles(alpha)))))
    if limits.cone:
        widest = math.degrees(math.acos(-limits.height_max))
        reached = np.degrees(np.arccos(np.clip(-alpha[:, 2], -1.0, 1.0)))
        out = max(0.0, float(np.max(reached)) - widest)
    return Verdict(
        balance=float(np.linalg.norm(tensions @ directions + force)) / W,
        norm=float(np.max(np.abs(lengths - 1.0))),
        stationarity=_stationarity(problem, mu, T, alpha, low, high),
        gap=cost(mu, T, alpha) / optimal_objective(n, mu) - 1.0,
        angle_deg=short,
        tension=n * max(0.0, beyond),
        cone_deg=out,
    )


def _angles(alpha: Array) -> Array:
    """Angle (n,) of every cable to its nearest, rad, a block of rows at a time."""
    n = len(alpha)
    if n <= LARGEST_DENSE:
        return pairwise_angles(alpha)
    found = np.empty(n)
    for begin in range(0, n, LARGEST_DENSE):
        rows = alpha[begin : begin + LARGEST_DENSE]
        cosines = rows @ alpha.T
        cosines[range(len(rows)), range(begin, begin + len(rows))] = -1.0
        nearest = alpha[np.argmax(cosines, axis=1)]
        chord = np.linalg.norm(rows - nearest, axis=1)
        found[begin : begin + len(rows)] = 2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0))
    return found


def _stationarity(
    problem: Problem, mu: float, T: Array, alpha: Array, low: float, high: float
) -> float:
    """KKT residual with the best multipliers (least squares, those of a wrong sign dropped).

    Slopes are taken on the manifold: by each tension, and by each direction within its tangent plane. A
    multiplier that is dropped stays so: the residual may be overstated, never understated by a wrong sign.
    """
    n, limits = problem.n, problem.limits
    if not (np.isfinite(T).all() and np.isfinite(alpha).all()):
        return math.nan
    if limits.pairs and n > LARGEST_DENSE:
        return math.nan
    across = 1.0 / (1.0 / n**2 + mu * n)

    def slopes(by_tensions: Array, by_directions: Array) -> Array:
        """Relative slopes (m, 4n) from slopes by T (m, n) and by alpha in space (m, n, 3)."""
        radial = np.sum(by_directions * alpha, axis=2, keepdims=True)
        tangent = across * (by_directions - radial * alpha)
        return np.hstack([n * by_tensions, tangent.reshape(len(tangent), 3 * n)])

    cost_slope = slopes(T[None], 2.0 * mu * (alpha @ (alpha.T @ alpha))[None])[0]
    balance = slopes(alpha.T, np.einsum("i,ka->kia", T, np.eye(3)))

    def at(cables: NDArray[np.intp]) -> Array:
        """One row (n,) a cable, with 1 in its place."""
        rows = np.zeros((len(cables), n))
        rows[np.arange(len(cables)), cables] = 1.0
        return rows

    least = at(np.flatnonzero(n * (T - low) < AT_WORK))
    most = at(np.flatnonzero(n * (high - T) < AT_WORK))
    at_work = [
        slopes(least, np.zeros((*least.shape, 3))),
        slopes(-most, np.zeros((*most.shape, 3))),
    ]
    if limits.cone:
        rim = at(np.flatnonzero(limits.height_max - alpha[:, 2] < AT_WORK))
        at_work.append(slopes(0.0 * rim, np.einsum("ki,a->kia", -rim, [0.0, 0.0, 1.0])))
    if limits.pairs:
        i, j = np.triu_indices(n, k=1)
        close = limits.cosine_max - np.sum(alpha[i] * alpha[j], axis=1) < AT_WORK
        i, j = i[close], j[close]
        apart = -np.einsum("ki,ka->kia", at(i), alpha[j])
        apart -= np.einsum("ki,ka->kia", at(j), alpha[i])
        at_work.append(slopes(np.zeros((len(i), n)), apart))
    pushing = np.vstack(at_work)
    while True:
        rows = np.vstack([balance, pushing])
        multipliers = np.linalg.lstsq(rows.T, cost_slope, rcond=None)[0]
        right = multipliers[3:] >= 0.0
        if right.all():
            return float(np.max(np.abs(cost_slope - multipliers @ rows)))
        pushing = pushing[right]
