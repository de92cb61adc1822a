"""A push: a constant force on the load for a while."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.part import Vector
from colift.team import Team
from colift.world.disturbance._lever import Metre, arm_of, aside, turn_by
from colift.world.disturbance.base import SIGNATURE, DisturbancePart

Newton = Annotated[float, Field(ge=-1e6, le=1e6)]

PARAMS = Layout(team={"force": 3, "begin": 1, "end": 1, "arm": 3})
"""``arm``: from a rigid load's centre of mass to where it is pushed, in its frame."""
P = PARAMS.at


@kernel(SIGNATURE)
def _push(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    step, dt = now.step, now.dt
    positions = sees.positions
    external = writes.external_forces
    t = step * dt
    if params[P.begin] <= t < params[P.end]:
        for k in range(3):
            external[positions.shape[0], k] += params[P.force + k]
        turn_by(
            P.arm, params, params[P.force], params[P.force + 1], params[P.force + 2], sees, writes
        )


class Push(DisturbancePart):
    """``force`` on the load from ``at`` for ``duration``."""

    kernel = _push

    force: tuple[Newton, Newton, Newton] = (0.0, 0.0, 0.0)
    """World frame, N."""
    point: tuple[Metre, Metre, Metre] | None = None
    """Where it pushes a rigid load, its frame, m; left out: at its centre of mass, so that it does not turn it."""
    at: Annotated[float, Field(ge=0.0)] = 0.0
    """Begin, s."""
    duration: Annotated[float, Field(ge=0.0)] = 1.0
    """s."""

    def check(self, team: Team) -> list[tuple[str, str]]:
        return super().check(team) or aside("point", self.point, team)

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, force=self.force, begin=self.at, end=self.at + self.duration, arm=arm_of(self.point, team)
        )  # fmt: skip
