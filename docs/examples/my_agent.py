"""A team without a leader: each drone broadcasts the force that it wants, and bears its share of the mean of all."""

from __future__ import annotations

import math

from colift.control.agents.base import SIGNATURE, AgentPart, Status
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import message
from colift.team import Team

MOST = 8
MEMORY = Layout(drone={"started": 1, "inner": 3, "wishes": 3 * MOST})
"""``inner``: pull beside the share, by which the cables lean apart; ``wishes``: the last heard, by the drone's number."""
M = MEMORY.at
MILLI = 1e3
FREE, HOLDING = int(Status.FREE), int(Status.HOLDING)


@kernel(SIGNATURE)
def agree(now, sees, params, memory, writes):
    n = sees.members.shape[0]
    if memory[M.started] == 0.0:  # lean as in the start formation, with nothing of it in the sum
        memory[M.started] = 1.0
        lean = -sees.wish[2] / (n * writes.direction[2])
        for k in range(2):
            memory[M.inner + k] = -lean * writes.direction[k]
        for m in range(MOST):
            for k in range(3):
                memory[M.wishes + 3 * m + k] = sees.wish[k]
    status = FREE
    for j in range(n):
        m = M.wishes + 3 * int(sees.members[j])
        for k in range(3):
            if sees.members[j] == sees.number[0]:
                memory[m + k] = sees.wish[k]
            elif sees.heard[j] > 0.0:
                memory[m + k] = message.get(sees.inbox[j], 2 * k) / MILLI
            else:
                status = HOLDING
    square = 0.0
    for k in range(3):
        message.put(writes.outbox, 2 * k, MILLI * sees.wish[k])
        pull = memory[M.inner + k]
        for j in range(n):
            pull += memory[M.wishes + 3 * int(sees.members[j]) + k] / (n * n)
        writes.direction[k] = -pull
        square += pull * pull
    writes.tension[0] = math.sqrt(square)
    for k in range(3):
        writes.direction[k] /= max(writes.tension[0], 1e-9)
    return status


class MeanWish(AgentPart):
    """Up to eight drones; no settings."""

    kernel = agree
    remembers = MEMORY

    def check(self, team: Team) -> list[tuple[str, str]]:
        few = team.n <= MOST
        return super().check(team) + [("kind", f"is for {MOST} drones at most")] * (not few)
