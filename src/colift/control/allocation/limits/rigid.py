"""Parts of a cycle for a rigid load: limits and starts of every cable, pairs that may come too near, what an answer keeps.

For each cable ``data`` holds a row of :mod:`colift.control.allocation.limits.elastic`, for each pair that is watched ``pairs`` one of its
pairs: forces over ``sigma``, levers over ``arm_unit``, distances in metres. Kernels of this file import only the compiler front end.
"""

from __future__ import annotations

import math

from colift.control.allocation.limits import elastic, metres
from colift.control.allocation.limits.cycle import LEVEL as LEAN_MOST
from colift.kernel.jit import inline
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion, wrench
from colift.kernel.math.columns import column
from colift.kernel.spans import BODY, LINE

PARAMS = Layout(
    team={
        "sigma": 1, "arm_unit": 1, "span": 1, "axis": 3, "most": 1, "max_rate": 1, "cone": 1, "tilt": 1, "flat": 1,
        "box_angle": 1, "slew": 1, "barrier": 1, "tolerance": 1, "iterations": 1, "g": 1, "flying": 1, "price": 6, "metres": 1,
        "rods": 1, "clear": 1,
    },
    drone={
        "plan": 3, "arm": 3, "out": 3, "boxed": 1, "T_min": 1, "T_max": 1, "m": 1, "f_max": 1, "length": 1, "size": 1,
        "rotor": 1,
    },
)  # fmt: skip
"""In columns. ``sigma`` is a share of the weight, N, ``arm_unit`` the length of the load by which arms are measured, m."""
MEMORY = Layout(
    team={
        "known": 1, "attitude": 4, "asked": 3, "lam": 6, "plus": 6, "minus": 6, "miss": 6, "f": 6, "lost": 18,
    },
    drone={"row": elastic.WIDTH, "last": 3, "w": 3, "end": 3, "place": 3},
)  # fmt: skip
"""In columns; how much room every pair has left, all that are watched, and the reduced system follow."""
P, PLACES = PARAMS.at, PARAMS.spans
M, COLUMNS = MEMORY.at, MEMORY.spans
R, V = elastic.R, elastic.V
WIDTH, PAIR = elastic.WIDTH, elastic.PAIR

ROOM = 1e-3
"""Part of the range of tensions that a start keeps from its ends."""
LIFT = 0.6
"""Least tension of a start, over the plan's: a cable that is almost slack can hardly turn the others' way."""
INSIDE = 0.05
"""Of the largest turn, how far inside of a cone a start is."""
AHEAD = 1.5
"""Of the wanted attitude's next turn, what distances and cones keep for it."""
BUFFER, BUFFER_ANGLE = 1e-3, math.radians(0.1)
"""What they keep anyhow, m, rad."""
PARTED = 1e-5
"""By how much farther apart than asked a pair that is too near is turned where there is no room for more, m."""
FADE = 0.75
"""Part of what is left of it that a pair keeps within a cycle, where its buffer is used up."""
ROUNDING = 1e-9

T_MAX, T_MIN, CONE, RATE, POWER, TILT, DRONES, CABLE, BOX, GAP = (
    1,
    2,
    4,
    8,
    16,
    32,
    128,
    256,
    512,
    1024,
)
"""Bits of :attr:`~colift.control.allocation.base.Allocation.active_limits`, where points have them too the same (64 is their least angle)."""


@inline
def lead_in(ax, ay, az, tan, turn, x, y, z):  # type: ignore[no-untyped-def]
    """A direction led by at most ``turn`` towards the axis ``a``, to just inside of a cone; tangent of the cone that holds it now."""
    t = ax * x + ay * y + az * z
    ux, uy, uz = x - t * ax, y - t * ay, z - t * az
    level = math.sqrt(ux * ux + uy * uy + uz * uz)
    limit = math.atan(tan)
    angle = math.atan2(level, t)
    inside = limit - INSIDE * min(turn, limit)
    if angle <= inside:
        return x, y, z, tan
    if level < 1e-9:  # straight away from the axis
        ux, uy, uz = (1.0, 0.0, 0.0) if abs(ax) < 0.9 else (0.0, 1.0, 0.0)
        t = ax * ux + ay * uy + az * uz
        ux, uy, uz = ux - t * ax, uy - t * ay, uz - t * az
        level = math.sqrt(ux * ux + uy * uy + uz * uz)
    gain = min(turn, angle - inside)
    if angle - gain > inside:
        # No worse than half of the way; what is beyond a right angle has no tangent and is led back unseen.
        tan = math.tan(min(max(angle - 0.5 * gain, limit), 1.55))
    angle -= gain
    c, s = math.cos(angle), math.sin(angle) / level
    x, y, z = c * ax + s * ux, c * ay + s * uy, c * az + s * uz
    return x, y, z, tan


@inline
def turned_by(q, known, w, x, y, z, most):  # type: ignore[no-untyped-def]
    """Rotation, as a quaternion, from the attitude ``q`` to ``(w, x, y, z)``, by no more than ``most``, rad."""
    if not known:
        return 1.0, 0.0, 0.0, 0.0
    c, u, v, r = quaternion.multiply(w, x, y, z, q[0], -q[1], -q[2], -q[3])
    side = 2.0 if c >= 0.0 else -2.0
    u, v, r = side * u, side * v, side * r
    size = math.sqrt(u * u + v * v + r * r)
    scale = most / size if size > most else 1.0
    return quaternion.turn(1.0, 0.0, 0.0, 0.0, scale * u, scale * v, scale * r)


@inline
def fly(n, unit, params, data):  # type: ignore[no-untyped-def]
    """What every drone needs for itself, brought within what it can do, from what :func:`accelerate` left."""
    for i in range(n):
        d = WIDTH * i
        mass = column(params, P.rows, n, PLACES.m)[i] * unit
        thrust = column(params, P.rows, n, PLACES.f_max)[i] * unit
        own = mass * params[P.g]
        x, y = mass * data[d + R.own], mass * data[d + R.own + 1]
        z = min(max(mass * data[d + R.own + 2] + own, 0.3 * own), 0.8 * thrust)
        level = math.sqrt(x * x + y * y)
        most = z * math.tan(LEAN_MOST * math.atan(params[P.tilt]))
        scale = most / level if level > most else 1.0
        x, y = x * scale, y * scale
        size = math.sqrt(x * x + y * y + z * z)
        scale = 0.9 * thrust / size if size > 0.9 * thrust else 1.0
        data[d + R.own], data[d + R.own + 1], data[d + R.own + 2] = x * scale, y * scale, z * scale
        data[d + R.f_max] = thrust
        data[d + R.tilt] = params[P.tilt]


@inline
def accelerate(n, reference, attitude, rates, arms, data):  # type: ignore[no-untyped-def]
    """Wanted acceleration of every cable's end, m/s^2; none where it is no number."""
    qw, qx, qy, qz = attitude
    p, q, r = rates[0, 0], rates[0, 1], rates[0, 2]
    p1, q1, r1 = rates[1, 0], rates[1, 1], rates[1, 2]
    for i in range(n):
        d = WIDTH * i
        a, b, c = arms[3 * i], arms[3 * i + 1], arms[3 * i + 2]
        u, v, w = q * c - r * b, r * a - p * c, p * b - q * a
        x = q1 * c - r1 * b + q * w - r * v
        y = r1 * a - p1 * c + r * u - p * w
        z = p1 * b - q1 * a + p * v - q * u
        x, y, z = quaternion.into_world(qw, qx, qy, qz, x, y, z)
        x, y, z = x + reference[2, 0], y + reference[2, 1], z + reference[2, 2]
        if not math.isfinite(x + y + z):
            x = y = z = 0.0
        data[d + R.own], data[d + R.own + 1], data[d + R.own + 2] = x, y, z


@inline
def least_of(kind, i, j, n, params):  # type: ignore[no-untyped-def]
    """Distance that a pair keeps, m; 0: not limited."""
    if kind == metres.DRONES:
        sizes = column(params, P.rows, n, PLACES.size)
        return 0.5 * (sizes[i] + sizes[j])
    rotors = column(params, P.rows, n, PLACES.rotor)
    if kind == metres.ROTOR:
        return rotors[i]
    if kind == metres.ROTOR_BACK:
        return rotors[j]
    return params[P.clear]


@inline
def between(kind, i, j, flat, length, data):  # type: ignore[no-untyped-def]
    """Distance and normal of a pair where the cables are now, as :func:`colift.control.allocation.limits.metres.apart`."""
    d, e = WIDTH * i, WIDTH * j
    px, py, pz = elastic.drone(d, 0.0, length[i], data)
    qx, qy, qz = elastic.drone(e, 0.0, length[j], data)
    return metres.apart(
        kind, flat, data[d + R.place] - data[e + R.place], data[d + R.place + 1] - data[e + R.place + 1],
        data[d + R.place + 2] - data[e + R.place + 2], px, py, pz, qx, qy, qz,
    )  # fmt: skip


@inline
def went(n, count, wanted, length, attitude, last, rest, moved, memory, data):  # type: ignore[no-untyped-def]
    """How far each drone has gone since the last cycle, m, and the load has turned, rad, into ``moved`` (n + 1), and what is remembered for it.

    How far a direction is from the last cycle's, times its cable, is left in ``data``.
    """
    if memory[M.known] == 0.0:
        memory[M.known] = 1.0
        for k in range(count):
            rest[k] = -1.0
    w, x, y, z = wanted
    sign = (
        -1.0 if attitude[0] * w + attitude[1] * x + attitude[2] * y + attitude[3] * z < 0.0 else 1.0
    )
    rotate = (sign * attitude[0] - w) ** 2 + (sign * attitude[1] - x) ** 2
    rotate += (sign * attitude[2] - y) ** 2 + (sign * attitude[3] - z) ** 2
    moved[n] = 2.0 * math.sqrt(rotate)
    attitude[0], attitude[1], attitude[2], attitude[3] = w, x, y, z
    for i in range(n):
        d = WIDTH * i
        x, y, z = data[d + R.w], data[d + R.w + 1], data[d + R.w + 2]
        scale = 1.0 / math.sqrt(x * x + y * y + z * z)
        step = off = 0.0
        for k in range(3):
            now_at = data[d + R.w + k] * scale
            step += (now_at - last[3 * i + k]) ** 2
            off += (now_at - data[d + R.a + k]) ** 2
            last[3 * i + k] = now_at
        moved[i] = length[i] * math.sqrt(step)
        data[d + R.c] = length[i] * math.sqrt(off)


@inline
def watch(n, delta, ahead, moved, params, length, rest, pairs, data):  # type: ignore[no-untyped-def]
    """List the pairs that may come too near in this cycle, where they start; their number.

    ``rest`` (n (n - 1) / 2) is how much nearer each pair may surely come, from the last time that it was looked at; ``moved`` (n + 1)
    how far each drone has gone since the last cycle, m, and the load has turned, rad. Who lacks room is pushed apart.
    """
    flat = params[P.flat]
    kinds = metres.KINDS if params[P.rods] != 0.0 else 1
    m = 0
    at = 0
    close = wrong = False
    for i in range(n):
        d = WIDTH * i
        for j in range(i):
            e = WIDTH * j
            x = data[d + R.place] - data[e + R.place]
            y = data[d + R.place + 1] - data[e + R.place + 1]
            z = data[d + R.place + 2] - data[e + R.place + 2]
            span = math.sqrt(x * x + y * y + z * z)
            buffer = BUFFER + AHEAD * ahead * span
            reach = delta * (length[i] + length[j]) + data[d + R.c] + data[e + R.c] + buffer
            rest[at] -= moved[i] + moved[j] + moved[n] * span
            if rest[at] > reach:
                at += 1
                continue
            rest[at] = 1e300
            for kind in range(kinds):
                least = least_of(kind, i, j, n, params)
                if least <= 0.0:
                    continue
                size, _, _, _, _, _ = between(kind, i, j, flat, length, data)
                rest[at] = min(rest[at], size - least)
                if size - least > reach:
                    continue
                o = PAIR * m
                pairs[o + V.kind], pairs[o + V.i], pairs[o + V.j] = kind, i, j
                pairs[o + V.least], pairs[o + V.g], pairs[o + V.z] = least, size, buffer
                wrong = wrong or size <= least * (1.0 + ROUNDING)
                close = close or size < least + buffer
                m += 1
            at += 1
    if close:
        for i in range(n):
            for c in range(3):
                data[WIDTH * i + R.best + c] = data[WIDTH * i + R.w + c]
        for p in range(m):
            push(PAIR * p, n, flat, delta, pairs[PAIR * p + V.z], length, pairs, data)
        worse = False
        for p in range(m):
            o = PAIR * p
            kind, i, j = int(pairs[o + V.kind]), int(pairs[o + V.i]), int(pairs[o + V.j])
            size, _, _, _, _, _ = between(kind, i, j, flat, length, data)
            worse = worse or size < 0.5 * (pairs[o + V.g] + pairs[o + V.least])
        if worse:  # what helps one pair would cost another one its room: only who is too near is parted, and no more than that
            for i in range(n):
                for c in range(3):
                    data[WIDTH * i + R.w + c] = data[WIDTH * i + R.best + c]
            for p in range(m):
                if wrong and pairs[PAIR * p + V.g] <= pairs[PAIR * p + V.least] * (1.0 + ROUNDING):
                    push(PAIR * p, n, flat, delta, PARTED, length, pairs, data)
    for p in range(m):
        o = PAIR * p
        kind, i, j = int(pairs[o + V.kind]), int(pairs[o + V.i]), int(pairs[o + V.j])
        size, nx, ny, nz, _, _ = between(kind, i, j, flat, length, data)
        least, before, buffer = pairs[o + V.least], pairs[o + V.g], pairs[o + V.z]
        if size > least + 1e-6:
            least += min(buffer, FADE * (size - least))
        elif size > before + 1e-6:
            least = min(least, before + 0.5 * (size - before))
        else:
            least = size - 1e-6
        pairs[o + V.least], pairs[o + V.g] = least, size - least
        pairs[o + V.normal], pairs[o + V.normal + 1], pairs[o + V.normal + 2] = nx, ny, nz
    return m


@inline
def push(o, n, flat, delta, room, length, pairs, data):  # type: ignore[no-untyped-def]
    """Turn both cables of a pair apart, by what it lacks of its distance and this ``room``, m, and by no more than half of the largest turn together."""
    kind, i, j = int(pairs[o + V.kind]), int(pairs[o + V.i]), int(pairs[o + V.j])
    size, nx, ny, nz, u, v = between(kind, i, j, flat, length, data)
    lack = pairs[o + V.least] + room - size
    if lack <= 0.0:
        return
    if size < 1e-6:  # no direction is better than another
        nx, ny, nz = math.cos(2.4 * (i + n * j)), math.sin(2.4 * (i + n * j)), 0.0
    lean(i, -u * nx, -u * ny, -u * nz, min(0.5 * lack / length[i], 0.25 * delta), data)
    lean(j, v * nx, v * ny, v * nz, min(0.5 * lack / length[j], 0.25 * delta), data)


@inline
def lean(i, x, y, z, turn, data):  # type: ignore[no-untyped-def]
    """Turn a cable's force by ``turn`` towards a vector."""
    d = WIDTH * i
    wx, wy, wz = data[d + R.w], data[d + R.w + 1], data[d + R.w + 2]
    square = wx * wx + wy * wy + wz * wz
    along = (wx * x + wy * y + wz * z) / square
    x, y, z = x - along * wx, y - along * wy, z - along * wz
    level = math.sqrt(x * x + y * y + z * z)
    if level < 1e-9:
        return
    size = math.sqrt(square)
    c, s = math.cos(turn), math.sin(turn) * size / level
    x, y, z = c * wx + s * x, c * wy + s * y, c * wz + s * z
    far = 1.1  # only where no cone is left
    far = min(
        far, held(data[d + R.rate], data[d + R.a], data[d + R.a + 1], data[d + R.a + 2], x, y, z)
    )
    far = min(far, held(data[d + R.cone], 0.0, 0.0, -1.0, x, y, z))
    if data[d + R.box] > 0.0:
        bx, by, bz = data[d + R.box + 1], data[d + R.box + 2], data[d + R.box + 3]
        far = min(far, held(data[d + R.box], bx, by, bz, x, y, z))
    if far > 0.0:
        data[d + R.w], data[d + R.w + 1], data[d + R.w + 2] = x, y, z


@inline
def held(tan, ax, ay, az, x, y, z):  # type: ignore[no-untyped-def]
    """How far inside of a cone about the unit ``a`` a force is, over half of its angle; negative outside."""
    t = ax * x + ay * y + az * z
    if t <= 0.0:
        return -1.0
    x, y, z = x / t - ax, y / t - ay, z / t - az
    return 0.95 - (x * x + y * y + z * z) / (tan * tan)


@inline
def starts(n, unit, delta, ahead, turning, flying, tensions, directions, params, data):  # type: ignore[no-untyped-def]
    """Limits of every cable in this cycle and a force strictly inside of them; whether one had to be relaxed.

    It is the last one, turned with the load, which leaves distances as they were.
    """
    relaxed = False
    turn = 0.5 * delta
    lows = column(params, P.rows, n, PLACES.T_min)
    highs = column(params, P.rows, n, PLACES.T_max)
    boxed = column(params, P.rows, n, PLACES.boxed)
    tan_box = math.tan(max(math.atan(params[P.box_angle]) - BUFFER_ANGLE - AHEAD * ahead, 0.02))
    for i in range(n):
        d = WIDTH * i
        x, y, z = directions[i, 0], directions[i, 1], directions[i, 2]
        norm = math.sqrt(x * x + y * y + z * z)
        if not (norm > 1e-9 and norm < 1e9):
            x, y, z, norm = 0.0, 0.0, -1.0, 1.0
        norm = 1.0 / norm
        x, y, z = x * norm, y * norm, z * norm
        data[d + R.a], data[d + R.a + 1], data[d + R.a + 2] = x, y, z
        data[d + R.rate] = math.tan(delta)
        ax, ay, az = x, y, z
        x, y, z = quaternion.into_world(turning[0], turning[1], turning[2], turning[3], x, y, z)
        x, y, z, tan = lead_in(0.0, 0.0, -1.0, params[P.cone], 0.5 * turn, x, y, z)
        data[d + R.cone] = tan
        data[d + R.box] = 0.0
        if boxed[i] != 0.0:
            bx, by, bz = data[d + R.box + 1], data[d + R.box + 2], data[d + R.box + 3]
            x, y, z, tan = lead_in(bx, by, bz, tan_box, 0.5 * turn, x, y, z)
            if bx * x + by * y + bz * z > 0.02:
                data[d + R.box] = tan
            else:
                relaxed = True
            relaxed = relaxed or tan > params[P.box_angle]
            if -z < math.cos(math.atan(data[d + R.cone])) + 1e-9:
                data[d + R.cone] = math.tan(min(math.acos(-z) + 1e-3, 1.55))
        relaxed = relaxed or data[d + R.cone] > params[P.cone] * (1.0 + ROUNDING)
        if -z < 0.03:  # no cone holds it: straight on to the side
            z = -0.03
            norm = 1.0 / math.sqrt(x * x + y * y + z * z)
            x, y, z = x * norm, y * norm, z * norm
            data[d + R.a], data[d + R.a + 1], data[d + R.a + 2] = ax, ay, az = x, y, z
        cosine = ax * x + ay * y + az * z
        if cosine < math.cos(0.9 * delta):
            data[d + R.a], data[d + R.a + 1], data[d + R.a + 2] = ax, ay, az = x, y, z
            cosine = 1.0
        low, high = lows[i] * unit, highs[i] * unit
        data[d + R.T_min], data[d + R.T_max] = low, high
        room = ROOM * (high - low)
        low = (low + room) / cosine
        hx, hy, hz = data[d + R.home], data[d + R.home + 1], data[d + R.home + 2]
        t = tensions[i] * unit
        if not (t > 0.0 and t < 1e300):
            t = 0.0
        t = max(min(max(t, LIFT * math.sqrt(hx * hx + hy * hy + hz * hz)), high - room), low)
        if flying:
            px, py, pz = data[d + R.own], data[d + R.own + 1], data[d + R.own + 2]
            cos_tilt = math.cos(math.atan(data[d + R.tilt]))
            for k in range(8):
                ux, uy, uz = px - t * x, py - t * y, pz - t * z
                thrust = math.sqrt(ux * ux + uy * uy + uz * uz)
                if data[d + R.f_max] - thrust > 1e-6 and uz - cos_tilt * thrust > 1e-6:
                    break
                if k < 7:
                    t = low + 0.4 * (t - low) if k < 6 else low
                else:  # even the least tension asks too much of this drone
                    relaxed = True
                    data[d + R.f_max] = max(data[d + R.f_max], thrust * 1.001)
                    angle = math.acos(min(max(uz / thrust, 0.05), 1.0)) + 1e-3
                    data[d + R.tilt] = max(data[d + R.tilt], math.tan(min(angle, 1.55)))
        data[d + R.w], data[d + R.w + 1], data[d + R.w + 2] = t * x, t * y, t * z
        for k in range(3):
            data[d + R.dw + k] = 0.0
    return relaxed


@inline
def broken(n, flying, unit, cos_cone, cos_box, length, params, data):  # type: ignore[no-untyped-def]
    """Whether an answer is outside of any limit that a start may have relaxed, as bits; pairs apart."""
    boxed = column(params, P.rows, n, PLACES.boxed)
    thrusts = column(params, P.rows, n, PLACES.f_max)
    bits = 0
    for i in range(n):
        d = WIDTH * i
        x, y, z = data[d + R.w], data[d + R.w + 1], data[d + R.w + 2]
        size = math.sqrt(x * x + y * y + z * z)
        if -z < (cos_cone - ROUNDING) * size:
            bits |= CONE
        if boxed[i] != 0.0:
            out = x * data[d + R.box + 1] + y * data[d + R.box + 2] + z * data[d + R.box + 3]
            if out < (cos_box - ROUNDING) * size:
                bits |= BOX
        if flying:
            x, y, z = data[d + R.own] - x, data[d + R.own + 1] - y, data[d + R.own + 2] - z
            size = math.sqrt(x * x + y * y + z * z)
            if size > thrusts[i] * unit * (1.0 + ROUNDING):
                bits |= POWER
            if z < (math.cos(math.atan(params[P.tilt])) - ROUNDING) * size:
                bits |= TILT
    return bits


@inline
def pairs_broken(n, m, flat, length, pairs, params, data):  # type: ignore[no-untyped-def]
    """Bits of the distances that a watched pair does not keep."""
    bits = 0
    for p in range(m):
        o = PAIR * p
        kind, i, j = int(pairs[o + V.kind]), int(pairs[o + V.i]), int(pairs[o + V.j])
        size, _, _, _, _, _ = between(kind, i, j, flat, length, data)
        if size < least_of(kind, i, j, n, params) * (1.0 - ROUNDING):
            bits |= bit_of(kind)
    return bits


@inline
def bit_of(kind):  # type: ignore[no-untyped-def]
    if kind == metres.DRONES:
        return DRONES
    return GAP if kind == metres.CABLES else CABLE


@inline
def at_work(n, m, pairs, data):  # type: ignore[no-untyped-def]
    """Bits of the limits that push with more than a tenth of a share."""
    bits = 0
    for i in range(n):
        z = WIDTH * i + R.z
        bits |= T_MAX if data[z + elastic.T_MAX] > 0.1 else 0
        bits |= T_MIN if data[z + elastic.T_MIN] > 0.1 else 0
        bits |= CONE if data[z + elastic.CONE] > 0.1 else 0
        bits |= RATE if data[z + elastic.RATE] > 0.1 else 0
        bits |= POWER if data[z + elastic.POWER] > 0.1 else 0
        bits |= TILT if data[z + elastic.TILT] > 0.1 else 0
        bits |= BOX if data[z + elastic.BOX] > 0.1 else 0
    for p in range(m):
        if pairs[PAIR * p + V.z] > 0.1:
            bits |= bit_of(int(pairs[PAIR * p + V.kind]))
    return bits


@inline
def slewed(fx, fy, most, memory):  # type: ignore[no-untyped-def]
    """The level force, from the last one on by no more than ``most``, N."""
    asked = memory[M.asked : M.asked + 3]
    if asked[2] != 0.0:
        dx, dy = fx - asked[0], fy - asked[1]
        size = math.sqrt(dx * dx + dy * dy)
        if size > most:
            fx, fy = asked[0] + dx * most / size, asked[1] + dy * most / size
    asked[0], asked[1], asked[2] = fx, fy, 1.0
    return fx, fy


@inline
def nothing(n, span, ax, ay, az, ends, lost):  # type: ignore[no-untyped-def]
    """Combinations of the wrench's rows that no cable force changes, into ``lost``; their number."""
    if span == BODY:
        return 0
    cx, cy, cz = wrench.middle(n, ends)
    if span == LINE:
        lost[0], lost[1], lost[2] = cy * az - cz * ay, cz * ax - cx * az, cx * ay - cy * ax
        lost[3], lost[4], lost[5] = ax, ay, az
        return 1
    for k in range(18):
        lost[k] = 0.0
    lost[1], lost[2], lost[3] = cz, -cy, 1.0
    lost[6], lost[8], lost[10] = -cz, cx, 1.0
    lost[12], lost[13], lost[17] = cy, -cx, 1.0
    return 3


@inline
def left_over(n, f, data):  # type: ignore[no-untyped-def]
    """What the answer leaves of the wrench, in shares."""
    fx, fy, fz, mx, my, mz = f[0], f[1], f[2], f[3], f[4], f[5]
    for i in range(n):
        d = WIDTH * i
        rx, ry, rz = data[d + R.end], data[d + R.end + 1], data[d + R.end + 2]
        x, y, z = data[d + R.w], data[d + R.w + 1], data[d + R.w + 2]
        fx, fy, fz = fx + x, fy + y, fz + z
        mx, my, mz = mx + ry * z - rz * y, my + rz * x - rx * z, mz + rx * y - ry * x
    return fx, fy, fz, mx, my, mz
