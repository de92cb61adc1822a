"""What the allocators for rigid loads have in common: how a call begins, the nearest forces that make a wrench, what is said of them."""

from __future__ import annotations

import math

from colift.control.allocation.base import (
    HOVER_PERIOD,
    INFO_ACTIVE,
    INFO_BALANCE,
    INFO_ITERATIONS,
    INFO_MOMENT,
    AllocatorPart,
    Status,
)
from colift.control.allocation.common import share
from colift.kernel.jit import inline
from colift.kernel.math import quaternion, wrench
from colift.kernel.rounding import NO_TENSION, UNBALANCED
from colift.team import Team
from colift.team.geometry import Array
from colift.team.plan import plan

_CONVERGED = int(Status.CONVERGED)
_FORCE_REDUCED = int(Status.FORCE_REDUCED)


def settled(part: AllocatorPart, team: Team) -> tuple[Array, Array]:
    """Directions (n, 3) and tensions (n,), N, at which an allocator without a plan of its own holds a level load in hover."""
    hover = part.hover(team, plan(team)[0], HOVER_PERIOD)
    return hover.directions, hover.tensions


@inline
def begin(known, force, moment, tensions, info):  # type: ignore[no-untyped-def]
    """Clear ``info``; the size of the force as :func:`colift.control.allocation.common.share.begin`, NaN where not all that is asked is known."""
    size = math.sqrt(moment[0] * moment[0] + moment[1] * moment[1] + moment[2] * moment[2])
    if not (known and math.isfinite(size + force[0] + force[1] + force[2])):
        for k in range(info.shape[0]):
            info[k] = 0.0 if k in (INFO_ITERATIONS, INFO_ACTIVE) else math.nan
        return math.nan
    W = share.begin(force, tensions, info)
    info[INFO_MOMENT] = size
    return W


@inline
def imbalance(force, moment, ends, w, info):  # type: ignore[no-untyped-def]
    """Note and return the errors of the balance of force and moment, N and N m, of cable forces ``w`` (3 n) at ``ends`` (3 n), m."""
    fx, fy, fz, mx, my, mz = wrench.unmet(
        ends.shape[0] // 3, force[0], force[1], force[2], moment[0], moment[1], moment[2], ends, w
    )
    info[INFO_BALANCE] = math.sqrt(fx * fx + fy * fy + fz * fz)
    info[INFO_MOMENT] = math.sqrt(mx * mx + my * my + mz * mz)
    return info[INFO_BALANCE], info[INFO_MOMENT]


@inline
def nearest(W, force, moment, attitude, span, axis, ends, w, tensions, directions, info):  # type: ignore[no-untyped-def]
    """Answer with the cable forces nearest to ``w`` (3 n) that make force and moment; a moment that no cables can make is left out.

    ``axis`` (3,) is the line of all ends in the load's frame, ``ends`` (3 n) are in the world.
    """
    n = tensions.shape[0]
    qw, qx, qy, qz = attitude
    fx, fy, fz = force[0], force[1], force[2]
    ax, ay, az = quaternion.into_world(qw, qx, qy, qz, axis[0], axis[1], axis[2])
    mx, my, mz = wrench.possible(
        n, span, ax, ay, az, fx, fy, fz, moment[0], moment[1], moment[2], ends
    )
    for _ in range(2):  # the second time removes what rounding left
        ux, uy, uz, vx, vy, vz = wrench.unmet(n, fx, fy, fz, mx, my, mz, ends, w)
        wrench.correct(n, span, ax, ay, az, ux, uy, uz, vx, vy, vz, ends, w)
    reach = 0.0
    for i in range(n):
        x, y, z = w[3 * i], w[3 * i + 1], w[3 * i + 2]
        tensions[i] = math.sqrt(x * x + y * y + z * z)
        if tensions[i] > NO_TENSION * W:
            directions[i, 0] = x / tensions[i]
            directions[i, 1] = y / tensions[i]
            directions[i, 2] = z / tensions[i]
        for k in range(3):
            reach = max(reach, abs(ends[3 * i + k]))
    share.effort(W, tensions, info)
    missing, _ = imbalance(force, moment, ends, w, info)
    _, _, _, vx, vy, vz = wrench.unmet(n, fx, fy, fz, mx, my, mz, ends, w)
    turning = math.sqrt(vx * vx + vy * vy + vz * vz)
    asked = W * reach + math.sqrt(mx * mx + my * my + mz * mz)
    whole = missing <= UNBALANCED * W and turning <= UNBALANCED * asked
    return _CONVERGED if whole else _FORCE_REDUCED
