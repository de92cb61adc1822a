"""Distances in metres between drones, and from drones to other drones' cables, as limits on the cables' directions.

Drone i flies at ``x_i = e - L_i alpha_i``, with the end ``e`` of all cables on a point load. Between two drones,
``u = L_i alpha_i - L_j alpha_j``.

A sphere. ``|u|^2 = L_i^2 + L_j^2 - 2 L_i L_j c`` with ``c = alpha_i.alpha_j``: to stay ``d`` apart is a least angle of that pair,
``c <= (L_i^2 + L_j^2 - d^2) / (2 L_i L_j)``; with equal lengths the angle is ``2 asin(d / 2L)``.

A cable. The point of cable j nearest to drone i is the foot of the perpendicular, at ``L_i c`` from the load, or an end of
the cable. The distance falls as c grows, so it too is a least angle: ``c <= sqrt(1 - d^2 / L_i^2)`` where the foot lies on the
cable, that of the two drones where it lies beyond drone j, and none can be kept where ``L_i < d``, since the cable ends at the load.

So each pair has a *cap*, the largest cosine that all three limits allow. A table holds it above its diagonal and below
it which of them that is.

An ellipsoid. Rotors blow downwards, so drones want more room above each other: ``|S u| >= d``, ``S = diag(1, 1, 1/stretch)``. That is
no function of c. As a limit of the iteration, in units of ``L_i L_j``::

    g = |S u|^2 / (2 L_i L_j) - d^2 / (2 L_i L_j) >= 0,     r = sqrt(L_i / L_j)
      = 1/2 |S v|^2 - q,                                    v = r alpha_i - alpha_j / r

which is ``c_max - c`` for spheres and equal lengths. Gradients: ``r S^2 v`` by ``alpha_i``, ``-S^2 v / r`` by ``alpha_j``; second
derivatives ``r^2 S^2``, ``-S^2``, ``S^2 / r^2``. As ``|S u| >= |u| / stretch``, caps may imply it.

Kernels of this file import only the compiler front end.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from colift.kernel.jit import inline

Array = NDArray[np.float64]

ANGLE, DRONES, CABLE = 64.0, 128.0, 256.0
"""Bits of :attr:`~colift.control.allocation.base.Allocation.active_limits`: what limits a pair."""
WIDEST = math.radians(150.0)
"""Widest angle that a pair is asked for, rad; distances that ask for more are refused before."""


class Apart(NamedTuple):
    """Distances of one cycle: tables of the team, and the order in which the cycle has the cables."""

    capped: bool
    """Pairs have caps of their own, else all have the same least angle."""
    stacked: bool
    """Ellipsoids are to be kept as well."""
    flat: float
    """``1 / stretch^2``."""
    table: Any
    """Caps and what they stem from (n * n), in the team's order."""
    length: Any
    """Of each cable (n), m, in the cycle's order."""
    size: Any
    """Of each drone (n), m: two stay their mean apart."""
    order: Any


@inline
def cap_of(n, i, j, apart):  # type: ignore[no-untyped-def]
    """Largest cosine between cables i and j of the cycle."""
    a, b = int(apart.order[i]), int(apart.order[j])
    return apart.table[n * min(a, b) + max(a, b)]


@inline
def cause_of(n, i, j, apart):  # type: ignore[no-untyped-def]
    """Which limit that is, as a bit."""
    a, b = int(apart.order[i]), int(apart.order[j])
    return apart.table[n * max(a, b) + min(a, b)]


@inline
def room(i, j, apart, x, y, z, u, v, w):  # type: ignore[no-untyped-def]
    """``g`` of the ellipsoid for cables i along ``(x, y, z)`` and j along ``(u, v, w)``."""
    root = math.sqrt(apart.length[i] / apart.length[j])
    back = 1.0 / root
    size = 0.5 * (apart.size[i] + apart.size[j])
    x, y, z = root * x - back * u, root * y - back * v, root * z - back * w
    square = size * size / (apart.length[i] * apart.length[j])
    return 0.5 * (x * x + y * y + apart.flat * z * z - square)


@inline
def is_too_near(n, apart, margin, alpha):  # type: ignore[no-untyped-def]
    """Whether any pair of ellipsoids has no more than a margin."""
    for i in range(n):
        x, y, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        for j in range(i):
            u, v, w = alpha[3 * j], alpha[3 * j + 1], alpha[3 * j + 2]
            if not room(i, j, apart, x, y, z, u, v, w) > margin:
                return True
    return False


@inline
def broken(n, apart, margin, alpha):  # type: ignore[no-untyped-def]
    """Bits of the distances that some pair does not keep."""
    drones = cable = False
    for i in range(n):
        x, y, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        for j in range(i):
            u, v, w = alpha[3 * j], alpha[3 * j + 1], alpha[3 * j + 2]
            if apart.capped and cap_of(n, i, j, apart) - (x * u + y * v + z * w) < -margin:
                drones = drones or cause_of(n, i, j, apart) == DRONES
                cable = cable or cause_of(n, i, j, apart) == CABLE
            if apart.stacked and room(i, j, apart, x, y, z, u, v, w) < -margin:
                drones = True
    return (int(DRONES) if drones else 0) | (int(CABLE) if cable else 0)


@inline
def near_ellipsoids(n, m, reach, delta, kappa, sure, slack, firm, start, apart, work):  # type: ignore[no-untyped-def]
    """List the pairs whose ellipsoids may touch in this cycle, or come within ``reach`` (rad) of that, behind m rows.

    As :func:`colift.control.allocation.limits.cycle.near_pairs` does with angles; the number of rows with these.
    """
    alpha, pairs, first = work.alpha, work.pairs, work.first
    length = apart.length
    for i in range(n):
        x, y, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        for j in range(i):
            u, v, w = alpha[3 * j], alpha[3 * j + 1], alpha[3 * j + 2]
            mean = math.sqrt(length[i] * length[j])
            size = 0.5 * (apart.size[i] + apart.size[j])
            seen = size + max(reach * mean, (length[i] + length[j]) * delta)
            limit = 0.5 * (size / mean) ** 2
            edge = 0.5 * (seen / mean) ** 2 - limit
            g = room(i, j, apart, x, y, z, u, v, w)
            if g < edge:
                first[i] = min(first[i], j)
                work.strong[i] = min(work.strong[i], j)
                pairs[2 * m] = i
                pairs[2 * m + 1] = j
                fade = min(1.0 - g / edge, 1.0)
                fade *= 2.0 - fade
                work.kappa_pair[m] = kappa * fade * fade
                work.cos_max[m] = limit
                work.cause[m] = DRONES
                work.root[m] = length[i] / mean
                if g <= sure:
                    before = room(
                        i, j, apart, start[3 * i], start[3 * i + 1], start[3 * i + 2],
                        start[3 * j], start[3 * j + 1], start[3 * j + 2],
                    )  # fmt: skip
                    work.cos_max[m] = limit + min(0.0, min(0.5 * (before + g), g - slack))
                    g += limit - work.cos_max[m]
                    work.kappa_pair[m] = min(work.kappa_pair[m], firm * g)
                m += 1
    return m


@inline
def margins(n, caps, m, begin, work, g):  # type: ignore[no-untyped-def]
    """Values of the rows from ``caps`` to ``m``, into ``g`` from ``begin`` on."""
    alpha, pairs, root = work.alpha, work.pairs, work.root
    for k in range(caps, m):
        i = 3 * int(pairs[2 * k])
        j = 3 * int(pairs[2 * k + 1])
        r = root[k]
        back = 1.0 / r
        x = r * alpha[i] - back * alpha[j]
        y = r * alpha[i + 1] - back * alpha[j + 1]
        z = r * alpha[i + 2] - back * alpha[j + 2]
        g[begin + k] = 0.5 * (x * x + y * y + work.flat * z * z) - work.cos_max[k]


@inline
def add_gradient(caps, m, begin, work, G):  # type: ignore[no-untyped-def]
    """Their barriers' part of the gradient by the directions, world frame, added to ``G`` (3n)."""
    alpha, pairs, root = work.alpha, work.pairs, work.root
    for k in range(caps, m):
        i = 3 * int(pairs[2 * k])
        j = 3 * int(pairs[2 * k + 1])
        r = root[k]
        back = 1.0 / r
        primal = work.kappa_pair[k] / work.g[begin + k]
        x = r * alpha[i] - back * alpha[j]
        y = r * alpha[i + 1] - back * alpha[j + 1]
        z = work.flat * (r * alpha[i + 2] - back * alpha[j + 2])
        G[i] -= primal * r * x
        G[i + 1] -= primal * r * y
        G[i + 2] -= primal * r * z
        G[j] += primal * back * x
        G[j + 1] += primal * back * y
        G[j + 2] += primal * back * z


@inline
def assemble(n, caps, m, begin, width, block_of, work):  # type: ignore[no-untyped-def]
    """Their part of gradients and Hessians, into ``rows`` (``width`` each) and the blocks of ``K``.

    ``block_of``: :func:`colift.control.allocation.limits.newton.block_of`.
    """
    T, alpha, pairs, root, rows, K = work.T, work.alpha, work.pairs, work.root, work.rows, work.K
    flat = work.flat
    for k in range(caps, m):
        i = int(pairs[2 * k])
        j = int(pairs[2 * k + 1])  # j < i
        oi = width * i
        oj = width * j
        r = root[k]
        back = 1.0 / r
        gk = work.g[begin + k]
        zk = work.z[begin + k]
        stiff = zk / gk
        primal = work.kappa_pair[k] / gk
        aix, aiy, aiz = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        ajx, ajy, ajz = alpha[3 * j], alpha[3 * j + 1], alpha[3 * j + 2]
        x = r * aix - back * ajx
        y = r * aiy - back * ajy
        z = flat * (r * aiz - back * ajz)
        bi0, bi1, bi2 = rows[oi], rows[oi + 1], rows[oi + 2]
        di0, di1, di2 = rows[oi + 3], rows[oi + 4], rows[oi + 5]
        bj0, bj1, bj2 = rows[oj], rows[oj + 1], rows[oj + 2]
        dj0, dj1, dj2 = rows[oj + 3], rows[oj + 4], rows[oj + 5]
        # Of -g, in each cable's frame, as for the caps.
        ui1 = -r * (bi0 * x + bi1 * y + bi2 * z)
        ui2 = -r * (di0 * x + di1 * y + di2 * z)
        uj1 = back * (bj0 * x + bj1 * y + bj2 * z)
        uj2 = back * (dj0 * x + dj1 * y + dj2 * z)
        rows[oi + 6] += zk * ui1
        rows[oi + 7] += zk * ui2
        rows[oj + 6] += zk * uj1
        rows[oj + 7] += zk * uj2
        rows[oi + 8] += primal * ui1
        rows[oi + 9] += primal * ui2
        rows[oj + 8] += primal * uj1
        rows[oj + 9] += primal * uj2
        around = r * (aix * x + aiy * y + aiz * z)
        bend = zk * r * r
        rows[oi + 10] += stiff * ui1 * ui1 + zk * around
        rows[oi + 10] -= bend * (bi0 * bi0 + bi1 * bi1 + flat * bi2 * bi2)
        rows[oi + 11] += stiff * ui1 * ui2 - bend * (bi0 * di0 + bi1 * di1 + flat * bi2 * di2)
        rows[oi + 12] += stiff * ui2 * ui2 + zk * around
        rows[oi + 12] -= bend * (di0 * di0 + di1 * di1 + flat * di2 * di2)
        around = -back * (ajx * x + ajy * y + ajz * z)
        bend = zk * back * back
        rows[oj + 10] += stiff * uj1 * uj1 + zk * around
        rows[oj + 10] -= bend * (bj0 * bj0 + bj1 * bj1 + flat * bj2 * bj2)
        rows[oj + 11] += stiff * uj1 * uj2 - bend * (bj0 * dj0 + bj1 * dj1 + flat * bj2 * dj2)
        rows[oj + 12] += stiff * uj2 * uj2 + zk * around
        rows[oj + 12] -= bend * (dj0 * dj0 + dj1 * dj1 + flat * dj2 * dj2)
        scale = 1.0 / (T[i] * T[j])
        top, down, right = block_of(n, i, j, work)
        low = top + down
        across = bi0 * bj0 + bi1 * bj1 + flat * bi2 * bj2
        K[top] += scale * (stiff * ui1 * uj1 + zk * across)
        across = bi0 * dj0 + bi1 * dj1 + flat * bi2 * dj2
        K[top + right] += scale * (stiff * ui1 * uj2 + zk * across)
        across = di0 * bj0 + di1 * bj1 + flat * di2 * bj2
        K[low] += scale * (stiff * ui2 * uj1 + zk * across)
        across = di0 * dj0 + di1 * dj1 + flat * di2 * dj2
        K[low + right] += scale * (stiff * ui2 * uj2 + zk * across)


@inline
def push_apart(n, i, buffer, apart, alpha):  # type: ignore[no-untyped-def]
    """Tangential push on cable i, rad: half of every deficit of an ellipsoid's distance."""
    x, y, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
    length, flat = apart.length, apart.flat
    px = py = pz = 0.0
    for j in range(n):
        if j == i:
            continue
        u = length[i] * x - length[j] * alpha[3 * j]
        v = length[i] * y - length[j] * alpha[3 * j + 1]
        w = length[i] * z - length[j] * alpha[3 * j + 2]
        aim = 0.5 * (apart.size[i] + apart.size[j]) + buffer * math.sqrt(length[i] * length[j])
        far = math.sqrt(u * u + v * v + flat * w * w)
        if far >= aim:
            continue
        w *= flat
        along = u * x + v * y + w * z
        u, v, w = u - along * x, v - along * y, w - along * z
        slope = math.sqrt(u * u + v * v + w * w)
        if slope < 1e-3 * aim:
            # One above the other along the cable: each goes its own way.
            angle = 2.399963229728653 * i
            u, v, w = math.cos(angle), math.sin(angle), 0.5 * math.cos(1.7 * angle)
            along = u * x + v * y + w * z
            u, v, w = u - along * x, v - along * y, w - along * z
            slope = math.sqrt(u * u + v * v + w * w)
            far = slope
        push = min(0.5 * (aim - min(far, aim)) * max(far, 0.1 * aim) / (length[i] * slope), 0.5)
        px += push * u / slope
        py += push * v / slope
        pz += push * w / slope
    return px, py, pz


def angles_of(lengths: Array, sizes: Array, clearances: Array, least: float) -> tuple[Array, Array]:
    """Least angle (n, n) of every pair, rad, and which limit asks for it, as a bit (n, n); for a point load.

    Parameters
    ----------
    lengths : (n,) array
        Of the cables, m.
    sizes : (n,) array
        Two drones' centres stay the mean of theirs apart, as spheres, m; 0: no limit.
    clearances : (n,) array
        A drone's centre stays this far from others' cables, m; 0: no limit.
    least : float
        Angle that every pair keeps, rad.

    """
    a, b = lengths[:, None], lengths[None, :]
    apart = 0.5 * (sizes[:, None] + sizes[None, :])
    cos_drones = np.where(apart > 0.0, (a * a + b * b - apart**2) / (2.0 * a * b), np.inf)
    near = np.broadcast_to(clearances[:, None], cos_drones.shape)  # drone i to cable j
    foot = np.sqrt(np.maximum(a * a - near**2, 0.0))
    cos_cable = np.where(foot <= b, foot / a, (a * a + b * b - near**2) / (2.0 * a * b))
    cos_cable = np.where(near > 0.0, cos_cable, np.inf)
    cos_cable = np.minimum(cos_cable, cos_cable.T)
    cosines = np.minimum(cos_drones, cos_cable)
    angles = np.where(cosines < math.cos(least), np.arccos(np.clip(cosines, -1.0, 1.0)), least)
    causes = np.where(cos_cable < cos_drones, CABLE, DRONES)
    return angles, np.where(cosines < math.cos(least), causes, ANGLE)


def distances(
    lengths: Array, directions: Array, stretch: float = 1.0, ends: Array | None = None
) -> tuple[Array, Array]:
    """Of drones from each other, in the ellipsoid's norm, and of each drone from each other's cable.

    Parameters
    ----------
    lengths : (n,) array
        Of the cables, m.
    directions : (..., n, 3) array
        From the drones to the load.
    stretch : float
        How much longer than wide the ellipsoid is.
    ends : (..., n, 3) array, optional
        Where the cables end on the load, m; all at one point when left out.

    Returns
    -------
    drones, cables : (..., n, n) array
        m; ``drones[i, j]`` between drones i and j, ``cables[i, j]`` from drone i to cable j; inf on the diagonals.

    """
    spans = lengths[:, None] * directions
    at = -spans if ends is None else ends - spans
    away = at[..., :, None, :] - at[..., None, :, :]  # of i from j
    drones = np.sqrt(np.sum((away / [1.0, 1.0, stretch]) ** 2, axis=-1))
    cable = np.broadcast_to(spans[..., None, :, :], away.shape)
    share = np.clip(np.sum(away * cable, axis=-1) / lengths**2, 0.0, 1.0)
    cables = np.linalg.norm(away - share[..., None] * cable, axis=-1)
    itself = np.arange(lengths.size)
    drones[..., itself, itself] = cables[..., itself, itself] = np.inf
    return drones, cables
