"""Distances from points and cables to obstacles, with gradients: signed, convex for each obstacle.

Obstacles are rows as those of :mod:`colift.team.obstacles`, which measures flights.
"""

from __future__ import annotations

import math

from colift.kernel.jit import aside
from colift.team.obstacles import CYLINDER

STEPS = 14
"""Of the search for a cable's nearest point, each of which leaves two thirds."""


@aside
def distance(o, px, py, pz):  # type: ignore[no-untyped-def]
    """Signed distance of a point to the obstacle ``o``, and its gradient; below 0 inside."""
    dx, dy, dz = px - o[1], py - o[2], pz - o[3]
    if o[0] == CYLINDER:
        rho = math.sqrt(dx * dx + dy * dy)
        a, b = rho - o[4], abs(dz) - o[6]
        nx, ny = (dx / rho, dy / rho) if rho > 1e-12 else (1.0, 0.0)
        nz = 1.0 if dz >= 0.0 else -1.0
        if a > 0.0 and b > 0.0:
            d = math.sqrt(a * a + b * b)
            return d - o[7], nx * a / d, ny * a / d, nz * b / d
        if a > b:
            return a - o[7], nx, ny, 0.0
        return b - o[7], 0.0, 0.0, nz
    sx = 1.0 if dx >= 0.0 else -1.0
    sy = 1.0 if dy >= 0.0 else -1.0
    sz = 1.0 if dz >= 0.0 else -1.0
    a, b, c = abs(dx) - o[4], abs(dy) - o[5], abs(dz) - o[6]
    if a <= 0.0 and b <= 0.0 and c <= 0.0:
        if a >= b and a >= c:
            return a - o[7], sx, 0.0, 0.0
        if b >= c:
            return b - o[7], 0.0, sy, 0.0
        return c - o[7], 0.0, 0.0, sz
    a, b, c = max(a, 0.0), max(b, 0.0), max(c, 0.0)
    d = math.sqrt(a * a + b * b + c * c)
    return d - o[7], sx * a / d, sy * b / d, sz * c / d


@aside
def along(o, px, py, pz, vx, vy, vz, enough):  # type: ignore[no-untyped-def]
    """Where on the segment ``p + t v``, t in [0, 1], the obstacle is nearest; -1 if all of it is further than ``enough``.

    The distance is convex in t, which a ternary search brackets.
    """
    d, _, _, _ = distance(o, px + 0.5 * vx, py + 0.5 * vy, pz + 0.5 * vz)
    if d > enough + 0.5 * math.sqrt(vx * vx + vy * vy + vz * vz):
        return -1.0
    a, b = 0.0, 1.0
    for _ in range(STEPS):
        s, t = a + (b - a) / 3.0, b - (b - a) / 3.0
        ds, _, _, _ = distance(o, px + s * vx, py + s * vy, pz + s * vz)
        dt, _, _, _ = distance(o, px + t * vx, py + t * vy, pz + t * vz)
        if ds <= dt:
            b = t
        else:
            a = s
    return 0.5 * (a + b)
