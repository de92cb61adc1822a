"""Driven from outside: by an autopilot with motors of its own."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from colift.part import driven
from colift.world.actuation.base import ActuationPart


@driven
class External(ActuationPart):
    """What the layer writes is set by :meth:`colift.flight.flight.Flight.act`."""

    lag: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    """Time by which the thrust vector follows late, s: controllers that ask for the lag of motors are told this one."""

    def motor_lag(self) -> float:
        return self.lag
