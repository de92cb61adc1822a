"""Driven from outside: by a person, a learner, another program."""

from __future__ import annotations

from colift.control.load_control.base import SIGNATURE, LoadControlPart
from colift.kernel.jit import kernel
from colift.kernel.ports import hold


class External(LoadControlPart):
    """Writes nothing: ``force`` stay what :meth:`colift.flight.flight.Flight.act` set them to."""

    kernel = kernel(SIGNATURE)(hold)
