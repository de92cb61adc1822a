"""A radio link: packets with delay, jitter and loss."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.kernel.math import fifo, noise
from colift.part import Vector, timing_problems
from colift.team import Team
from colift.world.link.base import SIGNATURE, LinkPart

Delay = Annotated[float, Field(ge=0.0, le=2.0)]
Share = Annotated[float, Field(ge=0.0, lt=1.0)]

PARAMS = Layout(
    team={"period": 1, "delay": 1, "jitter": 1, "slots": 1, "row": 1}, drone={"loss": 1}
)
"""``slots``: packets that may be on their way to a drone; ``row``: length of a drone's row in memory."""
PACKET = Layout(team={"sent": 1, "tension": 1, "direction": 3})
"""``sent``: at which step."""
MEMORY = Layout(drone={"started": 1, "packets": None})
P, K, M = PARAMS.at, PACKET.at, MEMORY.at
_WIDTH = PACKET.size(0)


@kernel(SIGNATURE)
def _transmit(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    step, key, dt = now.step, now.key, now.dt
    tensions, directions = sees.desired_tensions, sees.desired_directions
    received_tensions, received_directions = writes.received_tensions, writes.received_directions
    ages = writes.received_ages
    slots, row = int(params[P.slots]), int(params[P.row])
    every = max(1, int(params[P.period] / dt + 0.5))
    due, number = step % every == 0, step // every
    for i in range(tensions.shape[0]):
        o = M.rows + row * i
        queue = o + M.packets
        at = -1
        if memory[o + M.started] == 0.0:
            memory[o + M.started] = 1.0
            at = fifo.post(memory, queue, slots, _WIDTH, step)
        elif due:
            luck, late = noise.uniforms(key, number, i)
            if luck >= params[P.rows + P.width * i + P.loss]:
                delay = params[P.delay] + params[P.jitter] * late
                at = fifo.post(memory, queue, slots, _WIDTH, step + int(delay / dt + 0.5))
        if at >= 0:
            memory[at + K.sent] = step
            memory[at + K.tension] = tensions[i]
            for k in range(3):
                memory[at + K.direction + k] = directions[i, k]
        at = fifo.fetch(memory, queue, slots, _WIDTH, step)
        ages[i] += dt
        if at >= 0:
            ages[i] = (step - memory[at + K.sent]) * dt
            received_tensions[i] = memory[at + K.tension]
            for k in range(3):
                received_directions[i, k] = memory[at + K.direction + k]


class Radio(LinkPart):
    """Every drone gets a packet of its own each period; what is lost or late leaves it with the last one.

    A packet takes ``delay`` and up to ``jitter`` more, evenly distributed, and does not overtake another. The
    first of all arrives at once: the drones start with what they are told on the ground. Defaults are those of a
    good wireless network.
    """

    kernel = _transmit
    remembers = MEMORY
    per_drone = ("loss",)

    period: Annotated[float, Field(ge=1e-5, le=10.0)] = 0.01
    """Time between two packets to a drone, s; a whole multiple of ``timing.step``."""
    delay: Delay = 0.005
    """Shortest time on the way, s."""
    jitter: Delay = 0.005
    """Longest time beyond that, s."""
    loss: Share | list[Share] = 0.01
    """Share of the packets that is lost; one value, or one for each drone."""

    @property
    def _slots(self) -> int:
        return math.ceil((self.delay + self.jitter) / self.period) + 2

    def check_timing(self, step: float, duration: float) -> list[tuple[str, str]]:
        delays = {"delay": self.delay, "jitter": self.jitter}
        return timing_problems(step, duration, {"period": self.period}, delays)

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, period=self.period, delay=self.delay, jitter=self.jitter, slots=self._slots,
            row=self.layout().at.width, loss=self.loss,
        )  # fmt: skip

    def layout(self) -> Layout:
        return MEMORY.filled(packets=int(fifo.size(self._slots, _WIDTH)))
