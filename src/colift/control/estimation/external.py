"""Driven from outside: by a person, a learner, another program."""

from __future__ import annotations

from colift.control.estimation.base import SIGNATURE, EstimationPart
from colift.kernel.jit import kernel
from colift.kernel.ports import hold


class External(EstimationPart):
    """Writes nothing: the estimated state stay what :meth:`colift.flight.flight.Flight.act` set them to."""

    kernel = kernel(SIGNATURE)(hold)
