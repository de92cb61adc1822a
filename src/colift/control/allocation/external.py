"""Driven from outside: by a person, a learner, another program."""

from __future__ import annotations

from colift.control.allocation.base import SIGNATURE, AllocatorPart
from colift.kernel.jit import kernel
from colift.kernel.ports import hold_answer


class External(AllocatorPart):
    """Writes nothing: ``desired_tensions`` and ``desired_directions`` stay what :meth:`colift.flight.flight.Flight.act` set them to."""

    kernel = kernel(SIGNATURE)(hold_answer)
