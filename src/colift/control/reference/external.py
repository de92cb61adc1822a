"""Driven from outside: by a person, a learner, another program."""

from colift.control.reference.base import ReferencePart
from colift.part import driven


@driven
class External(ReferencePart):
    """What the layer writes is set by :meth:`colift.flight.flight.Flight.act`."""
