"""Direction of the cable that a drone holds, with its rate and acceleration: planned motion as it is, corrections filtered."""

from __future__ import annotations

import math

from colift.kernel.jit import inline
from colift.kernel.math import quaternion
from colift.kernel.math.sphere import FOLLOW, follow
from colift.kernel.math.vectors import cross

CABLE = FOLLOW + 6
"""Numbers that it remembers of a cable: direction, rate and acceleration, then the correction and its rate."""


@inline
def lead(i, alpha, nominal, omega, dt, memory, o, reach):  # type: ignore[no-untyped-def]
    """Lead the cable of drone i towards ``alpha[i]``: direction, rate and acceleration in ``memory[o : o + 9]``.

    ``omega`` (rad/s) and ``reach`` (rad) are those of :func:`colift.kernel.math.sphere.follow`.

    Where ``nominal[i]`` (3, 3) gives the planned pull and its derivatives, that motion passes unfiltered, and only what
    ``alpha`` differs by from it goes through a critically damped filter of the frequency ``omega``.
    """
    if math.isnan(nominal[i, 0, 0]):
        follow(memory, o, alpha[i, 0], alpha[i, 1], alpha[i, 2], omega, dt, reach)
        return
    T = T1 = T2 = 0.0
    for k in range(3):
        T += nominal[i, 0, k] * nominal[i, 0, k]
    T = math.sqrt(max(T, 1e-18))
    for k in range(3):
        T1 += nominal[i, 0, k] / T * nominal[i, 1, k]
    for k in range(3):
        rate = (nominal[i, 1, k] - nominal[i, 0, k] / T * T1) / T
        T2 += rate * nominal[i, 1, k] + nominal[i, 0, k] / T * nominal[i, 2, k]
    damp = 1.0 / (1.0 + 2.0 * omega * dt)
    c = o + FOLLOW
    for k in range(3):
        direction = nominal[i, 0, k] / T
        rate = (nominal[i, 1, k] - direction * T1) / T
        turning = (nominal[i, 2, k] - direction * T2 - 2.0 * rate * T1) / T
        before = memory[c + 3 + k]
        off = alpha[i, k] - direction - memory[c + k]
        speed = (before + dt * omega * omega * off) * damp
        memory[c + 3 + k] = speed
        memory[c + k] += dt * speed
        memory[o + k] = direction + memory[c + k]
        memory[o + 3 + k] = rate + speed
        memory[o + 6 + k] = turning + (speed - before) / dt


FRAME = 10
"""Numbers that :func:`turn_frame` remembers: an attitude, its rates and their derivative."""


@inline
def turn_frame(fresh, reference, attitude, g, dt, keep, memory, o):  # type: ignore[no-untyped-def]
    """The frame in which a rigid load's cables stand still as planned: its third axis along the wanted force, turned to the wanted heading.

    ``memory[o : o + 10]`` holds its attitude, its rates in itself and their derivative, of which a filter keeps ``keep``.
    """
    x, y, z = reference[2, 0], reference[2, 1], reference[2, 2] + g
    norm = math.sqrt(max(x * x + y * y + z * z, 1e-12))
    w, x, y, z = quaternion.from_thrust_direction(x / norm, y / norm, z / norm)
    c, s = attitude[0], attitude[3]
    norm = math.sqrt(c * c + s * s)
    c, s = (c / norm, s / norm) if norm > 1e-9 else (1.0, 0.0)
    w, x, y, z = quaternion.multiply(w, x, y, z, c, 0.0, 0.0, s)
    if fresh:
        memory[o], memory[o + 1], memory[o + 2], memory[o + 3] = w, x, y, z
    ew, ex, ey, ez = quaternion.multiply(
        memory[o], -memory[o + 1], -memory[o + 2], -memory[o + 3], w, x, y, z
    )
    rate = 2.0 / dt if ew >= 0.0 else -2.0 / dt
    turn = (rate * ex, rate * ey, rate * ez)
    for k in range(3):
        bend = (turn[k] - memory[o + 4 + k]) / dt
        if fresh:
            bend = 0.0
        memory[o + 7 + k] = keep * memory[o + 7 + k] + (1.0 - keep) * bend
        memory[o + 4 + k] = turn[k]
    memory[o], memory[o + 1], memory[o + 2], memory[o + 3] = w, x, y, z


@inline
def lead_within(i, fresh, alpha, frame, omega, dt, memory, own, o, reach):  # type: ignore[no-untyped-def]
    """Lead the cable of drone i towards ``alpha[i]`` as :func:`lead` does, but filter it in a frame that turns (:func:`turn_frame`).

    What turns with the frame passes unfiltered. ``memory[own : own + FOLLOW]`` is the filter's.
    """
    w, x, y, z = memory[frame], memory[frame + 1], memory[frame + 2], memory[frame + 3]
    a, b, c = quaternion.into_body(w, x, y, z, alpha[i, 0], alpha[i, 1], alpha[i, 2])
    if fresh:
        memory[own], memory[own + 1], memory[own + 2] = a, b, c
    follow(memory, own, a, b, c, omega, dt, reach)
    d = (memory[own], memory[own + 1], memory[own + 2])
    v = (memory[own + 3], memory[own + 4], memory[own + 5])
    turn = (memory[frame + 4], memory[frame + 5], memory[frame + 6])
    bend = (memory[frame + 7], memory[frame + 8], memory[frame + 9])
    flow, rest = cross(turn, d), cross(turn, v)
    inner, outer = cross(turn, flow), cross(bend, d)
    direction = quaternion.into_world(w, x, y, z, d[0], d[1], d[2])
    rate = quaternion.into_world(w, x, y, z, flow[0] + v[0], flow[1] + v[1], flow[2] + v[2])
    speed = (
        inner[0] + outer[0] + 2.0 * rest[0] + memory[own + 6],
        inner[1] + outer[1] + 2.0 * rest[1] + memory[own + 7],
        inner[2] + outer[2] + 2.0 * rest[2] + memory[own + 8],
    )
    turning = quaternion.into_world(w, x, y, z, speed[0], speed[1], speed[2])
    for k in range(3):
        memory[o + k] = direction[k]
        memory[o + 3 + k] = rate[k]
        memory[o + 6 + k] = turning[k]


SWING = 6
"""Numbers that :func:`swing` remembers of a cable beside its direction, rate and acceleration."""


@inline
def swing(i, alpha, T, change, omega, dt, memory, o, reach):  # type: ignore[no-untyped-def]
    """Lead a cable of a team of one or two, where the load's motion is the cable's: that part passes unfiltered.

    ``change`` (9,) is what the reference's acceleration adds to this cable's pull, and two derivatives. The pull that is
    left of ``T[i] alpha[i]`` goes through a critically damped filter of the frequency ``omega``; of their
    sum the direction, its rate and acceleration are put into ``memory[o : o + 9]``.
    """
    damp = 1.0 / (1.0 + 2.0 * omega * dt)
    c = o + 9
    size = T[i] * reach
    away = 0.0
    for k in range(3):
        away += (T[i] * alpha[i, k] - change[k] - memory[c + k]) ** 2
    share = min(1.0, size / math.sqrt(max(away, 1e-18)))
    norm = 0.0
    for k in range(3):
        before = memory[c + 3 + k]
        off = share * (T[i] * alpha[i, k] - change[k] - memory[c + k])
        speed = (before + dt * omega * omega * off) * damp
        memory[c + 3 + k] = speed
        memory[c + k] += dt * speed
        # Pull, and in place of rate and acceleration its derivatives.
        memory[o + k] = memory[c + k] + change[k]
        memory[o + 3 + k] = speed + change[3 + k]
        memory[o + 6 + k] = (speed - before) / dt + change[6 + k]
        norm += memory[o + k] * memory[o + k]
    norm = math.sqrt(max(norm, 1e-18))
    stretch = stretch2 = 0.0
    for k in range(3):
        memory[o + k] /= norm
        stretch += memory[o + k] * memory[o + 3 + k]
    for k in range(3):
        memory[o + 3 + k] = (memory[o + 3 + k] - memory[o + k] * stretch) / norm
        stretch2 += memory[o + k] * memory[o + 6 + k]
    turn = 0.0
    for k in range(3):
        turn += memory[o + 3 + k] * memory[o + 3 + k]
    for k in range(3):
        # d'' = (p'' - d (d.p'') - 2 d' (d.p')) / |p| - d |d'|^2
        along = stretch2 * memory[o + k] + 2.0 * stretch * memory[o + 3 + k]
        memory[o + 6 + k] = (memory[o + 6 + k] - along) / norm - memory[o + k] * turn
