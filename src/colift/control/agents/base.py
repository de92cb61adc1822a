"""The contract of the agents: one decides for one drone, from what it wants itself and what it hears of the others."""

from __future__ import annotations

import enum
from typing import ClassVar

from colift.kernel.layout import Layout
from colift.kernel.ports import PORTS
from colift.part import Part, Vector
from colift.team import Team

SIGNATURE = PORTS["agents"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called for one drone after the other at the allocation's period, ``now.dt``; all are called before any message of theirs
is carried. ``now.step`` and ``now.time`` are those of the drone's own clock, of which the others know nothing. ``memory`` is
that of this drone alone, ``params`` are common to all. ``tension`` and ``direction`` hold, on entry, the drone's
last (or the start formation); of two drones, neither sees the other's. Returns a :class:`Status`.
"""


class Status(enum.IntFlag):
    """How an agent's cycle ended, recorded as ``agent_status``."""

    FREE = 0
    """Everybody was heard, and nothing was in the way."""
    HOLDING = 1
    """Somebody is unheard: what all have to agree on is held."""
    CLIPPED = 2
    """A limit of this drone's own cut its pull."""


class AgentPart(Part):
    """Base of all agents. Its layout has fields of each drone only: their row is the memory of one."""

    layer: ClassVar[str] = "agents"
    decides: ClassVar[bool] = True
    """Whether drones decide for themselves; else the allocator's answer is flown and no agent is called."""

    wrenches: ClassVar[bool] = False
    """Whether it shares a moment, as a rigid load needs, too."""

    remembers: ClassVar[Layout] = Layout()

    def memory(self, team: Team) -> Vector:
        """Memory of all drones' agents, one after the other."""
        return self.layout().zeros(team.n)

    def check(self, team: Team) -> list[tuple[str, str]]:
        if self.memory(team).size % team.n:
            return [("kind", "its memory must be the same for each drone, and nothing beside it")]
        if self.decides and not self.wrenches and team.body is not None:
            return [("kind", "shares forces only: a rigid load needs leaderless-wrench")]
        return super().check(team)
