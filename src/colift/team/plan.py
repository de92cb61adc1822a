"""A formation that holds a rigid load in hover: a ring of drones around it, in plain NumPy.

Each cable leans outwards by the same angle, straight away from the middle where drones then are far enough apart, else towards
equal azimuths in the order of the attachments. Outward cables hold the yaw (a load that has turned is turned back) and keep drones and cables apart. The upright parts of the
tensions share the weight so that it does not tip; a last correction of least norm balances all six.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from colift.kernel.spans import BODY, LINE, POINT
from colift.team.bodies import Team
from colift.team.geometry import Array, matrix_of, quaternion_of, ring, zero_yaw_quaternion
from colift.team.load import LEVEL

LEAN = math.radians(30.0)
"""Angle of cables from the vertical, unless distances ask for more."""
LEANING = math.radians(10.0)
"""Least angle of a load that hangs only leaning: with less, the cable that faces the lost one is hardly taut."""
WIDER = math.radians(1.0)
"""Step in which the ring is widened."""
FLAT = 1e-6
"""Of ends that count as in one line or point: their extent across it over that of the load."""
SPARE = 1.15
"""Distances of the plan, over those that are asked for."""
FLOOR = 0.05
"""Least upright part of a tension, over a cable's share of the weight."""
ENOUGH = 1e-6
"""Of the weight, what a plan that holds the load may leave of it."""
APART = 0.5
"""Least angle between the azimuths of two drones, over that of equal azimuths."""
KEPT = 0.1
"""Least tension of a cable that others have left alone, over its share of the weight."""
MIDDLE = 0.15
"""Attachments that are closer to the middle than this part of the farthest one have no azimuth."""


def plan(
    team: Team,
    attitude: ArrayLike | None = None,
    *,
    lean: float = LEAN,
    widest: float = math.radians(60.0),
    distance: ArrayLike = 0.0,
    downwash: float = 2.0,
    least: ArrayLike | None = None,
) -> tuple[Array, Array]:
    """Directions (n, 3), from drone to load, and tensions (n,), N, that hold the load in this attitude.

    Parameters
    ----------
    team : Team
        Drones and load; without a body, a ring on a point.
    attitude : (4,) array
        Of the load, unit quaternion wxyz; left out, that in which it hangs (:attr:`colift.team.load.Body.hang`).
    lean, widest : float
        Angle of the cables from the vertical, rad, and how far it may grow where drones would be too near.
    distance : float or (n,) array
        Between drones, m: two keep the mean of theirs.
    downwash : float
        How much more of it drones keep above each other than beside each other.
    least : float or (n,) array, optional
        Upright part of the tensions, N; a twentieth of a cable's share of the weight when left out.

    Returns
    -------
    (directions, tensions)
        What no formation holds, such as a load whose weight lies outside of its attachments, is held as far as it can be.

    """
    if attitude is None:
        attitude = LEVEL if team.body is None else team.body.hang
    arms = team.levers @ matrix_of(attitude).T
    weight = team.load_mass * max(team.gravity, 1e-3)
    floors = np.broadcast_to(FLOOR * weight / team.n if least is None else least, team.n)
    sizes = np.broadcast_to(np.asarray(distance, dtype=float), team.n)
    needed = SPARE * 0.5 * (sizes[:, None] + sizes[None, :])
    best, most = None, -math.inf
    angles = np.arange(min(lean, widest), widest + 1e-9, WIDER)
    tried = [(angles[0], even) for even in (0.0, 0.5)] + [(angle, 1.0) for angle in angles]
    for angle, even in tried:
        along = _outward(arms, team.cable_lengths, float(angle), even)
        found = _held(arms, along, weight, floors)
        ratio = _clearance(arms, team.cable_lengths, found, needed, downwash)
        if ratio > most:
            best, most = found, ratio
        if ratio >= 1.0:
            break
    assert best is not None
    tensions = np.linalg.norm(best, axis=1)
    return np.asarray(best / tensions[:, None]), np.asarray(tensions)


def shares(team: Team, directions: Array, tensions: Array) -> Array:
    """A plan's forces (n, 3) over the load's weight, in the frame that has its heading: as kernels turn them with it."""
    forces = tensions[:, None] * directions / (team.load_mass * max(team.gravity, 1e-3))
    if team.body is None:
        return forces
    w, _, _, z = team.body.hang
    size = math.hypot(w, z)
    return forces @ matrix_of((w / size, 0.0, 0.0, z / size)) if z != 0.0 else forces


def taken_over(
    team: Team, directions: Array, acceleration: ArrayLike, attitude: ArrayLike
) -> Array:
    """A formation, as :func:`shares` gives it, of cables that stay where they are (n, 3) when others have left.

    Their tensions come as near to the load's motion, with this acceleration (3,) in this attitude (4,), as pulls can. No cable is let
    go slack.
    """
    weight = team.load_mass * max(team.gravity, 1e-3)
    force = team.load_mass * np.array(acceleration, dtype=float)
    force[2] = max(force[2] + weight, 0.1 * weight)  # as position control plans
    W = float(np.linalg.norm(force))
    arms = team.levers @ matrix_of(attitude).T
    reach = max(float(np.abs(arms).max()), 1e-6)
    columns = np.vstack([directions.T, np.cross(arms, directions).T / reach])
    wanted = np.concatenate([-force / W, np.zeros(3)])
    pulls = _at_least(
        columns, wanted, np.full(team.n, 1.0 / team.n), np.full(team.n, KEPT / team.n)
    )
    turned = matrix_of(zero_yaw_quaternion(force[None] / W)[0])
    w, _, _, z = np.asarray(attitude, dtype=float)
    size = max(math.hypot(w, z), 1e-9)
    forces = pulls[:, None] * directions
    return np.asarray(forces @ turned @ matrix_of((w / size, 0.0, 0.0, z / size)))


def unheld(team: Team, attitude: ArrayLike, directions: Array, tensions: Array) -> float:
    """What these cables leave of the load's weight and its moment in this attitude, over the weight; moments over the largest arm."""
    arms = team.levers @ matrix_of(np.asarray(attitude, dtype=float)).T
    left = wrench_map(arms) @ (tensions[:, None] * directions).ravel()
    weight = team.load_mass * max(team.gravity, 1e-3)
    left[2] += weight
    left[3:] /= max(float(np.abs(arms).max()), 1e-3)
    return float(np.abs(left).max()) / weight


def least_lean(
    team: Team, *, most: float = math.radians(20.0), **of_plan: Any
) -> tuple[float, Array] | None:
    """Least angle, rad, by which the load leans where a plan holds it, and that attitude (4,); None where none does.

    Level first, then leaning in every direction, from 10 degrees on in steps of 5: a load that has lost the cable at one corner hangs on
    the others when that corner sinks. Of one angle the direction whose smallest tension is largest.
    """
    most = most if team.n > 2 else 0.0
    angles = np.arange(LEANING, most + 1e-9, math.radians(5.0))
    for angle in (0.0, *angles):
        best, found = 0.0, None
        for azimuth in np.arange(1 if angle == 0.0 else 12) * (math.pi / 6.0):
            half = 0.5 * angle
            axis = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
            attitude = np.array([math.cos(half), *(math.sin(half) * axis)])
            directions, tensions = plan(team, attitude, **of_plan)
            if unheld(team, attitude, directions, tensions) <= ENOUGH and tensions.min() > best:
                best, found = float(tensions.min()), attitude
        if found is not None:
            return float(angle), found
    return None


def hung(team: Team) -> Array:
    """Attitude (4,) in which a load hangs on two cables: their ends level, its centre of mass below the line through them, its heading as it is."""
    level = np.array(LEVEL)
    if team.body is None or team.n != 2:
        return level
    one, other = team.levers
    line = other - one
    size = np.linalg.norm(line)
    foot = one - line * (one @ line) / max(size**2, 1e-12)
    height, across = np.linalg.norm(foot), np.linalg.norm(line[:2])
    if min(size, height, across) < 1e-6:  # it has no side that hangs down, or no heading
        return level
    own = np.array([line / size, np.cross(foot / height, line / size), foot / height])
    along = np.array([line[0], line[1], 0.0]) / across
    up = np.array([0.0, 0.0, 1.0])
    return quaternion_of(np.array([along, np.cross(up, along), up]).T @ own)


def wrench_map(arms: Array) -> Array:
    """Matrix (6, 3 n) from cable forces to their sum and their moment, for ends at ``arms`` (n, 3)."""
    x, y, z = arms.T
    zero = np.zeros_like(x)
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]])  # (3, 3, n)
    force = np.broadcast_to(np.eye(3)[:, :, None], cross.shape)
    return np.concatenate([force, cross]).transpose(0, 2, 1).reshape(6, -1)


def _outward(arms: Array, lengths: Array, angle: float, even: float) -> Array:
    """Directions (n, 3) that lean by ``angle`` from the vertical, towards a ring of drones.

    They are straight outwards, so that each pulls without turning the load; with ``even`` at 1 at equal azimuths.
    """
    n = len(arms)
    level = arms[:, :2] - arms[:, :2].mean(axis=0)
    radii = np.linalg.norm(level, axis=1)
    if radii.max() < 1e-9:
        return ring(n, angle)
    around = np.flatnonzero(radii > MIDDLE * radii.max())
    azimuth = np.arctan2(level[around, 1], level[around, 0])
    order = around[np.argsort(azimuth, kind="stable")]
    azimuth = np.sort(azimuth)
    steps = 2.0 * np.pi * np.arange(len(order)) / len(order)
    start = np.angle(np.mean(np.exp(1j * (azimuth - steps))))
    circle = radii.max() + np.max(lengths) * math.sin(angle)
    for share in np.linspace(even, 1.0, 5):
        aim = azimuth + share * np.angle(np.exp(1j * (start + steps - azimuth)))
        gaps = np.diff(aim, append=aim[0] + 2.0 * np.pi)
        if gaps.min() >= APART * steps[1] if len(order) > 1 else True:
            break
    places = circle * np.column_stack([np.cos(aim), np.sin(aim)])
    outward = np.zeros((n, 2))
    outward[order] = places - level[order]
    size = np.linalg.norm(outward, axis=1, keepdims=True)
    outward /= np.where(size > 0.0, size, 1.0)
    directions = np.empty((n, 3))
    directions[:, :2] = -math.sin(angle) * outward
    directions[:, 2] = -np.sqrt(1.0 - np.sum(directions[:, :2] ** 2, axis=1))
    return directions


def _held(arms: Array, directions: Array, weight: float, floors: Array) -> Array:
    """Cable forces (n, 3) near these directions that balance the weight."""
    n = len(arms)
    rows = np.vstack([np.ones(n), arms[:, 0], arms[:, 1]])
    wanted = np.array([weight, 0.0, 0.0])
    upright = _at_least(rows, wanted, np.full(n, weight / n), floors)
    forces = directions * (upright / -directions[:, 2])[:, None]
    balance = wrench_map(arms)
    wanted = np.array([0.0, 0.0, -weight, 0.0, 0.0, 0.0]) - balance @ forces.ravel()
    step = np.linalg.lstsq(balance, wanted, rcond=1e-9)[0].reshape(n, 3)
    corrected = forces + step
    return corrected if np.all(-corrected[:, 2] > 0.5 * floors) else forces


def _at_least(rows: Array, wanted: Array, start: Array, floors: Array) -> Array:
    """Values (n,) near ``start``, none below its floor, of which ``rows`` make what is wanted as nearly as they can."""
    values, free = start.copy(), np.ones(len(start), dtype=bool)
    for _ in start:
        step = np.linalg.lstsq(rows[:, free], wanted - rows @ values, rcond=1e-9)[0]
        values[free] += step
        low = free & (values < floors)
        if not low.any():
            break
        values[low] = floors[low]
        if low.sum() == free.sum():
            break
        free &= ~low
    return np.asarray(values)


def _clearance(arms: Array, lengths: Array, forces: Array, needed: Array, downwash: float) -> float:
    """Least distance of two drones over what is needed."""
    n = len(arms)
    if n < 2 or not needed.any():
        return math.inf
    drones = arms - lengths[:, None] * forces / np.linalg.norm(forces, axis=1, keepdims=True)
    apart = (drones[:, None, :] - drones[None, :, :]) / np.array([1.0, 1.0, downwash])
    i, j = np.triu_indices(n, k=1)
    needs = needed[i, j]
    ratio = np.linalg.norm(apart[i, j], axis=1)[needs > 0.0] / needs[needs > 0.0]
    return float(ratio.min(initial=math.inf))


def spanned(team: Team) -> tuple[float, Array]:
    """Whether the ends lie in one point, in one line or wider, and the line's unit direction (3,) in the load's frame."""
    ends = team.levers - team.levers.mean(axis=0)
    size = max(float(np.linalg.norm(team.levers, axis=1).max()), 1e-9)
    _, extents, axes = np.linalg.svd(np.vstack([ends, np.zeros((3, 3))]), full_matrices=False)
    if extents[0] <= FLAT * size:
        return POINT, np.array([0.0, 0.0, 1.0])
    return (LINE if extents[1] <= FLAT * size else BODY), axes[0]
