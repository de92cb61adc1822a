"""Driven from outside: by a person, a learner, another program."""

from __future__ import annotations

from colift.control.attitude_control.base import SIGNATURE, AttitudeControlPart
from colift.kernel.jit import kernel
from colift.kernel.ports import hold


class External(AttitudeControlPart):
    """Writes nothing: ``torques`` stay what :meth:`colift.flight.flight.Flight.act` set them to."""

    kernel = kernel(SIGNATURE)(hold)
