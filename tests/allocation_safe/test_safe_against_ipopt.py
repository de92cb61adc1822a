"""An independent solver on random safe problems: IPOPT through CasADi (optional: the extra `ipopt`).

IPOPT starts from the allocator's answer and from a second point, and may find nothing better.
"""

from __future__ import annotations

import numpy as np
import pytest

from colift.allocation._feasibility import spread_formation
from colift.allocation.safe import SafeAllocator
from colift.geometry import pairwise_angles
from colift.team import Team

casadi = pytest.importorskip("casadi", reason="optional: the extra ipopt (casadi)")

PROBLEMS = 200
LEAST_ANGLES = {3: 60.0, 4: 50.0, 5: 42.0, 6: 44.0}  # degrees, wider than the paper's optimum
CONE, LOW, HIGH = 55.0, 0.1, 1.0


def ipopt(n: int, mu: float):
    """A solver of the safe problem in cable forces ``w`` (3n), force as parameter."""
    w, force = casadi.SX.sym("w", 3, n), casadi.SX.sym("force", 3)
    tension = [casadi.norm_2(w[:, i]) for i in range(n)]
    cosines = [
        casadi.dot(w[:, i], w[:, j]) / (tension[i] * tension[j]) for i in range(n) for j in range(i)
    ]
    cost = 0.5 * sum(t**2 for t in tension) + mu * sum(c**2 for c in cosines)
    limits = [*tension, *cosines, *(w[2, i] / tension[i] for i in range(n))]
    balance = casadi.sum2(w) + force
    problem = {"x": casadi.vec(w), "p": force, "f": cost, "g": casadi.vertcat(balance, *limits)}
    options = {"print_time": False, "ipopt.print_level": 0, "ipopt.tol": 1e-9, "ipopt.sb": "yes"}
    pairs = n * (n - 1) // 2
    low = [0.0] * 3 + [LOW] * n + [-1.0] * pairs + [-1.0] * n
    high = [0.0] * 3 + [HIGH] * n + [np.cos(np.radians(LEAST_ANGLES[n]))] * pairs
    high += [-np.cos(np.radians(CONE))] * n
    solver = casadi.nlpsol("ipopt", "ipopt", problem, options)
    return lambda start, f: solver(x0=start, p=f, lbg=low, ubg=high)


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
    solve = ipopt(n, mu)
    team = Team.uniform(n, load_mass=0.225 * n / 4)
    least = LEAST_ANGLES[n]
    start = spread_formation(n, np.radians(CONE - 2.0), np.radians(least + 1.0))
    near, far, limited = [], [], 0
    for _ in range(PROBLEMS // 4):
        force = team.load_mass * (rng.uniform(-1.5, 1.5, 3) + [0.0, 0.0, 9.81])
        ours, answer = settled(team, mu, least, start, force)
        w = answer.tensions[:, None] * answer.directions
        assert np.abs(w.sum(axis=0) + force).max() < 1e-8
        assert np.degrees(pairwise_angles(answer.directions).min()) >= least - 1e-6
        limited += answer.optimality_gap > 1e-4 * ours
        near.append(ours / float(solve(w.ravel(), force)["f"]) - 1.0)
        far.append(ours / float(solve(0.5 * start.ravel(), force)["f"]) - 1.0)
    # The problem is not convex: IPOPT leaves its start and may end in another valley, seldom a lower one.
    assert np.mean(np.array(near) > 1e-5) <= 0.02
    assert np.max(near) < 5e-3
    assert np.median(far) < 1e-5
    assert np.mean(np.array(far) > 1e-4) < 0.1
    assert limited > PROBLEMS // 8  # the limits are at work in most of them
