"""What a supervised flight is about: the numbers of the signal ``phase``, and what they are called."""

from __future__ import annotations

from enum import IntEnum


class Phase(IntEnum):
    """Phases of a lift. ``FLY`` is that of every flight without a supervisor."""

    FLY = 0
    """The load follows the reference, whose clock runs; in all other phases the clock is held."""
    STAND = 1
    """Load and drones stand on the ground, motors idle; where they stand is averaged."""
    CLIMB = 2
    """Each drone flies on an arc about the load to its place in the formation, its cable slack."""
    HOOK = 3
    """In hover the force on each drone is learned; then each goes out until its cable pulls."""
    TENSION = 4
    """The tensions rise in proportion until the load leaves the ground; it is weighed."""
    RISE = 5
    """The load rises to where the reference begins."""
    LOWER = 6
    """From where the reference ends the load comes to a rest above the place where it is set down."""
    TOUCH = 7
    """Straight down at the speed of touch-down, until the ground is felt."""
    UNLOAD = 8
    """The tensions vanish and each drone goes on towards the load with the speed that it has."""
    SLACKEN = 9
    """The drones come nearer, until no cable can pull."""
    RELEASE = 10
    """The cables let go of the load; the drones fly off and come down beside it."""
    LAND = 11
    """The drones come down on arcs about the load, their cables hooked."""
    DONE = 12
    """All stand on the ground."""
