"""Boxes, upright cylinders and spheres that stand in the way: how far drones, cables and load are from them.

An obstacle is a row of eight numbers: kind, centre (3), half sizes (3), rounding. Boxes stand along the axes; a sphere is a box
without size that is rounded by its radius; the first half size of an upright cylinder is its radius, the last half its height.
Here a drone counts as a ball of its radius, or as its centre where that is not known; a cable as straight from the drone to its end;
the load as a point, or as the corners of its box.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BOX, CYLINDER = 0.0, 1.0
WIDTH = 8
STEPS = 30
"""Of the search for a cable's nearest point, each of which leaves two thirds."""
CELLS = 2_000_000
"""Distances that are held at a time."""


class Bodies(NamedTuple):
    """A team at many moments, world frame, m."""

    radii: Array
    """Of the drones (n,), m; NaN where it is not known."""
    positions: Array
    """Of the drones (rows, n, 3)."""
    ends: Array
    """Of the cables on the load (rows, n, 3)."""
    attached: Array
    """1 while a cable holds (rows, n)."""
    load: Array
    """Points of the load (rows, p, 3)."""

    def of(self, rows: slice) -> Bodies:
        """At some of these moments."""
        return Bodies(self.radii, *(each[rows] for each in self[1:]))


class Touch(NamedTuple):
    """Where a team and its obstacles first meet."""

    row: int
    text: str
    """Who touches which, with drones by their place ``{0}``, ``{1}``."""
    obstacle: int


def distances(obstacles: Array, points: Array) -> Array:
    """Signed distance of points (..., 3) to each of m obstacles (..., m), m; below 0 inside."""
    return _distance(obstacles, points[..., None, :])


def _distance(obstacles: Array, points: Array) -> Array:
    """The same of points that go with the obstacles, row by row."""
    d = points - obstacles[..., 1:4]
    q = np.abs(d) - obstacles[..., 4:7]
    upright = obstacles[..., 0] == CYLINDER
    rho = np.hypot(d[..., 0], d[..., 1]) - obstacles[..., 4]
    q[..., 0] = np.where(upright, rho, q[..., 0])
    q[..., 1] = np.where(upright, rho, q[..., 1])
    out = np.maximum(q, 0.0)
    out[..., 1] = np.where(upright, 0.0, out[..., 1])
    inside = np.minimum(q.max(axis=-1), 0.0)
    return np.asarray(np.sqrt((out**2).sum(axis=-1)) + inside - obstacles[..., 7])


def _along(obstacles: Array, begin: Array, span: Array) -> Array:
    """Least distance (k,) of cables from ``begin`` (k, 3) over ``span`` to the obstacle of the same row; it is convex along a cable."""
    low, high = np.zeros(len(begin)), np.ones(len(begin))

    def at(share: Array) -> Array:
        return _distance(obstacles, begin + share[:, None] * span)

    for _ in range(STEPS):
        a, b = low + (high - low) / 3.0, high - (high - low) / 3.0
        nearer = at(a) <= at(b)
        low, high = np.where(nearer, low, a), np.where(nearer, b, high)
    return at(0.5 * (low + high))


def corners(size: Array, places: Array, attitudes: Array) -> Array:
    """Corners and middle (rows, 9, 3) of a load's box, from its places (rows, 1, 3) and attitudes (rows, 4), wxyz."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)] + [[0, 0, 0]])
    arms = 0.5 * signs * np.asarray(size)
    w, v = attitudes[:, :1, None], attitudes[:, None, 1:]
    across = 2.0 * np.cross(v, arms[None])
    return np.asarray(places + arms + w * across + np.cross(v, across))


def clearances(obstacles: Array, bodies: Bodies, enough: float = math.inf) -> Array:
    """Room (rows, p + 2 n, m) between points of the load, drones and cables, in this order, and each obstacle, m.

    Of a cable that is further away than ``enough`` it is no more than told; of one that holds nothing there is none: inf.
    """
    radii = np.nan_to_num(bodies.radii)
    load = distances(obstacles, bodies.load)
    drones = distances(obstacles, bodies.positions) - radii[:, None]
    span = bodies.ends - bodies.positions
    half = 0.5 * np.linalg.norm(span, axis=-1, keepdims=True)
    cables = distances(obstacles, bodies.positions + 0.5 * span) - half
    cables[bodies.attached <= 0.0] = math.inf
    row, drone, obstacle = np.nonzero(cables < enough)
    cables[row, drone, obstacle] = _along(
        obstacles[obstacle], bodies.positions[row, drone], span[row, drone]
    )
    return np.concatenate([load, drones, cables], axis=1)


def _parts(obstacles: Array, bodies: Bodies) -> list[slice]:
    """Stretches of rows that are looked at at a time."""
    wide = (bodies.load.shape[1] + 2 * bodies.radii.size) * len(obstacles)
    rows = max(1, CELLS // wide)
    return [slice(k, k + rows) for k in range(0, len(bodies.positions), rows)]


def least_clearance(obstacles: Array, bodies: Bodies) -> float:
    """Least room between any of them and any obstacle at any time, m; NaN without obstacles."""
    if not len(obstacles):
        return math.nan
    least = math.inf
    for rows in _parts(obstacles, bodies):
        part = bodies.of(rows)
        bare = part._replace(attached=np.zeros_like(part.attached))
        least = min(least, float(np.nanmin(clearances(obstacles, bare), initial=math.inf)))
        least = min(least, float(np.nanmin(clearances(obstacles, part, least), initial=math.inf)))
    return least


def first_touch(obstacles: Array, bodies: Bodies) -> Touch | None:
    """When and what first touches an obstacle; None where nothing does."""
    n, points = bodies.radii.size, bodies.load.shape[1]
    for rows in _parts(obstacles, bodies) if len(obstacles) else []:
        near = clearances(obstacles, bodies.of(rows), 0.0) < 0.0
        hit = np.flatnonzero(near.any(axis=(1, 2)))
        if hit.size:
            who, which = np.argwhere(near[hit[0]])[0]
            drone = f"{{{(who - points) % n}}}"
            text = "the load" if who < points else f"drone {drone}"
            text = f"the cable of {text}" if who >= points + n else text
            return Touch(rows.start + int(hit[0]), f"{text} touched obstacle {which}", int(which))
    return None
