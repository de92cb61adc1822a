"""What flies: drones, cables and load, and the geometry of their formations."""

from colift.team.bodies import Team as Team
from colift.team.ground import Ground as Ground
from colift.team.load import Body as Body
from colift.team.vehicles import Vehicle as Vehicle

__all__ = ["Body", "Ground", "Team", "Vehicle"]
