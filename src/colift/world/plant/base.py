"""The contract of the plant: the truth that the controllers fly.

A plant keeps its state in its memory vector and has two kernels. ``observe`` writes the present
state into the signals; ``step`` takes commands, advances by ``dt`` and reports the tensions that
acted at the beginning of the step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from colift.kernel.layout import Layout
from colift.kernel.ports import PORTS
from colift.kernel.signals import LEVEL
from colift.part import Part
from colift.team import Team

OBSERVE_SIGNATURE = PORTS["plant_observe"].signature
"""Of ``observe(now, sees, params, memory, writes)``: writes the present state; sees nothing.

``ends`` are those of the cables on the load (:func:`colift.kernel.load.ends_of`). The directions of a cut cable are those from
its drone to its end, too.
"""

STEP_SIGNATURE = PORTS["plant"].signature
"""Of ``kernel(now, sees, params, memory, writes)``: advances by ``now.dt``.

``tensions`` are those at the beginning of the step. From when ``attached`` is 0 a cable pulls nothing. ``peak_tensions``
and ``catch_impulses`` are raised, never lowered, and ``slack_times`` grow: the loop sets peaks and impulses to zero after each
recorded row. Cables are as long as the team's and what ``winches`` have paid out by then
(:func:`colift.kernel.math.winch.paid_out`). A cable that comes taut while its ends part with speed ``u`` has a catch of impulse ``u / (1 / m_i + 1 / m_L)``:
what stops drone and load, were nothing else to hold them.
"""


STATE = Layout(
    team={"load_position": 3, "load_velocity": 3, "load_attitude": 4, "load_rates": 3},
    drone={"position": 3, "velocity": 3, "attitude": 4, "rates": 3},
)
"""How the memory of the plants that colift brings begins: the state of load and drones. The load's is that of its centre of mass."""


@dataclass(frozen=True)
class Start:
    """State at t = 0; shapes as in :data:`OBSERVE_SIGNATURE`, everything else at rest."""

    load_position: NDArray[np.float64]
    """Of a rigid load its middle."""
    load_velocity: NDArray[np.float64]
    directions: NDArray[np.float64]
    attitudes: NDArray[np.float64]
    load_attitude: tuple[float, ...] = LEVEL
    """Of a rigid load, wxyz."""
    load_rates: tuple[float, ...] = (0.0, 0.0, 0.0)
    """rad/s."""
    places: NDArray[np.float64] | None = None
    """Of the drones (n, 3), world, m, where their cables may be slack; None where they are taut along the ``directions``."""


class PlantPart(Part):
    """Base of all plants."""

    layer: ClassVar[str] = "plant"
    observe: ClassVar[Callable[..., Any]]
    reels: ClassVar[str] = "its cables keep their lengths"
    """Why winches cannot pay out its cables and take them in; empty where they can."""
    roped: ClassVar[bool] = False
    """Whether its cables have mass of their own; otherwise half of each cable's is its drone's and half the load's."""
    slackens: ClassVar[bool] = True
    """Whether its cables can go slack, and so be slack at the start."""

    def team_of(self, bodies: Team, density: float) -> Team:
        """The team that it is bound to, of bodies without and cables with this mass per length, kg/m."""
        return bodies if self.roped or density == 0.0 else bodies.with_ropes(density)

    def initial(self, team: Team, start: Start) -> NDArray[np.float64]:
        """Memory vector for the start state."""
        raise NotImplementedError
