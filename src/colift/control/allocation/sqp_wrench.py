"""The paper's cost for a rigid load: its SQP on tensions and alignment, with the balance of force and moment."""

from __future__ import annotations

import math

import numpy as np

from colift.control.allocation.base import (
    INFO_GAP,
    INFO_OBJECTIVE,
    SIGNATURE,
    Status,
)
from colift.control.allocation.common.wrenches import begin, imbalance, settled
from colift.control.allocation.paper import newton
from colift.control.allocation.paper import wrench as paper
from colift.control.allocation.sqp import Sqp
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion, wrench
from colift.kernel.math.columns import column
from colift.kernel.rounding import FAINT
from colift.kernel.spans import BODY, LINE
from colift.part import Vector
from colift.team import Team
from colift.team.geometry import Array
from colift.team.plan import spanned

_CONVERGED = int(Status.CONVERGED)
_ITERATION_LIMIT = int(Status.ITERATION_LIMIT)
_ZERO_FORCE = int(Status.ZERO_FORCE)
_INVALID_FORCE = int(Status.INVALID_FORCE)
_NUMERICAL_FAILURE = int(Status.NUMERICAL_FAILURE)

PARAMS = Layout(
    team={
        "mu": 1, "tolerance": 1, "iterations": 1, "transport": 1, "span": 1, "axis": 3, "unit": 1, "middle": 3,
    },
    drone={"arm": 3},
)  # fmt: skip
"""Arms in columns; ``unit``, m, is the length by which they are measured, ``middle`` the mean of the ends."""
MEMORY = Layout(
    team={"size": 1, "force": 3, "heading": 2, "lam": 6, "f": 6, "axis": 3},
    drone={"T": 1, "alpha": 3, "w": 3, "end": 3, "s": 3},
)
"""Size and unit vector of the last force, cosine and sine of the last heading, multipliers, and in columns the last answer; the
solver's workspace follows. A team that changes starts anew."""
P, PLACES = PARAMS.at, PARAMS.spans
M, COLUMNS = MEMORY.at, MEMORY.spans


@kernel(SIGNATURE, counted=False)
def _allocate(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    force, moment = sees.force, sees.moment
    tensions, directions = writes.desired_tensions, writes.desired_directions
    info = writes.allocator_info
    n = tensions.shape[0]
    mu = params[P.mu]
    last_T = column(memory, M.rows, n, COLUMNS.T)
    last_alpha = column(memory, M.rows, n, COLUMNS.alpha)
    w = column(memory, M.rows, n, COLUMNS.w)
    ends = column(memory, M.rows, n, COLUMNS.end)
    s = column(memory, M.rows, n, COLUMNS.s)
    work = memory[M.rows + M.width * n :]
    lam, f = memory[M.lam : M.lam + 6], memory[M.f : M.f + 6]
    axis = memory[M.axis : M.axis + 3]
    T = tensions
    alpha = directions.reshape(3 * n)

    known, qw, qx, qy, qz = wrench.unit_attitude(sees.estimated_load_attitude)
    W = begin(known, force, moment, tensions, info)
    if not math.isfinite(W):
        return _INVALID_FORCE
    if FAINT * math.sqrt(mu) >= W:
        for i in range(n):
            T[i] = 0.0
        memory[M.size] = 0.0
        return _ZERO_FORCE

    # In shares of the force, arms of the load; the moment about the mean of the ends, as far as there is one.
    span, unit = params[P.span], params[P.unit]
    wrench.turned(qw, qx, qy, qz, n, column(params, P.rows, n, PLACES.arm), ends)
    cx, cy, cz = quaternion.into_world(
        qw, qx, qy, qz, params[P.middle], params[P.middle + 1], params[P.middle + 2]
    )
    axis[0], axis[1], axis[2] = quaternion.into_world(
        qw, qx, qy, qz, params[P.axis], params[P.axis + 1], params[P.axis + 2]
    )
    for i in range(n):
        s[3 * i] = (ends[3 * i] - cx) / unit
        s[3 * i + 1] = (ends[3 * i + 1] - cy) / unit
        s[3 * i + 2] = (ends[3 * i + 2] - cz) / unit
    fx, fy, fz = force[0] / W, force[1] / W, force[2] / W
    scale = 1.0 / (W * unit)
    mx = moment[0] * scale - (cy * fz - cz * fy) / unit
    my = moment[1] * scale - (cz * fx - cx * fz) / unit
    mz = moment[2] * scale - (cx * fy - cy * fx) / unit
    if span == LINE:
        along = mx * axis[0] + my * axis[1] + mz * axis[2]
        mx, my, mz = mx - along * axis[0], my - along * axis[1], mz - along * axis[2]
    elif span != BODY:
        mx = my = mz = 0.0
    f[0], f[1], f[2], f[3], f[4], f[5] = fx, fy, fz, mx, my, mz

    W_last = memory[M.size]
    total = 0.0
    for i in range(n):
        last_T[i] = T[i]
        total += T[i]
    for i in range(3 * n):
        last_alpha[i] = alpha[i]
    cos_yaw, sin_yaw = wrench.heading(qw, qx, qy, qz)
    if W_last > 0.0:
        # Warm start: the last answer, turned with the load's heading, then from the old force to the new.
        for i in range(n):
            T[i] /= W_last
        if params[P.transport] != 0.0:
            c = memory[M.heading] * cos_yaw + memory[M.heading + 1] * sin_yaw
            b = memory[M.heading] * sin_yaw - memory[M.heading + 1] * cos_yaw
            wrench.yawed(n, c, b, alpha)
            wrench.yawed(2, c, b, lam)
            wrench.yawed(1, c, b, memory[M.force : M.force + 3])
            gx, gy, gz = memory[M.force], memory[M.force + 1], memory[M.force + 2]
            newton.rotate(n, gx, gy, gz, fx, fy, fz, alpha, lam[:3])
            newton.rotate(0, gx, gy, gz, fx, fy, fz, alpha, lam[3:])
    else:
        # As in :mod:`~colift.control.allocation.sqp`, whose cold starts end on a saddle less often so.
        for k in range(3):
            lam[k], lam[3 + k] = -f[k] / n, 0.0
        for i in range(n):
            T[i] = T[i] / total if total > 0.0 else 1.0 / n
    memory[M.force], memory[M.force + 1], memory[M.force + 2] = fx, fy, fz
    memory[M.heading], memory[M.heading + 1] = cos_yaw, sin_yaw

    outcome = paper.solve(
        n, span, axis, f, mu / (W * W), params[P.tolerance], int(params[P.iterations]), s, T, alpha, lam, work,
        info,
    )  # fmt: skip
    memory[M.size] = W
    fine = outcome != newton.NOT_FINITE
    if not fine:
        # Last directions, tensions corrected so that the wrench is balanced, where these cables can.
        for i in range(n):
            T[i] = 1.0 / n
        for i in range(3 * n):
            alpha[i] = last_alpha[i]
        fine = paper.project(n, span, axis, f, s, T, alpha) > 0.0
        for k in range(3):
            lam[k], lam[3 + k] = -f[k] / n, 0.0
    for i in range(n):
        T[i] *= W
        fine = fine and math.isfinite(T[i] + alpha[3 * i] + alpha[3 * i + 1] + alpha[3 * i + 2])
    if not fine:
        memory[M.size] = 0.0
        for i in range(n):
            T[i] = last_T[i]
        for i in range(3 * n):
            alpha[i] = last_alpha[i]
    for i in range(n):
        for k in range(3):
            w[3 * i + k] = T[i] * alpha[3 * i + k]
    info[INFO_OBJECTIVE] *= W * W
    info[INFO_GAP] *= W * W
    imbalance(force, moment, ends, w, info)
    if outcome == newton.CONVERGED:
        return _CONVERGED
    if outcome == newton.ITERATION_LIMIT:
        return _ITERATION_LIMIT
    return _NUMERICAL_FAILURE


class SqpWrench(Sqp):
    """The paper's problem with the balance of moments: least squared tensions plus ``mu`` times squared cosines between cables.

    Vazquez-Soqui, Oliva-Palomo, Mercado-Ravell and Castillo, "SQP-Based Cable-Tension Allocation for Multi-Drone Load Transport", 2026,
    state it for a point load; cost, bounds and unknowns are theirs, the three rows of the moment are added. Settings and statuses are
    those of ``sqp``. ``optimality_gap`` is the distance from the least cost of all that balance the force alone, which bounds that from
    the optimum; from four cables on it is zero where the load asks for little moment.

    The cost has no formation: nothing holds the cables of a rigid load outward, nor taut.

    Moments that no cables can make, those about the line of all ends, are left out (``moment_residual``).
    """

    kernel = _allocate
    wrenches = True

    def formation(self, team: Team) -> tuple[Array, Array]:
        return settled(self, team)

    def params(self, team: Team) -> Vector:
        span, axis = spanned(team)
        middle = team.levers.mean(axis=0)
        return PARAMS.pack(
            team.n, mu=self.mu, tolerance=self.tolerance, iterations=self.max_iterations,
            transport=self.transport, span=span, axis=axis, middle=middle,
            unit=max(float(np.abs(team.levers - middle).max()), 1e-3), arm=team.levers,
        )  # fmt: skip

    def memory(self, team: Team) -> Vector:
        return np.zeros(MEMORY.size(team.n) + paper.workspace_size(team.n))
