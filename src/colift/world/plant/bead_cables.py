"""Cables with mass and drag, lumped into beads between elastic segments (see :mod:`colift.world.plant._chain`).

Each bead carries one segment's mass, the drone and the load half a segment's each. Air drag acts across each
segment, ``rho_air c_d d / 2`` per length times the squared speed (Morison's normal drag). A cut is at the load's end: the
cable stays with its drone. What the controllers are told of this mass is ``drones.cable_density``.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
from pydantic import Field

from colift.part import Vector
from colift.team import Team
from colift.world.plant._chain import ROPE, ChainPart, Stiffness

AIR = 1.225
"""Density of air, kg/m^3."""
Speed = Annotated[float, Field(ge=-100.0, le=100.0)]


class BeadCables(ChainPart):
    """Elastic cables with mass and air drag, in beads."""

    roped = True
    reels = (
        "its ropes are beads of fixed mass: to pay out more of a rope with mass, mass would have to come from a drum, "
        "which its drones do not have"
    )

    stiffness: Stiffness = ROPE
    """EA of the cables, force per relative stretch, N (braided Dyneema of 1 mm: about 4e4)."""
    beads: Annotated[int, Field(ge=1, le=64)] = 3
    """Beads per cable."""
    density: Annotated[float, Field(gt=0.0, le=10.0)] = 6.5e-4
    """Mass of the cables per length, kg/m (braided Dyneema of 1 mm: about 6.5e-4)."""
    diameter: Annotated[float, Field(gt=0.0, le=0.1)] = 1e-3
    """Of the cables, for the drag, m."""
    drag_coefficient: Annotated[float, Field(ge=0.0, le=3.0)] = 1.1
    """Of the cables across the air; 0 for none."""
    air_velocity: tuple[Speed, Speed, Speed] = (0.0, 0.0, 0.0)
    """Velocity of the air around the cables, world, m/s."""

    def tautness(self, team: Team) -> Vector:
        return np.full(team.n, self.stiffness)

    @property
    def bead_count(self) -> int:
        return self.beads

    @property
    def line_density(self) -> float:
        return self.density

    @property
    def line_drag(self) -> float:
        return 0.5 * AIR * self.drag_coefficient * self.diameter

    @property
    def wind(self) -> tuple[float, float, float]:
        return self.air_velocity
