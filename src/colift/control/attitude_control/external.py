"""Driven from outside: by a person, a learner, another program."""

from colift.control.attitude_control.base import AttitudeControlPart
from colift.part import driven


@driven
class External(AttitudeControlPart):
    """What the layer writes is set by :meth:`colift.flight.flight.Flight.act`."""
