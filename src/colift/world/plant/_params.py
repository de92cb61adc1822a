"""Where the numbers of load and drones stand in state and parameters of the plants that colift brings."""

from __future__ import annotations

from colift.kernel.layout import Layout
from colift.world.plant.base import STATE

LOAD: int = STATE.at.rows
DRONE: int = STATE.at.width
CORNERS = 8
"""Most points with which a rigid load touches."""
PARAMS = Layout(
    team={
        "m_L": 1, "g": 1, "ground": 1, "height": 1, "friction": 1, "damping": 1, "rigid": 1, "inertia": 9,
        "inverse": 9, "centre": 3, "corners": 1, "corner": 3 * CORNERS,
    },
    drone={"m": 1, "L": 1, "J": 3, "foot": 1, "rho": 3},
)  # fmt: skip
"""How the parameters begin; ``ground`` is 1 where there is one, ``rigid`` where the load has an attitude. ``centre`` of mass in
the load's frame, and from there the ends ``rho`` of the cables and so many ``corners``."""
P = PARAMS.at
MASS: int = P.rows
BODY: int = P.width
"""Where the first drone's numbers stand in the parameters, and how many each has."""
