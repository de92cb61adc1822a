"""A battery that runs low."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

from pydantic import Field

from colift.world.fault.base import Change, FaultPart


class BatteryLow(FaultPart):
    """All four motors of a drone weaken together, step by step."""

    health: Annotated[float, Field(ge=0.0, le=1.0)] = 0.7
    """Share of their thrust that they give in the end."""
    duration: Annotated[float, Field(ge=0.0, le=1e6)] = 5.0
    """Time from the first step to the last, s."""
    steps: Annotated[int, Field(ge=1, le=1000)] = 20
    """Number of equal steps; 1: at once."""

    def changes(self, drone: int, at: float) -> Iterable[Change]:
        for k in range(self.steps):
            share = (k + 1) / self.steps
            when = at + self.duration * k / max(1, self.steps - 1)
            yield Change(when, "motor_health", drone, 1.0 - share * (1.0 - self.health))
