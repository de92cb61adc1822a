"""The load: a point, or a rigid body on which cables end around the centre of mass.

The state of a load begins with the place and velocity of its centre of mass, its attitude ``R`` and its rates ``Omega``; a point keeps
the attitude that it has. An end at ``rho`` from the centre of mass, in the load's frame, is at::

    x + R rho,    v + R (Omega x rho),    dv/dt + R (dOmega/dt x rho + Omega x (Omega x rho))

and a force ``f`` there gives ``dv/dt += f / m`` and ``dOmega/dt += I^-1 (rho x R^T f)``.
"""

from __future__ import annotations

from colift.kernel.jit import aside, inline
from colift.kernel.math import quaternion
from colift.kernel.math.small import matrix_times
from colift.world.plant._params import BODY, MASS, P

TURN, SPIN = 6, 10
"""Where attitude and rates of the load stand in the state."""


@aside
def into_load(y, a, b, c):  # type: ignore[no-untyped-def]
    """A vector of the world in the load's frame."""
    return quaternion.into_body(y[6], y[7], y[8], y[9], a, b, c)


@aside
def into_world(y, a, b, c):  # type: ignore[no-untyped-def]
    """A vector of the load's frame in the world's."""
    return quaternion.into_world(y[6], y[7], y[8], y[9], a, b, c)


@inline
def end_place(i, y, params):  # type: ignore[no-untyped-def]
    """Where cable i ends, world, m."""
    if params[P.rigid] == 0.0:
        return y[0], y[1], y[2]
    o = MASS + BODY * i + P.rho
    dx, dy, dz = into_world(y, params[o], params[o + 1], params[o + 2])
    return y[0] + dx, y[1] + dy, y[2] + dz


@aside
def speed_at(y, a, b, c):  # type: ignore[no-untyped-def]
    """Velocity of the load's point at ``(a, b, c)`` from the centre of mass, in its frame, m/s, world."""
    p, q, r = y[SPIN], y[SPIN + 1], y[SPIN + 2]
    dx, dy, dz = into_world(y, q * c - r * b, r * a - p * c, p * b - q * a)
    return y[3] + dx, y[4] + dy, y[5] + dz


@inline
def end_speed(i, y, params):  # type: ignore[no-untyped-def]
    """Velocity of the end of cable i, world, m/s."""
    if params[P.rigid] == 0.0:
        return y[3], y[4], y[5]
    o = MASS + BODY * i + P.rho
    return speed_at(y, params[o], params[o + 1], params[o + 2])


@aside
def _turned_acceleration(a, b, c, y, dy):  # type: ignore[no-untyped-def]
    p, q, r = y[SPIN], y[SPIN + 1], y[SPIN + 2]
    u, v, w = q * c - r * b, r * a - p * c, p * b - q * a
    p1, q1, r1 = dy[SPIN], dy[SPIN + 1], dy[SPIN + 2]
    u1 = q1 * c - r1 * b + q * w - r * v
    v1 = r1 * a - p1 * c + r * u - p * w
    w1 = p1 * b - q1 * a + p * v - q * u
    return into_world(y, u1, v1, w1)


@inline
def end_acceleration(i, y, dy, params):  # type: ignore[no-untyped-def]
    """Acceleration of the end of cable i, world, m/s^2."""
    if params[P.rigid] == 0.0:
        return dy[3], dy[4], dy[5]
    o = MASS + BODY * i + P.rho
    x, y_, z = _turned_acceleration(params[o], params[o + 1], params[o + 2], y, dy)
    return dy[3] + x, dy[4] + y_, dy[5] + z


@aside
def _turn_freely(y, params, dy):  # type: ignore[no-untyped-def]
    p, q, r = y[SPIN], y[SPIN + 1], y[SPIN + 2]
    dw, dx, dy_, dz = quaternion.multiply(
        y[6], y[7], y[8], y[9], 0.0, 0.5 * p, 0.5 * q, 0.5 * r
    )  # fmt: skip
    dy[6], dy[7], dy[8], dy[9] = dw, dx, dy_, dz
    hx, hy, hz = matrix_times(P.inertia, params, (p, q, r))
    ax, ay, az = matrix_times(
        P.inverse, params, (r * hy - q * hz, p * hz - r * hx, q * hx - p * hy)
    )
    dy[SPIN], dy[SPIN + 1], dy[SPIN + 2] = ax, ay, az


@inline
def spin(y, params, dy):  # type: ignore[no-untyped-def]
    """Derivatives of attitude and rates of a load on which nothing turns (Euler's equations); zero for a point."""
    if params[P.rigid] > 0.0:
        _turn_freely(y, params, dy)
        return
    for k in range(TURN, SPIN + 3):
        dy[k] = 0.0


@inline
def twist(a, b, c, params, y):  # type: ignore[no-untyped-def]
    """Add what a moment, or an angular impulse, about the centre of mass does to the rates; all in the load's frame."""
    x, y_, z = matrix_times(P.inverse, params, (a, b, c))
    y[SPIN] += x
    y[SPIN + 1] += y_
    y[SPIN + 2] += z


@aside
def push_end(i, fx, fy, fz, y, params, dy):  # type: ignore[no-untyped-def]
    """Turn a rigid load by a force of the world at the end of cable i; into a derivative."""
    o = MASS + BODY * i + P.rho
    a, b, c = params[o], params[o + 1], params[o + 2]
    u, v, w = into_load(y, fx, fy, fz)
    twist(b * w - c * v, c * u - a * w, a * v - b * u, params, dy)
