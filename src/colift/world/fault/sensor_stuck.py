"""Sensors that repeat their last value."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated, Literal

from pydantic import Field

from colift.world.fault.base import LOAD, Change, FaultPart


class SensorStuck(FaultPart):
    """All that is measured of a drone, or of the load, stands still for a while."""

    body: Literal["drone", "load"] = "drone"
    """Whose sensors."""
    duration: Annotated[float, Field(ge=0.0, le=1e6)] = 0.1
    """s."""

    def changes(self, drone: int, at: float) -> Iterable[Change]:
        whose = drone if self.body == "drone" else LOAD
        yield Change(at, "stuck", whose, 1.0)
        yield Change(at + self.duration, "stuck", whose, 0.0)
