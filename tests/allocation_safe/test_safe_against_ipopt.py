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
