"""The contract of the reference layer: where the load should be, and its three derivatives."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from colift.jit import f8, matrix, vector, void
from colift.part import Part, Vector
from colift.team import Team

SIGNATURE = void(f8, vector, matrix)
"""``kernel(t, params, reference)``: time in s, ``reference`` (4, 3) out, world frame.

Rows: position (m), velocity (m/s), acceleration (m/s^2), jerk (m/s^3), each the time derivative of
the row above.
"""


class ReferencePart(Part):
    """Base of all references: a pure function of time."""

    layer: ClassVar[str] = "reference"

    def sample(self, times: Vector, team: Team | None = None) -> Vector:
        """Reference at the given times: (len(times), 4, 3)."""
        params = self.params(team or Team.uniform(1))
        out = np.zeros((len(times), 4, 3))
        for row, t in zip(out, times, strict=True):
            type(self).kernel(float(t), params, row)
        return out
