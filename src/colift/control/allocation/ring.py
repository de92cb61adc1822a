"""Baseline: a fixed symmetric ring tilted with the force, least-norm tensions."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from colift.control.allocation.common.fixed import FixedPattern
from colift.team.geometry import Array, ring


class Ring(FixedPattern):
    """Cables on a regular ring about the wanted force; tensions of least norm.

    Not the unpublished baseline of the paper's authors: a reference point for any allocator.
    """

    spread_setting = ("cone_deg", (15.0, 25.0, 35.0, 45.0, 55.0))

    cone_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 35.0
    """Half-angle of the cone, degrees."""
    heading_deg: float = 0.0
    """Azimuth of the first drone, degrees."""

    def pattern(self, n: int) -> Array:
        return ring(n, math.radians(self.cone_deg), heading=math.radians(self.heading_deg))
