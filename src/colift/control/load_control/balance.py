"""The load hangs on the formation: the wanted force balances its weight and what is known to push it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, ClassVar

from pydantic import Field

from colift.control.load_control._upright import keep_upright
from colift.control.load_control.base import SIGNATURE, LoadControlPart
from colift.control.margins import Hanging
from colift.control.tuning import Delays, sway
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math.smooth import decay
from colift.part import Setup, Vector
from colift.team import Team

PARAMS = Layout(team={"m": 1, "g": 1, "rate": 1, "tangent": 1})
MEMORY = Layout(team={"push": 3})
"""Filtered external force on the load, N."""
P, M = PARAMS.at, MEMORY.at


@kernel(SIGNATURE)
def _balance(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    reference, forces, u_L = sees.reference, sees.estimated_forces, writes.force
    m, g, last = params[P.m], params[P.g], sees.estimated_forces.shape[0] - 1
    share = 1.0 - decay(now.dt, 1.0 / params[P.rate])
    push = M.push
    if sees.standing[last] != 0.0:  # the whole weight, as it is known
        share = 1.0
    for k in range(3):
        memory[push + k] += share * (forces[last, k] - memory[push + k])
        u_L[k] = m * (reference[2, k] + (g if k == 2 else 0.0)) - memory[push + k]
    keep_upright(m * g, params[P.tangent], u_L)
    for k in range(3):
        writes.steady_force[k] = u_L[k]


class Balance(LoadControlPart, Delays):
    """Feed-forward of the load's motion and of the observed force on it; no feedback of its place.

    The drones hold the formation (position control of kind ``formation``), and the load hangs on it. The force comes
    from the layer of observation and holds a wrong mass of the load, too. Below heavy drones it is followed slowly: what is
    not known of their thrust is taken for a push on the load.
    """

    kernel = _balance
    remembers = MEMORY
    gain_setting: ClassVar[str] = "rate"

    rate: Annotated[float, Field(gt=0.0, le=5.0)] = 0.45
    """How fast the observed force is followed, over the bandwidth of the velocity loop."""
    swing: Annotated[float, Field(gt=0.0, le=5.0)] = 0.6
    """The same for one or two drones, over the pendulum's frequency."""
    max_lean_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 60.0
    """Most lean of the wanted force from the vertical, degrees."""

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        yield from self.delay_warnings(mission, "load_control")

    def hanging(self, team: Team, axis: int) -> Hanging:
        rate = min(self.rate * self.bandwidths(team).velocity, sway(team))
        if team.n <= 2:
            wp = math.sqrt(max(team.gravity, 1e-3) / float(team.cable_lengths.mean()))
            rate = min(rate, self.swing * wp)
        return Hanging(rate=rate)

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, m=team.load_mass, g=team.gravity, rate=self.hanging(team, 0).rate,
            tangent=math.tan(math.radians(self.max_lean_deg)),
        )  # fmt: skip
