"""The contract of the attitude-control layer: from wanted attitude to torque."""

from __future__ import annotations

from typing import ClassVar

from colift.jit import f8, matrix, vector, void
from colift.part import Part

SIGNATURE = void(matrix, matrix, matrix, matrix, f8, vector, vector, matrix)
"""``kernel(attitudes, rates, wanted_attitudes, wanted_rates, dt, params, memory, torques)``.

=================  ======  ==================================================
attitudes          (n, 4)  of the drones, wxyz, body to world
rates              (n, 3)  body rates, body frame, rad/s
wanted_attitudes   (n, 4)  wxyz
wanted_rates       (n, 3)  body frame, rad/s
dt                 float   control period, s
torques            (n, 3)  out: torque commands, body frame, N m
=================  ======  ==================================================
"""


class AttitudeControlPart(Part):
    """Base of all attitude controllers."""

    layer: ClassVar[str] = "attitude_control"
