"""What is likely to go wrong in a mission that is valid: told before it flies.

Each part knows what it needs of the others (:meth:`colift.part.Part.warnings`); nothing is listed here. What the parts make
together, the loops, has its margins in :mod:`colift.mission.stability`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from colift.control.allocation.limits.hover import hovering
from colift.errors import Problem
from colift.mission.forecast import forecast
from colift.mission.stability import margin_warnings
from colift.part import FOLDERS, LISTS, placed
from colift.team.holding import holding

if TYPE_CHECKING:
    from colift.mission.mission import Mission


def notes_of(mission: Mission) -> list[Problem]:
    """What was put in for numbers that the mission leaves out and that should be known better."""
    return [Problem(f"drones.{field}", "", message) for field, message in mission.drones.notes()]


def warnings_of(mission: Mission) -> list[Problem]:
    """Everything that the mission's parts warn of, by the path of the field; then loops that are hardly stable."""
    found: list[Problem] = []
    for folder in FOLDERS:
        chosen = getattr(mission, folder)
        named = (
            [(f"{folder}.{i}", part) for i, part in enumerate(chosen)]
            if folder in LISTS
            else [(folder, chosen)]
        )
        for path, part in named:
            for field, message in part.warnings(mission):
                where = placed(path, field)
                owner = mission.drones if where == field else part
                value = getattr(owner, field.rpartition(".")[2], "")
                shown = f"{value:g}" if isinstance(value, float) else str(value)
                found.append(Problem(where, shown, message))
    found += margin_warnings(mission)
    found += wind_warnings(mission)
    found += _holding_warnings(mission)
    return found


def wind_warnings(mission: Mission) -> list[Problem]:
    """What strong wind may do to the load; what it surely does is a mistake of the mission."""
    drones = mission.first_drones()
    team, allocation = mission.team.of(drones), mission.allocation.of(drones)
    if team.gravity == 0.0 or not any(part.feels_wind for part in mission.disturbance):
        return []
    limits = mission.actuation.of(drones).thrust_limits(team)
    hover, _ = hovering(
        team, allocation, limits, mission.start_directions(), mission.timing.allocation
    )
    blows = [part.of(drones) for part in mission.disturbance]
    ahead = forecast(team, hover, limits, allocation, blows)
    return [Problem(layer, "", message) for layer, message in ahead.doubts(team)]


def _holding_warnings(mission: Mission) -> list[Problem]:
    """What the cables of a rigid load hardly hold; that two of them hold no turn is told by who wants an attitude."""
    drones = mission.first_drones()
    team, allocation = mission.team.of(drones), mission.allocation.of(drones)
    if team.body is None or team.n < 3:
        return []
    held = holding(team, *allocation.formation(team))
    return [Problem("load.attachments", "", f"{name}: {text}") for name, text in held.warnings()]
