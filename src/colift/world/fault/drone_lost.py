"""A drone whose motors all stop."""

from __future__ import annotations

from collections.abc import Iterable

from colift.world.fault.base import Change, FaultPart


class DroneLost(FaultPart):
    """All motors of a drone stop; it falls, and hangs from the load unless its cable is cut at once."""

    with_cable: bool = True
    """Whether its cable holds; otherwise it is cut at the same moment."""

    def changes(self, drone: int, at: float) -> Iterable[Change]:
        yield Change(at, "motor_health", drone, 0.0)
        if not self.with_cable:
            yield Change(at, "attached", drone, 0.0)
