"""A network that does to messages whatever a radio and a stranger can do: for trying what a scheme promises.

It loses, delays, overtakes, doubles, replays and garbles, and lets drones be deaf or dumb for a while. It cannot make a seal.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import noise
from colift.kernel.signals import MESSAGE
from colift.part import Vector
from colift.team import Team
from colift.world.network.base import SIGNATURE, NetworkPart

Share = Annotated[float, Field(ge=0.0, le=1.0)]

KEPT = 256
"""Cycles of which everything that was said is kept."""
PARAMS = Layout(team={"loss": 1, "late": 1, "replay": 1, "garble": 1, "silence": 1, "calm": 1})
SLOT = Layout(team={"sent": 1, "bytes": MESSAGE})
MEMORY = Layout(drone={"said": KEPT * SLOT.size(0)})
P, S, M = PARAMS.at, SLOT.at, MEMORY.at
_WIDTH = SLOT.size(0)
_PAIRS = 1 << 12
PHASE = 100
"""Cycles after which drones turn deaf or dumb anew."""


@kernel(SIGNATURE)
def _carry(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    n, key, step = sees.members.shape[0], now.key, now.step
    if step > 0:
        for j in range(n):
            o = M.width * j + M.said + _WIDTH * ((step - 1) % KEPT)
            memory[o + S.sent] = step
            for k in range(MESSAGE):
                memory[o + S.bytes + k] = sees.outboxes[j, k]
    calm = params[P.calm] > 0.0 and (step // PHASE) % 8 >= 8 - int(8 * params[P.calm] + 0.5)
    for i in range(n):
        deaf = noise.uniform(key, step // PHASE, 2 * _PAIRS * _PAIRS + i) < params[P.silence]
        for j in range(n):
            writes.heard[i, j] = 0.0
            if i == j:
                continue
            dumb = noise.uniform(key, step // PHASE, 3 * _PAIRS * _PAIRS + j) < params[P.silence]
            channel = _PAIRS * i + j
            luck, age = noise.uniforms(key, step, channel)
            other, which = noise.uniforms(key, step, channel + _PAIRS * _PAIRS)
            late = 1
            if not calm:
                if deaf or dumb or luck < params[P.loss]:
                    continue
                late = 1 + int(age * params[P.late])
                if other < params[P.replay]:
                    late = 1 + int(which * (KEPT - 2))
            o = M.width * j + M.said + _WIDTH * ((step - late) % KEPT)
            if step < late or memory[o + S.sent] != step - late + 1:
                continue
            writes.heard[i, j] = 1.0
            for k in range(MESSAGE):
                writes.inboxes[i, j, k] = int(memory[o + S.bytes + k])
            if not calm and 1.0 - other < params[P.garble]:
                for k in range(3):
                    place, value = noise.uniforms(key, step, channel + (4 + k) * _PAIRS * _PAIRS)
                    writes.inboxes[i, j, int(place * MESSAGE)] = int(value * 256)


class Hostile(NetworkPart):
    """Each setting is the share of the messages, or of the time, that suffers it."""

    kernel = _carry
    remembers = MEMORY

    loss: Share = 0.3
    """Messages lost."""
    late: Annotated[int, Field(ge=0, le=KEPT - 2)] = 20
    """Most cycles on the way, each message by itself, so that later ones overtake and earlier ones come twice."""
    replay: Share = 0.05
    """Messages in whose place an earlier one of the last 2.5 s is heard."""
    garble: Share = 0.05
    """Messages of which three bytes are changed."""
    silence: Share = 0.1
    """Seconds in which a drone is deaf, and others in which it is dumb."""
    calm: Share = 0.0
    """Of each eight seconds, the last ones in which nothing of this happens."""

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, loss=self.loss, late=self.late, replay=self.replay, garble=self.garble,
            silence=self.silence, calm=self.calm,
        )  # fmt: skip
