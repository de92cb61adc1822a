"""A team in hover, as its allocator has it: the thrust that each drone needs, and whether it can be flown."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from colift.allocation.base import Allocation, Status
from colift.team import Team

Array = NDArray[np.float64]


def thrusts_of(team: Team, hover: Allocation) -> Array:
    """Thrust of each drone (n,) that holds its own weight and the pull of its cable, N."""
    thrust = -hover.tensions[:, None] * hover.directions
    thrust[:, 2] += team.masses * team.gravity
    return np.asarray(np.linalg.norm(thrust, axis=1))


def hover_conflicts(team: Team, hover: Allocation, thrusts: Array) -> dict[str, str]:
    """By layer, why a formation does not hold the load: a force that is not to be had, motors too weak.

    ``thrusts`` (n,): what the motors of each drone give, N.
    """
    weight = team.load_mass * team.gravity
    reached = -float(hover.tensions @ hover.directions[:, 2])
    found = {}
    if hover.status is Status.FORCE_REDUCED and abs(reached - weight) > 1e-6 * weight:
        what = "heavier" if weight > reached else "lighter"
        found["allocation"] = (
            f"the load's weight of {weight:.4g} N is {what} than the {reached:.4g} N that the cables "
            "pull in hover within the limits"
        )
    needed = thrusts_of(team, hover)
    if np.any(needed > thrusts):
        i = int(np.argmax(needed - thrusts))
        tilt = math.degrees(math.acos(min(max(-hover.directions[i, 2], -1.0), 1.0)))
        found["actuation"] = (
            f"the motors are too weak to hold the load in hover: drone {i} needs {needed[i]:.4g} N and its "
            f"motors give {thrusts[i]:.4g} N; it weighs {team.masses[i] * team.gravity:.4g} N, and its cable "
            f"pulls with {hover.tensions[i]:.4g} N at {tilt:.3g} degrees from the vertical"
        )
    return found
