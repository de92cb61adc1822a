"""The contract of the link between the central allocator and the drones."""

from __future__ import annotations

from typing import ClassVar

from colift.jit import f8, i8, matrix, vector, void
from colift.part import Part

SIGNATURE = void(i8, i8, f8, vector, matrix, vector, vector, vector, matrix)
"""``kernel(step, key, dt, tensions, directions, params, memory, received_tensions,
received_directions)``, called each physics step.

====================  ======  ========================================================
step                  int     number of the physics step
key                   int     of this part's random numbers (:mod:`colift.math.noise`)
dt                    float   physics step, s
tensions              (n,)    the allocator's answer, N
directions            (n, 3)  the allocator's answer, world
received_tensions     (n,)    in/out: what each drone has received last, N
received_directions   (n, 3)  in/out: what each drone has received last, world
====================  ======  ========================================================
"""


class LinkPart(Part):
    """Base of all links."""

    layer: ClassVar[str] = "link"
