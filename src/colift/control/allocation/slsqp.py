"""SciPy's SLSQP on the paper's problem: a slow, independent answer to compare with."""

from __future__ import annotations

from typing import Any

import numpy as np

from colift.control.allocation.common.oracle import (
    Oracle,
    P,
    TensionProblem,
    beyond_saddles,
    outcome_of,
    tension_problem,
)
from colift.control.allocation.common.plain import Outcome, Problem, plain_kernel
from colift.part import Vector


def minimise(asked: TensionProblem, z: Vector, tolerance: float, iterations: int) -> Any:
    """SciPy's answer from the point ``z`` (4n,)."""
    from scipy.optimize import minimize

    scale = 1.0 / max(1.0, asked.mu)
    return minimize(
        lambda z: scale * asked.objective(z),
        z,
        jac=lambda z: scale * asked.gradient(z),
        method="SLSQP",
        bounds=asked.bounds(),
        constraints=[
            {"type": "eq", "fun": asked.equalities, "jac": asked.equalities_jacobian},
            {"type": "ineq", "fun": asked.inequalities, "jac": asked.inequalities_jacobian},
        ][: 2 if asked.limits.pairs or asked.limits.cone else 1],
        options={"ftol": tolerance * tolerance, "maxiter": iterations},
    )


def _solve(problem: Problem) -> Outcome:
    asked = tension_problem(problem)
    tolerance, iterations = float(problem.params[P.tolerance]), int(problem.params[P.iterations])
    z = np.concatenate([problem.shares, problem.directions.ravel()])

    def solve(z: Vector) -> tuple[Vector, int]:
        answer = minimise(asked, z, tolerance, iterations)
        return np.asarray(answer.x), int(answer.nit)

    z, needed = solve(z)
    z, further = beyond_saddles(asked, z, tolerance, solve)
    return outcome_of(asked, z, tolerance, needed + further)


class Slsqp(Oracle):
    """The paper's problem by SciPy's sequential least-squares programming, warm-started.

    Kraft, "A software package for sequential quadratic programming", DFVLR-FB 88-28, 1988. An oracle:
    some thousand times slower than ``sqp``. The limits that may be added are those of ``safe``, in every
    answer that is ``CONVERGED``; where they cannot hold the status is ``NUMERICAL_FAILURE`` and the last
    directions are kept. From a saddle, such as coincident cables, it is sent on; one that it does not leave
    is not ``CONVERGED``.
    """

    kernel = plain_kernel(_solve)
    needs = ("scipy", "solvers")
