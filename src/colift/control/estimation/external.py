"""Driven from outside: by a person, a learner, another program."""

from colift.control.estimation.base import EstimationPart
from colift.part import driven


@driven
class External(EstimationPart):
    """What the layer writes is set by :meth:`colift.flight.flight.Flight.act`."""
