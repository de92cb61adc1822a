"""What the drones have of the allocator, and what they do when it is silent: hold it, and bring the load to rest."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from colift.kernel.math.leaning import PACE, paced
from colift.record.exchange.messages import shares

Array = NDArray[np.float64]

SILENT = 5
"""Periods without a word after which the allocator counts as silent."""
REST = 0.5
"""Length of a silence after which the load is brought to rest, s: by shorter ones it hardly moves, and stopping moves it more."""
EASE = 2.0
"""Time in which it is brought to rest, s. In less time rigid loads swing."""


class Held:
    """The last tensions and directions that each drone was told, and since when.

    While the allocator is silent they are held, and after a while the clock of the reference is brought to rest
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
        self._pace, self._period = pace, period

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
        silent = bool(ages.max() > SILENT * self._period)
        self.silences += int(silent and not self.silent)
        self.silent = silent
        rests = ages.max() > max(REST * 1e9, SILENT * self._period)
        self._run_at(0.0 if rests else 1.0, now * 1e-9)
        return [1e-9 * float(age) for age in ages]

    def _run_at(self, wanted: float, now: float) -> None:
        """Let the reference's clock go over to a pace; one change after the other, as each has its derivatives."""
        pace = self._pace
        after, done = pace[PACE.at.after], pace[PACE.at.begin] + pace[PACE.at.duration]
        if after == wanted or now < done:
            return
        clock, before, _, _ = paced(pace, now)
        pace[:] = PACE.pack(0, clock=clock, begin=now, before=before, after=wanted, duration=EASE)
