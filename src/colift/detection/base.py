"""The contract of fault detection: which drones still carry, from what a flight stack knows."""

from __future__ import annotations

from typing import ClassVar

from colift.jit import f8, matrix, vector, void
from colift.part import Part

SIGNATURE = void(f8, matrix, matrix, matrix, matrix, vector, vector, matrix, vector, vector, vector)
"""``kernel(dt, load, positions, velocities, attitudes, thrusts, tensions, directions, params, memory,
carrying)``, called at the period of the position controllers.

==========  ======  ==================================================================
dt          float   period, s
load        (2, 3)  measured or estimated position (m) and velocity (m/s), world
positions   (n, 3)  of the drones, as above
velocities  (n, 3)  of the drones, as above
attitudes   (n, 4)  wxyz, as above
thrusts     (n,)    commands, N
tensions    (n,)    wanted of the drones, N
directions  (n, 3)  wanted, unit, from drone to load, world
carrying    (n,)    in/out: 1; set to 0 for a drone that is judged lost to the load
==========  ======  ==================================================================

A drone judged lost leaves the team at once: the others share the load anew, and its cable is released
if it still holds.
"""


class DetectionPart(Part):
    """Base of all methods of detection."""

    layer: ClassVar[str] = "detection"
