"""Driven from outside: by a person, a learner, another program."""

from __future__ import annotations

from colift.control.observation.base import SIGNATURE, ObservationPart
from colift.kernel.jit import kernel
from colift.kernel.ports import hold


class External(ObservationPart):
    """Writes nothing: the forces stay what :meth:`colift.flight.flight.Flight.act` set them to."""

    kernel = kernel(SIGNATURE)(hold)
