"""What the safe allocators' limits are by the team's numbers, where they are not given, and the types of these settings."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated

import numpy as np
from pydantic import Field

from colift.control.allocation.base import AllocatorPart
from colift.control.allocation.limits.hover import RESERVE
from colift.part import Vector
from colift.team import Team

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


class Limited(AllocatorPart):
    """Base of the safe allocators: what their limits are for each cable and drone."""

    if TYPE_CHECKING:  # fields of each
        tension_min: Force | list[Force] | None
        max_thrust: Force | list[Force] | None

    def usual_limits(self, team: Team, rate: float = RATE, low: float = LOW) -> dict[str, Vector]:
        """What limits are by the team's numbers, as :meth:`left_open`.

        ``rate`` is the fastest turn of a cable of 1 m, rad/s, ``low`` the least tension over a cable's share of the weight.
        """
        known, share = np.isfinite(team.max_thrusts), share_of(team)
        lifts = MOST * team.max_thrusts - team.masses * team.gravity
        turn = rate / math.sqrt(float(team.cable_lengths.mean())) if team.n > 2 else SWINGING
        return {
            "max_rate": np.where(known.all(), np.full(team.n, turn), math.nan),
            "tension_min": np.where(known, low * share, math.nan),
            "tension_max": np.where(known, np.maximum(lifts, 1.2 * low * share), math.nan),
            "max_thrust": MOST * team.max_thrusts,
            "min_distance": 2.0 * CLEAR * team.radii,
            "cable_distance": CLEAR * team.radii,
        }

    def crossed(self, team: Team) -> list[tuple[str, str]]:
        """A limit of the tension beyond the other."""
        low, high = self.settled("tension_min", team), self.settled("tension_max", team)
        if np.all(1.2 * low <= high):
            return []
        i = int(np.argmax(1.2 * low - high))
        message = (
            f"tension_min = {low[i]:.4g} conflicts with tension_max = {high[i]:.4g}: "
            "each cable needs tension_max of at least 1.2 tension_min"
        )
        return [("tension_max" if self.tension_min is None else "tension_min", message)]

    def conflicts(self, team: Team) -> list[tuple[str, str]]:
        own = team.masses * team.gravity
        weak = np.flatnonzero(0.8 * self.thrust_limits(team) < own)
        if not weak.size or "max_thrust" in self.by_team(team):
            return []
        i = int(weak[0])
        need = f"drone {i} alone weighs {own[i]:.4g} N and needs a quarter more to fly"
        return [
            ("max_thrust", f"max_thrust = {self.max_thrust} conflicts with drones.mass: {need}")
        ]

    def thrust_limits(self, team: Team) -> Vector:
        """Largest thrust of each drone (n,) as far as the allocator is told, N; inf: not limited."""
        return self.settled("max_thrust", team)

    def turn_rate(self, team: Team) -> float:
        """Fastest turn of a cable's direction, rad/s."""
        return float(self.settled("max_rate", team)[0])

    def tension_caps(self, team: Team) -> Vector:
        """Largest tension of each cable (n,), N."""
        return self.settled("tension_max", team)

    def tension_floors(self, team: Team) -> Vector:
        """Least tension of each cable (n,), N."""
        return self.settled("tension_min", team)

    def drone_distances(self, team: Team) -> Vector:
        """Least distance of each drone (n,), m: two keep the mean of theirs; 0: not limited."""
        return self.settled("min_distance", team)

    def cable_distances(self, team: Team) -> Vector:
        """Least distance of each drone (n,) from the others' cables, m; 0: not limited."""
        return self.settled("cable_distance", team)


def share_of(team: Team) -> float:
    """A cable's share of the load's weight, N."""
    return team.load_mass * max(team.gravity, 1e-3) / team.n
