"""Kernels around solvers in plain Python: they keep the layer's contract whatever the solver does."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from colift.control.allocation.base import (
    INFO_ACTIVE,
    INFO_GAP,
    INFO_ITERATIONS,
    INFO_OBJECTIVE,
    INFO_RESIDUAL,
    Status,
)
from colift.control.allocation.common.wrenches import begin, imbalance
from colift.kernel.math.wrench import unit_attitude
from colift.kernel.rounding import RANK
from colift.kernel.signals import LEVEL
from colift.part import Vector
from colift.team.geometry import Array, matrix_of
from colift.team.plan import wrench_map

_SOLVER_ERRORS = (ArithmeticError, RuntimeError, ValueError)


class Problem(NamedTuple):
    """What a solver is asked: forces are in units of ``size``.

    Attributes
    ----------
    force : (3,) unit vector, the wanted force.
    size : float, of the wanted force, N.
    dt : float, s.
    params, memory : vectors of the part.
    shares : (n,) last tensions; equal ones at the start.
    directions : (n, 3) last directions.
    moment : (3,) wanted moment on a rigid load about the mean of the cables' ends, over ``size``, m.
    turn : (3, 3) rotation of the load, as measured, from its frame to the world.
    ends : (n, 3) where the cables end, from their mean, m.

    """

    force: Array
    size: float
    dt: float
    params: Vector
    memory: Vector
    shares: Array
    directions: Array
    moment: Array
    turn: Array
    ends: Array


class Outcome(NamedTuple):
    """What a solver found, in units of the force's size.

    ``pulls`` (n, 3) are the cables' forces on the drones, ``T_i alpha_i``, with sum ``-force``; objective
    and gap in its square.
    """

    pulls: Array
    status: Status
    iterations: int
    residual: float
    objective: float
    gap: float
    active: int = 0


def balanced(pulls: Array, force: Array) -> Array:
    """The pulls (n, 3), corrected in proportion to their sizes to add up to ``-force``."""
    sizes = np.linalg.norm(pulls, axis=1)
    total = sizes.sum()
    weights = sizes / total if total > 0.0 else np.full(len(pulls), 1.0 / len(pulls))
    return np.asarray(pulls - np.outer(weights, pulls.sum(axis=0) + force))


def balanced_wrench(pulls: Array, problem: Problem) -> Array:
    """The pulls (n, 3), corrected by the least norm to balance force and moment, as far as cables can."""
    wrench = wrench_map(problem.ends)
    unmet = wrench @ pulls.ravel() + np.concatenate([problem.force, problem.moment])
    step = np.linalg.lstsq(wrench, unmet, rcond=RANK)[0]
    return np.asarray(pulls - step.reshape(pulls.shape))


def plain_kernel(
    solve: Callable[[Problem], Outcome], arms: Callable[[Vector], Array] | None = None
) -> Callable[..., int]:
    """The kernel of a part whose answers come from ``solve``; ``arms`` finds the ends (n, 3) of one that shares moments in its parameters.

    The answer's forces are corrected to balance the wanted force, and moment. An answer that is not finite, or a
    solver's error, becomes the last directions with a share that balances the force
    (``NUMERICAL_FAILURE``).
    """

    def kernel(now, sees, params, memory, writes) -> int:  # type: ignore[no-untyped-def]
        force, dt, info = sees.force, now.dt, writes.allocator_info
        tensions, directions = writes.desired_tensions, writes.desired_directions
        n, rigid = len(tensions), arms is not None
        moment = sees.moment if rigid else np.zeros(3)
        attitude = sees.estimated_load_attitude if rigid else np.array(LEVEL)
        known, *attitude = unit_attitude(attitude)
        W = begin(known, force, moment, tensions, info)
        if not math.isfinite(W):
            return int(Status.INVALID_FORCE)
        if W == 0.0:
            return int(Status.ZERO_FORCE)
        unit, turn = force / W, matrix_of(attitude)
        ends = np.zeros((n, 3)) if arms is None else arms(params) @ turn.T
        middle = ends.mean(axis=0)
        last = float(np.linalg.norm(tensions @ directions))
        shares = tensions / last if last > 0.0 else np.full(n, 1.0 / n)
        problem = Problem(
            unit, W, dt, params, memory, shares, directions.copy(),
            moment / W - np.cross(middle, unit), turn, ends - middle,
        )  # fmt: skip
        try:
            outcome = solve(problem)
        except _SOLVER_ERRORS:
            outcome = None
        if outcome is None or not np.isfinite(outcome.pulls).all():
            failed = Status.NUMERICAL_FAILURE
            outcome = Outcome(directions / n, failed, 0, math.nan, math.nan, math.nan)
        pulls = balanced_wrench(outcome.pulls, problem) if rigid else balanced(outcome.pulls, unit)
        sizes = np.linalg.norm(pulls, axis=1)
        taut = sizes > 1e-12
        directions[taut] = pulls[taut] / sizes[taut, None]
        tensions[:] = W * np.where(taut, sizes, 0.0)
        info[INFO_ITERATIONS] = outcome.iterations
        info[INFO_RESIDUAL] = outcome.residual
        info[INFO_OBJECTIVE] = outcome.objective * W * W
        info[INFO_GAP] = outcome.gap * W * W
        info[INFO_ACTIVE] = outcome.active
        imbalance(force, moment, ends.ravel(), (tensions[:, None] * directions).ravel(), info)
        return int(outcome.status)

    return kernel
