"""A mission's team as it begins, as a model for other simulators."""

from __future__ import annotations

import numpy as np

from colift.flight.flight import start_state
from colift.mission.mission import Mission
from colift.record.exchange.messages import Body
from colift.record.exchange.mjcf import mjcf
from colift.record.exchange.sdf import sdf
from colift.record.exchange.urdf import urdf
from colift.team.geometry import matrix_of

FORMATS = {"mjcf": ".xml", "urdf": ".urdf", "sdf": ".sdf"}
"""Models, and how the names of their files end."""


def model(mission: Mission, kind: str) -> str:
    """The text of a model, of the drones that fly at first."""
    team = mission.team.of(mission.first_drones())
    if kind == "urdf":
        return urdf(team, mission.name)
    load, drones = start_of(mission)
    return (mjcf if kind == "mjcf" else sdf)(team, mission.name, load, drones)


def start_of(mission: Mission) -> tuple[Body, list[Body]]:
    """Load and drones where they begin, at rest."""
    team = mission.team.of(mission.first_drones())
    start, _ = start_state(mission)
    still, attitude = np.zeros(3), np.array(start.load_attitude)
    load = Body(start.load_position, still, attitude, still)
    ends = np.zeros((team.n, 3)) if team.body is None else team.body.attachments
    places = start.places
    if places is None:
        hooks = load.position + ends @ matrix_of(attitude).T
        places = hooks - team.cable_lengths[:, None] * start.directions
    return load, [Body(*each, still) for each in zip(places, np.zeros_like(places), start.attitudes, strict=True)]  # fmt: skip
