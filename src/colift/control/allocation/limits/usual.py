"""What the safe allocators' limits are by the team's numbers, where they are not given, and the types of these settings."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from colift.control.allocation.limits.hover import RESERVE

Degrees = Annotated[float, Field(gt=0.0, lt=90.0)]
Force = Annotated[float, Field(gt=0.0, le=1e6)]
Distance = Annotated[float, Field(ge=0.0, le=1e3)]

LOW = 0.5
"""Least tension over a cable's share of the load's weight, where the drones' thrust is known and no limit is given."""
MOST = 1.0 - RESERVE
"""Share of a drone's thrust that is planned with then."""
RATE, SWINGING = 0.4, 1.0
"""Fastest turn of cables of 1 m, rad/s, which drones with real motors can follow; of one or two cables, on which a load swings."""
CLEAR = 1.2
"""Distance that a drone keeps from all others' middle and cables where no limit is given, in its radii."""
