"""What agents have in common that agree by sealed messages."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from colift.control.agents._message import MOST
from colift.control.agents.base import AgentPart
from colift.part import Vector
from colift.team import Team

Force = Annotated[float, Field(gt=0.0, le=1e6)]


class Speaking(AgentPart):
    """What all have in common whose drones speak in sealed messages and bear what their cables may."""

    per_drone = ("tension_min", "tension_max")
    from_team: ClassVar[Mapping[str, float | None]] = {"tension_min": 0.05, "tension_max": 5.0}
    least_share: ClassVar[float]
    """Least tension over a cable's share of the load's weight, where nothing else is given."""

    tension_min: Force | list[Force] | None = None
    """Least tension, N; one value, or one per cable. None: 0.5 of a cable's share of the load's weight, 0.15 of ``leaderless-wrench``, where
    ``drones.max_thrust`` is known, else 0.05."""
    tension_max: Force | list[Force] | None = None
    """Largest tension, N; one value, or one per cable. None: what 0.95 of ``drones.max_thrust`` lifts beside the drone,
    or 5."""
    patience: Annotated[float, Field(gt=0.0, le=10.0)] = 0.15
    """Time after which somebody who is not heard is taken for silent, s."""
    stale: Annotated[float, Field(gt=0.0, le=100.0)] = 1.0
    """Age, by the own clock, from which on a message is not heard, s: more than clocks differ by."""
    key: Annotated[str, Field(pattern="^[0-9a-f]{16}$")] = "0" * 16
    """Secret of the team, 16 hexadecimal digits: a message without its seal is not heard."""

    def check(self, team: Team) -> list[tuple[str, str]]:
        few = team.n <= MOST
        return super().check(team) + [("kind", f"is for {MOST} drones at most")] * (not few)

    def left_open(self, team: Team) -> dict[str, Vector]:
        known = np.isfinite(team.max_thrusts)
        low = self.least_share * team.load_mass * max(team.gravity, 1e-3) / team.n
        lifts = 0.95 * team.max_thrusts - team.masses * team.gravity
        return {
            "tension_min": np.where(known, low, math.nan),
            "tension_max": np.where(known, np.maximum(lifts, 1.2 * low), math.nan),
        }

    @property
    def secret(self) -> tuple[int, int]:
        """The key as two words."""
        return int(self.key[8:], 16), int(self.key[:8], 16)
