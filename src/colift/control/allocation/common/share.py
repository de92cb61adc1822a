"""What the closed-form allocators have in common: how a call begins, and what is said of its answer."""

from __future__ import annotations

import math

from colift.control.allocation.base import (
    INFO_BALANCE,
    INFO_GAP,
    INFO_OBJECTIVE,
    INFO_RESIDUAL,
)
from colift.kernel.jit import inline
from colift.kernel.rounding import NO_FORCE


@inline
def begin(force, tensions, info):  # type: ignore[no-untyped-def]
    """Clear ``info``; the size of the force, N: NaN where not finite, 0 where too small to share."""
    for k in range(info.shape[0]):
        info[k] = 0.0
    info[INFO_RESIDUAL] = math.nan
    info[INFO_OBJECTIVE] = math.nan
    info[INFO_GAP] = math.nan
    W = math.sqrt(force[0] * force[0] + force[1] * force[1] + force[2] * force[2])
    if not math.isfinite(W):
        info[INFO_BALANCE] = math.nan
        return math.nan
    info[INFO_BALANCE] = W
    if W <= NO_FORCE:
        for i in range(tensions.shape[0]):
            tensions[i] = 0.0
        return 0.0
    return W


@inline
def balance(force, tensions, directions, info):  # type: ignore[no-untyped-def]
    """Note and return the error of the force balance, N."""
    rx, ry, rz = force[0], force[1], force[2]
    for i in range(tensions.shape[0]):
        rx += tensions[i] * directions[i, 0]
        ry += tensions[i] * directions[i, 1]
        rz += tensions[i] * directions[i, 2]
    info[INFO_BALANCE] = math.sqrt(rx * rx + ry * ry + rz * rz)
    return info[INFO_BALANCE]


@inline
def effort(W, tensions, info):  # type: ignore[no-untyped-def]
    """Note ``1/2 sum T^2`` and its distance from the least of all, ``W^2 / 2n`` of parallel cables."""
    n = tensions.shape[0]
    J = 0.0
    for i in range(n):
        J += 0.5 * tensions[i] * tensions[i]
    info[INFO_OBJECTIVE] = J
    info[INFO_GAP] = J - 0.5 * W * W / n
