"""Driven from outside: by a person, a learner, another program."""

from __future__ import annotations

from colift.control.supervision.base import SIGNATURE, SupervisionPart
from colift.kernel.jit import kernel
from colift.kernel.ports import hold


class External(SupervisionPart):
    """Writes nothing: phase and clock stay what :meth:`colift.flight.flight.Flight.act` set them to."""

    kernel = kernel(SIGNATURE)(hold)
