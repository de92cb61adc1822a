"""Missions as data: the schema, loading with complete validation, overrides."""

from colift.mission.load import load_mission, mission_names
from colift.mission.schema import Mission

__all__ = ["Mission", "load_mission", "mission_names"]
