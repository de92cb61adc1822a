"""Lead a configuration that breaks a limit back: a rate-limited repulsion on the sphere.

Before the optimisation of a cycle, cables that are too close are pushed apart along their great circles
and cables outside the cone are turned towards the vertical, all within a part of what the rate
limit allows. A move is taken only if it leaves no broken limit worse and breaks no other; the limits
of this cycle are then set between where the configuration was and where it is now, and the proximal
term holds what was gained. Cables move one after the other, so that one that is stuck does not
hold up the others.

Coincident cables have no direction to part in: the golden angle gives each its own.

This file imports only the compiler front end, thresholds and the limits on distances.
"""

from __future__ import annotations

import math

from colift.control.allocation.limits import distance
from colift.kernel.jit import inline
from colift.kernel.rounding import NO_WORSE

BUFFER = 0.02
"""Aim this much inside the limits, rad."""
SHARE = 0.7
"""Part of the rate limit that recovery may use; the optimisation has the rest."""
SWEEPS = 12
"""Sweeps of the repulsion in one cycle."""
FIRM = 10.0
"""Largest push between two cables that are too close, in shares of the load."""


@inline
def window(n, cosine, alpha):  # type: ignore[no-untyped-def]
    """Along x, how far apart two directions with this or a larger cosine can be; 4, all, where they are not in order."""
    for i in range(1, n):
        if alpha[3 * i] < alpha[3 * i - 3]:
            return 4.0
    return math.sqrt(max(2.0 - 2.0 * cosine, 0.0)) + 1e-6


@inline
def is_broken(n, cos_angle, cos_cone, margin, apart, alpha):  # type: ignore[no-untyped-def]
    """Whether any pair or any cable's place in the cone has no more than a margin (cosine).

    ``cos_angle`` is that of the widest angle that any pair keeps.
    """
    wide = window(n, cos_angle - margin, alpha)
    begin = 0
    for i in range(n):
        x, y, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        if not -z - cos_cone > margin:
            return True
        while x - alpha[3 * begin] > wide:
            begin += 1
        for j in range(begin, i):
            c = x * alpha[3 * j] + y * alpha[3 * j + 1] + z * alpha[3 * j + 2]
            if not cos_angle - c > margin and not (
                apart.capped and distance.cap_of(n, i, j, apart) - c > margin
            ):
                return True
    return apart.stacked and distance.is_too_near(n, apart, margin, alpha)


@inline
def push_of(n, i, aim, rim, apart, alpha):  # type: ignore[no-untyped-def]
    """Tangential push on cable i, rad: half of every deficit of angle or distance, all of that from the cone."""
    x, y, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
    cos_aim = math.cos(aim)
    px = py = pz = 0.0
    for j in range(n):
        if j == i:
            continue
        c = x * alpha[3 * j] + y * alpha[3 * j + 1] + z * alpha[3 * j + 2]
        if c <= cos_aim:
            continue
        wanted = aim
        if apart.capped:
            wanted = math.acos(distance.cap_of(n, i, j, apart)) + BUFFER
            if c <= math.cos(wanted):
                continue
        dx = x - alpha[3 * j]
        dy = y - alpha[3 * j + 1]
        dz = z - alpha[3 * j + 2]
        norm = math.sqrt(dx * dx + dy * dy + dz * dz)
        if norm < 1e-4:
            angle = 2.399963229728653 * i
            dx, dy, dz = math.cos(angle), math.sin(angle), 0.5 * math.cos(1.7 * angle)
            norm = math.sqrt(dx * dx + dy * dy + dz * dz)
        push = 0.5 * (wanted - math.acos(min(c, 1.0))) / norm
        px += push * dx
        py += push * dy
        pz += push * dz
    if -z < math.cos(rim):
        # Along the meridian to the vertical; straight up has no meridian of its own.
        push = math.acos(max(-z, -1.0)) - rim
        h = math.sqrt(x * x + y * y)
        ex, ey = (x / h, y / h) if h > 1e-6 else (math.cos(2.4 * i), math.sin(2.4 * i))
        px += push * z * ex
        py += push * z * ey
        pz -= push * h
    if apart.stacked:
        ax, ay, az = distance.push_apart(n, i, BUFFER, apart, alpha)
        px, py, pz = px + ax, py + ay, pz + az
    return px, py, pz


@inline
def is_no_worse(n, i, x, y, z, cos_angle, cos_cone, apart, alpha):  # type: ignore[no-untyped-def]
    """Whether cable i may move to (x, y, z): no kept limit breaks, no broken one gets worse."""
    u, v, w = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
    if -z - cos_cone < min(NO_WORSE, -w - cos_cone):
        return False
    for j in range(n):
        if j != i:
            new = x * alpha[3 * j] + y * alpha[3 * j + 1] + z * alpha[3 * j + 2]
            old = u * alpha[3 * j] + v * alpha[3 * j + 1] + w * alpha[3 * j + 2]
            most = distance.cap_of(n, i, j, apart) if apart.capped else cos_angle
            if most - new < min(NO_WORSE, most - old):
                return False
            if apart.stacked:
                a, b, c = alpha[3 * j], alpha[3 * j + 1], alpha[3 * j + 2]
                left = distance.room(i, j, apart, x, y, z, a, b, c)
                if left < min(NO_WORSE, distance.room(i, j, apart, u, v, w, a, b, c)):
                    return False
    return True


@inline
def lead_back(n, min_angle, cone, delta, start, apart, alpha):  # type: ignore[no-untyped-def]
    """Move ``alpha`` from ``start`` towards the limits, cable by cable, each within its rate.

    ``min_angle`` is the widest that any pair keeps.
    """
    cos_angle, cos_cone = math.cos(min_angle), math.cos(cone)
    aim = min_angle + BUFFER
    rim = max(cone - BUFFER, 0.5 * cone)
    chord = 2.0 * math.sin(0.5 * SHARE * delta)
    for _ in range(SWEEPS):
        moved = False
        for i in range(n):
            px, py, pz = push_of(n, i, aim, rim, apart, alpha)
            size = math.sqrt(px * px + py * py + pz * pz)
            if size < 1e-9:
                continue
            scale = min(1.0, chord / size)
            for _ in range(4):
                x = alpha[3 * i] + scale * px
                y = alpha[3 * i + 1] + scale * py
                z = alpha[3 * i + 2] + scale * pz
                norm = 1.0 / math.sqrt(x * x + y * y + z * z)
                dx = x * norm - start[3 * i]
                dy = y * norm - start[3 * i + 1]
                dz = z * norm - start[3 * i + 2]
                length = math.sqrt(dx * dx + dy * dy + dz * dz)
                part = chord / length if length > chord else 1.0
                x = start[3 * i] + part * dx
                y = start[3 * i + 1] + part * dy
                z = start[3 * i + 2] + part * dz
                norm = 1.0 / math.sqrt(x * x + y * y + z * z)
                x *= norm
                y *= norm
                z *= norm
                if is_no_worse(n, i, x, y, z, cos_angle, cos_cone, apart, alpha):
                    alpha[3 * i] = x
                    alpha[3 * i + 1] = y
                    alpha[3 * i + 2] = z
                    moved = True
                    break
                scale *= 0.3
        if not moved:
            break
