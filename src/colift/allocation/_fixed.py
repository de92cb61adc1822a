"""A fixed pattern of cables that tilts with the force: shared by the baselines."""

from __future__ import annotations

import math

import numpy as np

from colift.allocation._sqp_newton import rotate
from colift.allocation.base import (
    INFO_BALANCE,
    INFO_GAP,
    INFO_OBJECTIVE,
    INFO_RESIDUAL,
    SIGNATURE,
    AllocatorPart,
    Status,
)
from colift.geometry import Array, min_norm_tensions
from colift.jit import kernel
from colift.part import Vector
from colift.team import Team

_CONVERGED = int(Status.CONVERGED)
_ZERO_FORCE = int(Status.ZERO_FORCE)
_INVALID_FORCE = int(Status.INVALID_FORCE)
_CLAMPED = int(Status.CLAMPED)


@kernel(SIGNATURE)
def allocate_fixed(force, acceleration, dt, params, memory, tensions, directions, info):  # type: ignore[no-untyped-def]
    """Turn the pattern from the vertical to the force; scale its shares by the force's size."""
    n = tensions.shape[0]
    for k in range(info.shape[0]):
        info[k] = 0.0
    info[INFO_RESIDUAL] = math.nan
    info[INFO_OBJECTIVE] = math.nan
    info[INFO_GAP] = math.nan
    fx, fy, fz = force[0], force[1], force[2]
    W = math.sqrt(fx * fx + fy * fy + fz * fz)
    if not math.isfinite(W):
        info[INFO_BALANCE] = math.nan
        return _INVALID_FORCE
    if W <= 1e-12:
        for i in range(n):
            tensions[i] = 0.0
        info[INFO_BALANCE] = W
        return _ZERO_FORCE
    alpha = directions.reshape(3 * n)
    for k in range(3 * n):
        alpha[k] = params[k]
    rotate(n, 0.0, 0.0, 1.0, fx / W, fy / W, fz / W, alpha, memory)
    rx, ry, rz = fx, fy, fz
    for i in range(n):
        tensions[i] = W * params[3 * n + i]
        rx += tensions[i] * alpha[3 * i]
        ry += tensions[i] * alpha[3 * i + 1]
        rz += tensions[i] * alpha[3 * i + 2]
    info[INFO_BALANCE] = math.sqrt(rx * rx + ry * ry + rz * rz)
    return _CONVERGED if info[INFO_BALANCE] <= 1e-9 * W else _CLAMPED


class FixedPattern(AllocatorPart):
    """Base of the baselines: one pattern, whatever happens."""

    kernel = allocate_fixed

    def pattern(self, n: int) -> Array:
        """Directions (n, 3) for an upward force."""
        raise NotImplementedError

    def params(self, team: Team) -> Vector:
        directions = self.pattern(team.n)
        shares = np.maximum(min_norm_tensions(directions, [0.0, 0.0, 1.0]), 0.0)
        return np.concatenate([directions.ravel(), shares])

    def memory(self, team: Team) -> Vector:
        return np.zeros(3)
