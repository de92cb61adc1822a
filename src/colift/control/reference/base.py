"""The contract of the reference layer: where the load should be, and its three derivatives."""

from __future__ import annotations

from typing import ClassVar, Self

import numpy as np

from colift.kernel.ports import PORTS
from colift.part import Part, Vector
from colift.team import Team

SIGNATURE = PORTS["reference"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

The four rows of ``reference`` are position, velocity, acceleration and jerk, each the time derivative of the row above, at
``now.time``. Who turns a rigid load writes ``reference_attitude`` and ``reference_rates`` too; else it stays level. A reference remembers
nothing: its memory is empty.
"""


class ReferencePart(Part):
    """Base of all references: a pure function of time."""

    layer: ClassVar[str] = "reference"

    turns: ClassVar[tuple[str, ...]] = ()
    """Settings that turn a rigid load; at 0 they ask for nothing."""

    def check(self, team: Team) -> list[tuple[str, str]]:
        found = super().check(team)
        if team.body is None:
            given = [name for name in self.turns if np.any(getattr(self, name))]
            found += [(name, "turns the load, which is a point: load.kind") for name in given]
        return found

    def upright(self) -> Self:
        """The same without roll and pitch of a rigid load, for one that leans of itself."""
        return self

    def pose(self, team: Team, time: float = 0.0) -> tuple[Vector, Vector, Vector]:
        """Motion (4, 3), attitude (4,), wxyz, and rates with two derivatives (3, 3) that are wanted at a time, s."""
        port = PORTS["reference"]
        signals = port.signals(team.n)
        wire = port.wire(type(self).kernel, self.params(team), np.zeros(0), signals)
        port.invoke(wire, 0, time, 0.0)
        names = ("reference", "reference_attitude", "reference_rates")
        motion, attitude, rates = (signals[name] for name in names)
        return motion, attitude, rates

    def sample(self, times: Vector, team: Team | None = None) -> Vector:
        """Reference at the given times: (len(times), 4, 3)."""
        team = team or Team.uniform(1)
        port, params = PORTS["reference"], self.params(team)
        signals, out = port.signals(team.n), np.zeros((len(times), 4, 3))
        for row, t in zip(out, times, strict=True):
            wire = port.wire(type(self).kernel, params, np.zeros(0), signals | {"reference": row})
            port.invoke(wire, 0, float(t), 0.0)
        return out
