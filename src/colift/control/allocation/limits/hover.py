"""A team in hover, as its allocator has it: the thrust that each drone needs, and whether it can be flown."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from colift.control.allocation.base import Allocation, AllocatorPart, Status
from colift.team import Team

Array = NDArray[np.float64]

RESERVE = 0.05
"""Share of its motors' thrust that no drone may need in hover: what it is controlled with.

A motor at its most cannot turn its drone but by giving less on the other side, so what turns comes out of what lifts.
Four drones of 0.5 kg with a load of 1 kg that starts 5 cm beside its place: it sinks by 0.54 m before it is caught
where hover leaves 1.7 %, by 0.22 m with 3.2 %, 0.11 m with 5.2 % and 0.02 m with 14 %.
"""


def hover_conflicts(team: Team, hover: Allocation, thrusts: Array) -> dict[str, str]:
    """By layer, why a formation does not hold the load: a force that is not to be had, motors too weak to control.

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
    needed = team.hover_thrusts(hover.tensions, hover.directions)
    if np.any(needed > (1.0 - RESERVE) * thrusts):
        i = int(np.argmax(needed / thrusts))
        tilt = math.degrees(math.acos(min(max(-hover.directions[i, 2], -1.0), 1.0)))
        need, give = float(needed[i]), float(thrusts[i])
        short = (
            f"leave {100.0 * (1.0 - need / give):.2g} % of their thrust to control with"
            if need <= give
            else "are too weak to hold the load in hover"
        )
        found["actuation"] = (
            f"the motors {short}: drone {i} needs {need:.4g} N and its motors give {give:.4g} N, of which "
            f"{100.0 * RESERVE:g} % are kept in reserve ({(1.0 - RESERVE) * give:.4g} N are left for hover); it weighs "
            f"{team.masses[i] * team.gravity:.4g} N, and its cable pulls with {hover.tensions[i]:.4g} N at "
            f"{tilt:.3g} degrees from the vertical"
        )
    return found


def hovering(
    team: Team, allocation: AllocatorPart, thrusts: Array, directions: Array, period: float
) -> tuple[Allocation, dict[str, str]]:
    """A team in hover as its allocator settles it from ``directions`` (n, 3), and by layer why that does not hold the load.

    ``thrusts`` (n,): what the motors of each drone give, N; ``period`` of the allocator, s.
    """
    hover = allocation.hover(team, directions, period)
    conflicts = hover_conflicts(team, hover, thrusts)
    if "allocation" in conflicts:
        steep = allocation.with_any_thrust(team).hover(team, directions, period)
        weak = hover_conflicts(team, steep, thrusts)
        conflicts = weak if "actuation" in weak else conflicts
    return hover, conflicts
