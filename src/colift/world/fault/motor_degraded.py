"""A motor that gives less than it is told."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

from pydantic import Field

from colift.world.fault.base import Change, FaultPart


class MotorDegraded(FaultPart):
    """One motor of a drone gives only a share of its thrust, which turns the drone; the others are as before."""

    needs_motors = True

    motor: Annotated[int, Field(ge=0, le=3)] = 0
    """Number of the motor, from 0, anticlockwise from the one at +x, +y."""
    health: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5
    """Share of its thrust that it still gives."""

    def changes(self, drone: int, at: float) -> Iterable[Change]:
        healths = tuple(self.health if motor == self.motor else None for motor in range(4))
        yield Change(at, "motor_health", drone, healths)
