"""A fixed pattern of cables that tilts with the force: shared by the baselines."""

from __future__ import annotations

import math

import numpy as np

from colift.control.allocation.base import SIGNATURE, AllocatorPart, Status
from colift.control.allocation.common.share import balance, begin
from colift.control.allocation.paper.newton import rotate
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math.columns import column
from colift.kernel.rounding import UNBALANCED
from colift.part import Vector
from colift.team import Team
from colift.team.geometry import Array, min_norm_tensions

_CONVERGED = int(Status.CONVERGED)
_ZERO_FORCE = int(Status.ZERO_FORCE)
_INVALID_FORCE = int(Status.INVALID_FORCE)
_CLAMPED = int(Status.CLAMPED)

PARAMS = Layout(drone={"direction": 3, "share": 1})
"""In columns; of an upward force."""
MEMORY = Layout(team={"spare": 3})
P, SPANS = PARAMS.at, PARAMS.spans


@kernel(SIGNATURE)
def allocate_fixed(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    """Turn the pattern from the vertical to the force; scale its shares by the force's size."""
    force = sees.force
    tensions, directions = writes.desired_tensions, writes.desired_directions
    info = writes.allocator_info
    n = tensions.shape[0]
    W = begin(force, tensions, info)
    if not math.isfinite(W):
        return _INVALID_FORCE
    if W == 0.0:
        return _ZERO_FORCE
    alpha = directions.reshape(3 * n)
    pattern = column(params, P.rows, n, SPANS.direction)
    shares = column(params, P.rows, n, SPANS.share)
    for k in range(3 * n):
        alpha[k] = pattern[k]
    rotate(n, 0.0, 0.0, 1.0, force[0] / W, force[1] / W, force[2] / W, alpha, memory)
    for i in range(n):
        tensions[i] = W * shares[i]
    return _CONVERGED if balance(force, tensions, directions, info) <= UNBALANCED * W else _CLAMPED


class FixedPattern(AllocatorPart):
    """Base of the baselines: one pattern, whatever happens."""

    kernel = allocate_fixed
    remembers = MEMORY

    def pattern(self, n: int) -> Array:
        """Directions (n, 3) for an upward force."""
        raise NotImplementedError

    def params(self, team: Team) -> Vector:
        directions = self.pattern(team.n)
        shares = np.maximum(min_norm_tensions(directions, [0.0, 0.0, 1.0]), 0.0)
        return np.concatenate([directions.ravel(), shares])
