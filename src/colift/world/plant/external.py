"""The world outside: load and drones are where they are told to be."""

from __future__ import annotations

import numpy as np

from colift.part import Vector, driven
from colift.team import Team
from colift.world.plant._bodies import BodiesPart, state_size


@driven
class External(BodiesPart):
    """Load and drones stay where the memory's state was set to, and the rest what :meth:`colift.flight.flight.Flight.act` set it to."""

    anchored = False

    def memory(self, team: Team) -> Vector:
        return np.zeros(state_size(team.n))
