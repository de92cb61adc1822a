"""colift: several multirotors carry one load on cables - allocate, control, simulate, judge."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from colift.allocation import Status
    from colift.allocation.base import Allocation, Allocator
    from colift.allocation.safe import SafeAllocator
    from colift.allocation.sqp import SqpAllocator
    from colift.compilation import Warmed, warm
    from colift.errors import ColiftError, MissionError, SettingError
    from colift.mission import Mission, load_mission
    from colift.recording import Recording
    from colift.runner import Run, run
    from colift.team import Team

# Resolved on first use: importing a kernel's module loads (the first time: compiles) it.
_HOMES = {
    "Allocation": "colift.allocation.base",
    "Allocator": "colift.allocation.base",
    "ColiftError": "colift.errors",
    "Mission": "colift.mission",
    "MissionError": "colift.errors",
    "Recording": "colift.recording",
    "Run": "colift.runner",
    "SafeAllocator": "colift.allocation.safe",
    "SettingError": "colift.errors",
    "SqpAllocator": "colift.allocation.sqp",
    "Status": "colift.allocation",
    "Team": "colift.team",
    "Warmed": "colift.compilation",
    "load_mission": "colift.mission",
    "run": "colift.runner",
    "warm": "colift.compilation",
}

__all__ = [
    "Allocation",
    "Allocator",
    "ColiftError",
    "Mission",
    "MissionError",
    "Recording",
    "Run",
    "SafeAllocator",
    "SettingError",
    "SqpAllocator",
    "Status",
    "Team",
    "Warmed",
    "load_mission",
    "run",
    "warm",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'colift' has no attribute {name!r}")
    value = getattr(import_module(_HOMES[name]), name)
    globals()[name] = value
    return value
