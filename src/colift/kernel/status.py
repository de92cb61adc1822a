"""How an allocation ends, apart from the kernels so that reading a recording loads none."""

from __future__ import annotations

import enum


class Status(enum.IntEnum):
    """How an allocation ended. Only ``CONVERGED`` is ``ok``; every other is usable all the same."""

    CONVERGED = 0
    """The answer meets the allocator's own tolerance."""
    ITERATION_LIMIT = 1
    """Force balance and bounds hold; optimality was not reached within the iteration cap."""
    ZERO_FORCE = 2
    """The force is (almost) zero: no tension, directions kept."""
    INVALID_FORCE = 3
    """The force is not finite (or its square is not): the last allocation is repeated."""
    NUMERICAL_FAILURE = 4
    """The iteration left the numbers: the last directions with a share that balances the force."""
    CLAMPED = 5
    """A tension came out negative and was set to zero: the force is not fully balanced."""
    FORCE_REDUCED = 6
    """The limits do not allow the whole force: the nearest allowed one, horizontal part given up first."""
    RECOVERING = 7
    """A limit is broken since the start: the cables are on their way back, none worse than it was."""
    PUSHING = 8
    """A tension came out negative and is shown on the opposite side: a drone below the load."""
    SILENT = 9
    """The allocator was not heard: the drones hold what they have. Of the loop, not of an allocator."""

    @property
    def ok(self) -> bool:
        """Whether the answer is what the allocator promises."""
        return self is Status.CONVERGED
