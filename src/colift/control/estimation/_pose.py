"""Where a rigid load is and how it is turned, from the drones and their cables alone: an extended Kalman filter on SE(3).

A taut cable holds its end ``x + R rho_i`` at its length from its drone, ``L_i``, and lets it come no nearer and go no farther; and a drone feels along which line
it is pulled: its accelerometer's force less its thrust. Between measurements the load moves as Newton's and Euler's laws have it under the wanted tensions. With errors
in the load's frame, ``x += R xi``, ``R <- R exp(eta^)``, and ``a_i`` from drone to end there, at the distance ``d_i``::

    L_i  = d_i + a_i . xi + (rho_i x a_i) . eta
    L_i' = a_i . R^T (v_end - v_i) + a_i . nu + (rho_i x a_i) . dOmega
    u_i  = a_i + (I - a_i a_i^T) (xi + eta x rho_i) / d_i

one number after the other (sequential update), so that no matrix is inverted and what nothing measures just stays uncertain: the turn of a bar about its line
of attachments. The dynamics say the rest: below drones that stand, a load swings about where it hangs.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from colift.kernel.jit import aside, inline
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion
from colift.kernel.math.ages import newer
from colift.kernel.math.small import cross, matrix_times

STATE = 12
"""Errors of place, turn, speed and rates."""
POSE = Layout(
    team={
        "alive": 1, "since": 1, "x": 3, "q": 4, "v": 3, "W": 3, "error": STATE, "h": STATE, "k": STATE,
        "A": 36, "P": STATE * STATE,
    }
)  # fmt: skip
"""Place of the centre of mass (world), attitude, its velocity (world), rates (load); covariance ``P`` of their errors; time ``since`` they held."""
CABLE = Layout(team={"felt_age": 1, "pull": 1, "fresh": 1, "line": 3})
"""Of a drone: age of the accelerometer's last sample; pull that it feels along its cable, smoothed; whether what pulls at it is new, N, world."""
BODY = Layout(team={"J": 9, "inverse": 9, "centre": 3})
"""Parameters: inertia and its inverse, and where the centre of mass is, in the load's frame."""
M, C, B = POSE.at, CABLE.at, BODY.at

LENGTH, SPEED, LINE = 0.003, 0.02, 0.1
"""Deviations of a distance, m, its rate, m/s, and a felt direction, rad: of drones as they are known now."""
PUSH, TWIST = 0.1, 0.2
"""What the laws of motion leave out, in a second: m/s^2 and rad/s^2."""
FIRST = (0.05, 0.2, 0.2, 0.3)
"""Deviations at the start: of place, m, turn, rad, speed, m/s, and rates, rad/s."""
TAUT = 0.25
"""Share of its wanted tension from which on a cable counts as taut."""
SMOOTH = 0.2
"""Share of a new sample in the pull that is felt."""
SURPRISE = 0.1
"""Most that one measurement may surprise with: m, m/s, rad."""
HELD = 2
"""Cables that must be taut; with fewer the load is left where it is."""


@inline
def rotate(o, memory, v):  # type: ignore[no-untyped-def]
    """From the load's frame into the world."""
    q = o + M.q
    return quaternion.into_world(
        memory[q], memory[q + 1], memory[q + 2], memory[q + 3], v[0], v[1], v[2]
    )


@inline
def unrotate(o, memory, v):  # type: ignore[no-untyped-def]
    """From the world into the load's frame."""
    q = o + M.q
    return quaternion.into_body(
        memory[q], memory[q + 1], memory[q + 2], memory[q + 3], v[0], v[1], v[2]
    )


@inline
def dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@aside
def towards(o, rho, i, positions, memory):  # type: ignore[no-untyped-def]
    """Unit vector from drone i to its cable's end, and their distance; in the load's frame."""
    x, y, z = unrotate(
        o, memory,
        (memory[o + M.x] - positions[i, 0], memory[o + M.x + 1] - positions[i, 1], memory[o + M.x + 2] - positions[i, 2]),
    )  # fmt: skip
    x, y, z = x + rho[0], y + rho[1], z + rho[2]
    d = max(math.sqrt(x * x + y * y + z * z), 1e-6)
    return (x / d, y / d, z / d), d


@aside
def restart(o, x, q, v, W, memory):  # type: ignore[no-untyped-def]
    """Believe this place of the centre of mass, attitude, velocity and rates, with the deviations of a start."""
    for k in range(3):
        memory[o + M.x + k], memory[o + M.v + k], memory[o + M.W + k] = x[k], v[k], W[k]
    for k in range(4):
        memory[o + M.q + k] = q[k]
    for k in range(STATE * STATE):
        memory[o + M.P + k] = 0.0
    for k in range(STATE):
        memory[o + M.P + (STATE + 1) * k] = FIRST[k // 3] * FIRST[k // 3]
    memory[o + M.alive], memory[o + M.since] = 1.0, 0.0


@aside
def believe(o, body, params, memory, writes):  # type: ignore[no-untyped-def]
    """Start where the load was estimated to be last."""
    q, w, place = writes.estimated_load_attitude, writes.estimated_load_rates, writes.estimated_load
    c, W = (
        (params[body + B.centre], params[body + B.centre + 1], params[body + B.centre + 2]),
        (w[0], w[1], w[2]),
    )
    away = quaternion.into_world(q[0], q[1], q[2], q[3], c[0], c[1], c[2])
    turn = cross(W, c)
    flow = quaternion.into_world(q[0], q[1], q[2], q[3], turn[0], turn[1], turn[2])
    x = (place[0, 0] + away[0], place[0, 1] + away[1], place[0, 2] + away[2])
    v = (place[1, 0] + flow[0], place[1, 1] + flow[1], place[1, 2] + flow[2])
    restart(o, x, (q[0], q[1], q[2], q[3]), v, W, memory)


@aside
def guess(o, n, arms, apart, lengths, params, positions, velocities, directions, memory):  # type: ignore[no-untyped-def]
    """Start level, where the cables' ends are if cables are as they are wanted: the heading and middle that fit them best."""
    scale = 1.0 / n
    px = py = pz = rx = ry = rz = vx = vy = vz = 0.0
    for i in range(n):
        a, L = arms + apart * i, params[lengths + apart * i]
        px, py = (
            px + scale * (positions[i, 0] + L * directions[i, 0]),
            py + scale * (positions[i, 1] + L * directions[i, 1]),
        )
        pz += scale * (positions[i, 2] + L * directions[i, 2])
        rx, ry, rz = rx + scale * params[a], ry + scale * params[a + 1], rz + scale * params[a + 2]
        vx, vy, vz = vx + scale * velocities[i, 0], vy + scale * velocities[i, 1], vz + scale * velocities[i, 2]  # fmt: skip
    sine = cosine = 0.0
    for i in range(n):
        a, L = arms + apart * i, params[lengths + apart * i]
        ax, ay = params[a] - rx, params[a + 1] - ry
        bx, by = (
            positions[i, 0] + L * directions[i, 0] - px,
            positions[i, 1] + L * directions[i, 1] - py,
        )
        sine, cosine = sine + ax * by - ay * bx, cosine + ax * bx + ay * by
    half = 0.5 * math.atan2(sine, cosine)
    q = (math.cos(half), 0.0, 0.0, math.sin(half))
    x, y, z = quaternion.into_world(q[0], q[1], q[2], q[3], rx, ry, rz)
    restart(o, (px - x, py - y, pz - z), q, (vx, vy, vz), (0.0, 0.0, 0.0), memory)


@aside
def add_cable(o, rho, a, d, T, m, body, params, memory):  # type: ignore[no-untyped-def]
    """Add to ``A`` (6, 6) how the pull of one cable changes with the load's place and turn, as accelerations."""
    end = (d * a[0] - rho[0], d * a[1] - rho[1], d * a[2] - rho[2])
    for j in range(6):
        e = (1.0 if j % 3 == 0 else 0.0, 1.0 if j % 3 == 1 else 0.0, 1.0 if j % 3 == 2 else 0.0)
        turned = (0.0, 0.0, 0.0)
        moved = e
        if j >= 3:
            turned = cross(e, a)
            moved = cross(end, e)
        along = dot(a, moved)
        bent = ((moved[0] - a[0] * along) / d, (moved[1] - a[1] * along) / d, (moved[2] - a[2] * along) / d)  # fmt: skip
        pull = (-T * bent[0], -T * bent[1], -T * bent[2])
        spin = matrix_times(body + B.inverse, params, cross(rho, pull))
        for k in range(3):
            memory[o + M.A + 6 * k + j] += (pull[k] - T * turned[k]) / m
            memory[o + M.A + 6 * (3 + k) + j] += spin[k]


@aside
def move(o, h, force, moment, m, g, body, params, memory):  # type: ignore[no-untyped-def]
    """Newton's and Euler's laws over ``h`` seconds, for the state and, with ``A``, its covariance; force and moment in the load's frame."""
    for s in range(2):  # rows, then columns: P <- F P F^T
        one, other = (STATE, 1) if s == 0 else (1, STATE)
        for c in range(STATE):
            for r in range(6):
                memory[o + M.P + one * r + other * c] += (
                    h * memory[o + M.P + one * (r + 6) + other * c]
                )
            for r in range(6):
                total = 0.0
                for j in range(6):
                    total += memory[o + M.A + 6 * r + j] * memory[o + M.P + one * j + other * c]
                memory[o + M.P + one * (r + 6) + other * c] += h * total
    for k in range(3):
        memory[o + M.P + (STATE + 1) * (6 + k)] += h * PUSH * PUSH
        memory[o + M.P + (STATE + 1) * (9 + k)] += h * TWIST * TWIST
    W = (memory[o + M.W], memory[o + M.W + 1], memory[o + M.W + 2])
    H = cross(W, matrix_times(body + B.J, params, W))
    spin = matrix_times(
        body + B.inverse, params, (moment[0] - H[0], moment[1] - H[1], moment[2] - H[2])
    )
    push = rotate(o, memory, force)
    for k in range(3):
        memory[o + M.v + k] += h * (push[k] / m - (g if k == 2 else 0.0))
        memory[o + M.x + k] += h * memory[o + M.v + k]
        memory[o + M.W + k] += h * spin[k]
    q = o + M.q
    turned = quaternion.turn(
        memory[q], memory[q + 1], memory[q + 2], memory[q + 3],
        h * memory[o + M.W], h * memory[o + M.W + 1], h * memory[o + M.W + 2],
    )  # fmt: skip
    for k in range(4):
        memory[q + k] = turned[k]


@aside
def measure(o, left, deviation, memory):  # type: ignore[no-untyped-def]
    """Take in one number, of which ``left`` is not explained and ``h`` is the slope; into the errors and their covariance."""
    size = deviation * deviation
    for r in range(STATE):
        total = 0.0
        for c in range(STATE):
            total += memory[o + M.P + STATE * r + c] * memory[o + M.h + c]
        memory[o + M.k + r] = total
        size += memory[o + M.h + r] * total
    left = min(max(left, -SURPRISE), SURPRISE)
    for r in range(STATE):
        left -= memory[o + M.h + r] * memory[o + M.error + r]
    if not (size > 0.0 and abs(left) < math.inf):
        return
    for r in range(STATE):
        gain = memory[o + M.k + r] / size
        memory[o + M.error + r] += gain * left
        for c in range(STATE):
            memory[o + M.P + STATE * r + c] -= gain * memory[o + M.k + c]


@inline
def slope(o, first, a, rho, scale, memory):  # type: ignore[no-untyped-def]
    """Fill ``h``: of something along ``a`` at the end ``rho``, in the error that begins at ``first``."""
    for k in range(STATE):
        memory[o + M.h + k] = 0.0
    t = cross(rho, a)
    for k in range(3):
        memory[o + M.h + first + k] = scale * a[k]
        memory[o + M.h + first + 3 + k] = scale * t[k]


@aside
def see_length(o, rho, a, left, i, rate, velocities, memory):  # type: ignore[no-untyped-def]
    """Take in what a cable is longer than the distance of its ends, and that its drone goes away from its end no faster than it is paid out."""
    slope(o, 0, a, rho, 1.0, memory)
    measure(o, left, LENGTH, memory)
    u, v, w = unrotate(
        o, memory,
        (memory[o + M.v] - velocities[i, 0], memory[o + M.v + 1] - velocities[i, 1], memory[o + M.v + 2] - velocities[i, 2]),
    )  # fmt: skip
    x, y, z = cross((memory[o + M.W], memory[o + M.W + 1], memory[o + M.W + 2]), rho)
    slope(o, 6, a, rho, 1.0, memory)
    measure(o, rate - dot(a, (u + x, v + y, w + z)), SPEED, memory)


@aside
def see_line(o, rho, a, d, felt, memory):  # type: ignore[no-untyped-def]
    """Take in along which line (unit vector, world) a drone feels that it is pulled."""
    seen = unrotate(o, memory, felt)
    e = (1.0, 0.0, 0.0) if abs(a[0]) < 0.7 else (0.0, 1.0, 0.0)
    b = cross(a, e)
    size = 1.0 / math.sqrt(dot(b, b))
    b = (size * b[0], size * b[1], size * b[2])
    for _ in range(2):
        slope(o, 0, b, rho, 1.0 / d, memory)
        measure(o, dot(b, seen), LINE, memory)
        b = cross(a, b)


@aside
def correct(o, memory):  # type: ignore[no-untyped-def]
    """Move the state by the errors that were found."""
    e = o + M.error
    x = rotate(o, memory, (memory[e], memory[e + 1], memory[e + 2]))
    v = rotate(o, memory, (memory[e + 6], memory[e + 7], memory[e + 8]))
    q = o + M.q
    w, a, b, c = quaternion.turn(
        memory[q], memory[q + 1], memory[q + 2], memory[q + 3], memory[e + 3], memory[e + 4], memory[e + 5]
    )  # fmt: skip
    size = 1.0 / math.sqrt(w * w + a * a + b * b + c * c)
    memory[q], memory[q + 1], memory[q + 2], memory[q + 3] = size * w, size * a, size * b, size * c
    sure = size < math.inf
    for k in range(3):
        memory[o + M.x + k] += x[k]
        memory[o + M.v + k] += v[k]
        memory[o + M.W + k] += memory[e + 9 + k]
        total = memory[o + M.x + k] + memory[o + M.v + k] + memory[o + M.W + k]
        sure = sure and abs(total) < math.inf
    for k in range(STATE):
        memory[e + k] = 0.0
        sure = sure and memory[o + M.P + (STATE + 1) * k] > 0.0
    if not sure:  # begin anew
        memory[o + M.alive] = 0.0


@aside
def tell(o, body, params, memory, writes):  # type: ignore[no-untyped-def]
    """Write place, velocity, attitude and rates of the load, carried forward over the time since they held."""
    h = memory[o + M.since]
    q, c = (
        o + M.q,
        (params[body + B.centre], params[body + B.centre + 1], params[body + B.centre + 2]),
    )
    W = (memory[o + M.W], memory[o + M.W + 1], memory[o + M.W + 2])
    turned = quaternion.turn(
        memory[q], memory[q + 1], memory[q + 2], memory[q + 3], h * W[0], h * W[1], h * W[2]
    )  # fmt: skip
    away, flow = rotate(o, memory, c), rotate(o, memory, cross(W, c))
    for k in range(4):
        writes.estimated_load_attitude[k] = turned[k]
    for k in range(3):
        writes.estimated_load_rates[k] = W[k]
        speed = memory[o + M.v + k] - flow[k]
        writes.estimated_load[0, k] = memory[o + M.x + k] - away[k] + h * speed
        writes.estimated_load[1, k] = speed


@aside
def felt_pull(i, thrust, m, sees, attitudes):  # type: ignore[no-untyped-def]
    """What pulls at drone i beside its thrust and weight, by its accelerometer, N, world."""
    f, q = sees.measured_specific_forces, attitudes
    return quaternion.into_world(
        q[i, 0], q[i, 1], q[i, 2], q[i, 3], m * f[i, 0], m * f[i, 1], m * f[i, 2] - thrust
    )  # fmt: skip


class Rows(NamedTuple):
    """Where in parameters and memory what belongs to a drone stands, and how far apart two drones' are."""

    params: int
    memory: int
    arm: int
    length: int
    mass: int
    thrust: int
    cable: int


@aside
def feel(i, T, at, rho, o, dt, rows, params, sees, attitudes, positions, memory):  # type: ignore[no-untyped-def]
    """Take in a new sample of drone i's accelerometer: what it feels along its cable."""
    c = at + rows.cable
    if not newer(memory, c + C.felt_age, sees.specific_force_ages[i], dt):
        return
    memory[c + C.felt_age] = sees.specific_force_ages[i]
    mass = params[rows.params * i + rows.mass]
    fx, fy, fz = felt_pull(i, memory[at + rows.thrust], mass, sees, attitudes)
    a, _ = towards(o, rho, i, positions, memory)
    along = dot(a, unrotate(o, memory, (fx, fy, fz)))
    if abs(along) < math.inf:
        memory[c + C.pull] += SMOOTH * (along - memory[c + C.pull])
        memory[c + C.fresh] = 1.0
        memory[c + C.line], memory[c + C.line + 1], memory[c + C.line + 2] = fx, fy, fz


@aside
def follow(o, first, n, dt, period, known, m, g, body, rows, params, sees, memory, writes):  # type: ignore[no-untyped-def]
    """The load's pose now: moved each ``period`` (s) under the wanted tensions and seen through the cables that are taut.

    It begins where the load was last ``known`` to be, else where it hangs on the cables that are wanted.
    """
    positions, velocities = writes.estimated_positions, writes.estimated_velocities
    tensions, apart = sees.received_tensions, rows.params
    if memory[o + M.alive] == 0.0:
        if known:
            believe(o, body, params, memory, writes)
        else:
            guess(
                o, n, rows.arm, apart, rows.length, params, positions, velocities, sees.received_directions, memory
            )  # fmt: skip
        for i in range(n):
            c = first + rows.memory * i + rows.cable
            memory[c + C.pull], memory[c + C.fresh] = tensions[i], 0.0
            memory[c + C.felt_age] = sees.specific_force_ages[i] - dt
    memory[o + M.since] += dt
    for i in range(n):
        at, r = first + rows.memory * i, apart * i + rows.arm
        rho = (params[r], params[r + 1], params[r + 2])
        feel(
            i, tensions[i], at, rho, o, dt, rows, params, sees, writes.estimated_attitudes, positions, memory
        )  # fmt: skip
    if memory[o + M.since] > period - 0.5 * dt:
        h = memory[o + M.since]
        memory[o + M.since] = 0.0
        for k in range(36):
            memory[o + M.A + k] = 0.0
        fx = fy = fz = mx = my = mz = 0.0
        held = 0
        for i in range(n):
            T, r = tensions[i], apart * i + rows.arm
            if not memory[first + rows.memory * i + rows.cable + C.pull] > TAUT * T:
                continue
            rho = (params[r], params[r + 1], params[r + 2])
            a, d = towards(o, rho, i, positions, memory)
            add_cable(o, rho, a, d, T, m, body, params, memory)
            p, q, s = cross(rho, a)
            fx, fy, fz = fx - T * a[0], fy - T * a[1], fz - T * a[2]
            mx, my, mz = mx - T * p, my - T * q, mz - T * s
            held += 1
        if held >= HELD:
            move(o, h, (fx, fy, fz), (mx, my, mz), m, g, body, params, memory)
        else:
            for k in range(3):
                memory[o + M.v + k] = memory[o + M.W + k] = 0.0
        for i in range(n):
            c, r = first + rows.memory * i + rows.cable, apart * i + rows.arm
            if held < HELD or not memory[c + C.pull] > TAUT * tensions[i]:
                continue
            rho = (params[r], params[r + 1], params[r + 2])
            a, d = towards(o, rho, i, positions, memory)
            L = params[apart * i + rows.length] + sees.reeled[i, 0] + sees.found_lengths[i]
            see_length(o, rho, a, L - d, i, sees.reeled[i, 1], velocities, memory)
            if memory[c + C.fresh] != 0.0:
                x, y, z = memory[c + C.line], memory[c + C.line + 1], memory[c + C.line + 2]
                size = 1.0 / max(math.sqrt(x * x + y * y + z * z), 1e-6)
                see_line(o, rho, a, d, (size * x, size * y, size * z), memory)
                memory[c + C.fresh] = 0.0
        correct(o, memory)
        if memory[o + M.alive] == 0.0:
            return
    tell(o, body, params, memory, writes)
