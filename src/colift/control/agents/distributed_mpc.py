"""Each plans its own pull some steps ahead, against the plans that it has heard of the others: for comparison."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from colift.control.agents._message import MOST
from colift.control.agents.base import SIGNATURE, AgentPart, Status
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import message
from colift.part import Vector
from colift.team import Team

STAGES = 5
"""Stages of a plan: as many pulls as one message holds."""
PARAMS = Layout(team={"stage": 1, "balance": 1, "change": 1, "step": 1, "mass": 1, "unit": 1})
MEMORY = Layout(
    drone={
        "started": 1, "f": 3, "home": 3, "plan": 3 * STAGES, "heard": (2 + 3 * STAGES) * MOST, "best": STAGES, "factor": STAGES,
    }
)  # fmt: skip
"""Own pull on its cable ``f``, the one that it would like best, its ``plan``; of each other drone whether it was ``heard``, how long ago, s, and its plan; ``best``, ``factor``: scratch."""
P, M = PARAMS.at, MEMORY.at
WIDTH = 2 + 3 * STAGES
FREE, HOLDING = int(Status.FREE), int(Status.HOLDING)


@inline
def _at(memory, plan, k, stages):  # type: ignore[no-untyped-def]
    """Axis k of a plan so many stages after its first, between them along a line; its end where it is over."""
    if stages <= 0.0:
        return memory[plan + k]
    s = min(int(stages), STAGES - 1)
    later = min(s + 1, STAGES - 1)
    part = min(stages - s, 1.0)
    return (1.0 - part) * memory[plan + 3 * s + k] + part * memory[plan + 3 * later + k]


@kernel(SIGNATURE)
def _plan_ahead(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    n, F, dt = sees.members.shape[0], sees.wish, now.dt
    h, q, r = params[P.stage], params[P.balance], params[P.change]
    if memory[M.started] == 0.0:  # an equal share of the weight, as the start formation leans
        memory[M.started] = 1.0
        lean = -F[2] / (n * writes.direction[2])
        for k in range(3):
            memory[M.f + k] = memory[M.home + k] = lean * writes.direction[k]
            for s in range(STAGES):
                memory[M.plan + 3 * s + k] = memory[M.f + k]
    status = FREE
    for j in range(n):
        o = M.heard + WIDTH * int(sees.members[j])
        if sees.members[j] == sees.number[0]:
            continue
        memory[o + 1] += dt
        if sees.heard[j] > 0.0:
            memory[o], memory[o + 1] = 1.0, dt
            for m in range(3 * STAGES):
                memory[o + 2 + m] = params[P.unit] * message.get(sees.inbox[j], 2 * m)
        if memory[o] == 0.0:
            status = HOLDING
    free = status == FREE and math.isfinite(F[0] + F[1] + F[2])
    square = 0.0
    for k in range(3):
        if free:
            for s in range(STAGES):
                wanted = F[k] + params[P.mass] * sees.reference[3, k] * h * (s + 1)
                for j in range(n):
                    if sees.members[j] != sees.number[0]:
                        o = M.heard + WIDTH * int(sees.members[j])
                        wanted += _at(memory, o + 2, k, s + memory[o + 1] / h)
                memory[M.best + s] = memory[M.home + k] - q * wanted
            memory[M.best] += r * memory[M.f + k]
            # (1 + q + 2 r) f_s - r (f_s-1 + f_s+1) = home - q (F_s + others_s), by elimination
            for s in range(STAGES):
                d = 1.0 + q + (2.0 * r if s < STAGES - 1 else r)
                if s > 0:
                    d -= r * memory[M.factor + s - 1]
                    memory[M.best + s] += r * memory[M.best + s - 1]
                memory[M.factor + s] = r / d
                memory[M.best + s] /= d
            for s in range(STAGES - 2, -1, -1):
                memory[M.best + s] += memory[M.factor + s] * memory[M.best + s + 1]
            for s in range(STAGES):
                kept = _at(memory, M.plan, k, s + dt / h)
                memory[M.plan + 3 * s + k] = kept + params[P.step] / n * (memory[M.best + s] - kept)
            memory[M.f + k] += min(dt / h, 1.0) * (memory[M.plan + k] - memory[M.f + k])
        for s in range(STAGES):
            message.put(writes.outbox, 2 * (3 * s + k), memory[M.plan + 3 * s + k] / params[P.unit])
        square += memory[M.f + k] ** 2
    size = math.sqrt(square)
    writes.tension[0] = size
    if size > 1e-9:
        for k in range(3):
            writes.direction[k] = memory[M.f + k] / size
    return status


class DistributedMpc(AgentPart):
    """Each drone plans its own pull over some stages, takes for the others' what they have said that they plan, and says its own.

    After Wehbeh, Rahman and Sharf, "Distributed Model Predictive Control for UAVs Collaborative Payload Transport", IROS 2020: every vehicle
    solves its own problem, with the states that it has been told of the others'. What is assumed here: the load is a point and the force on it
    is what all share, so that a stage costs ``q |F + sum f|^2 + |f_i - home_i|^2 + r |change of f_i|^2`` over the weight of the distance from the
    start formation; nothing is limited, so that each answer is closed. Each goes only the n-th part of the way to its answer (Venkat, Rawlings and
    Wright, "Stability and optimality of distributed model predictive control", CDC 2005), without which answers to each other swing up. One
    exchange a cycle. Nothing keeps cables apart.
    """

    kernel = _plan_ahead
    remembers = MEMORY

    stage: Annotated[float, Field(gt=0.0, le=1.0)] = 0.05
    """Time from one stage of a plan to the next, s; there are five."""
    balance: Annotated[float, Field(gt=0.0, le=1e4)] = 30.0
    """Weight ``q`` of the force that is missing."""
    change: Annotated[float, Field(ge=0.0, le=1e4)] = 5.0
    """Weight ``r`` of the change from one stage to the next."""
    step: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    """Share of the n-th part of the way to its answer that each goes in a cycle. More swings up where messages are late."""

    def check(self, team: Team) -> list[tuple[str, str]]:
        few = team.n <= MOST
        return super().check(team) + [("kind", f"is for {MOST} drones at most")] * (not few)

    def params(self, team: Team) -> Vector:
        weight = team.load_mass * max(team.gravity, 1e-3)
        return PARAMS.pack(
            team.n, stage=self.stage, balance=self.balance, change=self.change, step=self.step, mass=team.load_mass,
            unit=4.0 * weight / message.MOST,
        )  # fmt: skip
