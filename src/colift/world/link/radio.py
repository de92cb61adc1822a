"""A radio link: packets with delay, jitter and loss."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.kernel.jit import kernel
from colift.kernel.math import fifo, noise
from colift.part import Places, Vector, carry_rows, timing_problems
from colift.team import Team
from colift.world.link.base import SIGNATURE, LinkPart

Delay = Annotated[float, Field(ge=0.0, le=2.0)]
Share = Annotated[float, Field(ge=0.0, lt=1.0)]

_HEAD = 4  # params before the drones' losses: period, delay, jitter, slots
_WIDTH = 4  # numbers in a packet: tension, direction


@kernel(SIGNATURE)
def _transmit(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    step, key, dt = now.step, now.key, now.dt
    tensions, directions = sees.desired_tensions, sees.desired_directions
    received_tensions, received_directions = writes.received_tensions, writes.received_directions
    slots = int(params[3])
    row = 1 + fifo.size(slots, _WIDTH)
    every = max(1, int(params[0] / dt + 0.5))
    due, number = step % every == 0, step // every
    for i in range(tensions.shape[0]):
        o = row * i
        at = -1
        if memory[o] == 0.0:
            memory[o] = 1.0
            at = fifo.post(memory, o + 1, slots, _WIDTH, step)
        elif due:
            luck, late = noise.uniforms(key, number, i)
            if luck >= params[_HEAD + i]:
                delay = params[1] + params[2] * late
                at = fifo.post(memory, o + 1, slots, _WIDTH, step + int(delay / dt + 0.5))
        if at >= 0:
            memory[at] = tensions[i]
            for k in range(3):
                memory[at + 1 + k] = directions[i, k]
        at = fifo.fetch(memory, o + 1, slots, _WIDTH, step)
        if at >= 0:
            received_tensions[i] = memory[at]
            for k in range(3):
                received_directions[i, k] = memory[at + 1 + k]


class Radio(LinkPart):
    """Every drone gets a packet of its own each period; what is lost or late leaves it with the last one.

    A packet takes ``delay`` and up to ``jitter`` more, evenly distributed, and does not overtake another. The
    first of all arrives at once: the drones start with what they are told on the ground. Defaults are those of a
    good wireless network.
    """

    kernel = _transmit
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
        losses = np.broadcast_to(np.asarray(self.loss, dtype=float), team.n)
        return np.array([self.period, self.delay, self.jitter, self._slots, *losses])

    def memory(self, team: Team) -> Vector:
        return np.zeros((1 + int(fifo.size(self._slots, _WIDTH))) * team.n)

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        return carry_rows(old, fresh, 0, 1 + int(fifo.size(self._slots, _WIDTH)), places)
