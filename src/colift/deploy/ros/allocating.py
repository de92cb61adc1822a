"""What the allocator's node does: from the wanted force to the force of each cable."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from colift.deploy.ros.layers import Layers
from colift.kernel.status import Status
from colift.mission.mission import Mission
from colift.record.exchange.messages import Body, rotated

Array = NDArray[np.float64]

LONGEST = 10
"""Periods that count at most as the time since the last answer: no cable turns by more at once."""


class Allocating(Layers):
    """A mission's allocator, warm-started by its own last answer.

    Attributes
    ----------
    statuses : Counter
        How often each status was answered.
    last : int
        Time of the last answer, ns; -1 before the first.
    last_status : Status
    longest : float
        The longest call, s.

    """

    def __init__(self, mission: Mission) -> None:
        super().__init__(mission)
        self.statuses: Counter[Status] = Counter()
        self.zero = 0
        self.last, self.last_status, self.longest = -1, Status.CONVERGED, 0.0

    @property
    def info(self) -> Array:
        """Iterations, residual, objective, gap, errors of both balances and limits at work."""
        return np.asarray(self.bus.allocator_info)

    def begin(self, load: Body | None, drones: Sequence[Body | None]) -> None:
        """Start from where the cables hang; from the mission's start where not all is known."""
        if load is None or any(drone is None for drone in drones):
            return
        ends = load.position + rotated(load.attitude, self.bus.attachments)
        cables = ends - np.array([drone.position for drone in drones if drone is not None])
        lengths = np.linalg.norm(cables, axis=1, keepdims=True)
        if (lengths > 1e-6).all():
            self.bus.desired_directions[:] = cables / lengths

    def told(
        self,
        *,
        load: Body | None = None,
        reference: Body | None = None,
        acceleration: tuple[Array, Array] | None = None,
    ) -> None:
        """What an allocator may see beside the force, as far as it is known."""
        bus = self.bus
        if load is not None:
            bus.estimated_load_attitude[:] = load.attitude
        if reference is not None:
            bus.reference[:2] = reference.position, reference.velocity
            bus.reference_attitude[:], bus.reference_rates[0] = reference.attitude, reference.rates
        if acceleration is not None:
            bus.reference[2], bus.reference_rates[1] = acceleration

    def answer(self, at: int, force: Array, moment: Array) -> Array:
        """Forces (n, 3) of the cables on the load, N, for a wanted force and moment at a time (ns)."""
        bus = self.bus
        bus.force[:], bus.moment[:] = force, moment
        if self.last < 0:
            self.zero, self.last = at, at - self.period
        dt = 1e-9 * min(max(at - self.last, 1), LONGEST * self.period)
        begin = perf_counter()
        self.last_status = Status(self.call("allocation", at - self.zero, dt))
        self.longest = max(self.longest, perf_counter() - begin)
        self.statuses[self.last_status] += 1
        self.last = at
        return np.asarray(-bus.desired_tensions[:, None] * bus.desired_directions)
