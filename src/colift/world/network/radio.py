"""A radio on which messages are late, overtake each other and are lost, alone or in a row, and which may fall apart in two."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import noise
from colift.kernel.signals import MESSAGE
from colift.part import Vector, timing_problems
from colift.team import Team
from colift.world.network.base import SIGNATURE, NetworkPart

Delay = Annotated[float, Field(ge=0.0, le=1.0)]
Share = Annotated[float, Field(ge=0.0, le=1.0)]
Number = Annotated[int, Field(ge=0, le=51)]

PARAMS = Layout(
    team={
        "delay": 1, "jitter": 1, "burst": 1, "slots": 1, "row": 1,
        "split": 1, "split_at": 1, "split_for": 1, "split_every": 1,
    },
    drone={"loss": 1},
)  # fmt: skip
"""``split``: a bit for each number of a drone on the one side; ``row``: length of a drone's row in memory."""
SLOT = Layout(team={"sent": 1, "bytes": MESSAGE})
"""``sent``: in which cycle, counted from 1."""
MEMORY = Layout(drone={"said": None})
P, S, M = PARAMS.at, SLOT.at, MEMORY.at
_WIDTH = SLOT.size(0)
SHORTEST = 1e-3
"""Least time between two messages of a drone that are carried, s: so many are kept as may be on their way."""
_PAIRS, _BLOCKS, _BEGINS = 1 << 12, 1 << 25, 1 << 26
"""Channels of random numbers: one for each pair of drones, of messages, of blocks and of where blocks begin."""


@kernel(SIGNATURE)
def _carry(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    n, dt = sees.members.shape[0], now.dt
    slots, row = int(params[P.slots]), int(params[P.row])
    delay, jitter, burst = params[P.delay], params[P.jitter], params[P.burst]
    every = max(1, math.ceil(SHORTEST / dt - 1e-9))
    if now.step > 0 and (now.step - 1) % every == 0:
        for j in range(n):
            o = row * j + M.said + _WIDTH * ((now.step - 1) // every % slots)
            memory[o + S.sent] = now.step
            for k in range(MESSAGE):
                memory[o + S.bytes + k] = sees.outboxes[j, k]
    time = now.step * dt - params[P.split_at]
    if params[P.split_every] > 0.0 and time > 0.0:
        time %= params[P.split_every]
    apart = 0.0 <= time < params[P.split_for]
    sides = int(params[P.split])
    first = max(1, math.ceil(delay / dt - 1e-9))
    last = max(1, math.ceil((delay + jitter) / dt - 1e-9))
    for i in range(n):
        own = int(sees.members[i])
        for j in range(n):
            other = int(sees.members[j])
            writes.heard[i, j] = 0.0
            if i == j or (apart and (sides >> own) & 1 != (sides >> other) & 1):
                continue
            channel = _PAIRS * own + other
            for late in range(first, last + 1):
                sent = now.step - late + 1
                if sent < 1 or (sent - 1) % every != 0:
                    continue
                o = row * j + M.said + _WIDTH * ((sent - 1) // every % slots)
                if memory[o + S.sent] != sent:
                    continue
                way, luck = noise.uniforms(now.key, sent, channel)
                if late != max(1, math.ceil((delay + jitter * way) / dt - 1e-9)):
                    continue
                if burst > 0.0:
                    begin = noise.uniform(now.key, 0, channel + _BEGINS)
                    luck = noise.uniform(now.key, int(sent * dt / burst + begin), channel + _BLOCKS)
                if luck < params[P.rows + P.width * i + P.loss]:
                    continue
                writes.heard[i, j] = 1.0
                for k in range(MESSAGE):
                    writes.inboxes[i, j, k] = int(memory[o + S.bytes + k])
                break


class Radio(NetworkPart):
    """A message takes ``delay`` and up to ``jitter`` more, evenly distributed, and at least a cycle; it may overtake another.

    Each drone loses messages of each other by itself. Where cycles (``timing.allocation``) are shorter than 1 ms, a message is carried
    every millisecond.
    """

    kernel = _carry
    remembers = MEMORY
    per_drone = ("loss",)

    delay: Delay = 0.005
    """Shortest time on the way, s."""
    jitter: Delay = 0.005
    """Longest time beyond that, s."""
    loss: Share | list[Share] = 0.01
    """Share of the messages that a drone does not hear; one value, or one for each drone."""
    burst: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    """Messages from one drone to another are heard or lost together for so long, s; 0: each by itself."""
    split: tuple[Number, ...] = ()
    """Drones that are cut off from all others, though not from each other, for a while."""
    split_at: Annotated[float, Field(ge=0.0)] = 5.0
    """When, s."""
    split_for: Annotated[float, Field(ge=0.0)] = 5.0
    """For how long, s."""
    split_every: Annotated[float, Field(ge=0.0)] = 0.0
    """Time from one such begin to the next, s; 0: once."""

    @property
    def _slots(self) -> int:
        return math.ceil((self.delay + self.jitter) / SHORTEST) + 2

    def check(self, team: Team) -> list[tuple[str, str]]:
        beyond = [drone for drone in self.split if drone >= team.n]
        found = (
            [("split", f"there is no drone {beyond[0]}; the team has {team.n}")] if beyond else []
        )
        return super().check(team) + found

    def check_timing(self, step: float, duration: float) -> list[tuple[str, str]]:
        return timing_problems(step, duration, {}, {"delay": self.delay, "jitter": self.jitter})

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, delay=self.delay, jitter=self.jitter, burst=self.burst, slots=self._slots,
            row=self.layout().at.width, split=float(sum(1 << drone for drone in {*self.split})),
            split_at=self.split_at, split_for=self.split_for if self.split else 0.0,
            split_every=self.split_every, loss=self.loss,
        )  # fmt: skip

    def layout(self) -> Layout:
        return MEMORY.filled(said=self._slots * _WIDTH)
