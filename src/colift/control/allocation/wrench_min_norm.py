"""Pseudo-inverse for a rigid load: the cable forces nearest to a hover formation that make the wrench."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.control.allocation.base import INFO_GAP, SIGNATURE, AllocatorPart, Status
from colift.control.allocation.common.share import balance, begin, effort
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion, wrench
from colift.kernel.math.columns import column
from colift.kernel.rounding import NO_TENSION, UNBALANCED
from colift.part import Vector
from colift.team import Team
from colift.team.geometry import Array
from colift.team.plan import plan, shares, spanned

_CONVERGED = int(Status.CONVERGED)
_ZERO_FORCE = int(Status.ZERO_FORCE)
_INVALID_FORCE = int(Status.INVALID_FORCE)
_FORCE_REDUCED = int(Status.FORCE_REDUCED)

PARAMS = Layout(team={"span": 1, "axis": 3, "reach": 1}, drone={"plan": 3, "arm": 3})
MEMORY = Layout(drone={"w": 3, "end": 3})
"""Both in columns; the plan is that of a unit upward force."""
P, PLACES = PARAMS.at, PARAMS.spans
M, COLUMNS = MEMORY.at, MEMORY.spans


@kernel(SIGNATURE)
def _allocate(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    force, moment = sees.force, sees.moment
    tensions, directions = writes.desired_tensions, writes.desired_directions
    info = writes.allocator_info
    n = tensions.shape[0]
    w = column(memory, M.rows, n, COLUMNS.w)
    ends = column(memory, M.rows, n, COLUMNS.end)
    W = begin(force, tensions, info)
    known, qw, qx, qy, qz = wrench.unit_attitude(sees.estimated_load_attitude)
    wanted, pw, px, py, pz = wrench.unit_attitude(sees.reference_attitude)
    fx, fy, fz = force[0], force[1], force[2]
    mx, my, mz = moment[0], moment[1], moment[2]
    size = math.sqrt(mx * mx + my * my + mz * mz)
    if not (math.isfinite(W) and math.isfinite(size) and known and wanted):
        return _INVALID_FORCE
    if W == 0.0:
        return _ZERO_FORCE
    wrench.turned(qw, qx, qy, qz, n, column(params, P.rows, n, PLACES.arm), ends)
    cos_yaw, sin_yaw = wrench.heading(pw, px, py, pz)
    formation = column(params, P.rows, n, PLACES.plan)
    if sees.formation[0, 2] != 0.0:
        formation = sees.formation.reshape(3 * n)
    wrench.planned(n, fx, fy, fz, W, cos_yaw, sin_yaw, formation, w)
    span = params[P.span]
    ax, ay, az = quaternion.into_world(
        qw, qx, qy, qz, params[P.axis], params[P.axis + 1], params[P.axis + 2]
    )
    for _ in range(2):  # the second time removes what rounding left
        ux, uy, uz, vx, vy, vz = wrench.unmet(n, fx, fy, fz, mx, my, mz, ends, w)
        wrench.correct(n, span, ax, ay, az, ux, uy, uz, vx, vy, vz, ends, w)
    for i in range(n):
        x, y, z = w[3 * i], w[3 * i + 1], w[3 * i + 2]
        tensions[i] = math.sqrt(x * x + y * y + z * z)
        if tensions[i] > NO_TENSION * W:
            directions[i, 0] = x / tensions[i]
            directions[i, 1] = y / tensions[i]
            directions[i, 2] = z / tensions[i]
    effort(W, tensions, info)
    missing = balance(force, tensions, directions, info) > UNBALANCED * W
    _, _, _, vx, vy, vz = wrench.unmet(n, fx, fy, fz, mx, my, mz, ends, w)
    reach = UNBALANCED * (W * params[P.reach] + size)
    if missing or math.sqrt(vx * vx + vy * vy + vz * vz) > reach:
        info[INFO_GAP] = math.nan
        return _FORCE_REDUCED
    return _CONVERGED


class WrenchMinNorm(AllocatorPart):
    """Cable forces nearest to a plan that make force and moment: ``w = w_plan - G^+ (G w_plan + [F, M])``.

    The pseudo-inverse of the wrench map ``G`` (6 x 3n) with a hover formation as its part in the null space, after Li, Ge and Loianno,
    "RotorTM: A Flexible Simulator for Aerial Transportation and Manipulation", IEEE T-RO, 2023. The plan
    (:func:`colift.team.plan.plan`) is a ring of drones that leans with the force and turns with the wanted heading.
    No limit is kept: not of tensions, nor turns, nor distances.

    Two cables, or others that end in one line, make no moment about it, and those on a point load none at all; then
    the nearest moment that they can make is made, with status ``FORCE_REDUCED``.
    """

    kernel = _allocate
    remembers = MEMORY
    wrenches = True

    cone_deg: Annotated[float, Field(gt=0.0, lt=80.0)] = 30.0
    """Angle of the formation's cables from the vertical in hover, degrees."""

    def formation(self, team: Team) -> tuple[Array, Array]:
        return plan(team, lean=math.radians(self.cone_deg))

    def params(self, team: Team) -> Vector:
        span, axis = spanned(team)
        forces = shares(team, *self.formation(team))
        reach = max(float(abs(team.levers).max()), 1e-9)
        return np.concatenate([[span, *axis, reach], forces.ravel(), team.levers.ravel()])
