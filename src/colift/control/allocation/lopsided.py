"""Baseline: a fixed lopsided pattern, the kind that gives the paper's bad plots."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.control.allocation.common.fixed import FixedPattern
from colift.team.geometry import Array, ring


class Lopsided(FixedPattern):
    """One cable apart and the others bunched opposite to it; tensions of least norm.

    The paper's baseline is not published. Its plots show one cable that carries far more than the
    others and angles below 30 degrees; any lopsided pattern does that, and this is one.
    """

    cone_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 35.0
    """Half-angle of the cone, degrees."""
    sector_deg: Annotated[float, Field(gt=0.0, lt=360.0)] = 90.0
    """Azimuth sector that all cables but the first share, opposite to the first, degrees."""

    def pattern(self, n: int) -> Array:
        if n < 3:
            return ring(n, math.radians(self.cone_deg))
        cone, half = math.radians(self.cone_deg), 0.5 * math.radians(self.sector_deg)
        azimuth = np.concatenate([[0.0], np.linspace(np.pi - half, np.pi + half, n - 1)])
        outward = math.sin(cone) * np.column_stack([np.cos(azimuth), np.sin(azimuth)])
        return -np.column_stack([outward, np.full(n, math.cos(cone))])
