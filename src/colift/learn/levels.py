"""At which level of the controllers an action stands: what it commands, and which layers it drives instead of their parts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from colift.learn.numbers import CABLES, CENTRAL, DRONE, FORCES, MOTORS, PART, RATES


@dataclass(frozen=True)
class Level:
    """A level of the action: all numbers are within -1 and 1, and 0 is what holds the load at rest in the formation of the start."""

    number: int
    width: int
    """Numbers for each drone."""
    meaning: str
    driven: Mapping[str, str]
    """Kind of the part of each layer whose place the action takes, or that is not needed then."""


_EXTERNAL = "external"
_IDLE = {"allocation.kind": _EXTERNAL, "load_control.kind": _EXTERNAL, "observation.kind": "none"}

LEVELS = {
    "cables": Level(
        CABLES, 3, "the pull of its cable on the load, world, by up to half of the drone's share of the load's weight",
        {"allocation.kind": _EXTERNAL},
    ),
    "forces": Level(
        FORCES, 3, "the thrust vector that the drone is to give, world, by up to half of its thrust in hover",
        {**_IDLE, "position_control.kind": _EXTERNAL},
    ),
    "rates": Level(
        RATES, 4, "thrust, by up to half of that in hover; rates about the body's axes up to 6, 6 and 2 rad/s",
        {**_IDLE, "position_control.kind": _EXTERNAL, "attitude_control.kind": "rates"},
    ),
    "motors": Level(
        MOTORS, 4, "the thrust of each motor, by up to half of that in hover",
        {**_IDLE, "position_control.kind": _EXTERNAL, "attitude_control.kind": _EXTERNAL},
    ),
}  # fmt: skip
"""By name."""

OBSERVATIONS = {"central": CENTRAL, "drone": DRONE, "part": PART}
"""All numbers in one vector; a row for each drone of what it sees; what an allocator sees, for the level ``cables``."""


def driven(level: str) -> dict[str, Any]:
    """Changes of a mission that let an action of this level drive it, and nobody regroup the team meanwhile."""
    return {**LEVELS[level].driven, "detection.kind": "none"}
