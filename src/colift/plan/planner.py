"""The planner: guesses, optimisation on coarse and then fine knots, and a certificate by dense sampling for what is handed out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.errors import PlanError
from colift.plan import guess, splines
from colift.plan.problem import KINDS, LIMITS, assemble, optimise
from colift.plan.scene import Scene
from colift.record.recording import atomic_path

Numbers = NDArray[np.float64]
Progress = Callable[[float], None]
Found = tuple[Numbers, Numbers, float]
"""Control points of load and pulls, and the duration."""
DEGREES = (7, 5)
FIXED = (6, 4)
"""Control points at each end that rest makes equal: five derivatives of the load's path and three of the pulls are 0."""
COARSE, FINE, SAMPLES = 10, 20, 4
DENSE = 16
"""Samples an interval of the certificate, four times those of the optimisation."""
MARGINS = np.array([0.004, 0.004, 0.012, 0.06, 0.01])
"""What is kept from each limit between samples: m, m, weights, rad/s, shares of pull."""
COARSELY = ((0.0, 40), (3.0, 80), (1.5, 80))
FINELY = ((1.0, 40), (0.3, 40))
AGAIN = ((2.0, 30), (1.0, 30), (0.3, 40))
"""Weights of time and iterations, on either grid: at first slow and geometric, then hurried, then ever closer to the limits."""
POLISHES = 5
SLOWER = 1.004
"""Factor of the duration after a plan was refused."""


@dataclass(frozen=True)
class Limits:
    """Bodies and limits; left as they are, those of the public benchmark's robots."""

    drone_mass: float = 0.034
    """kg."""
    load_mass: float = 0.0054
    """kg."""
    inertia: float = 16.655602e-6
    """The largest across the thrust, kg m^2."""
    arm: float = 0.046
    """From the centre to a rotor's axis, m."""
    most: float = 1.4
    """Of a motor, over its part of the drone's weight."""
    least: float = 0.0
    rate: float = 8.0
    """Of body and cables, rad/s."""
    speed: float = 4.0
    """Of the load, m/s."""
    slack: float = 0.3
    """Least pull of a cable over an equal share of the load's weight."""
    radius: float = 0.1
    """Of a drone, m; two are kept apart by twice as much."""
    load_radius: float = 0.01
    cable_radius: float = 0.005
    gravity: float = 9.81

    def numbers(self) -> Numbers:
        """For the kernels."""
        weight = self.drone_mass * self.gravity
        return LIMITS.pack(
            0, g=self.gravity, q=self.load_mass / self.drone_mass, kappa=np.sqrt(2.0) * self.inertia / (self.arm * weight),
            most=self.most, least=self.least, rate=self.rate, cable_rate=self.rate, slack=self.slack, speed=self.speed,
            apart=2.0 * self.radius, radius=self.radius, load_radius=self.load_radius, cable_radius=self.cable_radius, smooth=0.1,
        )  # fmt: skip


def basis(n: int) -> Numbers:
    """Orthonormal columns (n, n - 1) whose entries sum to zero each: differences of the pulls that move no load."""
    Q, _ = np.linalg.qr(np.column_stack([np.ones(n), np.eye(n)[:, : n - 1]]))
    return np.ascontiguousarray(Q[:, 1:])


class Grid:
    """Tables and places in the unknowns of a spline with so many intervals, for n drones."""

    def __init__(self, n: int, intervals: int, samples: int = SAMPLES) -> None:
        self.n, self.intervals, self.samples = n, intervals, samples
        self.load = splines.table(intervals, 7, 7, samples)
        self.pulls = splines.table(intervals, 5, 5, samples)
        counts = [intervals + degree for degree in DEGREES]
        keys = [
            (p - (degree / 2), 1 - which, which, p)
            for which, (degree, fixed, count) in enumerate(zip(DEGREES, FIXED, counts, strict=True))
            for p in range(fixed, count - fixed)
        ]
        self.index = [np.full(count, -1, dtype=np.int64) for count in counts]
        at = 0
        for _, _, which, p in sorted(keys, key=lambda key: (key[0], key[2])):
            self.index[which][p] = at
            at += 3 if which == 0 else 3 * (n - 1)
        self.unknowns = at
        widths = (3, 3 * (n - 1))
        self.spans = np.zeros((intervals, 2), dtype=np.int64)
        for j in range(intervals):
            used = [
                (o, o + width)
                for index, degree, width in zip(self.index, DEGREES, widths, strict=True)
                for o in index[j : j + degree + 1]
                if o >= 0
            ]
            self.spans[j] = min(a for a, _ in used), max(b for _, b in used)
        self.band = int(np.diff(self.spans, axis=1).max())
        self.H, self.work = np.zeros((at, at)), np.zeros((at, at))


@dataclass(frozen=True)
class Plan:
    """A whole-team trajectory; ``load_points`` (K + 7, 3) and ``pull_points`` (K + 5, 3 n - 3) over ``duration``, s.

    ``excess`` says by how much it is beyond each limit at its worst dense sample (:data:`colift.plan.problem.KINDS`; m, m, weights,
    rad/s, equal shares, m/s): below 0 everywhere for one that was accepted.
    """

    scene: Scene
    limits: Limits
    duration: float
    load_points: Numbers
    pull_points: Numbers
    excess: dict[str, float]
    seed: int
    guess: int = 0
    moved_deg: float = 0.0
    """Largest angle by which a cable of the start was turned to make it one that can rest."""
    first: float = 0.0
    """Wall time until the first accepted plan, s."""
    total: float = 0.0

    @cached_property
    def intervals(self) -> int:
        return len(self.load_points) - DEGREES[0]

    def sample(self, count: int) -> dict[str, Numbers]:
        """About ``count`` rows of all that the plan says, world frame.

        Time (S,); load (S, 5, 3), place and derivatives; forces of the cables on the load (S, n, 3, 3), N, with two derivatives; places,
        speeds and accelerations of the drones (S, n, 3, 3); thrusts (S, n, 3), N.
        """
        each = max(-(-count // self.intervals), 1)
        n, K, g = len(self.scene.lengths), self.intervals, self.limits.gravity
        x = np.stack([
            splines.curve(self.load_points, splines.table(K, 7, 7, each)[:, k], K, each) / self.duration**k for k in range(7)
        ], axis=1)  # fmt: skip
        z = np.stack([
            splines.curve(self.pull_points, splines.table(K, 5, 5, each)[:, k], K, each) / self.duration**k for k in range(5)
        ], axis=1)  # fmt: skip
        twice = np.array([2.0, 6.0, 12.0, 20.0, 30.0])
        F = x[:, 2:] * twice[None, :, None] / g
        F[:, 0, 2] += 1.0
        zl = z.reshape(len(z), 5, n - 1, 3)
        f = F[:, :, None] / n + np.einsum("il,sklc->skic", basis(n), zl)
        u = _unit(f)
        drones = x[:, :3, None] + self.scene.lengths[None, None, :, None] * u[:, :3]
        to = np.array([1.0, 1.0, 2.0])[None, :, None, None]
        forces = f[:, :3] * to * self.limits.load_mass * g
        drones = drones * to
        thrusts = self.limits.drone_mass * (drones[:, 2] + [0.0, 0.0, g]) + forces[:, 0]
        factorials = np.array([1.0, 1.0, 2.0, 6.0, 24.0])[None, :, None]
        return {
            "time": np.linspace(0.0, self.duration, len(x)),
            "load": x[:, :5] * factorials,
            "forces": np.ascontiguousarray(np.swapaxes(forces, 1, 2)),
            "drones": np.ascontiguousarray(np.swapaxes(drones, 1, 2)),
            "thrusts": thrusts,
        }


def _unit(f: Numbers) -> Numbers:
    """Taylor coefficients of f / |f| along axis 1 of (S, order, n, 3)."""
    order = f.shape[1]
    y = [sum((f[:, i] * f[:, k - i]).sum(-1) for i in range(k + 1)) for k in range(order)]
    r = [y[0] ** -0.5]
    for k in range(1, order):
        r.append(sum((-0.5 * j - (k - j)) * y[j] * r[k - j] for j in range(1, k + 1)) / (k * y[0]))
    return np.stack(
        [sum(f[:, j] * r[k - j][..., None] for j in range(k + 1)) for k in range(order)], axis=1
    )


class Attempt:
    """Control points on the way to a plan."""

    def __init__(self, scene: Scene, limits: Limits, pulls: Numbers) -> None:
        self.scene, self.limits = scene, limits
        self.params, self.N = limits.numbers(), basis(len(scene.lengths))
        self.rest = pulls
        self.obstacles = scene.obstacles
        self.T = np.ones(1)
        self.worst = np.zeros(len(KINDS))

    def begin(self, places: Numbers, pulls: Numbers, grid: Grid, duration: float) -> None:
        """Fit splines to a path of the load and pulls along it."""
        self.grid = grid
        S = len(grid.load)
        s = np.linspace(0.0, 1.0, S)
        share = s * s * (3.0 - 2.0 * s) * (len(places) - 1)
        at = np.stack(
            [np.interp(share, np.arange(len(places)), places[:, c]) for c in range(3)], axis=1
        )
        along = np.stack(
            [np.interp(share, np.arange(len(pulls)), pulls[:, c]) for c in range(pulls.shape[1])],
            axis=1,
        )
        n = len(self.scene.lengths)
        z = np.einsum("il,sic->slc", self.N, along.reshape(S, n, 3)).reshape(S, -1)
        self.x, self.z = (
            self._fit(values, local, degree, fixed)
            for values, local, degree, fixed in (
                (at, grid.load[:, 0], *self._ends(0)), (z, grid.pulls[:, 0], *self._ends(1)),
            )
        )  # fmt: skip
        self.T[0] = duration

    @staticmethod
    def _ends(which: int) -> tuple[int, int]:
        return DEGREES[which], FIXED[which]

    def _fit(self, values: Numbers, local: Numbers, degree: int, fixed: int) -> Numbers:
        matrix = splines.dense(local, self.grid.intervals, self.grid.samples)
        points = np.zeros((matrix.shape[1], values.shape[1]))
        points[:fixed], points[-fixed:] = values[0], values[-1]
        inner = matrix[:, fixed:-fixed]
        smooth = 0.1 * np.diff(np.eye(matrix.shape[1]), 2, axis=0)
        left = np.vstack([inner, smooth[:, fixed:-fixed]])
        right = np.vstack([values - matrix @ points, -smooth @ points])
        points[fixed:-fixed] = np.linalg.lstsq(left, right, rcond=None)[0]
        return points

    def refine(self, grid: Grid) -> None:
        """The same curves on twice the knots."""
        self.x = splines.refined(self.x, 7, self.grid.intervals)
        self.z = splines.refined(self.z, 5, self.grid.intervals)
        self.grid, self.obstacles = grid, self.scene.obstacles
        for points, fixed in ((self.x, 6), (self.z, 4)):
            points[:fixed], points[-fixed:] = points[0], points[-1]

    def improve(self, hurry: float, most: int, margins: Numbers) -> int:
        grid = self.grid
        return int(optimise(
            self.x, self.z, self.T, hurry, grid.load, grid.pulls, grid.samples, self.N, self.scene.lengths, self.params,
            self.obstacles, margins, grid.index[0], grid.index[1], grid.spans, grid.band, grid.H, grid.work, most, 1e-9, self.worst,
        ))  # fmt: skip

    def assemble(
        self, x: Numbers, z: Numbers, T: float, grad: Numbers, col: Numbers, fill: int
    ) -> float:
        """The cost of control points, and with ``fill`` its gradient; for tests."""
        grid = self.grid
        return float(assemble(
            x, z, T, grid.load, grid.pulls, grid.samples, self.N, self.scene.lengths, self.params, self.scene.obstacles, MARGINS,
            grid.index[0], grid.index[1], grid.spans, grid.H, grad, col, fill, self.worst,
        ))  # fmt: skip

    def copy(self) -> Found:
        return self.x.copy(), self.z.copy(), float(self.T[0])


def excess(
    scene: Scene,
    limits: Limits,
    load: Numbers,
    pulls: Numbers,
    duration: float,
    samples: int = DENSE,
) -> Numbers:
    """By how much splines are beyond each limit at their worst sample, both ends among them."""
    K = len(load) - DEGREES[0]
    worst, none = np.zeros(len(KINDS)), np.zeros(0)
    index = [np.full(len(points), -1, dtype=np.int64) for points in (load, pulls)]
    assemble(
        load, pulls, duration, splines.table(K, 7, 7, samples), splines.table(K, 5, 5, samples), samples, basis(len(scene.lengths)),
        scene.lengths, limits.numbers(), scene.obstacles, np.zeros(5), index[0], index[1], np.zeros((K, 2), dtype=np.int64), np.zeros((0, 0)), none,
        none, 0, worst,
    )  # fmt: skip
    return np.where(np.isfinite(worst), worst, np.inf)


def rest(scene: Scene, limits: Limits) -> tuple[Numbers, float]:
    """Pulls (n, 3) that hold the load at rest near the scene's directions, taut and apart; largest angle from these, degrees."""
    n = len(scene.lengths)
    least = 1.05 * limits.slack / n
    wanted = scene.directions
    if wanted is None:
        a = 2.0 * np.pi * np.arange(n) / n
        wanted = np.column_stack([0.6 * np.cos(a), 0.6 * np.sin(a), np.full(n, 0.8)])
    t = np.full(n, 1.0 / n)
    for _ in range(2000):
        t = np.maximum(t - (wanted @ (wanted.T @ t - [0.0, 0.0, 1.0]) + 1e-3 * t) / n, least)
    pulls = t[:, None] * wanted
    pulls += ([0.0, 0.0, 1.0] - pulls.sum(axis=0)) / n
    three = np.repeat(pulls.reshape(1, -1), 3, axis=0)
    at = np.repeat(scene.start[None], 3, axis=0)
    guess.yield_to(
        at,
        three,
        scene.lengths,
        np.zeros((0, 8)),
        limits.radius,
        2.0 * limits.radius + 0.01,
        1.02 * limits.slack,
        0.0,
        400,
    )
    found = three[1].reshape(n, 3)
    found += ([0.0, 0.0, 1.0] - found.sum(axis=0)) / n
    u = found / np.linalg.norm(found, axis=1)[:, None]
    return found, float(np.degrees(np.arccos(np.clip((u * wanted).sum(axis=1), -1.0, 1.0))).max())


def plan(
    scene: Scene, limits: Limits | None = None, *, seed: int = 0, seconds: float = 3.0, attempts: int = 12, margins: Numbers = MARGINS,
    progress: Progress = lambda _: None,
) -> Plan:  # fmt: skip
    """The shortest plan that was found within the attempts and, after a first one, within the time.

    The same seed tries the same guesses; how many fit into ``seconds`` is the machine's, ``attempts`` alone bound a repeatable run.

    Raises
    ------
    PlanError
        None was found; says which limit stood in the way of the attempt that came nearest.

    """
    limits = limits or Limits()
    n = len(scene.lengths)
    began = time.perf_counter()
    pulls, moved = rest(scene, limits)
    _check_ends(scene, limits, pulls)
    coarse, fine = Grid(n, COARSE), Grid(n, FINE)
    best: Plan | None = None
    near: Numbers | None = None
    first = 0.0
    for k in range(attempts):
        attempt = Attempt(scene, limits, pulls)
        rng = np.random.default_rng([seed, k])
        first_guess(attempt, coarse, rng, k + seed)
        found, worst = _settle(attempt, fine, margins, best.duration if best else np.inf)
        now = time.perf_counter() - began
        if found is not None:
            first = first or now
            x, z, T = found
            best = Plan(
                scene,
                limits,
                T,
                x,
                z,
                dict(zip(KINDS, worst.tolist(), strict=True)),
                seed,
                k,
                moved,
                first,
            )
        elif near is None or worst.max() < near.max():
            near = worst
        progress((k + 1) / attempts)
        if best is not None and now > seconds:
            break
    if best is None:
        assert near is not None
        kind = KINDS[int(near.argmax())]
        raise PlanError(
            f"{scene.name}: no plan in {attempts} attempts; the nearest was beyond its limit of {kind} by {near.max():.3g}. "
            "More attempts, another seed or wider limits may find one."
        )
    return replace(best, total=time.perf_counter() - began)


def _check_ends(scene: Scene, limits: Limits, pulls: Numbers) -> None:
    """Refuse what no plan can mend: a team that touches something where it starts or ends."""
    z = (basis(len(pulls)).T @ pulls).reshape(1, -1)
    for name, place in (("start", scene.start), ("goal", scene.goal)):
        still = excess(
            scene, limits, np.repeat(place[None], 8, axis=0), np.repeat(z, 6, axis=0), 1.0, 1
        )
        if still.max() > 0.0:
            kind = KINDS[int(still.argmax())]
            raise PlanError(
                f"{scene.name}: at its {name} the team is beyond its limit of {kind} by {still.max():.3g}"
            )


def first_guess(attempt: Attempt, grid: Grid, rng: np.random.Generator, k: int) -> None:
    """Path of the load and pulls along it: straightforward at first, then by chance."""
    scene, n = attempt.scene, len(attempt.scene.lengths)
    room = (0.25, 0.4, 0.55)[k % 3]
    places = guess.path(
        scene.start, scene.goal, scene.obstacles, 0.1, room, rng, 0.0 if k == 0 else 0.8, 41
    )
    pulls = np.repeat(attempt.rest.reshape(1, -1), len(places), axis=0)
    if k > 0:
        shift = rng.normal(0.0, 0.05 / n, (n, 3))
        pulls[1:-1] += (shift - shift.mean(axis=0)).ravel()
    attempt.obstacles = guess.one_sided(places, scene.obstacles)
    guess.yield_to(places, pulls, scene.lengths, attempt.obstacles, 0.11, 0.205, 0.4, 0.02, 40)
    far = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    attempt.begin(places, pulls, grid, (2.3, 2.8, 2.0)[k % 3] * np.sqrt(max(far, 0.3)))


def _settle(
    attempt: Attempt, fine: Grid, margins: Numbers, shorter: float
) -> tuple[Found | None, Numbers]:
    """Optimise and certify, again from what was certified as long as that gets shorter; None where it fails or takes ``shorter``."""
    for hurry, most in COARSELY:
        attempt.improve(hurry, most, margins)
    attempt.refine(fine)
    best: Found | None = None
    kept = np.full(len(KINDS), np.inf)
    for _ in range(POLISHES):
        for hurry, most in FINELY if best is None else AGAIN:
            attempt.improve(hurry, most, margins)
        found, worst = _certified(attempt, margins, shorter)
        if best is None:
            kept = worst
        if found is None:
            break
        gained = best is None or found[2] < 0.997 * best[2]
        if best is None or found[2] < best[2]:
            best, kept, shorter = found, worst, found[2]
        if not gained:
            break
    return best, kept


def _certified(attempt: Attempt, margins: Numbers, shorter: float) -> tuple[Found | None, Numbers]:
    """Slow down until dense samples keep every limit; what the nearest was beyond them where that fails or gets as long as ``shorter``."""
    nearest = np.full(len(KINDS), np.inf)
    for _ in range(12):
        if attempt.T[0] >= shorter:
            break
        attempt.improve(0.0, 12, margins)
        worst = excess(attempt.scene, attempt.limits, attempt.x, attempt.z, attempt.T[0])
        if worst.max() <= 0.0:
            return attempt.copy(), worst
        if worst.max() < nearest.max():
            nearest = worst
        attempt.T *= SLOWER
    return None, nearest


def save(best: Plan, file: Path) -> Path:
    """Write control points, what is needed to read them, and the trajectory sampled every millisecond, whole or not at all."""
    scene, limits = best.scene, best.limits
    sampled: dict[str, Any] = best.sample(round(1000.0 * best.duration))
    with atomic_path(file) as temporary, temporary.open("wb") as stream:
        np.savez(
            stream, duration=best.duration, load_points=best.load_points, pull_points=best.pull_points, cable_lengths=scene.lengths,
            obstacles=scene.obstacles, load_mass=limits.load_mass, drone_mass=limits.drone_mass, gravity=limits.gravity, seed=best.seed,
            **sampled,
        )  # fmt: skip
    return file
