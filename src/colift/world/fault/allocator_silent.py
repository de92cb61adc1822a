"""An allocator that does not answer."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Annotated

from pydantic import Field

from colift.world.fault.base import Change, FaultPart


class AllocatorSilent(FaultPart):
    """The allocator is not heard for a while; the drones hold what they were told last."""

    duration: Annotated[float, Field(ge=0.0, le=1e6)] = 0.2
    """s."""

    def changes(self, drone: int, at: float) -> Iterable[Change]:
        yield Change(at, "allocator_up", None, 0.0)
        yield Change(at + self.duration, "allocator_up", None, 1.0)
