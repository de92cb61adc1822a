"""The planner: guesses, optimisation on coarse and then fine knots, and a certificate by dense sampling for what is handed out."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.errors import PlanError, Problem, SettingError
from colift.kernel.math import splines
from colift.plan import guess
from colift.plan.problem import KINDS, LIMITS, NEVER, assemble, optimise, sampled
from colift.plan.scene import Scene
from colift.record.recording import atomic_path
from colift.wording import shown

Numbers = NDArray[np.float64]
Progress = Callable[[float], None]
Found = tuple[Numbers, Numbers, float]
"""Control points of load and pulls, and the duration."""
Judged = tuple[Found | None, Numbers]
"""What was certified, and by how much it is beyond each limit; None and the excess of the nearest where nothing was."""
DEGREES = (7, 5)
FIXED = (6, 4)
"""Control points at each end that rest makes equal: five derivatives of the load's path and three of the pulls are 0."""
COARSE, FINE, SAMPLES = 10, 20, 4
DENSE = 16
"""Samples an interval of the certificate, four times those of the optimisation."""
MARGINS = np.array([0.004, 0.004, 0.012, 0.06, 0.01])
"""What is kept from each limit between samples: m, m, weights, rad/s, shares of pull."""
SLOWLY = (0.0, 40)
COARSELY = ((3.0, 80), (1.5, 80))
FINELY = ((1.0, 40), (0.3, 40))
AGAIN = ((6.0, 40), (2.0, 40), (0.5, 40))
"""Weights of time and iterations, on either grid: at first slow and geometric, then hurried, then ever closer to the limits."""
POLISHES, ENOUGH = 5, 0.997
"""Polishes at most, and share of the duration above which one has gained nothing."""
SHORT = 1.7
"""Every second attempt is hurried from so many of a drone's own times on, the others from the slow plan: on many scenes one of both ends in a poor plan."""
DRAWN = 0.1
"""By how much the pulls of a guess differ from the formation's, over an equal share."""
SLOWER = 1.004
"""Factor of the duration after a plan was refused."""


RANGES = {
    "drone_mass": (1e-3, 100.0), "load_mass": (1e-4, 1000.0), "most": (1.0, 100.0), "least": (0.0, 1.0), "rate": (0.1, 100.0),
    "speed": (0.01, 100.0), "slack": (0.01, 1.0), "radius": (1e-3, 10.0), "load_radius": (0.0, 10.0), "cable_radius": (0.0, 1.0),
    "room": (0.0, 10.0), "gravity": (0.1, 100.0),
}  # fmt: skip
"""What a user may set of :class:`Limits`, and how far."""


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
    room: float = 0.0
    """Kept from obstacles beyond these radii, and twice as much between drones, for what a flight is off its plan, m."""
    gravity: float = 9.81

    @classmethod
    def of(cls, changes: Mapping[str, Any]) -> Limits:
        """The usual ones with these changes.

        Raises
        ------
        SettingError
            With every name that is no limit, and every value that none can have.

        """
        problems = []
        for name, value in changes.items():
            low, high = RANGES.get(name, (0.0, 0.0))
            if name not in RANGES:
                problems.append(
                    Problem(name, "", f"is no limit; must be one of {', '.join(RANGES)}")
                )
            elif type(value) not in (int, float) or not low <= value <= high:
                message = f"must be a number from {low:g} to {high:g}"
                problems.append(Problem(name, shown(value), message))
        if problems:
            raise SettingError(problems)
        return cls(**changes)

    @property
    def reach(self) -> float:
        """Radius of a drone with its room, m."""
        return self.radius + self.room

    def least_time(self, far: float) -> float:
        """Time in which a drone without a load gets so far from rest to rest, m, leaning at once, s."""
        most = self.gravity * np.sqrt(max(self.most**2 - 1.0, 0.01))
        top = min(self.speed, np.sqrt(most * far))
        return float(far / top + top / most)

    def numbers(self) -> Numbers:
        """For the kernels."""
        weight = self.drone_mass * self.gravity
        return LIMITS.pack(
            0, g=self.gravity, q=self.load_mass / self.drone_mass, kappa=np.sqrt(2.0) * self.inertia / (self.arm * weight),
            most=self.most, least=self.least, rate=self.rate, cable_rate=self.rate, slack=self.slack, speed=self.speed,
            apart=2.0 * self.reach, radius=self.reach, load_radius=self.load_radius + self.room,
            cable_radius=self.cable_radius + self.room, smooth=0.1,
        )  # fmt: skip


def basis(n: int) -> Numbers:
    """Orthonormal columns (n, n - 1) whose entries sum to zero each: differences of the pulls that move no load."""
    Q, _ = np.linalg.qr(np.column_stack([np.ones(n), np.eye(n)[:, : n - 1]]))
    return np.ascontiguousarray(Q[:, 1:])


def tables(intervals: int, samples: int) -> tuple[Numbers, Numbers]:
    """Those of load and pulls, with all derivatives that a plan needs."""
    load, pulls = (splines.table(intervals, degree, degree, samples) for degree in DEGREES)
    return load, pulls


class Grid:
    """Tables and places in the unknowns of a spline with so many intervals, for n drones.

    From the interval ``begin`` on: what comes before it, with all derivatives where it ends, is as it was.
    """

    def __init__(self, n: int, intervals: int, samples: int = SAMPLES, begin: int = 0) -> None:
        self.n, self.intervals, self.samples, self.begin = n, intervals, samples, begin
        self.load, self.pulls = (whole[begin * samples :] for whole in tables(intervals, samples))
        counts, widths = [intervals + degree for degree in DEGREES], (3, 3 * (n - 1))
        keys = [
            (p - degree / 2, which, p)
            for which, (degree, fixed, count) in enumerate(zip(DEGREES, FIXED, counts, strict=True))
            for p in range(begin + degree if begin else fixed, count - fixed)
        ]
        index = [np.full(count, -1, dtype=np.int64) for count in counts]
        at = 0
        for _, which, p in sorted(keys):
            index[which][p] = at
            at += widths[which]
        self.unknowns = at
        self.spans = np.zeros((intervals - begin, 2), dtype=np.int64)
        for j in range(intervals - begin):
            used = [
                (o, o + width)
                for each, degree, width in zip(index, DEGREES, widths, strict=True)
                for o in each[begin + j : begin + j + degree + 1]
                if o >= 0
            ]
            self.spans[j] = min(a for a, _ in used), max(b for _, b in used)
        self.index = [each[begin:] for each in index]
        self.H, self.work = np.zeros((at, at)), np.zeros((at, at))


@dataclass(frozen=True)
class Plan:
    """A whole-team trajectory; ``load_points`` (K + 7, 3) and ``pull_points`` (K + 5, 3 n - 3) over ``duration``, s.

    ``excess`` says by how much it is beyond each limit at its worst dense sample (:data:`colift.plan.problem.KINDS`; m, m, weights,
    rad/s, equal shares, m/s): below 0 everywhere for one that was accepted, and nothing of obstacles where there are none.
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

    @property
    def cable_points(self) -> Numbers:
        """Control points (K + 5, n, 3) of what each cable's force on the load is beyond an equal share of all, over its weight."""
        z = self.pull_points.reshape(len(self.pull_points), -1, 3)
        return np.asarray(np.einsum("il,klc->kic", basis(len(self.scene.lengths)), z))

    def sample(self, count: int) -> dict[str, Numbers]:
        """About ``count`` rows of all that the plan says, world frame.

        Time (S,); load (S, 5, 3), place and derivatives; forces of the cables on the load (S, n, 3, 3), N, with two derivatives; places,
        speeds and accelerations of the drones (S, n, 3, 3); thrusts (S, n, 3), N.
        """
        each = max(-(-count // self.intervals), 1)
        n, K, g = len(self.scene.lengths), self.intervals, self.limits.gravity
        S = each * K + 1
        x, f, u = np.empty((S, 7, 3)), np.empty((S, n, 5, 3)), np.empty((S, n, 5, 3))
        U = np.empty((S, n, 3, 3))
        sampled(
            self.load_points, self.pull_points, self.duration, *tables(K, each), basis(n), self.scene.lengths,
            self.limits.numbers(), x, f, u, U,
        )  # fmt: skip
        factorials = np.array([1.0, 1.0, 2.0, 6.0, 24.0])[:, None]
        drones = x[:, None, :3] + self.scene.lengths[:, None, None] * u[:, :, :3]
        return {
            "time": np.linspace(0.0, self.duration, S),
            "load": x[:, :5] * factorials,
            "forces": f[:, :, :3] * factorials[:3] * self.limits.load_mass * g,
            "drones": drones * factorials[:3],
            "thrusts": self.limits.drone_mass * g * U[:, :, 0],
        }


class Attempt:
    """Control points on the way to a plan."""

    def __init__(self, scene: Scene, limits: Limits, pulls: Numbers) -> None:
        self.scene, self.limits = scene, limits
        self.params, self.N = limits.numbers(), basis(len(scene.lengths))
        self.rest = pulls
        self.obstacles = scene.obstacles
        self.T = np.ones(1)
        self.short = np.inf
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
            self._fit(values, local[:, 0], degree, fixed)
            for values, local, degree, fixed in zip((at, z), (grid.load, grid.pulls), DEGREES, FIXED, strict=True)
        )  # fmt: skip
        self.T[0] = duration

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
        self.x, self.z = (
            splines.refined(points, degree, self.grid.intervals)
            for points, degree in zip((self.x, self.z), DEGREES, strict=True)
        )
        self.grid, self.obstacles = grid, self.scene.obstacles
        for points, fixed in zip((self.x, self.z), FIXED, strict=True):
            points[:fixed], points[-fixed:] = points[0], points[-1]

    def problem(self, margins: Numbers) -> Any:
        """What the kernels are told beside control points and duration (:data:`colift.plan.problem.PROBLEM`)."""
        grid = self.grid
        return (
            grid.load, grid.pulls, self.N, self.scene.lengths, self.params, self.obstacles, margins, *grid.index, grid.spans, grid.H,
        )  # fmt: skip

    def improve(self, hurry: float, most: int, margins: Numbers) -> None:
        """Optimise on the grid, in so many iterations at most; time weighs ``hurry``, and stays where that is 0."""
        problem, begin = (*self.problem(margins), self.worst), self.grid.begin
        x, z = self.x[begin:], self.z[begin:]
        optimise(x, z, self.T, hurry, most, self.grid.work, *problem)

    def copy(self) -> Found:
        return self.x.copy(), self.z.copy(), float(self.T[0])


def excess(
    scene: Scene,
    limits: Limits,
    load: Numbers,
    pulls: Numbers,
    duration: float,
    samples: int = DENSE,
    begin: int = 0,
) -> Numbers:
    """By how much splines are beyond each limit at their worst sample from the interval ``begin`` on, both ends among them."""
    K = len(load) - DEGREES[0]
    BX, BZ = (whole[begin * samples :] for whole in tables(K, samples))
    load, pulls, K = load[begin:], pulls[begin:], K - begin
    worst, none = np.zeros(len(KINDS)), np.zeros(0)
    ix, iz = (np.full(len(points), -1, dtype=np.int64) for points in (load, pulls))
    cost = assemble(
        load, pulls, duration, 0, BX, BZ, basis(len(scene.lengths)), scene.lengths, limits.numbers(), scene.obstacles,
        np.zeros(5), ix, iz, np.zeros((K, 2), dtype=np.int64), np.zeros((0, 0)), none, none, worst,
    )  # fmt: skip
    return worst if np.isfinite(cost) else np.full_like(worst, np.inf)


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
        limits.reach,
        2.0 * limits.reach + 0.01,
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
    progress: Progress = lambda _: None, clock: Callable[[], float] = time.perf_counter,
) -> Plan:  # fmt: skip
    """The shortest plan that was found within the attempts and, after a first one, within the time.

    The same seed tries the same guesses; how many fit into ``seconds`` of the ``clock`` is the machine's, ``attempts`` alone bound a repeatable run.

    Raises
    ------
    PlanError
        None was found; says which limit stood in the way of the attempt that came nearest.

    """
    limits = limits or Limits()
    began = clock()
    pulls, moved = rest(scene, limits)
    _check_ends(scene, limits, pulls)
    best: Plan | None = None
    near: Numbers | None = None
    first = 0.0
    for k, found, worst in _search(scene, limits, pulls, seed, attempts, margins):
        now = clock() - began
        if found is not None:
            first = first or now
            x, z, T = found
            best = Plan(scene, limits, T, x, z, by_kind(worst), seed, k, moved, first)
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
    return replace(best, total=clock() - began)


def by_kind(worst: Numbers) -> dict[str, float]:
    """Excess over each limit that there was."""
    return {kind: float(e) for kind, e in zip(KINDS, worst, strict=True) if e > NEVER}


def _search(
    scene: Scene, limits: Limits, pulls: Numbers, seed: int, attempts: int, margins: Numbers
) -> Iterator[tuple[int, Found | None, Numbers]]:
    """Number of the attempt with each certified plan, which is shorter than the one before, and with each failure."""
    n = len(scene.lengths)
    coarse, fine = Grid(n, COARSE), Grid(n, FINE)
    shorter = np.inf
    for k in range(attempts):
        attempt = Attempt(scene, limits, pulls)
        first_guess(attempt, coarse, np.random.default_rng([seed, k]), k + seed)
        for found, worst in _settle(attempt, fine, margins, shorter):
            if found is not None:
                shorter = found[2]
            yield k, found, worst


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
    limits = attempt.limits
    places = guess.path(
        scene.start,
        scene.goal,
        scene.obstacles,
        limits.reach,
        room,
        rng,
        0.0 if k == 0 else 0.8,
        41,
    )
    pulls = np.repeat(attempt.rest.reshape(1, -1), len(places), axis=0)
    if k > 0:
        shift = rng.normal(0.0, DRAWN / n, (n, 3))
        way = np.sin(np.linspace(0.0, np.pi, len(places)))
        pulls += way[:, None] * (shift - shift.mean(axis=0)).ravel()
    attempt.obstacles = guess.one_sided(places, scene.obstacles)
    guess.yield_to(
        places, pulls, scene.lengths, attempt.obstacles, limits.reach + 0.01, 2.05 * limits.reach,
        limits.slack + 0.1, 0.02, 40,
    )  # fmt: skip
    far = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
    far = max(far, 0.3)
    attempt.begin(places, pulls, grid, (2.3, 2.8, 2.0)[k % 3] * np.sqrt(far))
    if k % 2:
        attempt.short = SHORT * limits.least_time(far)


def _settle(attempt: Attempt, fine: Grid, margins: Numbers, shorter: float) -> Iterator[Judged]:
    """Optimise and certify: where nothing is known yet a slow plan, then ever shorter ones until that fails or gains nothing."""
    attempt.improve(*SLOWLY, margins)
    if np.isinf(shorter):
        slow = attempt.T.copy()
        found, worst = _certified(attempt, margins, shorter)
        if found is not None:
            yield found, worst
            shorter = found[2]
        attempt.T = slow
    attempt.T[0] = min(attempt.T[0], attempt.short)
    for hurry, most in COARSELY:
        attempt.improve(hurry, most, margins)
    attempt.refine(fine)
    for polish in range(POLISHES):
        for hurry, most in AGAIN if polish else FINELY:
            attempt.improve(hurry, most, margins)
        found, worst = _certified(attempt, margins, shorter)
        yield found, worst
        if found is None or (polish and found[2] > ENOUGH * shorter):
            return
        shorter = found[2]


def _certified(attempt: Attempt, margins: Numbers, shorter: float) -> Judged:
    """Slow down, further from the limits that were broken, until dense samples keep every one; fails before ``shorter``, s."""
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
        margins = margins + np.clip(worst[: len(margins)], 0.0, margins)
        attempt.T *= SLOWER
    return None, nearest


def save(best: Plan, file: Path) -> Path:
    """Write control points, what is needed to read them, and the trajectory sampled every millisecond, whole or not at all."""
    scene, limits = best.scene, best.limits
    sampled: dict[str, Any] = best.sample(round(1000.0 * best.duration))
    with atomic_path(file) as temporary, temporary.open("wb") as stream:
        np.savez(
            stream, duration=best.duration, load_points=best.load_points, pull_points=best.cable_points, cable_lengths=scene.lengths,
            obstacles=scene.obstacles, load_mass=limits.load_mass, drone_mass=limits.drone_mass, gravity=limits.gravity, seed=best.seed,
            **sampled,
        )  # fmt: skip
    return file
