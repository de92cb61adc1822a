"""Optimal exchange by the alternating direction method of multipliers, one iteration a cycle: for comparison."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from colift.control.agents._message import MOST
from colift.control.agents.base import SIGNATURE, AgentPart, Status
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import message
from colift.part import Vector
from colift.team import Team

PARAMS = Layout(team={"rho": 1, "unit": 1})
MEMORY = Layout(drone={"started": 1, "x": 3, "home": 3, "u": 3, "heard": 4 * MOST})
"""Own pull ``x``, the one that it would like best, the price ``u`` of what does not balance; of each other drone whether it was
``heard``, and its pull."""
P, M = PARAMS.at, MEMORY.at
FREE, HOLDING = int(Status.FREE), int(Status.HOLDING)


@kernel(SIGNATURE)
def _exchange(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    n, rho, unit, F = sees.members.shape[0], params[P.rho], params[P.unit], sees.wish
    if memory[M.started] == 0.0:  # an equal share of the weight, as the start formation leans
        memory[M.started] = 1.0
        lean = -F[2] / (n * writes.direction[2])
        for k in range(3):
            memory[M.x + k] = memory[M.home + k] = lean * writes.direction[k]
    status = FREE
    finite = math.isfinite(F[0] + F[1] + F[2])
    for j in range(n):
        o = M.heard + 4 * int(sees.members[j])
        if sees.members[j] == sees.number[0]:
            continue
        if sees.heard[j] > 0.0:
            memory[o] = 1.0
            for k in range(3):
                memory[o + 1 + k] = unit * message.get(sees.inbox[j], 2 * k)
        if memory[o] == 0.0:
            status = HOLDING
    square = 0.0
    for k in range(3):
        if status == FREE and finite:
            # r = mean of x, with the n-th part of the force: 0 where pulls balance it
            r = memory[M.x + k]
            for j in range(n):
                if sees.members[j] != sees.number[0]:
                    r += memory[M.heard + 4 * int(sees.members[j]) + 1 + k]
            r = (r + F[k]) / n
            memory[M.u + k] += r
            wanted = memory[M.x + k] - r - memory[M.u + k]
            memory[M.x + k] = (memory[M.home + k] + rho * wanted) / (1.0 + rho)
        message.put(writes.outbox, 2 * k, memory[M.x + k] / unit)
        square += memory[M.x + k] ** 2
    size = math.sqrt(square)
    writes.tension[0] = size
    if size > 1e-9:
        for k in range(3):
            writes.direction[k] = memory[M.x + k] / size
    return status


class ExchangeAdmm(AgentPart):
    """Pulls that balance the wanted force and differ least from those of the start formation.

    Optimal exchange of Boyd, Parikh, Chu, Peleato and Eckstein, "Distributed optimization and statistical learning via the
    alternating direction method of multipliers" (2011), section 7.3.2, with ``f_i(x) = |x - home_i|^2 / 2``; each drone keeps a price
    of its own, and takes for the pulls of the others what it heard last. It limits nothing, and nothing keeps cables apart.
    """

    kernel = _exchange
    remembers = MEMORY

    rho: Annotated[float, Field(gt=0.0, le=1e3)] = 0.2
    """Weight of the balance over that of the distance from the start. More diverges where messages are late, less follows more slowly."""

    def check(self, team: Team) -> list[tuple[str, str]]:
        few = team.n <= MOST
        return super().check(team) + [("kind", f"is for {MOST} drones at most")] * (not few)

    def params(self, team: Team) -> Vector:
        weight = team.load_mass * max(team.gravity, 1e-3)
        return PARAMS.pack(team.n, rho=self.rho, unit=4.0 * weight / message.MOST)
