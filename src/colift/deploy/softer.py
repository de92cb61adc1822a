"""What controllers may ask of an attitude loop that is not colift's own, and so follows later."""

from __future__ import annotations

from collections.abc import Container
from typing import Any

import numpy as np

from colift.mission.mission import Mission

FASTEST = 3.0
"""Highest frequency of a filter of the cables' wanted directions that an angle loop of 12 rad/s bears, rad/s."""
STIFFEST = {
    "position_control": {"k_p": 10.0, "k_d": 6.0, "k_i": 2.0},
    "load_control": {"k_p": 9.0, "k_d": 4.5, "k_i": 2.2},
}
"""And the largest gains over the mass of a drone and of the load, 1/s², 1/s, 1/s³."""


def softer(mission: Mission, given: Container[str]) -> dict[str, Any]:
    """Gains to lower in a mission, by path; those that stand in ``given`` are left alone."""
    masses = {
        "position_control": float(mission.team.masses.min()),
        "load_control": mission.team.load_mass,
    }
    largest = {"position_control.frequency": FASTEST} | {
        f"{section}.{gain}": round(limit * masses[section], 6)
        for section, gains in STIFFEST.items()
        for gain, limit in gains.items()
    }
    found = {}
    for path, most in largest.items():
        section, _, gain = path.partition(".")
        before = np.asarray(getattr(getattr(mission, section), gain, 0.0), dtype=float)
        if path not in given and (before > most).any():
            found[path] = np.minimum(before, most).tolist()
    return found


def notes(lowered: dict[str, Any]) -> list[str]:
    """A note on each of them."""
    return [f"{path} = {value}: an autopilot turns no faster" for path, value in lowered.items()]
