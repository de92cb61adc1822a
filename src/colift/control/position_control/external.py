"""Driven from outside: by a person, a learner, another program."""

from __future__ import annotations

from colift.control.position_control.base import SIGNATURE, PositionControlPart
from colift.kernel.jit import kernel
from colift.kernel.ports import hold


class External(PositionControlPart):
    """Writes nothing: thrusts, attitudes and rates stay what :meth:`colift.flight.flight.Flight.act` set them to."""

    kernel = kernel(SIGNATURE)(hold)
