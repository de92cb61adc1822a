"""One cycle of the safe allocator for wrenches: an interior point for cable forces within limits, where the wrench may give way.

In forces over a cable's share of the weight, and arms over a length of the load::

    min  cost/2 sum |w_i - wbar_i|^2 + sum_k price_k |slack_k|
    s.t. sum w_i + F = slack_F,  sum r_i x w_i + M = slack_M,  every limit g > 0

Every limit of a cable is concave in ``w_i``, so that the steps to its rim are roots of quadratics and any iterate, being strictly
inside, is a command that keeps all of them:

=====  ==================================================  ==========================================
limit  ``g``                                               meaning
=====  ==================================================  ==========================================
T_MAX  ``(T_max^2 - |w|^2) / 2 T_max``                     largest tension
T_MIN  ``a.w - T_min``                                     least tension, along the last direction a
CONE   ``t (tan^2 - |y|^2) / 2 tan``                       of the vertical, ``t = axis.w``, ``y = w/t - axis``
RATE   the same about the last direction                   turn in one cycle
BOX    the same about the load's outward normal            the cable does not pass through the load
POWER  ``(f^2 - |p - w|^2) / 2 f``                         thrust of the drone
TILT   the cone of ``p - w`` about the vertical            its tilt
=====  ==================================================  ==========================================

Newton's matrix is a 3 by 3 for each cable, coupled by six rows of the wrench and one row for each pair that is near. With ``K_i`` the
inverse of a cable's matrix and ``A`` all rows, the multipliers follow from ``(sum A_i K_i A_i^T + D) y = sum A_i K_i b_i - c``. A row
of the wrench that may give way has ``D = s+/z+ + s-/z-`` of its slack ``s+ - s-``, whose multipliers are ``z+- = price -+ lam``; else zero.
Slacks are what is missing at every iterate, from the first one on, so what is missing never grows by more than the barrier.

This file imports only the compiler front end, names of places and thresholds.
"""

from __future__ import annotations

import math

from colift.control.allocation.limits import metres
from colift.kernel.jit import inline
from colift.kernel.layout import Layout
from colift.kernel.rounding import BALANCED

T_MAX, T_MIN, CONE, RATE, BOX, POWER, TILT = range(7)
LIMITS = 7

ROW = Layout(
    team={
        "a": 3, "T_min": 1, "T_max": 1, "cone": 1, "rate": 1, "box": 4, "own": 3, "f_max": 1, "tilt": 1,
        "home": 3, "end": 3, "place": 3, "g": LIMITS, "z": LIMITS, "dz": LIMITS, "slope": 3 * LIMITS, "H": 6, "b": 3, "c": 3, "w": 3, "dw": 3, "force": 3, "best": 3,
    }
)  # fmt: skip
"""Of one cable. ``cone``, ``rate``, ``tilt`` and the first of ``box`` are the tangents of half-angles, 0 where there is no limit."""
R = ROW.at
WIDTH = R.rows
WATCH = Layout(
    team={"kind": 1, "i": 1, "j": 1, "least": 1, "normal": 3, "g": 1, "z": 1, "a": 3, "b": 3, "Ka": 3, "Kb": 3}
)  # fmt: skip
"""Of one pair: the distance that it keeps, its normal at the start, and the gradient of its margin by both cables' forces."""
V = WATCH.at
PAIR = V.rows

KEEP = 0.05
"""Part of the way to the nearest rim that a step leaves."""
YIELD = 0.7
"""Part of a price from which on the cost becomes slight: the wrench may be about to give way."""
SLIGHT = 0.01
FIRM = 0.9
"""Part of a price up to which a row of the wrench is met exactly in the end."""
SHARE = 0.02
"""Of what is missing, weighted by its prices: what barriers may be blamed for in the end."""
FLOOR = 1e-9
"""Smallest barrier, in squared shares."""
NEAR = 10.0
"""Squared residual over the barrier, up to which the barrier may shrink: rims are curved, and steps along them have to stay inside."""
TRIES = 8
CONVERGED, STOPPED = 0, 1


@inline
def add(d, k, g, x, y, z, mu, fresh, data):  # type: ignore[no-untyped-def]
    """One limit with its gradient into a cable's matrix and right-hand side; its multiplier."""
    m = mu / g if fresh else data[d + R.z + k]
    data[d + R.g + k] = g
    data[d + R.z + k] = m
    o = d + R.slope + 3 * k
    data[o], data[o + 1], data[o + 2] = x, y, z
    push = 1.0 / g
    stiff = m * push
    data[d + R.H] += stiff * x * x
    data[d + R.H + 1] += stiff * x * y
    data[d + R.H + 2] += stiff * x * z
    data[d + R.H + 3] += stiff * y * y
    data[d + R.H + 4] += stiff * y * z
    data[d + R.H + 5] += stiff * z * z
    data[d + R.c] += push * x
    data[d + R.c + 1] += push * y
    data[d + R.c + 2] += push * z
    data[d + R.force] -= m * x
    data[d + R.force + 1] -= m * y
    data[d + R.force + 2] -= m * z
    return m


@inline
def add_cone(d, k, tan, ax, ay, az, wx, wy, wz, side, mu, fresh, data):  # type: ignore[no-untyped-def]
    """A cone about the unit ``a`` that holds ``w``; ``side`` is -1 where ``w`` is the cable's force turned about."""
    t = ax * wx + ay * wy + az * wz
    inverse = 1.0 / t
    yx, yy, yz = wx * inverse - ax, wy * inverse - ay, wz * inverse - az
    square = yx * yx + yy * yy + yz * yz
    half = 0.5 / tan
    g = half * t * (tan * tan - square)
    c = half * (tan * tan + square) * side
    e = -2.0 * half * side
    m = add(d, k, g, c * ax + e * yx, c * ay + e * yy, c * az + e * yz, mu, fresh, data)
    # -g'' = (I - a a' - y a' - a y' + |y|^2 a a') / (t tan)
    m *= 2.0 * half * inverse
    c = square - 1.0
    data[d + R.H] += m * (1.0 + c * ax * ax - 2.0 * ax * yx)
    data[d + R.H + 1] += m * (c * ax * ay - ax * yy - ay * yx)
    data[d + R.H + 2] += m * (c * ax * az - ax * yz - az * yx)
    data[d + R.H + 3] += m * (1.0 + c * ay * ay - 2.0 * ay * yy)
    data[d + R.H + 4] += m * (c * ay * az - ay * yz - az * yy)
    data[d + R.H + 5] += m * (1.0 + c * az * az - 2.0 * az * yz)


@inline
def add_ball(d, k, size, x, y, z, side, mu, fresh, data):  # type: ignore[no-untyped-def]
    """A ball about the origin that holds ``(x, y, z)``."""
    inverse = 1.0 / size
    g = 0.5 * inverse * (size * size - x * x - y * y - z * z)
    c = -inverse * side
    m = add(d, k, g, c * x, c * y, c * z, mu, fresh, data) * inverse
    data[d + R.H] += m
    data[d + R.H + 3] += m
    data[d + R.H + 5] += m


@inline
def assemble(n, flying, cost, mu, fresh, data):  # type: ignore[no-untyped-def]
    """Every cable's matrix, right-hand side and what its limits and cost push with, where it is now."""
    for i in range(n):
        d = WIDTH * i
        x, y, z = data[d + R.w], data[d + R.w + 1], data[d + R.w + 2]
        ax, ay, az = data[d + R.a], data[d + R.a + 1], data[d + R.a + 2]
        for k in range(6):
            data[d + R.H + k] = 0.0
        data[d + R.H] = data[d + R.H + 3] = data[d + R.H + 5] = cost
        for k in range(3):
            pull = cost * (data[d + R.w + k] - data[d + R.home + k])
            data[d + R.b + k] = -pull
            data[d + R.c + k] = 0.0
            data[d + R.force + k] = pull
        add_ball(d, T_MAX, data[d + R.T_max], x, y, z, 1.0, mu, fresh, data)
        t = ax * x + ay * y + az * z
        add(d, T_MIN, t - data[d + R.T_min], ax, ay, az, mu, fresh, data)
        add_cone(d, CONE, data[d + R.cone], 0.0, 0.0, -1.0, x, y, z, 1.0, mu, fresh, data)
        add_cone(d, RATE, data[d + R.rate], ax, ay, az, x, y, z, 1.0, mu, fresh, data)
        if data[d + R.box] > 0.0:
            bx, by, bz = data[d + R.box + 1], data[d + R.box + 2], data[d + R.box + 3]
            add_cone(d, BOX, data[d + R.box], bx, by, bz, x, y, z, 1.0, mu, fresh, data)
        if flying:
            px, py, pz = data[d + R.own] - x, data[d + R.own + 1] - y, data[d + R.own + 2] - z
            add_ball(d, POWER, data[d + R.f_max], px, py, pz, -1.0, mu, fresh, data)
            add_cone(
                d, TILT, data[d + R.tilt], 0.0, 0.0, 1.0, px, py, pz, -1.0, mu, fresh, data
            )  # fmt: skip


@inline
def invert(n, data):  # type: ignore[no-untyped-def]
    """Every cable's matrix becomes its inverse, by its factors: it may be very stiff in some directions only."""
    for i in range(n):
        h = WIDTH * i + R.H
        p = 1.0 / data[h]
        l1, l2 = data[h + 1] * p, data[h + 2] * p
        q = 1.0 / (data[h + 3] - l1 * data[h + 1])
        rest = data[h + 4] - l1 * data[h + 2]
        l3 = rest * q
        r = 1.0 / (data[h + 5] - l2 * data[h + 2] - l3 * rest)
        m = l1 * l3 - l2
        data[h] = p + l1 * l1 * q + m * m * r
        data[h + 1] = -l1 * q - m * l3 * r
        data[h + 2] = m * r
        data[h + 3] = q + l3 * l3 * r
        data[h + 4] = -l3 * r
        data[h + 5] = r


@inline
def times(h, x, y, z, data):  # type: ignore[no-untyped-def]
    """A symmetric 3 by 3, six numbers from h on, times a vector."""
    return (
        data[h] * x + data[h + 1] * y + data[h + 2] * z,
        data[h + 1] * x + data[h + 3] * y + data[h + 4] * z,
        data[h + 2] * x + data[h + 4] * y + data[h + 5] * z,
    )


@inline
def couple(n, size, mu, S, right, data):  # type: ignore[no-untyped-def]
    """The six rows of the wrench: ``sum G K G^T`` into the lower half of S and ``sum G K b`` into ``right``."""
    for k in range(6):
        right[k] = 0.0
        for m in range(k + 1):
            S[size * k + m] = 0.0
    for i in range(n):
        d = WIDTH * i
        h = d + R.H
        x, y, z = data[d + R.end], data[d + R.end + 1], data[d + R.end + 2]
        xx, xy, xz = data[h], data[h + 1], data[h + 2]
        yy, yz, zz = data[h + 3], data[h + 4], data[h + 5]
        S[0] += xx
        S[size] += xy
        S[size + 1] += yy
        S[2 * size] += xz
        S[2 * size + 1] += yz
        S[2 * size + 2] += zz
        # rows r x K: what the moment is of each column of K
        axx, axy, axz = y * xz - z * xy, y * yz - z * yy, y * zz - z * yz
        ayx, ayy, ayz = z * xx - x * xz, z * xy - x * yz, z * xz - x * zz
        azx, azy, azz = x * xy - y * xx, x * yy - y * xy, x * yz - y * xz
        S[3 * size] += axx
        S[3 * size + 1] += axy
        S[3 * size + 2] += axz
        S[4 * size] += ayx
        S[4 * size + 1] += ayy
        S[4 * size + 2] += ayz
        S[5 * size] += azx
        S[5 * size + 1] += azy
        S[5 * size + 2] += azz
        S[3 * size + 3] += y * axz - z * axy
        S[4 * size + 3] += y * ayz - z * ayy
        S[4 * size + 4] += z * ayx - x * ayz
        S[5 * size + 3] += y * azz - z * azy
        S[5 * size + 4] += z * azx - x * azz
        S[5 * size + 5] += x * azy - y * azx
        for k in range(3):
            data[d + R.b + k] += mu * data[d + R.c + k]
        bx, by, bz = times(h, data[d + R.b], data[d + R.b + 1], data[d + R.b + 2], data)
        right[0] += bx
        right[1] += by
        right[2] += bz
        right[3] += y * bz - z * by
        right[4] += z * bx - x * bz
        right[5] += x * by - y * bx


@inline
def couple_pairs(n, size, m, S, right, pairs, kappa, data):  # type: ignore[no-untyped-def]
    """The rows of m near pairs, below those of the wrench; their gradient counts with the other sign."""
    for p in range(m):
        o = PAIR * p
        row = size * (6 + p)
        for k in range(6):
            S[row + k] = 0.0
        total = 0.0
        for side in range(2):
            d = WIDTH * int(pairs[o + (V.j if side else V.i)])
            at, to = (o + V.b, o + V.Kb) if side else (o + V.a, o + V.Ka)
            x, y, z = times(d + R.H, pairs[at], pairs[at + 1], pairs[at + 2], data)
            pairs[to], pairs[to + 1], pairs[to + 2] = x, y, z
            ex, ey, ez = data[d + R.end], data[d + R.end + 1], data[d + R.end + 2]
            S[row] -= x
            S[row + 1] -= y
            S[row + 2] -= z
            S[row + 3] -= ey * z - ez * y
            S[row + 4] -= ez * x - ex * z
            S[row + 5] -= ex * y - ey * x
            total -= x * data[d + R.b] + y * data[d + R.b + 1] + z * data[d + R.b + 2]
        i, j = pairs[o + V.i], pairs[o + V.j]
        for q in range(p + 1):
            c = PAIR * q
            value = 0.0
            for one in range(2):
                mine = j if one else i
                u = o + (V.Kb if one else V.Ka)
                for two in range(2):
                    if mine == pairs[c + (V.j if two else V.i)]:
                        v = c + (V.b if two else V.a)
                        value += pairs[u] * pairs[v] + pairs[u + 1] * pairs[v + 1]
                        value += pairs[u + 2] * pairs[v + 2]
            S[row + 6 + q] = value
        S[row + 6 + p] += pairs[o + V.g] / pairs[o + V.z]
        right[6 + p] = total + kappa / pairs[o + V.z]


@inline
def solve(size, S, right):  # type: ignore[no-untyped-def]
    """Cholesky factors of the lower half of S, and ``right`` becomes the solution; rows that add nothing are left out."""
    for k in range(size):
        row = size * k
        most = S[row + k]
        for m in range(k):
            value = S[row + m]
            for c in range(m):
                value -= S[row + c] * S[size * m + c]
            S[row + m] = value * S[size * m + m]
        value = S[row + k]
        for c in range(k):
            value -= S[row + c] * S[row + c]
        S[row + k] = 1.0 / math.sqrt(value) if value > 1e-14 * most and value > 1e-300 else 0.0
        value = right[k]
        for c in range(k):
            value -= S[row + c] * right[c]
        right[k] = value * S[row + k]
    for k in range(size - 1, -1, -1):
        value = right[k]
        for c in range(k + 1, size):
            value -= S[size * c + k] * right[c]
        right[k] = value * S[size * k + k]


@inline
def back(n, m, y, pairs, data):  # type: ignore[no-untyped-def]
    """Every cable's step from the multipliers."""
    for p in range(m):
        o = PAIR * p
        for side in range(2):
            d = WIDTH * int(pairs[o + (V.j if side else V.i)])
            at = o + (V.b if side else V.a)
            for k in range(3):
                data[d + R.b + k] += pairs[at + k] * y[6 + p]
    for i in range(n):
        d = WIDTH * i
        x, z = data[d + R.end], data[d + R.end + 2]
        ey = data[d + R.end + 1]
        bx = data[d + R.b] - y[0] - (y[4] * z - y[5] * ey)
        by = data[d + R.b + 1] - y[1] - (y[5] * x - y[3] * z)
        bz = data[d + R.b + 2] - y[2] - (y[3] * ey - y[4] * x)
        dx, dy, dz = times(d + R.H, bx, by, bz, data)
        data[d + R.dw], data[d + R.dw + 1], data[d + R.dw + 2] = dx, dy, dz


@inline
def root(A, B, C):  # type: ignore[no-untyped-def]
    """Smallest positive ``s`` with ``A s^2 + 2 B s + C = 0``, for ``C > 0``; huge where there is none."""
    under = B * B - A * C
    if under < 0.0:
        return 1e300
    down = math.sqrt(under) - B
    return C / down if down > 1e-300 * C else 1e300


@inline
def cone_root(tan, ax, ay, az, x, y, z, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Step at which a cone's rim is met."""
    t, dt = ax * x + ay * y + az * z, ax * dx + ay * dy + az * dz
    x, y, z = x - t * ax, y - t * ay, z - t * az
    dx, dy, dz = dx - dt * ax, dy - dt * ay, dz - dt * az
    c = tan * tan
    A = c * dt * dt - dx * dx - dy * dy - dz * dz
    B = c * t * dt - x * dx - y * dy - z * dz
    C = c * t * t - x * x - y * y - z * z
    return root(A, B, C)


@inline
def to_the_rim(n, flying, data):  # type: ignore[no-untyped-def]
    """Longest step at which every cable still keeps its limits."""
    far = 1e300
    for i in range(n):
        d = WIDTH * i
        x, y, z = data[d + R.w], data[d + R.w + 1], data[d + R.w + 2]
        dx, dy, dz = data[d + R.dw], data[d + R.dw + 1], data[d + R.dw + 2]
        ax, ay, az = data[d + R.a], data[d + R.a + 1], data[d + R.a + 2]
        most = data[d + R.T_max]
        square = dx * dx + dy * dy + dz * dz
        inner = x * dx + y * dy + z * dz
        far = min(far, root(-square, -inner, most * most - x * x - y * y - z * z))
        dt = ax * dx + ay * dy + az * dz
        if dt < 0.0:
            far = min(far, (data[d + R.T_min] - ax * x - ay * y - az * z) / dt)
        far = min(far, cone_root(data[d + R.cone], 0.0, 0.0, -1.0, x, y, z, dx, dy, dz))
        far = min(far, cone_root(data[d + R.rate], ax, ay, az, x, y, z, dx, dy, dz))
        if data[d + R.box] > 0.0:
            bx, by, bz = data[d + R.box + 1], data[d + R.box + 2], data[d + R.box + 3]
            far = min(far, cone_root(data[d + R.box], bx, by, bz, x, y, z, dx, dy, dz))
        if flying:
            x, y, z = data[d + R.own] - x, data[d + R.own + 1] - y, data[d + R.own + 2] - z
            f = data[d + R.f_max]
            far = min(far, root(-square, x * dx + y * dy + z * dz, f * f - x * x - y * y - z * z))
            far = min(far, cone_root(data[d + R.tilt], 0.0, 0.0, 1.0, x, y, z, -dx, -dy, -dz))
    return far


@inline
def turn_multipliers(n, flying, m, mu, y, pairs, data):  # type: ignore[no-untyped-def]
    """Steps of all limits' multipliers; the longest one that leaves them positive."""
    far = 1e300
    for i in range(n):
        d = WIDTH * i
        x, y_, z = data[d + R.dw], data[d + R.dw + 1], data[d + R.dw + 2]
        for k in range(LIMITS if flying else POWER):
            if k == BOX and data[d + R.box] <= 0.0:
                continue
            o = d + R.slope + 3 * k
            m_now, g = data[d + R.z + k], data[d + R.g + k]
            change = data[o] * x + data[o + 1] * y_ + data[o + 2] * z
            step = (mu - m_now * change) / g - m_now
            data[d + R.dz + k] = step
            if step < -m_now * 1e-12:
                far = min(far, -m_now / step)
    for p in range(m):
        step = y[6 + p] - pairs[PAIR * p + V.z]
        if step < 0.0:
            far = min(far, -pairs[PAIR * p + V.z] / step)
    return far


@inline
def move_multipliers(n, flying, m, s, y, pairs, data):  # type: ignore[no-untyped-def]
    """Take that step."""
    for i in range(n):
        d = WIDTH * i
        for k in range(LIMITS if flying else POWER):
            if k != BOX or data[d + R.box] > 0.0:
                data[d + R.z + k] += s * data[d + R.dz + k]
    for p in range(m):
        pairs[PAIR * p + V.z] += s * (y[6 + p] - pairs[PAIR * p + V.z])


@inline
def margin(o, flat, s, pairs, length, data):  # type: ignore[no-untyped-def]
    """Distance less what is to be kept of a pair after a step s, m."""
    d, e = WIDTH * int(pairs[o + V.i]), WIDTH * int(pairs[o + V.j])
    px, py, pz = drone(d, s, length[int(pairs[o + V.i])], data)
    qx, qy, qz = drone(e, s, length[int(pairs[o + V.j])], data)
    size, nx, ny, nz, _, _ = metres.apart(
        int(pairs[o + V.kind]), flat, data[d + R.place] - data[e + R.place],
        data[d + R.place + 1] - data[e + R.place + 1], data[d + R.place + 2] - data[e + R.place + 2],
        px, py, pz, qx, qy, qz,
    )  # fmt: skip
    if nx * pairs[o + V.normal] + ny * pairs[o + V.normal + 1] + nz * pairs[o + V.normal + 2] < 0.0:
        return metres.PASSED
    return size - pairs[o + V.least]


@inline
def drone(d, s, length, data):  # type: ignore[no-untyped-def]
    """From a cable's end to its drone after a step s, m."""
    x = data[d + R.w] + s * data[d + R.dw]
    y = data[d + R.w + 1] + s * data[d + R.dw + 1]
    z = data[d + R.w + 2] + s * data[d + R.dw + 2]
    scale = -length / math.sqrt(x * x + y * y + z * z)
    return x * scale, y * scale, z * scale


@inline
def assemble_pairs(m, flat, mu, fresh, pairs, length, data):  # type: ignore[no-untyped-def]
    """Margins, multipliers and gradients of near pairs, and of their curvature what makes a cable's matrix stiffer."""
    for p in range(m):
        o = PAIR * p
        i, j = int(pairs[o + V.i]), int(pairs[o + V.j])
        d, e = WIDTH * i, WIDTH * j
        px, py, pz = drone(d, 0.0, length[i], data)
        qx, qy, qz = drone(e, 0.0, length[j], data)
        size, nx, ny, nz, u, v = metres.apart(
            int(pairs[o + V.kind]), flat, data[d + R.place] - data[e + R.place],
            data[d + R.place + 1] - data[e + R.place + 1], data[d + R.place + 2] - data[e + R.place + 2],
            px, py, pz, qx, qy, qz,
        )  # fmt: skip
        g = max(size - pairs[o + V.least], 1e-12)
        z = mu / g if fresh else pairs[o + V.z]
        pairs[o + V.g], pairs[o + V.z] = g, z
        pairs[o + V.normal], pairs[o + V.normal + 1], pairs[o + V.normal + 2] = nx, ny, nz
        for side in range(2):
            at = o + (V.b if side else V.a)
            c = e if side else d
            wx, wy, wz = data[c + R.w], data[c + R.w + 1], data[c + R.w + 2]
            inverse = 1.0 / math.sqrt(wx * wx + wy * wy + wz * wz)
            wx, wy, wz = wx * inverse, wy * inverse, wz * inverse
            lever = (v * length[j] if side else -u * length[i]) * inverse
            along = nx * wx + ny * wy + nz * wz
            gx, gy, gz = (
                lever * (nx - along * wx),
                lever * (ny - along * wy),
                lever * (nz - along * wz),
            )
            pairs[at], pairs[at + 1], pairs[at + 2] = gx, gy, gz
            data[c + R.force] -= z * gx
            data[c + R.force + 1] -= z * gy
            data[c + R.force + 2] -= z * gz
            # -g'' of a direction on its sphere
            bend = z * lever * along * inverse
            if bend > 0.0:
                data[c + R.H] += bend * (1.0 - wx * wx)
                data[c + R.H + 1] -= bend * wx * wy
                data[c + R.H + 2] -= bend * wx * wz
                data[c + R.H + 3] += bend * (1.0 - wy * wy)
                data[c + R.H + 4] -= bend * wy * wz
                data[c + R.H + 5] += bend * (1.0 - wz * wz)


@inline
def missing(n, f, miss, data):  # type: ignore[no-untyped-def]
    """What the cables leave of the wrench, into ``miss``."""
    fx, fy, fz, mx, my, mz = f[0], f[1], f[2], f[3], f[4], f[5]
    for i in range(n):
        d = WIDTH * i
        rx, ry, rz = data[d + R.end], data[d + R.end + 1], data[d + R.end + 2]
        x, y, z = data[d + R.w], data[d + R.w + 1], data[d + R.w + 2]
        fx += x
        fy += y
        fz += z
        mx += ry * z - rz * y
        my += rz * x - rx * z
        mz += rx * y - ry * x
    miss[0], miss[1], miss[2], miss[3], miss[4], miss[5] = fx, fy, fz, mx, my, mz


@inline
def stationarity(n, lam, data):  # type: ignore[no-untyped-def]
    """Largest unbalanced push on a cable: cost, limits, near pairs and the wrench's multipliers."""
    worst = 0.0
    for i in range(n):
        d = WIDTH * i
        x, y, z = data[d + R.end], data[d + R.end + 1], data[d + R.end + 2]
        fx = data[d + R.force] + lam[0] + lam[4] * z - lam[5] * y
        fy = data[d + R.force + 1] + lam[1] + lam[5] * x - lam[3] * z
        fz = data[d + R.force + 2] + lam[2] + lam[3] * y - lam[4] * x
        worst = max(worst, max(abs(fx), max(abs(fy), abs(fz))))
    return worst


@inline
def iterate(n, flying, m, rows, task, lost, prices, f, work, info):  # type: ignore[no-untyped-def]
    """From strictly inside all limits to the least cost; :data:`CONVERGED` or :data:`STOPPED`.

    ``task`` is the final barrier, tolerance, most steps, and ``1 / stretch^2``; m pairs are watched, of which the first ``rows`` couple;
    ``lost`` (3 vectors of 6, as many as counted) are combinations of the wrench's rows that say nothing.
    """
    end, tolerance, most, flat, count = task
    data, pairs, length, S, y, lam, plus, minus, miss = work
    size = 6 + rows
    total = LIMITS * n + rows + 12.0
    missing(n, f, miss, data)
    loss = 0.0
    for k in range(6):
        loss += prices[k] * abs(miss[k])
        lam[k] = 0.0
    mu = min(max(0.1 * loss / total, 1e-3), 1.0)
    for k in range(6):
        room = mu / prices[k]
        plus[k] = max(miss[k], 0.0) + room
        minus[k] = max(-miss[k], 0.0) + room
    cost, s = 1.0, 1.0
    fresh = True
    outcome = STOPPED
    iterations = 0
    residual = least_loss = math.inf
    hard = near = False
    while True:
        assemble(n, flying, cost, mu, fresh, data)
        assemble_pairs(rows, flat, mu, fresh, pairs, length, data)
        fresh = False
        balance = loss = used = size_of = 0.0
        for k in range(6):
            balance = max(balance, abs(miss[k]))
            loss += prices[k] * abs(miss[k])
            used = max(used, abs(lam[k]) / prices[k])
            size_of = max(size_of, abs(lam[k]))
        if loss < least_loss:
            least_loss = loss
            for i in range(n):
                for k in range(3):
                    data[WIDTH * i + R.best + k] = data[WIDTH * i + R.w + k]
        if iterations > 0:
            residual = stationarity(n, lam, data)
            near = residual * residual <= NEAR * mu * (1.0 + size_of)
            if mu <= end and residual <= tolerance and balance <= BALANCED:
                outcome = CONVERGED
                break
            if used > FIRM and near and s > 0.9 and total * mu <= SHARE * loss:
                outcome = CONVERGED
                break
            if iterations >= most:
                break
            least = end
            if used > YIELD:
                cost = SLIGHT
                least = max(min(end, 0.5 * SHARE * loss / total), FLOOR)
            if near and s > 0.9:
                mu *= 0.1
            elif near and s > 0.5:
                mu *= 0.3
            elif s < 0.1:
                mu = min(2.0 * mu, 1.0)
            mu = max(mu, least)
        iterations += 1
        hard = mu <= end and near and s > 0.9 and used < FIRM
        invert(n, data)
        couple(n, size, mu, S, y, data)
        couple_pairs(n, size, rows, S, y, pairs, mu, data)
        for k in range(6):
            if hard:
                y[k] += miss[k]
                continue
            up, down = prices[k] - lam[k], prices[k] + lam[k]
            D = plus[k] / up + minus[k] / down
            S[size * k + k] += D
            y[k] -= mu / up - plus[k] - mu / down + minus[k] - D * lam[k]
        for c in range(count):
            weight = S[0]
            for k in range(6):
                for q in range(k + 1):
                    S[size * k + q] += weight * lost[6 * c + k] * lost[6 * c + q]
        solve(size, S, y)
        back(n, rows, y, pairs, data)
        far = to_the_rim(n, flying, data)
        turn = turn_multipliers(n, flying, rows, mu, y, pairs, data)
        for k in range(6):
            if hard:
                continue
            change = y[k] - lam[k]
            up, down = prices[k] - lam[k], prices[k] + lam[k]
            dp = mu / up - plus[k] + plus[k] / up * change
            dm = mu / down - minus[k] - minus[k] / down * change
            if dp < 0.0:
                far = min(far, -plus[k] / dp)
            if dm < 0.0:
                far = min(far, -minus[k] / dm)
            if change > 0.0:
                turn = min(turn, up / change)
            elif change < 0.0:
                turn = min(turn, -down / change)
        s = min(1.0, (1.0 - KEEP) * far)
        turn = min(1.0, (1.0 - KEEP) * turn)
        move_multipliers(n, flying, rows, turn, y, pairs, data)
        if not (s > 0.0 and turn > 0.0):
            break
        for _ in range(TRIES):
            low = 1.0
            for p in range(m):
                o = PAIR * p
                now = pairs[o + V.g]
                after = margin(o, flat, s, pairs, length, data)
                if after < KEEP * now:
                    low = min(low, max(0.9 * now / (now - after), 0.1))
            if low == 1.0:
                break
            s *= low
        else:
            s = 0.0
        for i in range(n):
            d = WIDTH * i
            for k in range(3):
                data[d + R.w + k] += s * data[d + R.dw + k]
        for p in range(rows, m):
            pairs[PAIR * p + V.g] = (
                margin(PAIR * p, flat, 0.0, pairs, length, data)
                if s > 0.0
                else pairs[PAIR * p + V.g]
            )
        missing(n, f, miss, data)
        for k in range(6):
            change = y[k] - lam[k]
            up, down = prices[k] - lam[k], prices[k] + lam[k]
            plus[k] += s * (mu / up - plus[k] + plus[k] / up * change)
            minus[k] += s * (mu / down - minus[k] - minus[k] / down * change)
            lam[k] += turn * change
            if hard or not (plus[k] > 0.0 and minus[k] > 0.0):
                lam[k] = min(max(lam[k], -0.99 * prices[k]), 0.99 * prices[k])
                room = mu / prices[k]
                plus[k] = max(miss[k], 0.0) + room
                minus[k] = max(-miss[k], 0.0) + room
    if outcome == STOPPED and loss > least_loss:
        for i in range(n):
            for k in range(3):
                data[WIDTH * i + R.w + k] = data[WIDTH * i + R.best + k]
    info[0] = iterations
    info[1] = residual
    return outcome
