"""Driven from outside: by a person, a learner, another program."""

from colift.control.load_control.base import LoadControlPart
from colift.part import driven


@driven
class External(LoadControlPart):
    """What the layer writes is set by :meth:`colift.flight.flight.Flight.act`."""

    turns = True
