"""Driven from outside: by a person, a learner, another program."""

from colift.control.allocation.base import AllocatorPart
from colift.part import driven


@driven
class External(AllocatorPart):
    """What the layer writes is set by :meth:`colift.flight.flight.Flight.act`."""

    wrenches = True
