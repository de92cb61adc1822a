"""A leg of a flight: the same drones and parts from its begin on, and what it recorded."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from colift.flight.loop import CYCLE_WIDTH, Circuit, Periods
from colift.kernel.signals import HIDDEN
from colift.team import Team


class Stretch(NamedTuple):
    """What the steps ``first <= k < stop`` recorded."""

    first: int
    stop: int
    log: NDArray[np.float64]
    cycles: NDArray[np.float64]


@dataclass
class Leg:
    """A stretch of the flight with the same drones and parts, what the loop needs, what it recorded."""

    drones: list[int]
    team: Team
    bus: Any
    circuit: Circuit
    begin: int
    stretches: deque[Stretch] = field(default_factory=deque)

    def recorded(
        self, begin: int, every: Periods
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rows of the log and allocations due from a step on."""
        late = takewhile(lambda each: each.stop > begin, reversed(self.stretches))
        found = list(late)[::-1]
        if not found:
            return np.zeros((0, self.bus.row.size)), np.zeros((0, CYCLE_WIDTH))
        log = np.concatenate([each.log for each in found])
        cycles = np.concatenate([each.cycles for each in found])
        first = found[0].first
        if first >= begin:
            return log, cycles
        rows, allocations = every.recording, every.allocation
        return log[due_rows(first, begin, rows) :], cycles[due_rows(first, begin, allocations) :]

    def forget(self, before: int) -> None:
        """Drop the stretches that ended by a step."""
        while self.stretches and self.stretches[0].stop <= before:
            self.begin = self.stretches.popleft().stop

    def state(self) -> list[NDArray[np.float64]]:
        """All that the loop changes in this leg, and all that may be changed from outside."""
        wires = (*self.circuit.wires, *self.circuit.disturbances)
        vectors = [each for wire in wires for each in (wire.params, wire.memory)]
        hidden = (getattr(self.bus, signal.name) for signal in HIDDEN)
        return [self.bus.row, *hidden, *self.circuit.wires.reference.writes, *vectors]


def due_rows(first: int, stop: int, period: int) -> int:
    """How many of the steps ``first <= k < stop`` are whole multiples of the period."""
    return -(-stop // period) - -(-first // period)


def places_of(old: list[int], new: list[int]) -> NDArray[np.int64]:
    """Place that each new drone had among the old ones, or -1."""
    return np.array([old.index(drone) if drone in old else -1 for drone in new])
