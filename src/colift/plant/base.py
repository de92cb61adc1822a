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

from colift.jit import f8, matrix, vector, void
from colift.part import Part
from colift.team import Team

OBSERVE_SIGNATURE = void(vector, vector, matrix, matrix, matrix, matrix, matrix, matrix, matrix)
"""``observe(params, memory, load, positions, velocities, attitudes, rates, directions,
direction_rates)``.

================  ======  ======================================================
load              (2, 3)  out: position (m) and velocity (m/s), world
positions         (n, 3)  out: of the drones, world, m
velocities        (n, 3)  out: world, m/s
attitudes         (n, 4)  out: wxyz, body to world
rates             (n, 3)  out: body rates, body frame, rad/s
directions        (n, 3)  out: unit vectors from drone to load, world; of a cut cable too
direction_rates   (n, 3)  out: their time derivatives, 1/s
================  ======  ======================================================
"""

STEP_SIGNATURE = void(
    vector, matrix, matrix, vector, f8, vector, vector, vector, vector, vector, vector
)  # fmt: skip
"""``step(thrusts, torques, external, attached, dt, params, memory, tensions, peak_tensions, catch_impulses,
slack_times)``.

==============  ==========  ========================================================
thrusts         (n,)        along the body z axes, N
torques         (n, 3)      body frame, N m
external        (n + 1, 3)  further forces on the drones and, last row, the load, world, N
attached        (n,)        1 while the cable holds, 0 from when it is cut: no tension, the drone flies free
dt              float       physics step, s
tensions        (n,)        out: at the beginning of the step, N
peak_tensions   (n + 1,)    in/out: raised to the largest tension of each cable and, last, the largest sum of them, N
catch_impulses  (n,)        in/out: raised to the largest impulse with which each cable came taut, N s
slack_times     (n,)        in/out: time that each cable, while attached, has spent without tension, s
==============  ==========  ========================================================

A cable that comes taut while its ends part with speed ``u`` has a catch of impulse ``u / (1 / m_i + 1 / m_L)``: what stops
drone and load, were nothing else to hold them. The loop sets peaks and impulses to zero after each recorded row.
"""


@dataclass(frozen=True)
class Start:
    """State at t = 0; shapes as in :data:`OBSERVE_SIGNATURE`, everything else at rest."""

    load_position: NDArray[np.float64]
    load_velocity: NDArray[np.float64]
    directions: NDArray[np.float64]
    attitudes: NDArray[np.float64]


class PlantPart(Part):
    """Base of all plants."""

    layer: ClassVar[str] = "plant"
    observe: ClassVar[Callable[..., Any]]

    def initial(self, team: Team, start: Start) -> NDArray[np.float64]:
        """Memory vector for the start state."""
        raise NotImplementedError
