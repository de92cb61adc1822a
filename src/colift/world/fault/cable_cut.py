"""A cable that breaks."""

from __future__ import annotations

from collections.abc import Iterable

from colift.world.fault.base import Change, FaultPart


class CableCut(FaultPart):
    """One cable breaks; its drone flies on, without load."""

    def changes(self, drone: int, at: float) -> Iterable[Change]:
        return [Change(at, "attached", drone, 0.0)]
