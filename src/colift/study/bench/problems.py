"""What every solver is asked: the paper's problem and the safe one, along a smooth and a noisy force.

Load and ``mu`` are scaled with the number of cables, which keeps the optimal cone of the paper's mission.
The least angle of the safe problem shrinks as the cables become more: they would not fit otherwise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from colift.control.allocation.base import Allocator
from colift.control.allocation.common.oracle import FREE, Limits
from colift.control.allocation.limits.feasibility import widest_formation
from colift.control.allocation.safe import Safe
from colift.control.allocation.sqp import Sqp
from colift.team import Team
from colift.team.geometry import Array
from colift.team.scaling import scaled_load, scaled_mu

Name = Literal["paper", "safe"]
Family = Literal["smooth", "noisy"]
NAMES: tuple[Name, ...] = ("paper", "safe")
FAMILIES: tuple[Family, ...] = ("smooth", "noisy")

GRAVITY = 9.81
PERIODS: dict[Name, float] = {"paper": 1e-3, "safe": 1e-2}
"""Time between two forces, s."""
NOISE = 0.3
"""Standard deviation of the noisy force, m/s^2 of the load, on each axis."""
WIDEST_CONE, TENSION_MIN, TENSION_MAX = 75.0, 0.05, 5.0
"""Limits of the safe problem, degrees and N; the defaults of the allocator ``safe``."""
SETTLED = 200
"""Cycles after which a formation counts as settled at the first force."""


def least_angle_deg(n: int) -> float:
    """Least angle of the safe problem, degrees: 30, or 0.7 of what an even spread in the cone has."""
    cap = 2.0 * math.pi * (1.0 - math.cos(math.radians(WIDEST_CONE)))
    return min(30.0, 0.7 * math.degrees(math.sqrt(1.15 * cap / n)))


def forces(n: int, count: int, *, family: Family = "smooth", period: float = 1e-3) -> Array:
    """Force commands (count, 3), N, ``period`` (s) apart: a circle of 2 m/s^2 with a vertical oscillation.

    The noisy family adds white noise to every one, the same in every run.
    """
    t = np.arange(count) * period
    wanted = np.column_stack(
        [2.0 * np.cos(1.4 * t), 2.0 * np.sin(1.4 * t), GRAVITY + 0.5 * np.sin(3.0 * t)]
    )
    if family == "noisy":
        wanted += NOISE * np.random.default_rng(n).standard_normal((count, 3))
    return scaled_load(n) * wanted


@dataclass(frozen=True)
class Problem:
    """One problem of the benchmark for n cables."""

    name: Name
    n: int

    @property
    def mu(self) -> float:
        """Weight of the alignment penalty, N^2."""
        return scaled_mu(self.n)

    @property
    def period(self) -> float:
        """Time between two forces, s."""
        return PERIODS[self.name]

    @property
    def limits(self) -> Limits:
        """Limits that every answer has to keep; tensions in N."""
        if self.name == "paper":
            return FREE
        cosine = math.cos(math.radians(least_angle_deg(self.n))) if self.n > 1 else 1.0
        height = -math.cos(math.radians(WIDEST_CONE))
        return Limits(TENSION_MIN, TENSION_MAX, cosine, height)

    @cached_property
    def team(self) -> Team:
        """The drones and their load."""
        return Team.uniform(self.n, load_mass=scaled_load(self.n))

    @cached_property
    def own(self) -> Sqp | Safe:
        """Our allocator for this problem."""
        if self.name == "paper":
            return Sqp(mu=self.mu)
        return Safe(
            mu=self.mu, min_angle_deg=least_angle_deg(self.n), max_cone_deg=WIDEST_CONE,
            tension_min=TENSION_MIN, tension_max=TENSION_MAX,
        )  # fmt: skip

    def forces(self, count: int, family: Family) -> Array:
        """The first ``count`` forces of a family (count, 3), N."""
        return forces(self.n, count, family=family, period=self.period)

    @cached_property
    def start(self) -> tuple[Array, Array]:
        """Tensions (n,) and directions (n, 3) that everyone starts from: ours, settled at the first force."""
        allocator = Allocator(self.own, self.team, dt=self.period)
        if self.name == "safe":
            enough = math.radians(1.02 * least_angle_deg(self.n))
            formation, _ = widest_formation(self.n, math.radians(WIDEST_CONE - 1.0), enough=enough)
            allocator.reset(directions=formation)
        first = self.forces(1, "smooth")[0]
        for _ in range(SETTLED if self.n <= 64 else SETTLED // 10):
            answer = allocator.allocate(first)
        return answer.tensions, answer.directions
