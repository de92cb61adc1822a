"""A wanted force that keeps cables taut and the formation upright."""

from __future__ import annotations

import math

from colift.kernel.jit import inline

LEAST = 0.3
"""Least upward force over the load's weight."""


@inline
def keep_upright(weight, tangent, force):  # type: ignore[no-untyped-def]
    """Bring ``force`` (3,) into a cone about the vertical of this half-angle's tangent, no lower than a part of the ``weight``, N."""
    force[2] = max(force[2], LEAST * weight)
    across = math.sqrt(force[0] * force[0] + force[1] * force[1])
    if across > tangent * force[2]:
        force[0] *= tangent * force[2] / across
        force[1] *= tangent * force[2] / across
