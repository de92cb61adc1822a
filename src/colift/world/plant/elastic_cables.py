"""Massless elastic cables: one spring and damper each that only pulls (see :mod:`colift.world.plant._chain`)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from colift.part import Vector
from colift.team import Team
from colift.world.plant._chain import ChainPart, Stiffness, rope


class ElasticCables(ChainPart):
    """Massless cables that stretch, with damping, and do not push."""

    from_team: ClassVar[Mapping[str, float | None]] = {"stiffness": None}

    stiffness: Stiffness | None = None
    """EA of the cables, force per relative stretch, N. None: that of a rope as thick as the load asks for, 4e4 (braided Dyneema of
    1 mm) for the paper's 0.225 kg and in proportion for others."""

    def left_open(self, team: Team) -> dict[str, Vector]:
        return {"stiffness": np.full(team.n, rope(team))}

    def tautness(self, team: Team) -> Vector:
        return self.settled("stiffness", team)
