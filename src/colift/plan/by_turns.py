"""A plan that is made by many, for comparison: each drone and the load improve their own part of it, with what they know of the others'.

After Jackson, Howell, Shah, Schwager and Manchester, "Scalable Cooperative Transport of Cable-Suspended Loads with UAVs Using Distributed
Trajectory Optimization", IEEE RA-L 5(2), 2020. Each drone solves for its own path and pull with the load's and the others' held, all at the
same time; then the load for its own path and the pulls; and each tells its part. What couples them, the length of a cable and that both its ends
pull the same, and what each keeps for itself, is brought about by augmented Lagrangians, of which everybody has one of its own::

    |x_i - x| = L,   t_i = t_i',   |m (a_i + g e3) + t_i (x_i - x) / L| <= f_max,   |x_i - x_j| >= 2 r        (drone)
    m_L (a + g e3) = sum t_i' (x_i - x) / L                                                                (load)

Half-way the drones are drawn into a fan that is no wider than one, as theirs are for a doorway. Deviations: paths are points at equal times
with differences for accelerations, solved by Gauss and Newton, instead of states of quadrotors by iterative LQR.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from colift.errors import PlanError
from colift.plan.planner import Limits, Progress, rest
from colift.plan.scene import Scene
from colift.team.obstacles import distances

Numbers = NDArray[np.float64]
Residuals = tuple[Numbers, Numbers]
"""Values (k,) and their derivatives (k, unknowns)."""

SMOOTH, HINT, NEARBY = 0.05, 3.0, 0.03
"""Weights of an acceleration, m/s^2, of the way to the fan half-way, m, and of the way from the start's formation, m."""
FIRST, GROWTH, LARGEST = 10.0, 1.5, 1e5
"""Penalty of the first round, by how much it grows in each, and the largest."""
STEPS = 4
"""Steps of Gauss and Newton for each in each round."""
ENOUGH = 1e-3
"""Violation at which a plan is done: m, and shares of the load's weight."""
STILL = 2
"""Points at either end that stay where they are, so that it begins and ends at rest."""
NUDGE = 1e-6
"""For a derivative by differences, m."""


@dataclass(frozen=True)
class TurnPlan:
    """What was agreed on, or how far it came.

    Attributes
    ----------
    times : (N,) array
        s.
    load, drones : (N, 3), (n, N, 3) arrays
        World, m.
    pulls : (N, n) array
        As the load has them, N.
    rounds : int
        Until it was done, or all.
    history : list of float
        The largest violation after each round.
    violation : dict of str to float
        The largest of each kind at the end: m, shares of the load's weight, of the largest thrust.
    seconds, longest : float
        Processor time of all, and of the one that takes longest in each round, as if each had a computer of its own, s.

    """

    scene: Scene
    times: Numbers
    load: Numbers
    drones: Numbers
    pulls: Numbers
    rounds: int
    history: list[float]
    violation: dict[str, float]
    seconds: float
    longest: float

    @property
    def done(self) -> bool:
        """Whether all is held."""
        return self.history[-1] <= ENOUGH


class _Times(NamedTuple):
    """Points at equal times: second differences (N, N), and which points are free."""

    size: int
    step: float
    bends: Numbers
    free: NDArray[np.intp]


def _times(count: int, duration: float) -> _Times:
    step = duration / (count - 1)
    bends = np.zeros((count, count))
    for k in range(1, count - 1):
        bends[k, k - 1 : k + 2] = np.array([1.0, -2.0, 1.0]) / step**2
    return _Times(count, step, bends, np.arange(STILL, count - STILL))


@dataclass
class _Agent:
    """One that solves: its points (N, 3) and pulls (N, k), and its multipliers by name."""

    points: Numbers
    pulls: Numbers
    multipliers: dict[str, Numbers] = field(default_factory=dict)
    spent: float = 0.0

    def take(self, step: Numbers, times: _Times) -> None:
        """Add a step to the unknowns: free points, then all pulls."""
        free = times.free
        self.points[free] += step[: 3 * len(free)].reshape(-1, 3)
        self.pulls += step[3 * len(free) :].reshape(self.pulls.shape)


class _Part(NamedTuple):
    """What an agent's problem is made of at its unknowns: costs, equalities, and inequalities ``<= 0``, each by name."""

    costs: list[Residuals]
    equal: dict[str, Residuals]
    below: dict[str, Residuals]


def _by_points(J: Numbers, times: _Times, width: int) -> Numbers:
    """Columns of the unknowns for a derivative (k, N, 3) with respect to all points; none for the pulls."""
    flat = J[:, times.free].reshape(len(J), -1)
    return np.hstack([flat, np.zeros((len(J), times.size * width))])


def _each(gradient: Numbers, times: _Times, width: int) -> Numbers:
    """The same for one value at each time, with its gradient (N, 3) there."""
    J = np.zeros((times.size, times.size, 3))
    k = np.arange(times.size)
    J[k, k] = gradient
    return _by_points(J, times, width)


def _pull_columns(times: _Times, width: int, which: int) -> Numbers:
    """Derivative of the pull ``which`` of ``width`` at each time."""
    J = np.zeros((times.size, 3 * len(times.free) + times.size * width))
    k = np.arange(times.size)
    J[k, 3 * len(times.free) + k * width + which] = 1.0
    return J


def _smooth(points: Numbers, times: _Times, width: int, hints: Numbers, weights: Numbers) -> list[Residuals]:  # fmt: skip
    """Costs of accelerations, and of the ways from ``hints`` (N, 3) with ``weights`` (N,)."""
    found = []
    for c in range(3):
        J = np.zeros((times.size, times.size, 3))
        J[:, :, c] = SMOOTH * times.bends
        found.append((SMOOTH * times.bends @ points[:, c], _by_points(J, times, width)))
        one = np.zeros((times.size, 3))
        one[:, c] = weights
        found.append((weights * (points[:, c] - hints[:, c]), _each(one, times, width)))
    return found


def _clear(points: Numbers, scene: Scene, radius: float, times: _Times, width: int) -> Residuals:
    """How far points are within ``radius`` of the obstacle that is nearest."""
    shifts = np.vstack([np.zeros(3), NUDGE * np.eye(3), -NUDGE * np.eye(3)])
    near = distances(scene.obstacles, points[None] + shifts[:, None]).min(axis=2)
    gradient = (near[1:4] - near[4:7]).T / (2.0 * NUDGE)
    return radius - near[0], _each(-gradient, times, width)


def _drone(agent: _Agent, i: int, load: _Agent, others: list[Numbers], scene: Scene, limits: Limits, times: _Times, hints: Numbers, weights: Numbers) -> _Part:  # fmt: skip
    """Drone i's problem, with its cable's length and the load's weight as units."""
    length, m, weight = scene.lengths[i], limits.drone_mass, limits.load_mass * limits.gravity
    x, t = agent.points, agent.pulls[:, 0]
    away = x - load.points
    size = np.linalg.norm(away, axis=1)
    pull = _pull_columns(times, 1, 0)
    equal = {
        "length": (size - length, _each(away / size[:, None], times, 1)),
        "pull": ((t - load.pulls[:, i]) / weight, pull / weight),
    }
    thrust = m * (times.bends @ x + [0.0, 0.0, limits.gravity]) + t[:, None] * away / length
    much = np.linalg.norm(thrust, axis=1)
    u, most = thrust / much[:, None], limits.most * m * limits.gravity
    J = m * times.bends[:, :, None] * u[:, None, :]
    k = np.arange(times.size)
    J[k, k] += t[:, None] * u / length
    J_thrust = _by_points(J, times, 1) + pull * np.sum(u * away, axis=1)[:, None] / length
    below = {
        "thrust": (much / most - 1.0, J_thrust / most),
        "taut": (limits.slack / len(scene.lengths) - t / weight, -pull / weight),
    }
    if len(scene.obstacles):
        below["obstacle"] = _clear(x, scene, limits.reach, times, 1)
    for j, other in enumerate(others):
        off = x - other
        gap = np.maximum(np.linalg.norm(off, axis=1), 1e-6)
        below[f"apart {j}"] = 2.0 * limits.reach - gap, _each(-off / gap[:, None], times, 1)
    return _Part(_smooth(x, times, 1, hints, weights), equal, below)


def _load(agent: _Agent, drones: list[_Agent], scene: Scene, limits: Limits, times: _Times, hints: Numbers, weights: Numbers) -> _Part:  # fmt: skip
    """The load's problem."""
    n, weight = len(drones), limits.load_mass * limits.gravity
    x, m = agent.points, limits.load_mass
    missing = m * (times.bends @ x + [0.0, 0.0, limits.gravity])
    equal: dict[str, Residuals] = {}
    J = [np.zeros((times.size, times.size, 3)) for _ in range(3)]
    by_pull = [np.zeros((times.size, 3 * len(times.free) + times.size * n)) for _ in range(3)]
    k = np.arange(times.size)
    for c in range(3):
        J[c][:, :, c] = m * times.bends
    for i, drone in enumerate(drones):
        away, length, t = drone.points - x, scene.lengths[i], agent.pulls[:, i]
        size = np.linalg.norm(away, axis=1)
        missing -= t[:, None] * away / length
        column = _pull_columns(times, n, i)
        for c in range(3):
            J[c][k, k, c] += t / length
            by_pull[c] -= column * away[:, c, None] / length
        equal[f"length {i}"] = size - length, _each(-away / size[:, None], times, n)
        equal[f"pull {i}"] = (t - drone.pulls[:, 0]) / weight, column / weight
    for c in range(3):
        equal[f"balance {c}"] = missing[:, c] / weight, (_by_points(J[c], times, n) + by_pull[c]) / weight  # fmt: skip
    below: dict[str, Residuals] = {}
    for i in range(n):
        below[f"taut {i}"] = limits.slack / n - agent.pulls[:, i] / weight, -_pull_columns(times, n, i) / weight  # fmt: skip
    if len(scene.obstacles):
        below["obstacle"] = _clear(x, scene, limits.load_radius + limits.room, times, n)
    return _Part(_smooth(x, times, n, hints, weights), equal, below)


def _improve(agent: _Agent, part_of: Callable[[], _Part], times: _Times, penalty: float) -> None:
    """Some steps of Gauss and Newton on the augmented Lagrangian, then its multipliers."""
    began = time.process_time()
    for _ in range(STEPS):
        part = part_of()
        rows = list(part.costs)
        root = np.sqrt(penalty)
        for name, (c, J) in part.equal.items():
            rows.append((root * (c + agent.multipliers.get(name, 0.0) / penalty), root * J))
        for name, (g, J) in part.below.items():
            over = g + agent.multipliers.get(name, 0.0) / penalty
            rows.append((root * np.maximum(over, 0.0), root * J * (over > 0.0)[:, None]))
        r = np.concatenate([values for values, _ in rows])
        J = np.concatenate([slopes for _, slopes in rows])
        H = J.T @ J
        H[np.diag_indices_from(H)] += 1e-6 + 1e-6 * H.diagonal()
        step = -np.linalg.solve(H, J.T @ r)
        agent.take(step * min(1.0, 0.5 / max(float(np.abs(step[: 3 * len(times.free)]).max()), 1e-9)), times)  # fmt: skip
    part = part_of()
    for name, (c, _) in part.equal.items():
        agent.multipliers[name] = agent.multipliers.get(name, 0.0) + penalty * c
    for name, (g, _) in part.below.items():
        agent.multipliers[name] = np.maximum(agent.multipliers.get(name, 0.0) + penalty * g, 0.0)
    agent.spent = time.process_time() - began


def _violation(parts: list[_Part]) -> dict[str, float]:
    """The largest of each kind."""
    found: dict[str, float] = {}
    for part in parts:
        values = {**{k: np.abs(c) for k, (c, _) in part.equal.items()}, **{k: g for k, (g, _) in part.below.items()}}  # fmt: skip
        for name, value in values.items():
            kind = name.split()[0]
            found[kind] = max(found.get(kind, 0.0), float(value.max()))
    return found


def _fan(scene: Scene, at: Numbers, widest: float) -> Numbers:
    """Places (n, 3) over a load, all in the upright plane of the way, the outermost ``widest`` (rad) from the vertical."""
    n = len(scene.lengths)
    way = scene.goal - scene.start
    way = np.array([way[0], way[1], 0.0]) / max(float(np.hypot(way[0], way[1])), 1e-9)
    angles = np.linspace(-widest, widest, n)
    along = np.sin(angles)[:, None] * way + np.cos(angles)[:, None] * [0.0, 0.0, 1.0]
    return np.asarray(at + scene.lengths[:, None] * along)


def plan_by_turns(
    scene: Scene, limits: Limits, *, duration: float = 10.0, points: int = 51, rounds: int = 60, fan: float = np.radians(50.0),
    progress: Progress = lambda _: None,
) -> TurnPlan:  # fmt: skip
    """Plan in turns, from straight lines on.

    Parameters
    ----------
    scene, limits : Scene, Limits
        The task, and what the bodies can do; rates and speeds are not limited, and cables pass through obstacles, as in the paper.
    duration : float
        s.
    points : int
        On each path, both ends among them.
    rounds : int
        At most.
    fan : float
        Half of the fan's angle, rad.
    progress : callable
        Told the share of the rounds that are done.

    Raises
    ------
    PlanError
        There are too few points.

    """
    if points < 2 * STILL + 3:
        raise PlanError(f"{scene.name}: needs {2 * STILL + 3} points on a path, not {points}")
    times, n = _times(points, duration), len(scene.lengths)
    hold, _ = rest(scene, limits)
    size = np.linalg.norm(hold, axis=1)
    start = scene.lengths[:, None] * hold / size[:, None]
    s = np.linspace(0.0, 1.0, points)
    s = s**3 * (10.0 + s * (-15.0 + 6.0 * s))
    s[:STILL], s[-STILL:] = 0.0, 1.0
    line = scene.start + s[:, None] * (scene.goal - scene.start)
    weight = limits.load_mass * limits.gravity
    load = _Agent(line.copy(), np.tile(size * weight, (points, 1)))
    drones = [_Agent(line + start[i], np.full((points, 1), size[i] * weight)) for i in range(n)]
    half = points // 2
    middle = _fan(scene, line[half], fan)
    # Who flies in front half-way is in front already: the fan's places in the order along the way.
    order = np.argsort(np.argsort(start @ (scene.goal - scene.start), kind="stable"))
    weights = np.full(points, NEARBY)
    weights[half] = HINT
    hints = [drone.points.copy() for drone in drones]
    for i in range(n):
        hints[i][half] = middle[order[i]]
    seconds = longest = 0.0
    history: list[float] = []
    violation: dict[str, float] = {}
    penalty = FIRST
    for k in range(rounds):
        heard = [drone.points.copy() for drone in drones]

        def own(i: int, heard: list[Numbers] = heard) -> Callable[[], _Part]:
            others = [heard[j] for j in range(n) if j != i]
            return lambda: _drone(drones[i], i, load, others, scene, limits, times, hints[i], weights)  # fmt: skip

        def loads() -> _Part:
            return _load(load, drones, scene, limits, times, line, weights)

        for i, drone in enumerate(drones):
            _improve(drone, own(i), times, penalty)
        _improve(load, loads, times, penalty)
        spent = [drone.spent for drone in drones]
        seconds += sum(spent) + load.spent
        longest += max(spent) + load.spent
        now = [drone.points for drone in drones]
        violation = _violation([*(own(i, now)() for i in range(n)), loads()])
        history.append(max(violation.values()))
        progress((k + 1) / rounds)
        if history[-1] <= ENOUGH:
            break
        penalty = min(penalty * GROWTH, LARGEST)
    return TurnPlan(
        scene, np.linspace(0.0, duration, points), load.points, np.array([d.points for d in drones]), load.pulls, len(history), history,
        violation, seconds, longest,
    )  # fmt: skip
