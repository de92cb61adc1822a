"""Driven from outside: by a person, a learner, another program."""

from colift.control.position_control.base import PositionControlPart
from colift.part import driven


@driven
class External(PositionControlPart):
    """What the layer writes is set by :meth:`colift.flight.flight.Flight.act`."""
