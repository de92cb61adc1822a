"""Missions as data: the schema, loading with complete validation, overrides."""

from __future__ import annotations

from typing import TYPE_CHECKING

from colift.lazy import lookup

if TYPE_CHECKING:
    from colift.catalogue import mission_names
    from colift.mission.load import load_mission
    from colift.mission.mission import Mission

# Resolved on first use: a mission imports its parts' kernels, and what a recording says of one needs none.
_HOMES = {
    "Mission": "colift.mission.mission",
    "load_mission": "colift.mission.load",
    "mission_names": "colift.catalogue",
}

__all__ = ["Mission", "load_mission", "mission_names"]

__getattr__ = lookup(__name__, _HOMES)
