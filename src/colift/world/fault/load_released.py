"""A load that is let go."""

from __future__ import annotations

from collections.abc import Iterable

from colift.world.fault.base import Change, FaultPart


class LoadReleased(FaultPart):
    """All cables are cut at once, on purpose; the drones fly on without load."""

    def changes(self, drone: int, at: float) -> Iterable[Change]:
        yield Change(at, "attached", None, 0.0)
