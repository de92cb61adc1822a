"""Pseudo-inverse for a rigid load: the cable forces nearest to a hover formation that make the wrench."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.control.allocation.base import SIGNATURE, AllocatorPart, Status
from colift.control.allocation.common.wrenches import begin, nearest
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import wrench
from colift.kernel.math.columns import column
from colift.part import Vector
from colift.team import Team
from colift.team.geometry import Array
from colift.team.plan import plan, shares, spanned

_ZERO_FORCE = int(Status.ZERO_FORCE)
_INVALID_FORCE = int(Status.INVALID_FORCE)

PARAMS = Layout(team={"span": 1, "axis": 3}, drone={"plan": 3, "arm": 3})
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
    known, qw, qx, qy, qz = wrench.unit_attitude(sees.estimated_load_attitude)
    wanted, pw, px, py, pz = wrench.unit_attitude(sees.reference_attitude)
    W = begin(known and wanted, force, moment, tensions, info)
    if not math.isfinite(W):
        return _INVALID_FORCE
    if W == 0.0:
        return _ZERO_FORCE
    wrench.turned(qw, qx, qy, qz, n, column(params, P.rows, n, PLACES.arm), ends)
    cos_yaw, sin_yaw = wrench.heading(pw, px, py, pz)
    formation = column(params, P.rows, n, PLACES.plan)
    if sees.formation[0, 2] != 0.0:
        formation = sees.formation.reshape(3 * n)
    wrench.planned(n, force[0], force[1], force[2], W, cos_yaw, sin_yaw, formation, w)
    axis = params[P.axis : P.axis + 3]
    return nearest(
        W,
        force,
        moment,
        (qw, qx, qy, qz),
        params[P.span],
        axis,
        ends,
        w,
        tensions,
        directions,
        info,
    )


class WrenchMinNorm(AllocatorPart):
    """Cable forces nearest to a plan that make force and moment: ``w = w_plan - G^+ (G w_plan + [F, M])``.

    The pseudo-inverse of the wrench map ``G`` (6 x 3n) with a hover formation as its part in the null space, after Li, Ge and Loianno,
    "RotorTM: A Flexible Simulator for Aerial Transportation and Manipulation", IEEE T-RO, 2023. The plan
    (:func:`colift.team.plan.plan`) is a ring of drones that leans with the force and turns with the wanted heading.
    No limit is kept: not of tensions, nor turns, nor distances.

    Two cables, or others that end in one line, make no moment about it, and those on a point load none at all: that is left out
    (``moment_residual``).
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
        return np.concatenate([[span, *axis], forces.ravel(), team.levers.ravel()])
