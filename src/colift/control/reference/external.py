"""Driven from outside: by a person, a learner, another program."""

from __future__ import annotations

from colift.control.reference.base import SIGNATURE, ReferencePart
from colift.kernel.jit import kernel
from colift.kernel.ports import hold


class External(ReferencePart):
    """Writes nothing: ``reference`` (and ``nominal_forces``) stay what :meth:`colift.flight.flight.Flight.act` set them to."""

    kernel = kernel(SIGNATURE)(hold)
