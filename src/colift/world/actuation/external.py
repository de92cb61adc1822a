"""Driven from outside: by an autopilot with motors of its own."""

from colift.part import driven
from colift.world.actuation.base import ActuationPart


@driven
class External(ActuationPart):
    """What the layer writes is set by :meth:`colift.flight.flight.Flight.act`."""
