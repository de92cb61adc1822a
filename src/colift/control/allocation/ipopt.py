"""IPOPT through CasADi on the paper's problem: a slow, independent answer to compare with."""

from __future__ import annotations

import importlib
import math
from functools import lru_cache
from typing import Any

import numpy as np

from colift.control.allocation.common.oracle import (
    Limits,
    Oracle,
    P,
    TensionProblem,
    beyond_saddles,
    outcome_of,
    tension_problem,
)
from colift.control.allocation.common.plain import Outcome, Problem, plain_kernel
from colift.interrupts import heard
from colift.kernel.layout import Layout
from colift.part import Vector
from colift.team import Team

MEMORY = Layout(team={"warm": 1}, drone={"bounds": 4})
"""Whether there are multipliers of the last answer, and those of the bounds; those of the constraints follow. A team that
changes starts anew."""
M = MEMORY.at

SHARPER = 1e-3
"""IPOPT's tolerance, which is on its scaled problem, relative to the part's."""

_WARM = {
    "warm_start_init_point": "yes",
    "mu_init": 1e-7,
    "warm_start_bound_push": 1e-9,
    "warm_start_mult_bound_push": 1e-9,
    "warm_start_slack_bound_push": 1e-9,
}


@lru_cache(maxsize=32)
def nlp_solver(
    n: int, pairs: bool, cone: bool, tolerance: float, iterations: int, warm: bool
) -> Any:
    """IPOPT on n cables; parameters: unit force (3,), ``mu``, factor of the objective."""
    casadi: Any = importlib.import_module("casadi")

    T, alpha = casadi.SX.sym("T", n), casadi.SX.sym("alpha", 3, n)
    p = casadi.SX.sym("p", 5)
    cosines = [casadi.dot(alpha[:, i], alpha[:, j]) for i in range(n) for j in range(i)]
    cost = 0.5 * casadi.dot(T, T) + p[3] * sum((c**2 for c in cosines), casadi.SX(0))
    constraints = [
        casadi.mtimes(alpha, T) + p[:3],
        *(casadi.dot(alpha[:, i], alpha[:, i]) for i in range(n)),
    ]
    constraints += cosines if pairs else []
    constraints += [alpha[2, i] for i in range(n)] if cone else []
    options = {
        "print_time": False,
        "error_on_fail": False,
        "show_eval_warnings": False,
        "ipopt": {"print_level": 0, "sb": "yes", "tol": tolerance, "max_iter": iterations}
        | (_WARM if warm else {}),
    }
    nlp = {
        "x": casadi.vertcat(T, casadi.vec(alpha)),
        "p": p,
        "f": p[4] * cost,
        "g": casadi.vertcat(*constraints),
    }
    return casadi.nlpsol("ipopt", "ipopt", nlp, options)


def constraint_bounds(n: int, limits: Limits) -> tuple[Vector, Vector]:
    """Bounds of the solver's constraints: force balance, unit norms, pairs, cone."""
    pairs = n * (n - 1) // 2 if limits.pairs else 0
    cone = n if limits.cone else 0
    low = np.concatenate([np.zeros(3), np.ones(n), np.full(pairs + cone, -math.inf)])
    high = np.concatenate(
        [
            np.zeros(3),
            np.ones(n),
            np.full(pairs, limits.cosine_max),
            np.full(cone, limits.height_max),
        ]
    )
    return low, high


def minimise(
    asked: TensionProblem,
    z: Vector,
    tolerance: float = 1e-9,
    iterations: int = 1000,
    multipliers: tuple[Vector, Vector] | None = None,
) -> tuple[Any, dict[str, Any]]:
    """CasADi's answer from the point ``z`` (4n,), warm where multipliers are given, and its account."""
    n, limits = asked.n, asked.limits
    solver = nlp_solver(
        n, limits.pairs, limits.cone, tolerance, iterations, multipliers is not None
    )
    low, high = np.array(asked.bounds()).T
    g_low, g_high = constraint_bounds(n, limits)
    start = {} if multipliers is None else dict(zip(("lam_x0", "lam_g0"), multipliers, strict=True))
    p = [*asked.force, asked.mu, 1.0 / max(1.0, asked.mu)]
    with heard():  # CasADi takes an interrupt for a failed evaluation
        answer = solver(x0=z, p=p, lbx=low, ubx=high, lbg=g_low, ubg=g_high, **start)
    return answer, solver.stats()


def _solve(problem: Problem) -> Outcome:
    with heard():  # also from what is asked of the answer
        return _answer(problem)


def _answer(problem: Problem) -> Outcome:
    asked = tension_problem(problem)
    n, memory = asked.n, problem.memory
    tolerance, most = float(problem.params[P.tolerance]), int(problem.params[P.iterations])
    z = np.concatenate([problem.shares, problem.directions.ravel()])
    size, end = len(constraint_bounds(n, asked.limits)[0]), MEMORY.size(n)
    lam_x, lam_g = memory[M.rows : end], memory[end : end + size]
    warm = (lam_x, lam_g) if memory[M.warm] > 0.0 else None
    answer, account = minimise(asked, z, SHARPER * tolerance, most, warm)
    iterations = int(account["iter_count"])
    if not account["success"] and warm is not None:
        answer, account = minimise(asked, z, SHARPER * tolerance, most)
        iterations += int(account["iter_count"])

    def solve(z: Vector) -> tuple[Vector, int]:
        nonlocal answer, account
        answer, account = minimise(asked, z, SHARPER * tolerance, most)
        return answer["x"].full().ravel(), int(account["iter_count"])

    z, further = beyond_saddles(asked, answer["x"].full().ravel(), tolerance, solve)
    memory[M.warm] = float(account["success"] and np.array_equal(z, answer["x"].full().ravel()))
    lam_x[:], lam_g[:] = (answer[name].full().ravel() for name in ("lam_x", "lam_g"))
    return outcome_of(asked, z, tolerance, iterations + further)


class Ipopt(Oracle):
    """The paper's problem by the interior-point solver IPOPT, exact second derivatives, warm-started.

    Wächter and Biegler, "On the implementation of an interior-point filter line-search algorithm for
    large-scale nonlinear programming", Mathematical Programming 106, 2006; derivatives by CasADi. An oracle:
    some thousand times slower than ``sqp``. The limits that may be added are those of ``safe``, in every
    answer that is ``CONVERGED``; where they cannot hold the status is ``NUMERICAL_FAILURE`` and the last
    directions are kept. From a saddle, such as coincident cables, it is sent on; one that it does not leave
    is not ``CONVERGED``.
    """

    kernel = plain_kernel(_solve)
    needs = ("casadi", "ipopt")

    def memory(self, team: Team) -> Vector:
        most = constraint_bounds(team.n, Limits(cosine_max=0.0, height_max=0.0))[0].size
        return np.zeros(MEMORY.size(team.n) + most)
