"""The contract of the reference layer: where the load should be, and its three derivatives."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from colift.kernel.ports import PORTS
from colift.part import Part, Vector
from colift.team import Team

SIGNATURE = PORTS["reference"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

The four rows of ``reference`` are position, velocity, acceleration and jerk, each the time derivative of the row above, at
``now.time``. A reference remembers nothing: its memory is empty.
"""


class ReferencePart(Part):
    """Base of all references: a pure function of time."""

    layer: ClassVar[str] = "reference"

    def sample(self, times: Vector, team: Team | None = None) -> Vector:
        """Reference at the given times: (len(times), 4, 3)."""
        team = team or Team.uniform(1)
        port, params = PORTS["reference"], self.params(team)
        signals, out = port.signals(team.n), np.zeros((len(times), 4, 3))
        for row, t in zip(out, times, strict=True):
            wire = port.wire(type(self).kernel, params, np.zeros(0), signals | {"reference": row})
            port.invoke(wire, 0, float(t), 0.0)
        return out
