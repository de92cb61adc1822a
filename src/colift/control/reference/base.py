"""The contract of the reference layer: where the load should be, and its three derivatives."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import ClassVar, Self

import numpy as np

from colift.kernel.ports import PORTS
from colift.part import Part, Vector
from colift.team import Team
from colift.team.load import Pose

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

    def pose(self, team: Team, time: float = 0.0) -> Pose:
        """Motion (4, 3), attitude (4,), wxyz, and rates with two derivatives (3, 3) that are wanted at a time, s."""
        return next(self.poses(team, (time,)))

    def poses(self, team: Team, times: Iterable[float]) -> Iterator[Pose]:
        """Those at each of some times, one after the other."""
        port = PORTS["reference"]
        signals = port.signals(team.n)
        wire = port.wire(type(self).kernel, self.params(team), np.zeros(0), signals)
        motion, attitude, rates = (
            signals[name] for name in ("reference", "reference_attitude", "reference_rates")
        )
        for time in times:
            port.invoke(wire, 0, float(time), 0.0)
            yield motion.copy(), attitude.copy(), rates.copy()

    def sample(self, times: Vector, team: Team | None = None) -> Vector:
        """Reference at the given times: (len(times), 4, 3)."""
        poses = self.poses(team or Team.uniform(1), times)
        return np.array([motion for motion, _, _ in poses]).reshape(-1, 4, 3)
