"""The heaviest and the lightest load that cables can hold in hover within their limits.

In cable forces ``w_i = T_i alpha_i`` (N, drone to load) the weight ``-sum w_iz`` and the horizontal balance are linear:

    max  -sum_i w_iz   such that   sum_i w_ix = sum_i w_iy = 0   and for each cable i and pair (i, j)
    T_min_i <= |w_i| <= T_max_i,   -w_iz >= cos(cone) |w_i|,
    |m_i g e3 - w_i| <= f_i  (thrust),   its angle to the vertical <= tilt,
    w_i . w_j <= c_ij |w_i| |w_j|,   |S (L_i alpha_i - L_j alpha_j)| >= d_ij

``c_ij`` is that of the least angle or of a distance (:mod:`colift.control.allocation.limits.distance`).

Only the pairs and ``T_min`` are not convex. A primal-dual interior point from several starts at once (a batch, the
first axis of every array); where a limit curves the wrong way its curvature is left out of the Newton matrix, which
costs iterations and no accuracy. What is returned holds every limit exactly. In plain NumPy, bounded, and without any
kernel: a few milliseconds for a small team, so a flight may ask when it has lost a drone.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from colift.control.allocation.limits import distance

Array = NDArray[np.float64]

KINDS = (
    "tension_max",
    "tension_min",
    "max_cone_deg",
    "max_thrust",
    "max_tilt_deg",
    "min_angle_deg",
    "min_distance",
    "cable_distance",
)
"""Limits: five a cable, in the order of their margins, then those of the pairs."""

AS_GOOD = 0.02
"""Difference of the weights, as a share, up to which the prices of another formation serve as well."""

_UP = np.array([0.0, 0.0, 1.0])
_EYE = np.eye(3)


@dataclass(frozen=True)
class Limits:
    """What n cables and their drones must keep.

    Attributes
    ----------
    weights : (n,) array
        Of the drones, N.
    low, high : (n,) array
        Tensions, N.
    thrust : (n,) array
        Largest thrust of each drone, N; inf where there is none.
    cone, min_angle, tilt : float
        rad; ``tilt`` pi / 2 where it is not limited. ``min_angle`` is the least that any pair is asked for.
    pairs : (n, n) array, optional
        Least angle of every pair, rad, where they have their own.
    causes : (n, n) array, optional
        Which limit asks for it, as a bit.
    lengths : (n,) array, optional
        Of the cables, m, where there are distances.
    apart : (n, n) array, optional
        Distances of drones that are no angle, m: in a norm in which heights count less, by ``stretch``.

    """

    weights: Array
    low: Array
    high: Array
    thrust: Array
    cone: float
    min_angle: float
    tilt: float = 0.5 * math.pi
    pairs: Array | None = None
    causes: Array | None = None
    lengths: Array | None = None
    apart: Array | None = None
    stretch: float = 1.0

    @property
    def widest(self) -> float:
        """The largest angle that any pair is asked for, rad."""
        if self.pairs is None or self.weights.size < 2:
            return self.min_angle
        return float(self.pairs[np.triu_indices(self.weights.size, k=1)].max())

    def ceiling(self, cosines: Array) -> Array:
        """Largest tension (..., n) of cables at these cosines to the vertical (..., n), N; negative: none."""
        own, c = self.weights, cosines
        s = np.sqrt(np.maximum(1.0 - c * c, 0.0))
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            room = self.thrust**2 - (own * s) ** 2
            lifted = np.where(
                np.isinf(self.thrust), np.inf, np.sqrt(np.maximum(room, 0.0)) - own * c
            )
            lifted = np.where(room >= 0.0, lifted, -1.0)
            # T s <= tan(tilt) (m g + T c)
            most = math.tan(self.tilt) if self.tilt < 0.5 * math.pi - 1e-9 else math.inf
            lever = s - most * c
            tilted = np.where(lever > 0.0, most * own / np.where(lever > 0.0, lever, 1.0), np.inf)
        return np.minimum(np.minimum(self.high, lifted), tilted)

    def bound(self) -> float:
        """A weight that no formation exceeds, N: what the drones lift, and what the least angle costs each pair."""
        n = self.weights.size
        lifted = float(np.maximum(self.ceiling(np.ones(n)), 0.0).sum())
        # A drone that leans pulls its cable harder, though no more upwards.
        free = replace(self, tilt=0.5 * math.pi)
        most = np.maximum(free.ceiling(np.full(n, math.cos(self.cone))), free.ceiling(np.ones(n)))
        most = np.where(free.thrust < self.weights * math.sin(self.cone), self.high, most)
        most = np.maximum(most, 0.0)
        squares, total = float(most @ most), float(most.sum())
        c = max(math.cos(self.min_angle), 0.0)
        return min(lifted, math.sqrt(squares + c * (total * total - squares)))


@dataclass(frozen=True)
class Optimum:
    """The best formation that was found.

    Attributes
    ----------
    weight : float
        What it holds, N; NaN if no start led to a formation within the limits.
    directions, tensions : (n, 3), (n,) array
        Drone to load; N.
    prices : dict
        By limit, in the order of :data:`KINDS`: the share by which the weight changes for a small share of the limit.

    """

    weight: float
    directions: Array
    tensions: Array
    prices: dict[str, float]


def extreme(
    limits: Limits,
    starts: Array,
    *,
    heaviest: bool = True,
    steps: int = 60,
    enough: float = math.inf,
) -> Optimum:
    """The heaviest (or lightest) load, from formations (k, n, 3) that keep angles and cone, in at most ``steps``.

    The search for the heaviest ends when ``enough`` (N) is held.
    """
    n = limits.weights.size
    cosines = -starts[:, :, 2]
    most = limits.ceiling(cosines)
    usable = np.all(most > limits.low * (1.0 + 1e-9), axis=1)
    none = Optimum(math.nan, starts[0], np.zeros(n), dict.fromkeys(KINDS, 0.0))
    if not usable.any():
        return none
    starts, most = starts[usable], most[usable]
    unit = max(float(np.mean(most)), 1e-9)
    problem = _Batch(limits, unit)
    tensions = limits.low + (0.5 if heaviest else 0.1) * (most - limits.low)
    w = starts * (tensions / unit)[:, :, None]
    w = w[problem.margins(w).min(axis=1) > 1e-9]
    if not len(w):
        return none
    w, z = problem.solve(w, -1.0 if heaviest else 1.0, steps, enough / unit)
    held, w = problem.within(w)
    if not held.any():
        return none
    weights = np.where(held, -w[:, :, 2].sum(axis=1), -math.inf if heaviest else math.inf)
    best = int(np.argmax(weights) if heaviest else np.argmin(weights))
    priced = best
    if limits.pairs is not None:
        # Where an iteration ends in a corner its multipliers say little: those of another that is nearly as good.
        near = np.flatnonzero(np.abs(weights - weights[best]) <= AS_GOOD * abs(weights[best]))
        priced = int(
            near[np.argmin(problem.residuals(w[near], z[near], -1.0 if heaviest else 1.0))]
        )
    size = np.linalg.norm(w[best], axis=1)
    return Optimum(
        weight=float(weights[best]) * unit,
        directions=w[best] / size[:, None],
        tensions=size * unit,
        prices=problem.prices(w[priced], z[priced], float(weights[priced])),
    )


class _Batch:
    """The interior point, in forces of ``unit``; arrays (k, n, 3), margins and multipliers (k, m)."""

    def __init__(self, limits: Limits, unit: float) -> None:
        n = limits.weights.size
        self.n = n
        self.own = limits.weights / unit
        self.low, self.high = limits.low / unit, limits.high / unit
        self.thrust = np.where(np.isinf(limits.thrust), 1e6, limits.thrust / unit)
        self.cos_cone, self.cos_tilt = math.cos(limits.cone), math.cos(limits.tilt)
        self.i, self.j = np.triu_indices(n, k=1)
        self.angles = np.full(self.i.size, limits.min_angle)
        if limits.pairs is not None:
            self.angles = limits.pairs[self.i, self.j]
        self.causes = np.full(self.i.size, distance.ANGLE)
        if limits.causes is not None:
            self.causes = limits.causes[self.i, self.j]
        self.cos_pair = np.array([math.cos(angle) for angle in self.angles])
        self.lengths = np.ones(n) if limits.lengths is None else limits.lengths
        self.unit = self.lengths[self.i] * self.lengths[self.j]
        self.flat = np.array([1.0, 1.0, 1.0 / limits.stretch**2])
        self.square = None if limits.apart is None else limits.apart[self.i, self.j] ** 2
        self.sin_cone, self.sin_tilt = math.sin(limits.cone), math.sin(limits.tilt)
        self.ends = np.zeros((self.i.size, n))  # which two cables are a pair
        self.ends[np.arange(self.i.size), self.i] = self.ends[np.arange(self.i.size), self.j] = 1.0

    def margins(self, w: Array) -> Array:
        T = np.linalg.norm(w, axis=2)
        u = self.own[:, None] * _UP - w
        f = np.linalg.norm(u, axis=2)
        alpha = w / np.maximum(T, 1e-300)[:, :, None]
        pairs = self.cos_pair - np.einsum("kpa,kpa->kp", alpha[:, self.i], alpha[:, self.j])
        return np.concatenate(
            [
                self.high - T,
                T - self.low,
                -w[:, :, 2] - self.cos_cone * T,
                self.thrust - f,
                u[:, :, 2] - self.cos_tilt * f,
                pairs,
                *self._ellipsoid_margins(alpha),
            ],
            axis=1,
        )

    def _ellipsoid_margins(self, alpha: Array) -> list[Array]:
        """As of the allocator, see :mod:`colift.control.allocation.limits.distance`."""
        if self.square is None:
            return []
        u = (self.lengths[:, None] * alpha)[:, self.i] - (self.lengths[:, None] * alpha)[:, self.j]
        return [0.5 * (np.sum(self.flat * u * u, axis=2) - self.square) / self.unit]

    def solve(self, w: Array, sign: float, steps: int, enough: float) -> tuple[Array, Array]:
        """Minimise ``sign`` times the weight; the last iterates and their multipliers."""
        k, n = w.shape[:2]
        g = self.margins(w)
        mu = 0.1
        z = mu / g
        gradient = np.tile(-sign * _UP, n)
        K = np.zeros((k, 3 * n + 2, 3 * n + 2))
        for a in range(2):
            K[:, 3 * n + a, a : 3 * n : 3] = K[:, a : 3 * n : 3, 3 * n + a] = 1.0
        rhs = np.zeros((k, 3 * n + 2))
        for _ in range(steps):
            H, J = self._curvature(w, z)
            weighted = J * (z / g)[:, :, None]
            K[:, : 3 * n, : 3 * n] = H + np.matmul(J.transpose(0, 2, 1), weighted)
            rhs[:, : 3 * n] = np.einsum("kmx,km->kx", J, mu / g) - gradient
            rhs[:, 3 * n :] = -w[:, :, :2].sum(axis=1)
            step = np.linalg.solve(K, rhs[:, :, None])[:, :, 0]
            dw = step[:, : 3 * n].reshape(k, n, 3)
            slope = np.einsum("kmx,kx->km", J, step[:, : 3 * n])
            dz = mu / g - z - (z / g) * slope
            # The largest step that keeps a part of every margin.
            share = np.ones(k)
            g_new = g
            for _ in range(12):
                trial = w + share[:, None, None] * dw
                g_new = self.margins(trial)
                bad = np.any(~(g_new > 0.05 * g), axis=1)
                if not bad.any():
                    break
                share = np.where(bad, 0.6 * share, share)
            share = np.where(np.any(~(g_new > 0.05 * g), axis=1), 0.0, share)
            w = w + share[:, None, None] * dw
            falling = np.where(dz < 0.0, -0.95 * z / np.where(dz < 0.0, dz, -1.0), 1.0)
            z = z + np.minimum(1.0, falling.min(axis=1))[:, None] * dz
            g = self.margins(w)
            z = np.clip(z, 0.1 * mu / g, 10.0 * mu / g)
            if -float(w[:, :, 2].sum(axis=1).min()) >= enough:
                held, _ = self.within(w)
                if np.any(held & (-w[:, :, 2].sum(axis=1) >= enough)):
                    break
            if float(np.median(share)) > 0.5:
                mu = max(0.4 * mu, 1e-5)
        return w, z

    def _curvature(self, w: Array, z: Array) -> tuple[Array, Array]:
        """Convex part of the Lagrangian's Hessian (k, 3n, 3n) and the margins' Jacobian (k, m, 3n)."""
        k, n = w.shape[:2]
        i, j = self.i, self.j
        T = np.linalg.norm(w, axis=2)
        alpha = w / T[:, :, None]
        u = self.own[:, None] * _UP - w
        f = np.maximum(np.linalg.norm(u, axis=2), 1e-12)
        axis = u / f[:, :, None]
        rows = 0 if self.square is None else i.size
        J = np.zeros((k, 5 * n + i.size + rows, n, 3))
        r = np.arange(n)
        J[:, r, r] = -alpha
        J[:, n + r, r] = alpha
        J[:, 2 * n + r, r] = -_UP - self.cos_cone * alpha
        J[:, 3 * n + r, r] = axis
        J[:, 4 * n + r, r] = -_UP + self.cos_tilt * axis
        c = np.einsum("kpa,kpa->kp", alpha[:, i], alpha[:, j])[:, :, None]
        pair = 5 * n + np.arange(i.size)
        J[:, pair, i] = -(alpha[:, j] - c * alpha[:, i]) / T[:, i, None]
        J[:, pair, j] = -(alpha[:, i] - c * alpha[:, j]) / T[:, j, None]
        if self.square is not None:
            L = self.lengths[:, None]
            v = self.flat * ((L * alpha)[:, i] - (L * alpha)[:, j]) / self.unit[:, None]
            for one, sign in ((i, 1.0), (j, -1.0)):
                slope = sign * v * L[one]
                along = np.einsum("kpa,kpa->kp", slope, alpha[:, one])[:, :, None]
                J[:, pair + i.size, one] = (slope - along * alpha[:, one]) / T[:, one, None]
        across = _EYE - alpha[:, :, :, None] * alpha[:, :, None, :]
        turned = _EYE - axis[:, :, :, None] * axis[:, :, None, :]
        zs = z[:, : 5 * n].reshape(k, 5, n)
        zp = z[:, 5 * n : 5 * n + i.size]
        around = zp @ self.ends
        H = np.zeros((k, n, 3, n, 3))
        blocks = ((zs[:, 0] + self.cos_cone * zs[:, 2]) / T + around / T**2)[
            :, :, None, None
        ] * across
        blocks += ((zs[:, 3] + self.cos_tilt * zs[:, 4]) / f)[:, :, None, None] * turned
        H[:, r, :, r] = np.moveaxis(blocks, 1, 0) + 1e-9 * _EYE
        cross = (zp / (T[:, i] * T[:, j]))[:, :, None, None] * np.matmul(across[:, i], across[:, j])
        H[:, i, :, j] = np.moveaxis(cross, 1, 0)
        H[:, j, :, i] = np.moveaxis(cross.transpose(0, 1, 3, 2), 1, 0)
        return H.reshape(k, 3 * n, 3 * n), J.reshape(k, -1, 3 * n)

    def within(self, w: Array) -> tuple[NDArray[np.bool_], Array]:
        """Which formations keep every limit and are in balance."""
        across = np.abs(w[:, :, :2].sum(axis=1)).max(axis=1)
        return (self.margins(w).min(axis=1) >= 0.0) & (across < 1e-9 * self.n), w

    def residuals(self, w: Array, z: Array, sign: float) -> Array:
        """Largest part (k,) of the objective's gradient that neither multipliers nor the horizontal balance explain."""
        _, J = self._curvature(w, z)
        left = -sign * _UP - np.einsum("kmx,km->kx", J, z).reshape(w.shape)
        left[:, :, :2] -= left[:, :, :2].mean(axis=1, keepdims=True)
        return np.asarray(np.abs(left).max(axis=(1, 2)))

    def prices(self, w: Array, z: Array, weight: float) -> dict[str, float]:
        n, T = self.n, np.linalg.norm(w, axis=1)
        # By how much the cosine falls for a small share of the angle, of the drones' distance, of that from a cable.
        a, b = self.lengths[self.i], self.lengths[self.j]
        falls = {
            distance.ANGLE: np.sin(self.angles) * self.angles,
            distance.DRONES: (a * a + b * b) / self.unit - 2.0 * self.cos_pair,
            distance.CABLE: np.sin(self.angles) ** 2 / np.maximum(self.cos_pair, 1e-3),
        }
        pairs = z[5 * n : 5 * n + self.i.size]
        by_cause = {
            cause: float(pairs @ np.where(self.causes == cause, fall, 0.0))
            for cause, fall in falls.items()
        }
        drones = by_cause[distance.DRONES]
        if self.square is not None:
            drones += float(z[5 * n + self.i.size :] @ (self.square / self.unit))
        return dict(
            zip(
                KINDS,
                [
                    float(z[:n] @ self.high) / weight,
                    float(z[n : 2 * n] @ self.low) / weight,
                    float(z[2 * n : 3 * n] @ T) * self.sin_cone * math.acos(self.cos_cone) / weight,
                    float(z[3 * n : 4 * n] @ self.thrust) / weight,
                    float(z[4 * n : 5 * n].sum()) / weight,
                    by_cause[distance.ANGLE] / weight,
                    drones / weight,
                    by_cause[distance.CABLE] / weight,
                ],
                strict=True,
            )
        )


def best_tensions(limits: Limits, directions: Array, steps: int = 25) -> tuple[float, Array]:
    """The heaviest load that cables along given directions (n, 3) hold, N, and their tensions; NaN: none.

    A linear programme with two equations, by Mehrotra's predictor and corrector; O(n).
    """
    c = -directions[:, 2]
    low, high = limits.low, limits.ceiling(c)
    if np.any(high <= low * (1.0 + 1e-9)):
        return math.nan, low
    unit = float(np.mean(high))
    span = (high - low) / unit
    A = directions[:, :2].T
    b = -A @ (low / unit)
    # x = (T - low) / unit in (0, span); max c.x with A x = b
    x, s, y = 0.5 * span, np.ones_like(c), np.zeros(2)
    r = np.ones_like(c)  # multipliers: s of x >= 0, r of x <= span
    for _ in range(steps):
        room = span - x
        if min(x.min(), room.min()) < 1e-13:
            break  # as near to the end as numbers allow, or there is no balance
        mu = float(s @ x + r @ room) / (2.0 * c.size)
        dual, primal = -c - A.T @ y - s + r, b - A @ x
        if mu < 1e-10 and np.abs(primal).max() < 1e-12:
            break
        D = s / x + r / room
        dx = ds = dr = np.zeros_like(c)
        for target in (0.0, None):
            if target is None:
                reach = min(_reach(x, dx), _reach(room, -dx), _reach(s, ds), _reach(r, dr))
                after = (s + reach * ds) @ (x + reach * dx) + (r + reach * dr) @ (room - reach * dx)
                target = mu * min(float(after) / (2.0 * c.size) / mu, 1.0) ** 3
            lower = (target - ds * dx) / x - s if dx.any() else target / x - s
            upper = (target + dr * dx) / room - r if dx.any() else target / room - r
            right = -dual + lower - upper
            K = (A / D) @ A.T
            K += (1e-13 * np.trace(K) + 1e-300) * np.eye(2)  # two cables span but one direction
            dy = np.linalg.solve(K, primal - (A / D) @ right)
            dx = (right + A.T @ dy) / D
            ds, dr = lower - s / x * dx, upper + r / room * dx
        reach = 0.99 * min(_reach(x, dx), _reach(room, -dx), _reach(s, ds), _reach(r, dr))
        x, y, s, r = x + reach * dx, y + reach * dy, s + reach * ds, r + reach * dr
    tensions = low + unit * np.clip(x, 0.0, span)
    if np.abs(A @ tensions).max() > 1e-6 * unit:
        return math.nan, tensions
    return float(c @ tensions), tensions


def _reach(x: Array, dx: Array) -> float:
    """The largest part of a step that keeps ``x`` positive, up to 1 / 0.99."""
    falling = dx < 0.0
    return (
        min(1.0 / 0.99, float(np.min(-x[falling] / dx[falling]))) if falling.any() else 1.0 / 0.99
    )
