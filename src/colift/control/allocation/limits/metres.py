"""Distances in metres between drones and cables that end at different places of a load.

Cable i is the segment from its end ``e_i`` to its drone ``x_i = e_i - L_i alpha_i``. With the nearest points ``p = e_i - t_i L_i alpha_i`` and
``q = e_j - t_j L_j alpha_j`` of a pair, and the unit normal ``nu``, along which ``q`` is away from ``p``::

    g = |S (p - q)| - d,    dg/dalpha_i = -t_i L_i nu,    dg/dalpha_j = t_j L_j nu,    nu = S^2 (p - q) / |S (p - q)|

Between drones both ``t`` are 1 and ``S = diag(1, 1, 1/stretch)``, for rotors blow downwards; else ``S`` is the identity. The ends' places
are those of the wanted attitude, so that noise of the measured one moves no limit.

A distance has no sign: two cables that have passed through each other are apart again. So the normal of the cycle's start is kept,
and one that has turned by more than a right angle counts as a distance that is broken.

Kernels of this file import only the compiler front end.
"""

from __future__ import annotations

import math

from colift.kernel.jit import inline

DRONES, ROTOR, ROTOR_BACK, CABLES = 0, 1, 2, 3
"""What of a pair: its drones, the first drone and the second cable, the other way round, its cables."""
KINDS = 4
PASSED = -1.0
"""Margin of a pair that has passed through itself, m."""


@inline
def closest(a, b, c, d, e):  # type: ignore[no-untyped-def]
    """Nearest points of two segments, as parts of their lengths.

    Between ``u s`` and ``r + v t``, 0 <= s, t <= 1: ``a = u.u``, ``b = u.v``, ``c = v.v``, ``d = u.r``, ``e = v.r``.
    """
    square = a * c - b * b
    s = 0.0
    if square > 1e-12 * a * c:
        s = min(max((d * c - b * e) / square, 0.0), 1.0)
    t = (b * s - e) / c
    if t < 0.0:
        t = 0.0
        s = min(max(d / a, 0.0), 1.0)
    elif t > 1.0:
        t = 1.0
        s = min(max((d + b) / a, 0.0), 1.0)
    return s, t


@inline
def apart(kind, flat, ex, ey, ez, px, py, pz, qx, qy, qz):  # type: ignore[no-untyped-def]
    """Distance of a pair, m, its unit normal in the norm's sense, and the parts of both cables' lengths.

    ``e`` is from the second end to the first, ``p`` from the first end to its drone, ``q`` from the second to its own; ``flat`` is
    ``1 / stretch^2``.
    """
    s, t = 1.0, 1.0
    if kind != DRONES:
        a = px * px + py * py + pz * pz
        b = px * qx + py * qy + pz * qz
        c = qx * qx + qy * qy + qz * qz
        d = -(px * ex + py * ey + pz * ez)
        e = -(qx * ex + qy * ey + qz * ez)
        if kind == CABLES:
            s, t = closest(a, b, c, d, e)
        elif kind == ROTOR:
            t = min(max((b - e) / c, 0.0), 1.0)
        else:
            s = min(max((b + d) / a, 0.0), 1.0)
        flat = 1.0
    x, y, z = ex + s * px - t * qx, ey + s * py - t * qy, ez + s * pz - t * qz
    size = math.sqrt(x * x + y * y + flat * z * z)
    if size < 1e-9:
        return 0.0, 1.0, 0.0, 0.0, s, t
    scale = 1.0 / size
    return size, x * scale, y * scale, flat * z * scale, s, t
