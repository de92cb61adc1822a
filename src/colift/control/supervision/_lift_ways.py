"""Ways of the load, the drones and their spans, with derivatives."""

from __future__ import annotations

import math

from colift.control.supervision._lift_memory import M
from colift.kernel.jit import inline
from colift.kernel.math.smooth import rest_to_rest, soonest

SERVO = 15.0
"""Bandwidth with which spans follow the rate that is wanted, 1/s."""
GENTLE = 0.5
"""Most acceleration of the load on such a way, m/s^2."""


@inline
def set_off(memory, begin, goal, speed, least):  # type: ignore[no-untyped-def]
    """A smooth way of the load from rest to rest."""
    away = 0.0
    for k in range(3):
        memory[M.begin + k], memory[M.goal + k] = begin[k], goal[k]
        away += (goal[k] - begin[k]) ** 2
    memory[M.way] = max(least, 1e-3, soonest(math.sqrt(away), speed, GENTLE))


@inline
def on_the_way(memory, time, shift, home):  # type: ignore[no-untyped-def]
    """Shift of the reference, which stands at ``home``, so that the load is on its way since ``time`` (s)."""
    T = memory[M.way]
    s0, s1, s2, s3 = rest_to_rest(time / T)
    for k in range(3):
        step = memory[M.goal + k] - memory[M.begin + k]
        shift[0, k] = memory[M.begin + k] + step * s0 - home[k]
        shift[1, k] = step * s1 / T
        shift[2, k] = step * s2 / (T * T)
        shift[3, k] = step * s3 / (T * T * T)


@inline
def arc(s, s1, s2, centre, start, end, course):  # type: ignore[no-untyped-def]
    """A place (3, 3) with derivatives on the arc about ``centre`` from ``start`` to ``end`` (3,), both relative to it.

    Distance, elevation and azimuth change in proportion to ``s``, whose rate and acceleration are ``s1`` and ``s2``.
    """
    h0, h1 = math.hypot(start[0], start[1]), math.hypot(end[0], end[1])
    r, r1 = math.hypot(h0, start[2]), math.hypot(h1, end[2])
    e, e1 = math.atan2(start[2], h0), math.atan2(end[2], h1)
    a1 = math.atan2(end[1], end[0]) if h1 > 1e-6 else math.atan2(start[1], start[0])
    a = math.atan2(start[1], start[0]) if h0 > 1e-6 else a1
    dr, de = r1 - r, e1 - e
    da = (a1 - a + math.pi) % (2.0 * math.pi) - math.pi
    r, e, a = r + s * dr, e + s * de, a + s * da
    ce, se, ca, sa = math.cos(e), math.sin(e), math.cos(a), math.sin(a)
    h, hd = r * ce, dr * ce - r * se * de
    hdd = -2.0 * dr * se * de - r * ce * de * de
    z, zd, zdd = r * se, dr * se + r * ce * de, 2.0 * dr * ce * de - r * se * de * de
    x, xd, xdd = h * ca, hd * ca - h * sa * da, hdd * ca - 2.0 * hd * sa * da - h * ca * da * da
    y, yd, ydd = h * sa, hd * sa + h * ca * da, hdd * sa + 2.0 * hd * ca * da - h * sa * da * da
    place, turn, bend = (x, y, z), (xd, yd, zd), (xdd, ydd, zdd)
    for k in range(3):
        course[0, k] = centre[k] + place[k]
        course[1, k] = turn[k] * s1
        course[2, k] = bend[k] * s1 * s1 + turn[k] * s2


@inline
def reel(i, dt, memory):  # type: ignore[no-untyped-def]
    """Span of cable i follows the wanted rate; twice continuously differentiable."""
    o = M.rows + M.width * i + M.span
    want = memory[M.rows + M.width * i + M.want]
    # Implicitly, stable for any step.
    bend = (memory[o + 2] + dt * SERVO * SERVO * (want - memory[o + 1])) / (
        1.0 + 2.0 * SERVO * dt + SERVO * SERVO * dt * dt
    )
    memory[o + 2] = bend
    memory[o + 1] += dt * bend
    memory[o] += dt * memory[o + 1]


@inline
def steady(o, memory):  # type: ignore[no-untyped-def]
    """Let the span of the cable whose memory begins at ``o`` keep its acceleration."""
    memory[o + M.want] = memory[o + M.span + 1] + 2.0 / SERVO * memory[o + M.span + 2]
