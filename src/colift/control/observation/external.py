"""Driven from outside: by a person, a learner, another program."""

from colift.control.observation.base import ObservationPart
from colift.part import driven


@driven
class External(ObservationPart):
    """What the layer writes is set by :meth:`colift.flight.flight.Flight.act`."""
