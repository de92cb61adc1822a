"""colift: several multirotors carry one load on cables - allocate, control, simulate, judge."""

from __future__ import annotations

from typing import TYPE_CHECKING

from colift.lazy import lookup

if TYPE_CHECKING:
    from colift.control.allocation.base import Allocation, Allocator
    from colift.control.allocation.safe import SafeAllocator
    from colift.control.allocation.sqp import SqpAllocator
    from colift.errors import ColiftError, MissionError, SettingError
    from colift.flight.compilation import Warmed, warm
    from colift.flight.runner import Run, run
    from colift.kernel.status import Status
    from colift.mission import Mission, load_mission
    from colift.record.recording import Recording
    from colift.team import Team

# Resolved on first use: importing a kernel's module loads (the first time: compiles) it.
_HOMES = {
    "Allocation": "colift.control.allocation.base",
    "Allocator": "colift.control.allocation.base",
    "ColiftError": "colift.errors",
    "Mission": "colift.mission",
    "MissionError": "colift.errors",
    "Recording": "colift.record.recording",
    "Run": "colift.flight.runner",
    "SafeAllocator": "colift.control.allocation.safe",
    "SettingError": "colift.errors",
    "SqpAllocator": "colift.control.allocation.sqp",
    "Status": "colift.kernel.status",
    "Team": "colift.team",
    "Warmed": "colift.flight.compilation",
    "load_mission": "colift.mission",
    "run": "colift.flight.runner",
    "warm": "colift.flight.compilation",
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

__getattr__ = lookup(__name__, _HOMES)
