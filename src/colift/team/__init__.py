"""What flies: drones, cables and load, and the geometry of their formations."""

from colift.team.bodies import Team as Team

__all__ = ["Team"]
