"""The safe allocator for rigid loads: a wrench shared among cables, under hard limits on cables, drones and distances."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from colift.control.allocation.base import (
    INFO_ACTIVE,
    INFO_BALANCE,
    INFO_GAP,
    INFO_MOMENT,
    INFO_OBJECTIVE,
    INFO_RESIDUAL,
    SIGNATURE,
    Allocator,
    Status,
)
from colift.control.allocation.common.wrenches import imbalance
from colift.control.allocation.limits import elastic, metres
from colift.control.allocation.limits.cycle import LEVEL as LEAN_MOST
from colift.control.allocation.limits.cycle import MAX_TURN
from colift.control.allocation.limits.usual import (
    LOW,
    RATE,
    Degrees,
    Distance,
    Force,
    Limited,
    share_of,
)
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion, wrench
from colift.kernel.math.columns import column
from colift.kernel.spans import BODY, LINE, POINT
from colift.part import Vector
from colift.team import Team
from colift.team.geometry import Array
from colift.team.load import LEVEL
from colift.team.plan import least_lean, plan, shares, spanned

_CONVERGED = int(Status.CONVERGED)
_ITERATION_LIMIT = int(Status.ITERATION_LIMIT)
_INVALID_FORCE = int(Status.INVALID_FORCE)
_FORCE_REDUCED = int(Status.FORCE_REDUCED)
_RECOVERING = int(Status.RECOVERING)

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

TURNING = 3.0
"""Fastest turn of a cable of 1 m that holds a rigid load, rad/s."""
LOWER, PLANNED = 0.15, 0.3
"""Least tension of a cable that holds a rigid load, over its share of the weight, and least upright part of what is planned for it."""
PRICES = {"horizontal": 60.0, "vertical": 1000.0, "tip": 200.0, "yaw": 20.0}
"""Of what is missing of a wrench, in shares of the load: yaw gives way first, then horizontal force, roll and pitch, the weight last."""
ROOM = 1e-3
"""Part of the range of tensions that a start keeps from its ends."""
LIFT = 0.6
"""Least tension of a start, over the plan's: a cable that is almost slack can hardly turn the others' way."""
INSIDE = 0.05
"""Of the largest turn, how far inside of a cone a start is."""
AHEAD = 1.5
"""Of the wanted attitude's next turn, what distances and cones keep for it."""
WITH_LOAD = 0.4
"""Part of the largest turn by which the last cables turn with the wanted attitude before anything else."""
BUFFER, BUFFER_ANGLE = 1e-3, math.radians(0.1)
"""What they keep anyhow, m, rad."""
FADE = 0.75
"""Part of what is left of it that a pair keeps within a cycle, where its buffer is used up."""
ROUNDING = 1e-9
ANY = 1e6
"""Force that nothing limits, N."""
STEEP = 5.0
"""Angle of a plan's cables that needs little thrust, degrees."""
RECOVERY = 5.0
"""Time in which a start that breaks a limit must be led back, s."""
BROKEN = {
    4: "max_cone_deg", 16: "max_thrust", 32: "max_tilt_deg", 128: "min_distance", 256: "cable_distance", 512: "box_deg",
    1024: "cable_gap",
}  # fmt: skip
"""Settings by their bit of ``active_limits``."""
COUPLED = 4
"""Most pairs in a step's matrix, for each cable; others only shorten the step."""


@inline
def lead_in(c, ax, ay, az, tan, turn, x, y, z):  # type: ignore[no-untyped-def]
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
            push(PAIR * p, n, flat, delta, length, pairs, data)
        worse = False
        for p in range(m):
            o = PAIR * p
            kind, i, j = int(pairs[o + V.kind]), int(pairs[o + V.i]), int(pairs[o + V.j])
            size, _, _, _, _, _ = between(kind, i, j, flat, length, data)
            worse = worse or size < 0.5 * (pairs[o + V.g] + pairs[o + V.least])
        if worse and not wrong:  # what helps one pair would cost another one its room
            for i in range(n):
                for c in range(3):
                    data[WIDTH * i + R.w + c] = data[WIDTH * i + R.best + c]
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
def push(o, n, flat, delta, length, pairs, data):  # type: ignore[no-untyped-def]
    """Turn both cables of a pair apart, by what its buffer lacks, and by no more than half of the largest turn together."""
    kind, i, j = int(pairs[o + V.kind]), int(pairs[o + V.i]), int(pairs[o + V.j])
    size, nx, ny, nz, u, v = between(kind, i, j, flat, length, data)
    lack = pairs[o + V.least] + pairs[o + V.z] - size
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
        x, y, z, tan = lead_in(0, 0.0, 0.0, -1.0, params[P.cone], 0.5 * turn, x, y, z)
        data[d + R.cone] = tan
        data[d + R.box] = 0.0
        if boxed[i] != 0.0:
            bx, by, bz = data[d + R.box + 1], data[d + R.box + 2], data[d + R.box + 3]
            x, y, z, tan = lead_in(0, bx, by, bz, tan_box, 0.5 * turn, x, y, z)
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
            bits |= 4
        if boxed[i] != 0.0:
            out = x * data[d + R.box + 1] + y * data[d + R.box + 2] + z * data[d + R.box + 3]
            if out < (cos_box - ROUNDING) * size:
                bits |= 512
        if flying:
            x, y, z = data[d + R.own] - x, data[d + R.own + 1] - y, data[d + R.own + 2] - z
            size = math.sqrt(x * x + y * y + z * z)
            if size > thrusts[i] * unit * (1.0 + ROUNDING):
                bits |= 16
            if z < (math.cos(math.atan(params[P.tilt])) - ROUNDING) * size:
                bits |= 32
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
        return 128
    return 1024 if kind == metres.CABLES else 256


@inline
def at_work(n, m, pairs, data):  # type: ignore[no-untyped-def]
    """Bits of the limits that push with more than a tenth of a share."""
    bits = 0
    for i in range(n):
        z = WIDTH * i + R.z
        bits |= 1 if data[z + elastic.T_MAX] > 0.1 else 0
        bits |= 2 if data[z + elastic.T_MIN] > 0.1 else 0
        bits |= 4 if data[z + elastic.CONE] > 0.1 else 0
        bits |= 8 if data[z + elastic.RATE] > 0.1 else 0
        bits |= 16 if data[z + elastic.POWER] > 0.1 else 0
        bits |= 32 if data[z + elastic.TILT] > 0.1 else 0
        bits |= 512 if data[z + elastic.BOX] > 0.1 else 0
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


@kernel(SIGNATURE, counted=False)
def _allocate(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    force, moment = sees.force, sees.moment
    tensions, directions = writes.desired_tensions, writes.desired_directions
    info = writes.allocator_info
    n = tensions.shape[0]
    count = n * (n - 1) // 2
    watched = metres.KINDS * count
    rest_at = M.rows + M.width * n
    pairs_at = rest_at + count
    square_at = pairs_at + PAIR * watched
    most_rows = min(COUPLED * n, watched)
    order = 6 + most_rows
    right_at = square_at + order * order
    moved_at = right_at + order
    data = column(memory, M.rows, n, COLUMNS.row)
    last = column(memory, M.rows, n, COLUMNS.last)
    spare = column(memory, M.rows, n, COLUMNS.w)
    ends = column(memory, M.rows, n, COLUMNS.end)
    places = column(memory, M.rows, n, COLUMNS.place)
    rest = memory[rest_at:pairs_at]
    pairs = memory[pairs_at:square_at]
    moved = memory[moved_at : moved_at + n + 1]
    f = memory[M.f : M.f + 6]
    length = column(params, P.rows, n, PLACES.length)
    arms = column(params, P.rows, n, PLACES.arm)

    for k in range(info.shape[0]):
        info[k] = 0.0
    known, qw, qx, qy, qz = wrench.unit_attitude(sees.estimated_load_attitude)
    wanted, pw, px, py, pz = wrench.unit_attitude(sees.reference_attitude)
    fx, fy, fz = force[0], force[1], force[2]
    mx, my, mz = moment[0], moment[1], moment[2]
    if not (known and wanted and math.isfinite(fx + fy + fz) and math.isfinite(mx + my + mz)):
        info[INFO_RESIDUAL] = math.nan
        info[INFO_GAP] = math.nan
        info[INFO_OBJECTIVE] = math.nan
        info[INFO_BALANCE] = math.nan
        info[INFO_MOMENT] = math.nan
        return _INVALID_FORCE
    sigma = params[P.sigma]
    unit = 1.0 / sigma
    period = dt if dt > 1e-6 else 1e-6
    delta = min(params[P.max_rate] * period, MAX_TURN)
    limit = params[P.most]
    if params[P.slew] > 0.0:
        fx, fy = slewed(fx, fy, params[P.slew] * n * sigma * delta, memory)
    fx = min(max(fx, -limit), limit) * unit
    fy = min(max(fy, -limit), limit) * unit
    fz = min(max(fz, -limit), limit) * unit
    scale = unit / params[P.arm_unit]
    limit *= 2.0 * params[P.arm_unit]
    mx = min(max(mx, -limit), limit) * scale
    my = min(max(my, -limit), limit) * scale
    mz = min(max(mz, -limit), limit) * scale

    # Ends: as they are for the wrench, in the load's length; as they should be for distances, in metres.
    wrench.turned(qw, qx, qy, qz, n, arms, ends)
    wrench.turned(pw, px, py, pz, n, arms, places)
    back = 1.0 / params[P.arm_unit]
    for k in range(3 * n):
        ends[k] *= back
    span = params[P.span]
    ax, ay, az = quaternion.into_world(
        qw, qx, qy, qz, params[P.axis], params[P.axis + 1], params[P.axis + 2]
    )
    mx, my, mz = wrench.possible(n, span, ax, ay, az, fx, fy, fz, mx, my, mz, ends)
    f[0], f[1], f[2], f[3], f[4], f[5] = fx, fy, fz, mx, my, mz

    # The plan, turned and scaled, and the forces nearest to it: the least cost of all.
    W = math.sqrt(fx * fx + fy * fy + fz * fz)
    cos_yaw, sin_yaw = wrench.heading(pw, px, py, pz)
    formation = column(params, P.rows, n, PLACES.plan)
    if sees.formation[0, 2] != 0.0:
        formation = sees.formation.reshape(3 * n)
    if 0.1 * n < W:
        wrench.planned(n, fx, fy, fz, W, cos_yaw, sin_yaw, formation, spare)
    else:
        wrench.planned(n, 0.0, 0.0, 0.1 * n, 0.1 * n, cos_yaw, sin_yaw, formation, spare)
    outs = column(params, P.rows, n, PLACES.out)
    for i in range(n):
        d = WIDTH * i
        for k in range(3):
            data[d + R.home + k] = spare[3 * i + k]
            data[d + R.end + k] = ends[3 * i + k]
            data[d + R.place + k] = places[3 * i + k]
        x, y, z = quaternion.into_world(
            pw, px, py, pz, outs[3 * i], outs[3 * i + 1], outs[3 * i + 2]
        )
        data[d + R.box + 1], data[d + R.box + 2], data[d + R.box + 3] = -x, -y, -z
    ux, uy, uz, vx, vy, vz = wrench.unmet(n, fx, fy, fz, mx, my, mz, ends, spare)
    wrench.correct(n, span, ax, ay, az, ux, uy, uz, vx, vy, vz, ends, spare)
    ux, uy, uz, vx, vy, vz = wrench.unmet(n, fx, fy, fz, mx, my, mz, ends, spare)
    wrench.correct(n, span, ax, ay, az, ux, uy, uz, vx, vy, vz, ends, spare)
    bound = 0.0
    for i in range(n):
        for k in range(3):
            bound += 0.5 * (spare[3 * i + k] - data[WIDTH * i + R.home + k]) ** 2

    # Limits, and a start inside of them.
    rates = sees.reference_rates
    spin = math.sqrt(rates[0, 0] ** 2 + rates[0, 1] ** 2 + rates[0, 2] ** 2)
    ahead = min(spin * period, 0.1) if math.isfinite(spin) else 0.0
    flying = params[P.flying] != 0.0
    if flying:
        accelerate(n, sees.reference, (pw, px, py, pz), rates, arms, data)
        fly(n, unit, params, data)
    q = memory[M.attitude : M.attitude + 4]
    turning = turned_by(q, memory[M.known] != 0.0, pw, px, py, pz, WITH_LOAD * delta)
    relaxed = starts(n, unit, delta, ahead, turning, flying, tensions, directions, params, data)
    m = rows = 0
    if params[P.metres] != 0.0:
        rotate = 0.0
        if memory[M.known] == 0.0:
            memory[M.known] = 1.0
            for k in range(count):
                rest[k] = -1.0
        sign = -1.0 if q[0] * pw + q[1] * px + q[2] * py + q[3] * pz < 0.0 else 1.0
        rotate = (sign * q[0] - pw) ** 2 + (sign * q[1] - px) ** 2
        rotate += (sign * q[2] - py) ** 2 + (sign * q[3] - pz) ** 2
        moved[n] = 2.0 * math.sqrt(rotate)
        q[0], q[1], q[2], q[3] = pw, px, py, pz
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
        m = watch(n, delta, ahead, moved, params, length, rest, pairs, data)
        rows = min(m, most_rows)

    # The least cost of all, where it is within all limits; else the iteration.
    for i in range(n):
        d = WIDTH * i
        for k in range(3):
            data[d + R.dw + k] = spare[3 * i + k] - data[d + R.w + k]
    simple = elastic.to_the_rim(n, flying, data) > 1.0
    for p in range(m):
        simple = simple and elastic.margin(PAIR * p, params[P.flat], 1.0, pairs, length, data) > 0.0
    if simple:
        outcome = elastic.CONVERGED
        for i in range(n):
            d = WIDTH * i
            for k in range(3):
                data[d + R.w + k] = spare[3 * i + k]
            for k in range(elastic.LIMITS):
                data[d + R.z + k] = 0.0
        for p in range(m):
            pairs[PAIR * p + V.z] = 0.0
    else:
        for i in range(n):
            for k in range(elastic.LIMITS):
                data[WIDTH * i + R.z + k] = 0.0
        lost = memory[M.lost : M.lost + 18]
        none = nothing(n, span, ax, ay, az, ends, lost)
        work = (
            data, pairs, length, memory[square_at:right_at], memory[right_at:moved_at], memory[M.lam : M.lam + 6],
            memory[M.plus : M.plus + 6], memory[M.minus : M.minus + 6], memory[M.miss : M.miss + 6],
        )  # fmt: skip
        task = (
            params[P.barrier], params[P.tolerance], int(params[P.iterations]), params[P.flat], none
        )  # fmt: skip
        outcome = elastic.iterate(
            n, flying, m, rows, task, lost, params[P.price : P.price + 6], f, work, info
        )

    J = 0.0
    for i in range(n):
        d = WIDTH * i
        x, y, z = data[d + R.w], data[d + R.w + 1], data[d + R.w + 2]
        for k in range(3):
            J += 0.5 * (data[d + R.w + k] - data[d + R.home + k]) ** 2
            spare[3 * i + k] = data[d + R.w + k] * sigma
            ends[3 * i + k] *= params[P.arm_unit]
        t = math.sqrt(x * x + y * y + z * z)
        tensions[i] = t * sigma
        t = 1.0 / t
        directions[i, 0], directions[i, 1], directions[i, 2] = x * t, y * t, z * t
    balance, _ = imbalance(force, moment, ends, spare, info)
    info[INFO_OBJECTIVE] = J * sigma * sigma
    info[INFO_GAP] = (J - bound) * sigma * sigma
    bits = at_work(n, rows, pairs, data)
    ux, uy, uz, vx, vy, vz = left_over(n, f, data)
    turning = math.sqrt(vx * vx + vy * vy + vz * vz)
    reduced = balance > 1e-8 * max(1.0, sigma) or turning > 1e-8 * max(1.0, unit)
    cos_cone = math.cos(math.atan(params[P.cone]))
    if relaxed or m > 0:
        cos_box = math.cos(math.atan(params[P.box_angle]))
        wrong = pairs_broken(n, m, params[P.flat], length, pairs, params, data)
        if relaxed:
            wrong |= broken(n, flying, unit, cos_cone, cos_box, length, params, data)
        info[INFO_ACTIVE] = float(bits | wrong)
        if wrong != 0:
            return _RECOVERING
    info[INFO_ACTIVE] = float(bits)
    if reduced:
        return _FORCE_REDUCED
    return _CONVERGED if outcome == elastic.CONVERGED else _ITERATION_LIMIT


class SafeWrench(Limited):
    """The cable forces nearest to a hover formation that make the wanted force and moment, under hard limits.

    The limits hold in every answer. Where they do not allow the whole wrench, it gives way in this order: yaw, horizontal force,
    roll and pitch, the weight last. A load that is a point has no moment, and one on two cables none about the line through their ends: what
    no formation can make is left out.
    """

    kernel = _allocate
    wrenches = True
    spread_setting = ("cone_deg", (10.0, 20.0, 30.0, 40.0, 50.0))
    per_drone = ("tension_min", "tension_max", "max_thrust", "min_distance", "cable_distance")
    of_all = ("tension_min", "tension_max", "max_rate")
    from_team: ClassVar[Mapping[str, float | None]] = {
        "tension_min": 0.05,
        "tension_max": None,
        "max_thrust": None,
        "max_rate": 6.0,
        "min_distance": 0.0,
        "cable_distance": 0.0,
    }

    cone_deg: Degrees = 30.0
    """Angle of the plan's cables from the vertical in hover, degrees; more where distances ask for it."""
    min_distance: Distance | list[Distance] | None = None
    """Least distance between the centres of two drones, m; one value, or one per drone: two keep the mean of theirs. 0: not
    limited. None: 2.4 of ``drones.radius`` where that is known, else 0."""
    downwash: Annotated[float, Field(ge=1.0, le=10.0)] = 2.0
    """How much more of ``min_distance`` drones keep above each other than beside each other."""
    cable_distance: Distance | list[Distance] | None = None
    """Least distance of a drone's centre from the others' cables, m; one value, or one per drone. 0: not limited. None: 1.2 of
    ``drones.radius`` where that is known, else 0."""
    cable_gap: Distance | None = None
    """Least distance between two cables, m. 0: not limited. None: 5 cm, or half of that between the nearest two attachments."""
    box_deg: Annotated[float, Field(ge=0.0, lt=60.0)] = 5.0
    """Least angle between a cable and the load's surface where it ends, degrees. 0: not limited."""
    tension_min: Force | list[Force] | None = None
    """Least tension, N; one value, or one per cable. None: where ``drones.max_thrust`` is known 0.15 of a cable's share of a rigid load's
    weight, half of one of a point's, else 0.05."""
    tension_max: Force | list[Force] | None = None
    """Largest tension, N; one value, or one per cable. None: what 0.95 of ``drones.max_thrust`` lifts beside the drone,
    or six shares of the weight."""
    max_cone_deg: Degrees = 75.0
    """Largest angle between a cable and the vertical, degrees: drones stay above the load."""
    max_rate: Annotated[float, Field(gt=0.0, le=1e3)] | None = None
    """Fastest turn of a cable's direction, rad/s. None: where ``drones.max_thrust`` is known, 3 for a cable of 1 m and less as the
    square root of its length, as a rigid load is moved by cables that turn; 0.4 on a point, 1 for teams of one or two; else 6."""
    max_thrust: Force | list[Force] | None = None
    """Largest thrust of a drone, N. None: 0.95 of ``drones.max_thrust``, or not limited."""
    max_tilt_deg: Degrees | None = None
    """Largest angle between a drone's thrust and the vertical, degrees; none: not limited."""
    slew: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    """Fastest change of the level force that is asked of the cables, over what the formation gives that turns as a whole
    with ``max_rate``. 0: not limited."""
    barrier: Annotated[float, Field(ge=1e-9, le=0.1)] = 1e-5
    """Barrier of all limits where the whole wrench is given, in squared shares of the load."""
    tolerance: Annotated[float, Field(ge=1e-10, le=1e-2)] = 1e-4
    """KKT residual, in shares of the load, at which the iteration stops."""
    max_iterations: Annotated[int, Field(ge=2, le=200)] = 40
    """Most interior-point steps in one call; limits hold after every step."""

    def left_open(self, team: Team) -> dict[str, Vector]:
        rate, low = (RATE, LOW) if team.body is None else (TURNING, LOWER)
        found = self.usual_limits(team, rate, low)
        caps = found["tension_max"]
        return {**found, "tension_max": np.where(np.isnan(caps), 6.0 * share_of(team), caps)}

    def check(self, team: Team) -> list[tuple[str, str]]:
        return super().check(team) or self.crossed(team)

    def with_any_thrust(self, team: Team) -> SafeWrench:
        free = {"max_thrust", "tension_max"} & {*self.by_team(team)}
        return self.model_copy(update={**dict.fromkeys(free, ANY), "cone_deg": STEEP})

    def cannot_start(self, team: Team, directions: Array) -> str:
        allocator = Allocator(self, team)
        allocator.reset(directions)
        for _ in range(round(RECOVERY / allocator.dt)):
            answer = allocator.allocate([0.0, 0.0, team.load_mass * team.gravity])
            if answer.status is not Status.RECOVERING:
                return ""
        names = [name for bit, name in BROKEN.items() if answer.active_limits & bit]
        return (
            f"breaks a limit and cannot be led back: after {RECOVERY:g} s of hover the {team.n} cables would still break "
            f"{', '.join(names)}: start within the limits, or ask for less"
        )

    def leaning(self, team: Team) -> tuple[float, Array] | None:
        return least_lean(team, **self._asked(team))

    def cannot_hold(self, team: Team, thrusts: Vector, directions: Array) -> list[str]:
        """By its plan of the load as it hangs: what that needs of attachments, tensions and thrusts."""
        held = self.leaning(team)
        if held is None:
            return [
                f"its {team.n} cables hold the load neither level nor leaning: its weight is not between their ends"
            ]
        if held[0] > 0.0 and team.body is not None and np.array_equal(team.body.hang, LEVEL):
            return [
                f"its {team.n} cables hold the load only leaning, not level: its weight is not between their ends"
            ]
        along, tensions = self.formation(team)
        problems = []
        caps = self.tension_caps(team)
        if np.any(tensions > caps):
            i = int(np.argmax(tensions - caps))
            problems.append(
                f"cable {i} would need {tensions[i]:.3g} N of tension_max = {caps[i]:.3g}"
            )
        needed = team.hover_thrusts(tensions, along)
        if np.any(needed > thrusts):
            i = int(np.argmax(needed - thrusts))
            problems.append(f"drone {i} would need {needed[i]:.3g} N of its {thrusts[i]:.3g} N")
        return problems

    def gap(self, team: Team) -> float:
        """Least distance between two cables, m; 0: not limited."""
        if self.cable_gap is not None:
            return self.cable_gap
        if team.n < 2:
            return 0.0
        i, j = np.triu_indices(team.n, k=1)
        ends = np.linalg.norm(team.levers[i] - team.levers[j], axis=1)
        return min(0.05, 0.5 * float(ends.min()))

    def formation(self, team: Team) -> tuple[Array, Array]:
        return plan(team, **self._asked(team))

    def _asked(self, team: Team) -> dict[str, Any]:
        """What is asked of a plan."""
        most = math.radians(self.max_cone_deg)
        return {
            "lean": min(math.radians(self.cone_deg), 0.9 * most),
            "widest": 0.9 * most,
            "distance": self.drone_distances(team),
            "downwash": self.downwash,
            "least": np.maximum(1.1 * self.tension_floors(team), PLANNED * share_of(team)),
        }

    def params(self, team: Team) -> Vector:
        n = team.n
        span, axis = spanned(team)
        sigma = max(share_of(team), 1e-6)
        size = max(float(np.abs(team.levers).max()), 1e-3)
        most = self.thrust_limits(team)
        flying = bool(np.isfinite(most).any()) or self.max_tilt_deg is not None
        caps = self.tension_caps(team)
        sizes, rotors, gap = self.drone_distances(team), self.cable_distances(team), self.gap(team)
        if span == POINT:
            rotors, gap = np.zeros(n), 0.0  # cables that meet come as near as they like
        outs = outward(team)
        level, tip = PRICES["horizontal"], PRICES["tip"]
        order = [level, level, PRICES["vertical"], tip, tip, PRICES["yaw"]]
        head = Layout(team=PARAMS.team).pack(
            0,
            sigma=sigma,
            arm_unit=size,
            span=span,
            axis=axis,
            most=2.0 * float(caps.sum()),
            max_rate=self.turn_rate(team),
            cone=math.tan(math.radians(self.max_cone_deg)),
            tilt=math.tan(math.radians(self.max_tilt_deg or 89.0)),
            flat=1.0 / self.downwash**2,
            box_angle=math.tan(math.radians(90.0 - max(self.box_deg, 1.0))),
            slew=self.slew,
            barrier=self.barrier,
            tolerance=self.tolerance,
            iterations=self.max_iterations,
            g=team.gravity,
            flying=flying,
            price=order,
            metres=bool(sizes.any() or rotors.any() or gap > 0.0),
            rods=bool(rotors.any() or gap > 0.0),
            clear=gap,
        )
        columns = (
            shares(team, *self.formation(team)), team.levers, outs,
            np.any(outs != 0.0, axis=1) & (self.box_deg > 0.0), self.tension_floors(team), caps, team.masses,
            np.minimum(most, 1e6), team.cable_lengths, sizes, rotors,
        )  # fmt: skip
        return np.concatenate(
            [head, *(np.ravel(np.asarray(each, dtype=float)) for each in columns)]
        )

    def memory(self, team: Team) -> Vector:
        n = team.n
        count = n * (n - 1) // 2
        watched = metres.KINDS * count
        order = 6 + min(COUPLED * n, watched)
        return np.zeros(MEMORY.size(n) + count + PAIR * watched + order * order + order + n + 1)

    def carry_over(self, old: Vector, fresh: Vector, places: NDArray[np.int64]) -> Vector:
        return fresh  # all that is remembered is how far pairs are apart


def outward(team: Team) -> Array:
    """Normals (n, 3) of the load's box where the cables end on it, in the load's frame; zero within the box, and where it faces down.

    On an edge or corner the mean of its faces, the top one twice.
    """
    normals = np.zeros((team.n, 3))
    if team.body is None:
        return normals
    half = 0.5 * team.body.size
    for i, end in enumerate(team.body.attachments):
        on = (np.abs(end) >= half * (1.0 - 1e-6)) & (half > 0.0)
        normal = np.where(on, np.sign(end), 0.0) * np.array([1.0, 1.0, 2.0])
        if normal[2] < 0.0:
            normal[2] = 0.0
        size = np.linalg.norm(normal)
        normals[i] = normal / size if size > 0.0 else 0.0
    return normals
