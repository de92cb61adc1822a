"""Driven from outside: by a person, a learner, another program."""

from colift.control.supervision.base import SupervisionPart
from colift.part import driven


@driven
class External(SupervisionPart):
    """What the layer writes is set by :meth:`colift.flight.flight.Flight.act`."""
