"""What the wanted motion of a rigid load asks of cables and drones, before anything flies.

The plan of the formation, turned to the wanted force and heading, and the nearest cable forces that make the wanted force and moment
exactly are what flies where nothing is limited. A drone of which a faster turn is asked than its rotors give falls behind, and its cable
goes slack; where little is asked of a cable, it swings its drone around. No controller can mend a reference that asks for that.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from colift.control.position_control.base import PositionControlPart
from colift.control.reference.base import ReferencePart
from colift.errors import Problem
from colift.mission.schema import Frame
from colift.part import Part
from colift.team import Team
from colift.team.geometry import Array, matrix_of

ROOM = 0.65
"""Share of the rotors' angular acceleration that a plan may ask for: the rest is for corrections."""
STEP, MOST = 0.02, 1500
"""Time between two moments that are looked at, s, unless there would be more than so many."""


class Planned(NamedTuple):
    """Along a reference."""

    tensions: Array
    """Of the cables (times, n), N."""
    turning: Array
    """Angular acceleration of each drone's thrust (times, n), rad/s^2; NaN at both ends."""


def planned(
    team: Team, reference: ReferencePart, position_control: PositionControlPart, times: Array
) -> Planned | None:
    """What is planned of a rigid load's cables and drones at times that are evenly spaced; None where nothing is."""
    poses = [reference.pose(team, float(time)) for time in times]
    pulls = position_control.planned_pulls(team, poses)
    if pulls is None or team.body is None:
        return None
    turned = [matrix_of(attitude) for _, attitude, _ in poses]
    arms = np.array([team.body.attachments @ R.T for R in turned])
    ends = np.array([motion[0] for motion, _, _ in poses])[:, None] + arms
    step = float(times[1] - times[0])
    sizes = np.linalg.norm(pulls, axis=2)
    places = ends - team.cable_lengths[:, None] * pulls / sizes[..., None]
    upward = np.array([0.0, 0.0, team.gravity])
    thrusts = team.masses[:, None] * (_bend(places, step) + upward) - pulls
    aims = thrusts / np.linalg.norm(thrusts, axis=2, keepdims=True)
    return Planned(sizes, np.linalg.norm(_bend(aims, step), axis=2))


def _bend(values: Array, step: float) -> Array:
    """Second derivative along the first axis; NaN at both ends."""
    found = np.full_like(values, np.nan)
    found[1:-1] = (values[2:] - 2.0 * values[1:-1] + values[:-2]) / step**2
    return found


def planned_checks(frame: Frame, parts: Mapping[str, Part]) -> Iterable[Problem]:
    """A problem where the reference of a rigid load asks a drone for a faster turn than its rotors give."""
    drones, reference = frame.first_drones(), parts["reference"]
    position_control = parts["position_control"].of(drones)
    assert isinstance(reference, ReferencePart)
    assert isinstance(position_control, PositionControlPart)
    team = frame.team.of(drones)
    if team.body is None or team.gravity == 0.0 or team.n < 3:
        return
    count = min(MOST, max(8, round(frame.timing.duration / STEP)))
    times = np.linspace(0.0, frame.timing.duration, count)
    found = planned(team, reference, position_control, times)
    if found is None:
        return
    attitude = parts["attitude_control"].of(drones)
    if "max_acceleration" not in attitude.from_team:
        return
    limits = attitude.settled("max_acceleration", team)
    over = np.nan_to_num(found.turning) / limits
    k, i = np.unravel_index(np.argmax(over), over.shape)
    if over[k, i] > ROOM:
        message = (
            f"asks drone {drones[i]} at {times[k]:.3g} s to turn its thrust with {found.turning[k, i]:.3g} rad/s^2, and of the {limits[i]:.3g} "
            f"that its rotors give {ROOM:.0%} may be planned: move more slowly, turn the load less, or attach the cables wider apart"
        )
        yield Problem("reference", "", message)
