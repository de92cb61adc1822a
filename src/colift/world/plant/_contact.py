"""Contact with level ground: a force on each body like any other, by a spring and a damper that only push.

A body of mass ``m`` whose lowest point is ``d`` below the surface, with the speed ``v``, is pressed and held by::

    N = max(0, m (w^2 d - 2 zeta w v_z))                         where d > 0
    F = -m (w^2 (x - a) + 2 w v)  of its level part,             |F| <= mu N
    |x - a| <= mu min(d, 2 g / w^2)                              after each substep

``a`` is the body's *anchor*, the place that friction holds it at; it follows a body that slides, and one that flies. It is
bounded by what the spring presses, not by ``N``, in which the damper would lend the anchor a stretch that nobody has paid
for; and by twice what weight alone presses, or a hard landing would wind it up and throw the body back along the ground. At rest a body sinks in by ``g / w^2``, on every mass alike, and slides with ``mu m g``.

A load touches with its point, a rigid one with its corners, each for a quarter of its mass; a drone with four feet in the plane of its centre, each for a quarter of its mass: so a
drone that comes down aslant is levelled, and the energy of that comes from its weight. The feet stand no farther out than
where the drone rocks at the rate ``w`` too.

No constraint is solved, so that contact is the same on every cable: what holds the tensions sees one more force.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from colift.kernel.jit import aside, inline, splice
from colift.kernel.layout import Layout
from colift.team import Team
from colift.world.plant._load import into_load, into_world, speed_at, twist
from colift.world.plant._params import BODY, CORNERS, DRONE, LOAD, MASS, P

RATE = 300.0
"""The rate ``w`` of contact, 1/s: a body at rest sinks in by 0.11 mm."""
RESOLVED = 0.3
"""Largest ``w`` times substep: at substeps above 1 ms the ground becomes softer, at 10 ms 30 / s and 11 mm."""
HELD = 2.0
"""Depths of standing up to which pressing lets the anchor stretch."""
FEET = 4

ANCHORS = Layout(team={"load": 2 * CORNERS}, drone={"drone": 2})
"""At the end of a plant's memory: where friction holds the corners of the load, or its one point, and the drones, world x and y."""
FIRST: int = ANCHORS.at.rows
SPARE = Layout(team={"load": 3}, drone={"drone": 3})
"""Before them, forces that nobody asks for."""


@splice
def anchors_of(memory, n):  # type: ignore[no-untyped-def]
    """The anchors in a plant's memory."""
    return memory[memory.shape[0] - FIRST - 2 * n :]


@splice
def spare_of(memory, n):  # type: ignore[no-untyped-def]
    """Room for forces (n + 1, 3) in a plant's memory."""
    end = memory.shape[0] - FIRST - 2 * n
    return memory[end - 3 * (n + 1) : end].reshape(n + 1, 3)


def contact_size(n: int) -> int:
    """What contact takes of the memory of a plant."""
    return SPARE.size(n) + ANCHORS.size(n)


def damping_ratio(restitution: float) -> float:
    """Of a spring and damper that only push, for a body that leaves with this share of its speed.

    The force ends before the spring is relaxed (Schwager and Poeschel, Granular Matter 9, 2007, eq. 19). Below
    ``exp(-2)`` = 0.135 it is 1: critical damping, that share of a fast fall, and less of a slow one, which weight ends.
    """
    if restitution <= math.exp(-2.0):
        return 1.0
    low, high = 0.0, 1.0
    for _ in range(40):
        zeta = 0.5 * (low + high)
        root = math.sqrt(1.0 - zeta * zeta)
        phase = math.pi - math.atan2(2.0 * zeta * root, 1.0 - 2.0 * zeta * zeta)
        if math.exp(-zeta / root * phase) > restitution:
            low = zeta
        else:
            high = zeta
    return high


def feet(team: Team) -> NDArray[np.float64]:
    """Distance of each drone's feet from its centre (n,), m: its radius, unless it would rock too fast."""
    rocking = np.sqrt(2.0 * team.inertias[:, :2].min(axis=1) / team.masses)
    return np.asarray(np.fmin(rocking, team.radii))


@inline
def rate(h):  # type: ignore[no-untyped-def]
    """The rate ``w`` that a substep of ``h`` seconds follows."""
    return min(RATE, RESOLVED / h)


@inline
def press(m, d, sinking, w, zeta):  # type: ignore[no-untyped-def]
    """Normal force, N, on a mass at this depth (m) that goes down at this speed."""
    if d <= 0.0:
        return 0.0
    return max(0.0, m * w * (w * d + 2.0 * zeta * sinking))


@inline
def rub(m, x, y, vx, vy, w, most):  # type: ignore[no-untyped-def]
    """Friction, N, at ``(x, y)`` from the anchor and at this speed, no larger than ``most``."""
    fx = -m * w * (w * x + 2.0 * vx)
    fy = -m * w * (w * y + 2.0 * vy)
    size = math.sqrt(fx * fx + fy * fy)
    if size > most:
        fx *= most / size
        fy *= most / size
    return fx, fy


@inline
def up(y, o):  # type: ignore[no-untyped-def]
    """The vertical in the frame of the body whose attitude begins at ``o``: the third row of its matrix."""
    w, x, y_, z = y[o], y[o + 1], y[o + 2], y[o + 3]
    return 2.0 * (x * z - w * y_), 2.0 * (y_ * z + w * x), w * w - x * x - y_ * y_ + z * z


@aside
def touch_corners(y, anchors, w, params, dy):  # type: ignore[no-untyped-def]
    """Add to the derivative of a rigid load's motion what the ground does to its corners; the force, N, world."""
    height, friction, zeta = params[P.height], params[P.friction], params[P.damping]
    count = int(params[P.corners])
    m = params[P.m_L] / min(count, FEET)
    fx = fy = fz = 0.0
    for k in range(count):
        o = P.corner + 3 * k
        a, b, c = params[o], params[o + 1], params[o + 2]
        dx, dy_, dz = into_world(y, a, b, c)
        depth = height - y[2] - dz
        if depth <= 0.0:
            continue
        u, v, rising = speed_at(y, a, b, c)
        N = press(m, depth, -rising, w, zeta)
        if N > 0.0:
            x, y_ = y[0] + dx - anchors[2 * k], y[1] + dy_ - anchors[2 * k + 1]
            rx, ry = rub(m, x, y_, u, v, w, friction * N)
            fx, fy, fz = fx + rx, fy + ry, fz + N
            p, q, r = into_load(y, rx, ry, N)
            twist(b * r - c * q, c * p - a * r, a * q - b * p, params, dy)
    if fz > 0.0:
        dy[3] += fx / params[P.m_L]
        dy[4] += fy / params[P.m_L]
        dy[5] += fz / params[P.m_L]
    return fx, fy, fz


@inline
def touch(n, y, anchors, w, params, forces, dy):  # type: ignore[no-untyped-def]
    """Add to the derivative of the state what the ground does; ``forces`` (n + 1, 3) on drones and, last, load, N."""
    height, friction, zeta = params[P.height], params[P.friction], params[P.damping]
    fx = fy = N = 0.0
    m_L = params[P.m_L]
    if params[P.rigid] > 0.0:
        fx, fy, N = touch_corners(y, anchors, w, params, dy)
    else:
        N = press(m_L, height - y[2], -y[5], w, zeta)
    if N > 0.0 and params[P.rigid] == 0.0:
        fx, fy = rub(m_L, y[0] - anchors[0], y[1] - anchors[1], y[3], y[4], w, friction * N)
        dy[3] += fx / m_L
        dy[4] += fy / m_L
        dy[5] += N / m_L
    forces[n, 0], forces[n, 1], forces[n, 2] = fx, fy, N
    for i in range(n):
        o, a, b = LOAD + DRONE * i, FIRST + 2 * i, MASS + BODY * i
        m, r = params[b + P.m], params[b + P.foot]
        fx = fy = fz = 0.0
        d = height - y[o + 2]
        if d > -r:
            ux, uy, uz = up(y, o + 6)
            p, q, s = y[o + 10], y[o + 11], y[o + 12]
            along_x, along_y = (
                r * (uy * s - uz * q),
                r * (uz * p - ux * s),
            )  # speeds of feet, upward
            front = press(m / FEET, d - r * ux, -y[o + 5] - along_x, w, zeta)
            back = press(m / FEET, d + r * ux, -y[o + 5] + along_x, w, zeta)
            left = press(m / FEET, d - r * uy, -y[o + 5] - along_y, w, zeta)
            right = press(m / FEET, d + r * uy, -y[o + 5] + along_y, w, zeta)
            fz = front + back + left + right
            if fz > 0.0:
                x, y_ = y[o] - anchors[a], y[o + 1] - anchors[a + 1]
                fx, fy = rub(m, x, y_, y[o + 3], y[o + 4], w, friction * fz)
                dy[o + 3] += fx / m
                dy[o + 4] += fy / m
                dy[o + 5] += fz / m
                pitch, roll = r * (back - front), r * (left - right)
                jx, jy, jz = params[b + P.J], params[b + P.J + 1], params[b + P.J + 2]
                most = friction * r * fz
                turning = max(-most, min(most, -2.0 * w * jz * s))
                dy[o + 10] += uz * roll / jx
                dy[o + 11] += uz * pitch / jy
                dy[o + 12] += (turning - uy * pitch - ux * roll) / jz
        forces[i, 0], forces[i, 1], forces[i, 2] = fx, fy, fz


@inline
def depth(i, y, params):  # type: ignore[no-untyped-def]
    """How deep drone ``i`` stands, the mean of its feet, m; not above 0 where it flies."""
    o, b = LOAD + DRONE * i, MASS + BODY * i
    d, r = params[P.height] - y[o + 2], params[b + P.foot]
    if d <= -r:
        return 0.0
    ux, uy, _ = up(y, o + 6)
    total = max(0.0, d - r * ux) + max(0.0, d + r * ux) + max(0.0, d - r * uy)
    return (total + max(0.0, d + r * uy)) / FEET


@inline
def hold(px, py, anchors, a, reach):  # type: ignore[no-untyped-def]
    """Bring the anchor ``a`` within this reach (m) of the place ``(px, py)`` that it holds."""
    x, y = anchors[a] - px, anchors[a + 1] - py
    size = math.sqrt(x * x + y * y)
    if size > reach:
        anchors[a] = px + x * (reach / size)
        anchors[a + 1] = py + y * (reach / size)


@aside
def settle_corners(begin, y, most, params, anchors):  # type: ignore[no-untyped-def]
    """Let the anchors of a rigid load's corners follow; the largest speed (m/s) with which one came down, 0 where none did."""
    height, friction = params[P.height], params[P.friction]
    fastest = 0.0
    for k in range(int(params[P.corners])):
        o = P.corner + 3 * k
        a, b, c = params[o], params[o + 1], params[o + 2]
        dx, dy, dz = into_world(y, a, b, c)
        d = max(0.0, height - y[2] - dz)
        hold(y[0] + dx, y[1] + dy, anchors, 2 * k, friction * min(d, most))
        if d > 0.0 and begin[2] + into_world(begin, a, b, c)[2] >= height:
            fastest = max(fastest, -speed_at(begin, a, b, c)[2])
    return fastest


@inline
def settle(n, begin, y, w, params, anchors, touch_speeds):  # type: ignore[no-untyped-def]
    """After a substep that began at ``begin``: anchors follow; keep the speed (m/s) of each body that came down in it."""
    height, friction = params[P.height], params[P.friction]
    most = HELD * params[P.g] / (w * w)
    if params[P.rigid] > 0.0:
        touch_speeds[n] = max(touch_speeds[n], settle_corners(begin, y, most, params, anchors))
    else:
        d = max(0.0, height - y[2])
        hold(y[0], y[1], anchors, 0, friction * min(d, most))
        if d > 0.0 and begin[2] >= height:
            touch_speeds[n] = max(touch_speeds[n], -begin[5])
    for i in range(n):
        o = LOAD + DRONE * i
        d = depth(i, y, params)
        hold(y[o], y[o + 1], anchors, FIRST + 2 * i, friction * min(d, most))
        if d > 0.0 and depth(i, begin, params) == 0.0:
            touch_speeds[i] = max(touch_speeds[i], -begin[o + 5])
