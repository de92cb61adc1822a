"""The contract of faults: a fault is a list of changes to what still works, each at its time.

The changes go to the truth. Nobody tells the controllers: a ``detection`` part may find out.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field

from colift.part import Part

LOAD = -1
"""In place of a drone: the load, in signals that have a row for it."""


class Change(NamedTuple):
    """``signal[drone] = value`` at a time (s); without a drone the whole signal.

    ``signal`` is one of those of :data:`colift.kernel.signals.CONDITIONS`. In a value with several
    numbers, None leaves the one in its place as it is.
    """

    at: float
    signal: str
    drone: int | None
    value: Any


class FaultPart(Part):
    """Base of all faults: when, and which drone."""

    layer: ClassVar[str] = "fault"
    needs_motors: ClassVar[bool] = False
    """Whether it says nothing of a drone without motors of its own (of ``actuation``)."""

    at: Annotated[float, Field(ge=0.0)] | Literal["random"] = "random"
    """Time, s; random: any time of the flight, by the seed."""
    drone: Annotated[int, Field(ge=0)] | Literal["random"] = "random"
    """Number of the drone, from 0; random: any of the mission's, by the seed."""

    def changes(self, drone: int, at: float) -> Iterable[Change]:
        """What it changes when it befalls this drone at this time."""
        raise NotImplementedError

    def drawn(self, rng: np.random.Generator, n: int, duration: float) -> Self:
        """The same with the time and the drone that chance gives it in a flight with ``n`` drones."""
        when, who = float(rng.uniform(0.0, duration)), int(rng.integers(n))
        at = when if self.at == "random" else self.at
        drone = who if self.drone == "random" else self.drone
        return self.model_copy(update={"at": at, "drone": drone})

    def resolve(self, rng: np.random.Generator, n: int, duration: float) -> list[Change]:
        """The changes of one flight with ``n`` drones."""
        drawn = self.drawn(rng, n, duration)
        assert not isinstance(drawn.at, str)
        assert not isinstance(drawn.drone, str)
        return list(drawn.changes(drawn.drone, drawn.at))
