"""An independent solver on random safe problems: IPOPT through CasADi (optional: the extra `ipopt`).

IPOPT starts from the allocator's answer and from a second point, and may find nothing better.
"""

from __future__ import annotations

import numpy as np
import pytest

from colift.control.allocation.common.oracle import Limits, TensionProblem
from colift.control.allocation.ipopt import minimise
from colift.control.allocation.limits.feasibility import spread_formation
from colift.control.allocation.safe import SafeAllocator
from colift.team import Team
from colift.team.geometry import pairwise_angles

pytest.importorskip("casadi", reason="optional: the extra ipopt (casadi)")
pytestmark = pytest.mark.slow

PROBLEMS = 200
LEAST_ANGLES = {3: 60.0, 4: 50.0, 5: 42.0, 6: 44.0}  # degrees, wider than the paper's optimum
CONE, LOW, HIGH = 55.0, 0.1, 1.0


def settled(team: Team, mu: float, least: float, start: np.ndarray, force: np.ndarray):
    """The answer for one force as the barriers go to nothing, in steps; no proximal term.

    What is left is the problem itself.
    """
    allocator = SafeAllocator(team, mu, least, LOW, HIGH, CONE, settling=0.0, max_rate=2.0)
    allocator.reset(directions=start)
    for barrier in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        allocator.update(barrier=barrier, spread=max(10.0 * barrier, 1e-6))
        for _ in range(100):
            answer = allocator.allocate(force)
    return allocator.part.objective(answer.tensions, answer.directions), answer


@pytest.mark.parametrize("n", [3, 4, 5, 6])
def test_ipopt_finds_no_better_answer_within_the_same_limits(n: int) -> None:
    rng = np.random.default_rng(n)
    mu = 0.15
    team = Team.uniform(n, load_mass=0.225 * n / 4)
    least = LEAST_ANGLES[n]
    limits = Limits(LOW, HIGH, np.cos(np.radians(least)), -np.cos(np.radians(CONE)))
    start = spread_formation(n, np.radians(CONE - 2.0), np.radians(least + 1.0))
    near, far, limited = [], [], 0
    for _ in range(PROBLEMS // 4):
        force = team.load_mass * (rng.uniform(-1.5, 1.5, 3) + [0.0, 0.0, 9.81])
        ours, answer = settled(team, mu, least, start, force)
        w = answer.tensions[:, None] * answer.directions
        assert np.abs(w.sum(axis=0) + force).max() < 1e-8
        assert np.degrees(pairwise_angles(answer.directions).min()) >= least - 1e-6
        limited += answer.optimality_gap > 1e-4 * ours
        asked = TensionProblem(n, mu, force, limits)
        for found, T, alpha in (
            (near, answer.tensions, answer.directions),
            (far, np.full(n, 0.5), start),
        ):
            theirs, _ = minimise(asked, np.concatenate([T, alpha.ravel()]))
            found.append(ours / float(theirs["f"]) - 1.0)
    # The problem is not convex: IPOPT leaves its start and may end in another valley, seldom a lower one.
    assert np.mean(np.array(near) > 1e-5) <= 0.02
    assert np.max(near) < 5e-3
    assert np.median(far) < 1e-5
    assert np.mean(np.array(far) > 1e-4) < 0.1
    assert limited > PROBLEMS // 8  # the limits are at work in most of them


DISTANCES = {3: 1.15, 4: 0.95, 5: 0.85}  # m, wider than the optimum without them
CLEAR, STRETCH = 0.3, 2.0  # m, 1
POINTS = 60
"""Of each cable, from which IPOPT's drones keep the distance: a little less than ours is asked for."""


def ipopt_with_distances(team: Team, mu: float, force: np.ndarray, start: np.ndarray) -> float:
    """Objective of the same problem, written down a second time: no caps, no tables, no tangents."""
    import casadi as ca

    n, lengths = team.n, team.cable_lengths
    w = ca.SX.sym("w", 3, n)
    T = [ca.norm_2(w[:, i]) for i in range(n)]
    alpha = [w[:, i] / T[i] for i in range(n)]
    at = [-float(lengths[i]) * alpha[i] for i in range(n)]
    pairs = [(i, j) for i in range(n) for j in range(i)]
    cosines = [ca.dot(alpha[i], alpha[j]) for i, j in pairs]
    cost = 0.5 * sum(t * t for t in T) + mu * sum(c * c for c in cosines)
    g, low, high = [ca.sum2(w) + force], [0.0] * 3, [0.0] * 3

    def at_least(value, bound):
        g.append(value)
        low.append(bound)
        high.append(np.inf)

    for i in range(n):
        at_least(T[i], LOW)
        at_least(-T[i], -HIGH)
        at_least(-alpha[i][2], float(np.cos(np.radians(CONE))))
    squash = ca.DM([1.0, 1.0, 1.0 / STRETCH])
    for i, j in pairs:
        at_least(-ca.dot(alpha[i], alpha[j]), -float(np.cos(np.radians(NEAR))))
        at_least(ca.sumsqr(squash * (at[i] - at[j])), DISTANCES[n] ** 2)
        for one, other in ((i, j), (j, i)):
            for share in np.linspace(0.0, 1.0, POINTS):
                at_least(ca.sumsqr(at[one] - share * at[other]), CLEAR**2)
    problem = {"x": ca.reshape(w, 3 * n, 1), "f": cost, "g": ca.vertcat(*g)}
    quiet = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"}
    solver = ca.nlpsol("solver", "ipopt", problem, quiet)
    found = solver(x0=start.ravel(), lbg=low, ubg=high)
    return float(found["f"]) if solver.stats()["success"] else np.nan


NEAR = 10.0  # least angle, degrees: the distances ask for more


@pytest.mark.parametrize("n", [3, 4, 5])
def test_ipopt_finds_no_better_answer_within_the_same_distances(n: int) -> None:
    rng = np.random.default_rng([31, n])
    mu, near, active = 0.15, [], 0
    for _ in range(12):
        lengths = rng.uniform(0.7, 1.3, n)
        team = Team.uniform(n, load_mass=0.225 * n / 4)
        team = Team.of_bodies(
            [{"mass": 0.5, "inertia": (0.021, 0.0187, 0.0397)}] * n,
            load_mass=team.load_mass,
            cable_lengths=lengths,
        )
        force = team.load_mass * (rng.uniform(-1.0, 1.0, 3) + [0.0, 0.0, 9.81])
        asked = {"min_distance": DISTANCES[n], "downwash": STRETCH, "cable_distance": CLEAR}
        allocator = SafeAllocator(
            team, mu, NEAR, LOW, HIGH, CONE, settling=0.0, max_rate=2.0, **asked
        )
        for barrier in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
            allocator.update(barrier=barrier, spread=max(10.0 * barrier, 1e-6))
            for _ in range(300):
                answer = allocator.allocate(force)
        assert answer.force_residual < 1e-8
        w = answer.tensions[:, None] * answer.directions
        drones, cables = allocator.part.distances(team, answer.directions)
        assert drones.min() >= DISTANCES[n] - 1e-12
        assert cables.min() >= CLEAR - 1e-12
        active += drones.min() < DISTANCES[n] + 1e-3 or cables.min() < CLEAR + 1e-3
        ours = allocator.part.objective(answer.tensions, answer.directions)
        near.append(ours / ipopt_with_distances(team, mu, force, w) - 1.0)
    assert np.isfinite(near).sum() >= 10
    assert np.nanmax(near) < 2e-3
    assert np.nanmedian(near) < 5e-6
    assert active == 12  # the distances are at work in each
