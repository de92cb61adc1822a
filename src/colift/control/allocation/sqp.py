"""The paper's allocator: SQP on the tension and alignment cost, problem unchanged (paper eq. 14)."""

from __future__ import annotations

import math
from typing import Annotated, TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from colift.control.allocation.base import (
    INFO_BALANCE,
    INFO_GAP,
    INFO_OBJECTIVE,
    INFO_RESIDUAL,
    SIGNATURE,
    Allocator,
    AllocatorPart,
    Status,
)
from colift.control.allocation.common.oracle import paper_objective
from colift.control.allocation.paper import newton
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math.columns import column
from colift.kernel.rounding import FAINT, NO_FORCE
from colift.part import Vector
from colift.team import Team

_CONVERGED = int(Status.CONVERGED)
_ITERATION_LIMIT = int(Status.ITERATION_LIMIT)
_ZERO_FORCE = int(Status.ZERO_FORCE)
_INVALID_FORCE = int(Status.INVALID_FORCE)
_NUMERICAL_FAILURE = int(Status.NUMERICAL_FAILURE)

PARAMS = Layout(team={"mu": 1, "tolerance": 1, "iterations": 1, "transport": 1})
MEMORY = Layout(team={"size": 1, "force": 3, "lam": 3}, drone={"T": 1, "alpha": 3})
"""Size and unit vector of the last force, the multiplier, and in columns the last answer; the solver's workspace follows.
A team that changes starts anew."""
P, M, SPANS = PARAMS.at, MEMORY.at, MEMORY.spans


@kernel(SIGNATURE, counted=False)
def _allocate(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    force = sees.force
    tensions, directions = writes.desired_tensions, writes.desired_directions
    info = writes.allocator_info
    n = tensions.shape[0]
    mu = params[P.mu]
    transport = params[P.transport] != 0.0
    last_T = column(memory, M.rows, n, SPANS.T)
    last_alpha = column(memory, M.rows, n, SPANS.alpha)
    work = memory[M.rows + M.width * n :]
    lam = column(memory, 0, 1, SPANS.lam)
    T = tensions
    alpha = directions.reshape(3 * n)
    for k in range(info.shape[0]):
        info[k] = 0.0

    fx, fy, fz = force[0], force[1], force[2]
    W = math.sqrt(fx * fx + fy * fy + fz * fz)
    if not math.isfinite(W):
        info[INFO_RESIDUAL] = math.nan
        info[INFO_GAP] = math.nan
        info[INFO_OBJECTIVE] = math.nan
        info[INFO_BALANCE] = math.nan
        return _INVALID_FORCE
    if FAINT * math.sqrt(mu) >= W or W <= NO_FORCE:
        for i in range(n):
            T[i] = 0.0
        memory[M.size] = 0.0
        info[INFO_BALANCE] = W
        info[INFO_RESIDUAL] = math.nan
        info[INFO_OBJECTIVE] = math.nan
        info[INFO_GAP] = math.nan
        return _ZERO_FORCE
    fx /= W
    fy /= W
    fz /= W

    W_last = memory[M.size]
    total = 0.0
    for i in range(n):
        last_T[i] = T[i]
        total += T[i]
    for i in range(3 * n):
        last_alpha[i] = alpha[i]
    if W_last > 0.0:
        # Warm start: the last answer, turned by the smallest rotation from the old force to the new.
        for i in range(n):
            T[i] /= W_last
        if transport:
            newton.rotate(
                n, memory[M.force], memory[M.force + 1], memory[M.force + 2], fx, fy, fz, alpha, lam
            )
    else:
        # The optimum's multiplier has the opposite sign: starting here makes the first step bolder,
        # and far fewer cold starts end on a saddle with a slack cable.
        lam[0] = -fx / n
        lam[1] = -fy / n
        lam[2] = -fz / n
        for i in range(n):
            T[i] = T[i] / total if total > 0.0 else 1.0 / n
    memory[M.force] = fx
    memory[M.force + 1] = fy
    memory[M.force + 2] = fz

    outcome = newton.solve(
        n, fx, fy, fz, mu / (W * W), params[P.tolerance], int(params[P.iterations]), T, alpha, lam,
        work, info,
    )  # fmt: skip
    if outcome == newton.NOT_FINITE:
        # Last directions, tensions corrected in force coordinates so that the force is balanced.
        for i in range(n):
            T[i] = 1.0 / n
        for i in range(3 * n):
            alpha[i] = last_alpha[i]
        newton.project(n, fx, fy, fz, T, alpha)
        for k in range(3):
            lam[k] = -force[k] / (W * n)
    memory[M.size] = W
    bx = by = bz = 0.0
    for i in range(n):
        T[i] *= W
        bx += T[i] * alpha[3 * i]
        by += T[i] * alpha[3 * i + 1]
        bz += T[i] * alpha[3 * i + 2]
    bx += force[0]
    by += force[1]
    bz += force[2]
    info[INFO_OBJECTIVE] *= W * W
    info[INFO_GAP] *= W * W
    info[INFO_BALANCE] = math.sqrt(bx * bx + by * by + bz * bz)
    if outcome == newton.CONVERGED:
        return _CONVERGED
    if outcome == newton.ITERATION_LIMIT:
        return _ITERATION_LIMIT
    return _NUMERICAL_FAILURE


class Sqp(AllocatorPart):
    """The paper's problem: least squared tensions plus ``mu`` times squared cosines between cables."""

    kernel = _allocate
    spread_setting = ("mu", (0.05, 0.15, 0.4, 0.75, 1.35))

    mu: Annotated[float, Field(ge=0.0)] = 0.15
    """Weight of the alignment penalty, N^2."""
    tolerance: Annotated[float, Field(ge=1e-11, le=1e-3)] = 1e-8
    """KKT residual (relative) at which the iteration stops."""
    max_iterations: Annotated[int, Field(ge=1, le=1000)] = 50
    """Most Newton steps in one call."""
    transport: bool = True
    """Turn the warm start with the force; false starts from the last answer as it was."""

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, mu=self.mu, tolerance=self.tolerance, iterations=self.max_iterations,
            transport=self.transport,
        )  # fmt: skip

    def memory(self, team: Team) -> Vector:
        return np.zeros(MEMORY.size(team.n) + newton.workspace_size(team.n))

    def objective(self, tensions: NDArray[np.float64], directions: NDArray[np.float64]) -> float:
        return paper_objective(self.mu, tensions, directions)


class _Further(TypedDict, total=False):
    tolerance: float
    max_iterations: int
    transport: bool


class SqpSettings(_Further, total=False):
    """The settings of :class:`Sqp` as keywords, so that a type checker knows their names."""

    mu: float


class SqpAllocator(Allocator):
    """The paper's allocator, called by hand; see :class:`Sqp` for the settings.

    >>> allocator = SqpAllocator(n=4, mu=0.15)
    >>> answer = allocator.allocate([0.0, 0.0, 2.2])
    >>> answer.status.ok
    True
    """

    part: Sqp

    def __init__(
        self,
        n: int | Team,
        mu: float = 0.15,
        *,
        cone_deg: float = 35.0,
        **settings: Unpack[_Further],
    ) -> None:
        super().__init__(Sqp(mu=mu, **settings), n, cone_deg=cone_deg)

    def update(self, **settings: Unpack[SqpSettings]) -> None:  # type: ignore[override]
        super().update(**settings)

    @property
    def mu(self) -> float:
        """Weight of the alignment penalty, N^2; may be changed between two calls."""
        return self.part.mu

    @mu.setter
    def mu(self, value: float) -> None:
        self.update(mu=value)
