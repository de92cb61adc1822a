"""What becomes of a flight when drones have left or joined: whether those that fly then carry on, leaning, more slowly, or not at all.

On fewer cables a load may hang only where it leans, so that the corner that has lost its cable sinks; and a motion that many
cables make with ease may ask more of the rotors of a few than they give, and fewer when it is flown more slowly. It is answered from
models alone, before the flight (:func:`losses`) and in it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from colift.control.allocation.base import AllocatorPart
from colift.control.reference.base import ReferencePart
from colift.kernel.math import leaning
from colift.mission.planned import ROOM, STEP, most_asked, wanted
from colift.part import Part
from colift.team import Team
from colift.team.geometry import Array
from colift.team.load import LEVEL, from_to
from colift.team.plan import hung, shares
from colift.world.actuation.base import ActuationPart

if TYPE_CHECKING:
    from colift.mission.mission import Mission

PACES = (1.0, 0.85, 0.7, 0.55, 0.4, 0.3, 0.2)
"""At which a reference is flown on, over its own: the fastest at which its plan asks no more of the rotors than may be planned."""
TIMES = (0.5, 0.7, 1.0, 1.4, 2.0, 2.8, 4.0)
"""In which a load comes to lean, s."""
CALM = 0.3
"""Share of the rotors' angular acceleration that a plan may ask of a team that has just changed: most of them are for coming to rest."""
TAUT = 0.1
"""Least that it may ask of a cable, over its part of the force: with less it is slack at the first gust."""
FEWEST = 3
"""Cables that hold all of a rigid load's attitude."""


class Outlook(NamedTuple):
    """For a team."""

    hang: tuple[float, ...] = LEVEL
    """Attitude of a rigid load in hover beside that which the reference wants, wxyz."""
    within: float = 0.0
    """Time in which it comes to hang like that, s: the shortest in which the drones can turn it."""
    pace: float = 1.0
    """At which the reference goes on."""
    upright: bool = False
    """Whether the reference leaves out what it wants of roll and pitch."""
    reason: str = ""
    """Why the team cannot carry on; empty where it can, as far as its models say."""

    @property
    def carries(self) -> bool:
        """Whether the team carries on."""
        return not self.reason

    @property
    def lean(self) -> float:
        """Angle of the load in hover, rad."""
        return 2.0 * math.acos(min(abs(self.hang[0]), 1.0))

    def __str__(self) -> str:
        """In words."""
        if not self.carries:
            return f"comes down: {self.reason}"
        hanging = (
            f"leaning by {math.degrees(self.lean):.0f} degrees" if self.lean > 0.0 else "level"
        )
        upright = ", without the roll and pitch that are wanted" if self.upright else ""
        pace = f", at {self.pace:.0%} of the pace" if self.pace < 1.0 else ""
        return f"goes on {hanging}{upright}{pace}"

    def flown(self, team: Team) -> Team:
        """The team, its load hanging like that."""
        if team.body is None or self.hang == LEVEL:
            return team
        return replace(team, body=replace(team.body, hang=np.array(self.hang)))


def bound(parts: Mapping[str, Part], drones: list[int]) -> dict[str, Part]:
    """The layers' parts that :func:`outlook` asks, for these drones."""
    asked = ("actuation", "allocation", "reference", "position_control", "attitude_control")
    return {layer: parts[layer].of(drones) for layer in asked if layer in parts}


def outlook(
    team: Team,
    parts: Mapping[str, Part],
    directions: Array,
    first: float,
    last: float,
    before: tuple[ArrayLike, Array] | None = None,
) -> Outlook:
    """For this team, with the layers' parts bound to it, and the reference between two of its times, s.

    ``directions`` (n, 3) are those that the drones fly now; ``before`` are the load's attitude that is wanted now (4,), and the formation
    (n, 3) that the drones go on from.
    """
    actuation, allocation = parts["actuation"], parts["allocation"]
    assert isinstance(actuation, ActuationPart)
    assert isinstance(allocation, AllocatorPart)
    found = Outlook()
    if team.body is not None:
        if team.n < FEWEST:
            cables = "1 cable does" if team.n == 1 else f"{team.n} cables do"
            reason = f"{cables} not hold the attitude of the load"
            return Outlook(tuple(hung(team).tolist()), reason=reason)
        held = allocation.leaning(team)
        if held is not None:
            hang = tuple(held[1].tolist())
            team = Outlook(hang).flown(team)
            found = Outlook(hang)
    problems = [message for _, message in actuation.conflicts(team)]
    problems += allocation.cannot_hold(team, actuation.thrust_limits(team), directions)
    if problems or team.body is None or team.gravity == 0.0:
        return found._replace(reason="; ".join(problems))
    reference = parts["reference"]
    assert isinstance(reference, ReferencePart)
    leant = found.hang != LEVEL
    for upright in (True,) if leant else (False, True):
        flown = reference.upright() if upright else reference
        times, poses = wanted(team, flown, first, max(last, first + 0.1))
        for pace in PACES:
            most = most_asked(team, parts, times, poses, pace=pace)
            if most is None or (most.share <= CALM and most.taut >= TAUT):
                within = 0.0
                if before is not None:
                    _, wanted_now, _ = flown.pose(team, first)
                    within = _within(team, parts, from_to(wanted_now, before[0]), before[1])
                return found._replace(pace=pace, upright=upright, within=within)
    assert most is not None
    share = f"{most.share:.0%} of what a drone's rotors give, and of a cable {most.taut:.0%} of its part of the force"
    return found._replace(
        reason=f"upright and at a pace of {PACES[-1]:g} the reference asks {share}"
    )


def _within(team: Team, parts: Mapping[str, Part], hang: ArrayLike, formation: Array) -> float:
    """Shortest time in which the load, in hover, comes to hang as it does on this team, and the drones into their formation, s."""
    allocation = parts["allocation"]
    assert team.body is not None
    assert isinstance(allocation, AllocatorPart)
    goal = shares(team, *allocation.formation(team))
    for duration in TIMES:
        lean = leaning.lean_of(hang, team.body.hang, 0.0, duration)
        times = np.linspace(0.0, duration, max(8, round(duration / STEP)))
        poses, formations = [], []
        for time in times:
            attitude, rates = np.array(LEVEL), np.zeros((3, 3))
            share = leaning.leaned(lean, float(time), attitude, rates)
            poses.append((np.zeros((4, 3)), attitude, rates))
            formations.append(formation + share * (goal - formation))
        most = most_asked(team, parts, times, poses, formations=formations)
        if most is None or most.share <= ROOM:
            break
    return duration


def losses(mission: Mission) -> dict[int, Outlook]:
    """By drone what becomes of a mission whose first team loses it: see :func:`lost_one_by_one`."""
    return {drone: found for drone, _, found in lost_one_by_one(mission)}


def lost_one_by_one(mission: Mission) -> Iterator[tuple[int, list[int], Outlook]]:
    """Each drone of the first team, those that are left without it, and what becomes of them; nobody is left without the only one.

    It is lost at the start: the hardest moment, as all of the reference is to come.
    """
    drones = mission.first_drones()
    layers = ("actuation", "allocation", "reference", "position_control", "attitude_control")
    parts = {layer: getattr(mission, layer) for layer in layers}
    directions = mission.start_directions()
    for place, drone in enumerate(drones):
        rest = [other for other in drones if other != drone]
        if rest:
            found = outlook(
                mission.team.of(rest), bound(parts, rest), np.delete(directions, place, axis=0),
                0.0, mission.timing.duration,
            )  # fmt: skip
            yield drone, rest, found
