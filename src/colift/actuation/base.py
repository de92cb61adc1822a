"""The contract of the actuation layer: from commands to what the rotors do."""

from __future__ import annotations

from typing import ClassVar

from colift.jit import f8, i8, matrix, vector, void
from colift.part import Part

SIGNATURE = void(i8, i8, f8, vector, matrix, matrix, vector, vector, vector, matrix, vector)
"""``kernel(step, key, dt, thrusts, torques, motor_health, params, memory, applied_thrusts,
applied_torques, saturated_times)``, called each physics step.

================  ======  ==============================================================
step              int     number of the physics step
key               int     of this part's random numbers (:mod:`colift.math.noise`)
dt                float   physics step, s
thrusts           (n,)    commands, along the body z axes, N
torques           (n, 3)  commands, body frame, N m
motor_health      (n, 4)  share of its thrust that each motor still gives, 0 to 1
applied_thrusts   (n,)    out: N
applied_torques   (n, 3)  out: body frame, N m
saturated_times   (n,)    in/out: time in which each drone's motors could not give what was commanded, s
================  ======  ==============================================================
"""


class ActuationPart(Part):
    """Base of all models of the rotors."""

    layer: ClassVar[str] = "actuation"
    has_motors: ClassVar[bool] = True
    """Whether a motor acts at its own place, so that a weak one turns its drone."""
