"""What the drones have of the allocator, and what they do when it is silent: hold it, and bring the load to rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from colift.kernel.math.leaning import run_at
from colift.record.exchange.messages import shares

Array = NDArray[np.float64]

SILENT = 5
"""Periods without a word after which the allocator counts as silent."""


class Held:
    """The last tensions and directions that each drone was told, and since when.

    While the allocator is silent they are held, and the clock of the reference is brought to rest within a second
    (:mod:`colift.kernel.math.leaning`): a load that moves on would need other forces. It runs on when the allocator is back.

    Attributes
    ----------
    tensions, directions : (n,) array, N, and (n, 3) array
    since : (n,) array
        Times of what they have, ns; -1 before the first word.
    silent : bool
    silences : int
        How often it was.

    """

    def __init__(self, pace: Array, tensions: Array, directions: Array, period: int) -> None:
        self.tensions, self.directions = tensions.copy(), directions.copy()
        self.since = np.full(len(tensions), -1, dtype=np.int64)
        self.silent, self.silences = False, 0
        self._pace, self._limit = pace, SILENT * period

    def hear(self, drone: int, at: int, force: Array) -> bool:
        """A drone gets the force of its cable on the load (3,), N, of a time (ns); whether it is news."""
        if at <= self.since[drone]:
            return False
        one = slice(drone, drone + 1)
        self.tensions[one], self.directions[one] = shares([force], self.directions[one])
        self.since[drone] = at
        return True

    def heard(self, at: int) -> bool:
        """Whether all drones have what is of this time (ns)."""
        return bool((self.since >= at).all())

    def look(self, now: int) -> Sequence[float]:
        """Ages of what the drones have at a time (ns), s; tell the reference's clock of a silence that begins or ends."""
        ages = np.maximum(now - self.since, 0)
        silent = bool(ages.max() > self._limit)
        if silent != self.silent:
            self.silent, self.silences = silent, self.silences + silent
            run_at(self._pace, 0.0 if silent else 1.0, now * 1e-9)
        return [1e-9 * float(age) for age in ages]
