"""Each drone judges itself, by what it measures itself: for teams without a leader, and wherever nobody sees all."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from colift.control.detection.base import SIGNATURE
from colift.control.detection.residuals import MEMORY, SOON, Residuals, judge
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.ports import PORTS
from colift.part import Places, Vector
from colift.team import Team

SETTLES = 0.5
"""Least grace after a change of the team, s."""
Sees, Writes = PORTS["detection"].Sees, PORTS["detection"].Writes


@kernel(SIGNATURE)
def _judge_itself(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    n = sees.estimated_positions.shape[0]
    wide, long = params.shape[0] // n, memory.shape[0] // n
    for i in range(n):
        p, o = wide * i, long * i
        alone = Sees(
            sees.estimated_ends[i : i + 1], sees.estimated_positions[i : i + 1], sees.estimated_velocities[i : i + 1],
            sees.estimated_attitudes[i : i + 1], sees.estimated_ages[i : i + 1], sees.thrusts[i : i + 1], sees.lift_share, sees.reeled[i : i + 1],
            sees.received_tensions[i : i + 1], sees.received_directions[i : i + 1], sees.received_ages[i : i + 1],
        )  # fmt: skip
        judge(
            now, alone, params[p : p + wide], memory[o : o + long],
            Writes(writes.carrying[i : i + 1]),
        )  # fmt: skip


class SelfCheck(Residuals):
    """The signs of ``residuals``, of each drone by itself: it knows nothing of the wind of the others, nor whether all cables change.

    So a sign must last longer.
    """

    kernel = _judge_itself
    remembers = Layout(drone=MEMORY.team | MEMORY.drone)
    of_itself: ClassVar[bool] = True

    hold: Annotated[float, Field(ge=0.0, le=1.0)] = 0.05
    """Time for which a sign must last, s."""

    def grace_of(self, team: Team) -> float:
        """Also with a point: who learns late that another is gone asks its cable for more at once."""
        return max(super().grace_of(team), SETTLES) if self.grace is None else self.grace

    def params(self, team: Team) -> Vector:
        """As of teams of one, one after the other."""
        return np.concatenate([super(SelfCheck, self).params(team.of([i])) for i in range(team.n)])

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        kept = self.layout().carry_over(old, fresh, places)
        for row in kept.reshape(len(places), -1):
            MEMORY.view(row, "changed")[:], MEMORY.view(row, "tumbled")[:] = SOON, 0.0
        return kept
