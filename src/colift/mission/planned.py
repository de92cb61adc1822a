"""What the wanted motion of a rigid load asks of cables and drones, before anything flies.

The plan of the formation, turned to the wanted force and heading, and the nearest cable forces that make the wanted force and moment
exactly are what flies where nothing is limited. A drone of which a faster turn is asked than its rotors give falls behind, and its cable
goes slack; where little is asked of a cable, it swings its drone around. No controller can mend a reference that asks for that.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import numpy as np

from colift.control.reference.base import ReferencePart
from colift.errors import Problem
from colift.mission.schema import Frame
from colift.part import Part
from colift.team import Team
from colift.team.geometry import Array, matrix_of, rotation_between
from colift.team.plan import plan, wrench_map

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


def planned(team: Team, reference: ReferencePart, times: Array) -> Planned:
    """What is planned of a rigid load's cables and drones at times that are evenly spaced."""
    assert team.body is not None
    directions, tensions = plan(team)
    share = tensions[:, None] * directions / (team.load_mass * team.gravity)
    pulls, ends = np.empty((2, len(times), team.n, 3))
    for k, time in enumerate(times):
        motion, attitude, rates = reference.pose(team, float(time))
        R = matrix_of(attitude)
        pulls[k] = _pulls(team, share, R, motion[2], rates)
        ends[k] = motion[0] + team.body.attachments @ R.T
    sizes = np.linalg.norm(pulls, axis=2)
    step = float(times[1] - times[0])
    places = ends - team.cable_lengths[:, None] * pulls / sizes[..., None]
    upward = np.array([0.0, 0.0, team.gravity])
    thrusts = team.masses[:, None] * (_bend(places, step) + upward) - pulls
    aims = thrusts / np.linalg.norm(thrusts, axis=2, keepdims=True)
    return Planned(sizes, np.linalg.norm(_bend(aims, step), axis=2))


def planned_directions(team: Team, reference: ReferencePart) -> Array:
    """Directions (n, 3) of a rigid load's cables, from drone to load, that are planned at the start."""
    directions, tensions = plan(team)
    share = tensions[:, None] * directions / (team.load_mass * team.gravity)
    motion, attitude, rates = reference.pose(team)
    pulls = _pulls(team, share, matrix_of(attitude), motion[2], rates)
    return np.asarray(pulls / np.linalg.norm(pulls, axis=1, keepdims=True))


def _pulls(team: Team, share: Array, R: Array, acceleration: Array, rates: Array) -> Array:
    """Planned force of each cable on its drone (n, 3), N, for a pose ``R`` in motion."""
    assert team.body is not None
    Omega, turning, c, J = rates[0], rates[1], team.body.centre, team.body.inertia
    moment = R @ (J @ turning + np.cross(Omega, J @ Omega))
    bend = R @ (np.cross(turning, c) + np.cross(Omega, np.cross(Omega, c)))
    force = team.load_mass * (acceleration + bend + [0.0, 0.0, team.gravity])
    size = float(np.linalg.norm(force))
    half = 0.5 * math.atan2(R[1, 0], R[0, 0])
    turned = matrix_of([math.cos(half), 0.0, 0.0, math.sin(half)])
    lean = rotation_between(np.array([0.0, 0.0, 1.0]), force / size)
    w = size * share @ (lean @ turned).T
    G = wrench_map(team.levers @ R.T)
    missing = np.concatenate([force, moment]) + G @ w.ravel()
    return np.asarray(w - (np.linalg.pinv(G) @ missing).reshape(w.shape))


def _bend(values: Array, step: float) -> Array:
    """Second derivative along the first axis; NaN at both ends."""
    found = np.full_like(values, np.nan)
    found[1:-1] = (values[2:] - 2.0 * values[1:-1] + values[:-2]) / step**2
    return found


def planned_checks(frame: Frame, parts: Mapping[str, Part]) -> Iterable[Problem]:
    """A problem where the reference of a rigid load asks a drone for a faster turn than its rotors give."""
    drones, reference = frame.first_drones(), parts["reference"]
    assert isinstance(reference, ReferencePart)
    team = frame.team.of(drones)
    if team.body is None or team.gravity == 0.0 or team.n < 3:
        return
    count = min(MOST, max(8, round(frame.timing.duration / STEP)))
    times = np.linspace(0.0, frame.timing.duration, count)
    found = planned(team, reference, times)
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
