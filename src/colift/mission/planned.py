"""What the wanted motion of a rigid load asks of cables and drones, before anything flies.

The plan of the formation, turned to the wanted force and heading, and the nearest cable forces that make the wanted force and moment
exactly are what flies where nothing is limited. A drone of which a faster turn is asked than its rotors give falls behind, and its cable
goes slack; where little is asked of a cable, it swings its drone around. No controller can mend a reference that asks for that.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from colift.control.allocation.base import AllocatorPart
from colift.control.position_control.base import PositionControlPart
from colift.control.reference.base import ReferencePart
from colift.errors import Problem
from colift.mission.schema import Frame
from colift.part import Part
from colift.team import Team
from colift.team.geometry import Array, matrix_of
from colift.team.holding import holding
from colift.team.load import LEVEL, Pose, times_of
from colift.team.plan import shares

if TYPE_CHECKING:
    from colift.mission.mission import Mission

ROOM = 0.65
"""Share of the rotors' angular acceleration that a plan may ask for: the rest is for corrections."""
WINDOW = 0.04
"""Time over which it is taken, s: a jump of what is wanted, such as of a snap, asks for no more than a drone falls behind meanwhile."""
STEP, MOST = 0.02, 1500
"""Time between two moments that are looked at, s, unless there would be more than so many."""


class Planned(NamedTuple):
    """Along a reference."""

    tensions: Array
    """Of the cables (times, n), N."""
    taut: Array
    """What is asked of them over their part of the force (times, n)."""
    turning: Array
    """Angular acceleration of each drone's thrust (times, n), rad/s^2; NaN at both ends."""


class Demand(NamedTuple):
    """Where most is asked of a drone, along a reference."""

    share: float
    """Of the angular acceleration that its rotors give."""
    turning: float
    """Angular acceleration of its thrust, rad/s^2, and how much its rotors give."""
    limit: float
    time: float
    """Of the reference, s."""
    drone: int
    """In the team."""
    taut: float
    """Least that is asked of a cable, over its part of the force; below 0 it would have to push."""
    slack: tuple[float, int]
    """When, s, and of which."""

    def problems(self, drones: Sequence[int]) -> list[str]:
        """Why these drones cannot do it, to go on after the reference's name."""
        when, which = self.slack
        found = []
        if self.taut < 0.0:
            found.append(
                f"asks cable {drones[which]} at {when:.3g} s to push: tilt the load less, or move it more gently"
            )
        if self.share > ROOM:
            found.append(
                f"asks drone {drones[self.drone]} at {self.time:.3g} s to turn its thrust with {self.turning:.3g} rad/s^2, and of the {self.limit:.3g} "
                f"that its rotors give {ROOM:.0%} may be planned: move more slowly, turn the load less, or attach the cables wider apart"
            )
        return found


def wanted(
    team: Team, reference: ReferencePart, first: float, last: float
) -> tuple[Array, list[Pose]]:
    """Times of a reference, evenly spaced, and the poses that it wants there; of a load that hangs leaning, leaning."""
    times = np.linspace(first, last, min(MOST, max(8, round((last - first) / STEP))))
    poses = [*reference.poses(team, times)]
    if team.body is None or np.array_equal(team.body.hang, LEVEL):
        return times, poses
    lean = matrix_of(team.body.hang)
    return times, [(x, times_of(q, team.body.hang), rates @ lean) for x, q, rates in poses]


def planned(
    team: Team,
    position_control: PositionControlPart,
    times: Array,
    poses: Sequence[Pose],
    formations: Sequence[Array],
    pace: float = 1.0,
) -> Planned | None:
    """What is planned of a rigid load's cables and drones at times that are evenly spaced, at this pace; None where nothing is."""
    powers = pace ** np.arange(4.0)[:, None]
    poses = [(powers * x, q, powers[1:] * rates) for x, q, rates in poses]
    found = position_control.planned_pulls(team, poses, formations)
    if found is None or team.body is None:
        return None
    pulls, taut = found
    turned = [matrix_of(attitude) for _, attitude, _ in poses]
    arms = np.array([team.body.attachments @ R.T for R in turned])
    ends = np.array([motion[0] for motion, _, _ in poses])[:, None] + arms
    step = float(times[1] - times[0]) / pace
    sizes = np.linalg.norm(pulls, axis=2)
    places = ends - team.cable_lengths[:, None] * pulls / sizes[..., None]
    upward = np.array([0.0, 0.0, team.gravity])
    thrusts = team.masses[:, None] * (_bend(places, step) + upward) - pulls
    aims = thrusts / np.linalg.norm(thrusts, axis=2, keepdims=True)
    return Planned(sizes, taut, np.linalg.norm(_bend(aims, step), axis=2))


def _bend(values: Array, step: float) -> Array:
    """Second derivative along the first axis, over a time to which motors answer; NaN at both ends."""
    found = np.full_like(values, np.nan)
    k = min(max(1, round(WINDOW / step)), (len(values) - 1) // 2)
    found[k:-k] = (values[2 * k :] - 2.0 * values[k:-k] + values[: -2 * k]) / (k * step) ** 2
    return found


def most_asked(
    team: Team,
    parts: Mapping[str, Part],
    times: Array,
    poses: Sequence[Pose],
    *,
    formations: Sequence[Array] | None = None,
    pace: float = 1.0,
) -> Demand | None:
    """Where a reference asks most of the drones' rotors; None where nothing is planned, or nobody knows what they give.

    Formations at these times are the allocator's where none are given.
    """
    position_control, attitude = parts["position_control"], parts["attitude_control"]
    if formations is None:
        allocation = parts["allocation"]
        assert isinstance(allocation, AllocatorPart)
        formations = [shares(team, *allocation.formation(team))] * len(times)
    assert isinstance(position_control, PositionControlPart)
    found = planned(team, position_control, times, poses, formations, pace)
    if found is None or "max_acceleration" not in attitude.from_team:
        return None
    limits = np.broadcast_to(attitude.settled("max_acceleration", team), team.n)
    over = np.nan_to_num(found.turning) / limits
    k, i = (int(place) for place in np.unravel_index(np.argmax(over), over.shape))
    m, j = (int(place) for place in np.unravel_index(np.argmin(found.taut), found.taut.shape))
    return Demand(
        float(over[k, i]), float(found.turning[k, i]), float(limits[i]), float(times[k]), i,
        float(found.taut[m, j]), (float(times[m]), j),
    )  # fmt: skip


def demand_of(mission: Mission) -> Demand | None:
    """What the reference asks of a mission's first team, from its begin to the mission's end."""
    drones = mission.first_drones()
    team = mission.team.of(drones)
    asked = ("allocation", "position_control", "attitude_control")
    bound = {layer: getattr(mission, layer).of(drones) for layer in asked}
    return most_asked(team, bound, *wanted(team, mission.reference, 0.0, mission.timing.duration))


def planned_checks(frame: Frame, parts: Mapping[str, Part]) -> Iterable[Problem]:
    """Problems where cables cannot hold a rigid load, or its reference asks for what neither they nor the rotors give."""
    drones, reference = frame.first_drones(), parts["reference"]
    assert isinstance(reference, ReferencePart)
    team = frame.team.of(drones)
    if team.body is None or team.gravity == 0.0 or team.n < 3:
        return
    asked = ("allocation", "position_control", "attitude_control")
    bound = {layer: parts[layer].of(drones) for layer in asked}
    allocation = bound["allocation"]
    assert isinstance(allocation, AllocatorPart)
    for name, message in holding(team, *allocation.formation(team)).problems():
        yield Problem("load.attachments", "", f"{name}: {message}")
    times, poses = wanted(team, reference, 0.0, frame.timing.duration)
    most = most_asked(team, bound, times, poses)
    for message in most.problems(drones) if most is not None else ():
        yield Problem("reference", "", message)
