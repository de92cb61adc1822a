"""The contract of the load-control layer: from the load's tracking error to a wanted force."""

from __future__ import annotations

from typing import ClassVar

from colift.jit import f8, matrix, vector, void
from colift.part import Part

SIGNATURE = void(matrix, matrix, f8, vector, vector, vector)
"""``kernel(load, reference, dt, params, memory, force)``, all in the world frame.

=========  ======  ==============================================================
load       (2, 3)  position (m) and velocity (m/s) of the load
reference  (4, 3)  wanted position, velocity, acceleration, jerk
dt         float   control period, s
force      (3,)    out: total force that the cables should exert on the load, N
=========  ======  ==============================================================
"""


class LoadControlPart(Part):
    """Base of all load controllers."""

    layer: ClassVar[str] = "load_control"
    senses: ClassVar[tuple[str, ...]] = ("load",)
    """The sensors (:data:`colift.sensing.base.SENSORS`) whose delay it suffers."""
