"""Drag of rotors in the air that moves past them: in their plane, in proportion to thrust.

Faessler, Franchi, Scaramuzza, "Differential Flatness of Quadrotor Dynamics Subject to Rotor Drag", RA-L 2018.
"""

from __future__ import annotations

import math

from colift.kernel.jit import inline
from colift.kernel.math import quaternion


@inline
def drag(thrust, axis, coefficient, wind):  # type: ignore[no-untyped-def]
    """Force on rotors that thrust along the unit vector ``axis`` in the relative ``wind`` (3,), N.

    ``coefficient`` is the force per thrust and speed across the axis, s/m.
    """
    along = axis[0] * wind[0] + axis[1] * wind[1] + axis[2] * wind[2]
    scale = coefficient * thrust
    return (
        scale * (wind[0] - along * axis[0]),
        scale * (wind[1] - along * axis[1]),
        scale * (wind[2] - along * axis[2]),
    )


@inline
def force_of(i, thrust, attitudes, rates, delay, coefficient, wind, velocities):  # type: ignore[no-untyped-def]
    """Thrust and drag of drone i, world frame, N, along the axis that is there: its attitude is ``delay`` (s) old, and turns."""
    q, Omega = attitudes[i], rates[i]
    w, x, y, z = quaternion.turn(
        q[0], q[1], q[2], q[3], Omega[0] * delay, Omega[1] * delay, Omega[2] * delay
    )
    axis = quaternion.third_axis(w, x, y, z)
    v = velocities[i]
    blown = drag(thrust, axis, coefficient, (wind[0] - v[0], wind[1] - v[1], wind[2] - v[2]))
    return (
        thrust * axis[0] + blown[0],
        thrust * axis[1] + blown[1],
        thrust * axis[2] + blown[2],
    )


@inline
def thrust_for(x, y, z, coefficient, wind):  # type: ignore[no-untyped-def]
    """Thrust vector ``f a`` with which thrust and drag together are the force ``(x, y, z)``.

    ``F = f (a + c (w - a (a.w)))``: of ``b = F - f c w`` the direction is that of ``a``, and ``|b| = f (1 - c a.w)``;
    iterated on f, which changes by the square of ``c w`` only.
    """
    if coefficient <= 0.0:
        return x, y, z
    wx, wy, wz = coefficient * wind[0], coefficient * wind[1], coefficient * wind[2]
    f = math.sqrt(x * x + y * y + z * z)
    bx, by, bz, size = x, y, z, max(f, 1e-9)
    for _ in range(ROUNDS):
        bx, by, bz = x - f * wx, y - f * wy, z - f * wz
        size = math.sqrt(max(bx * bx + by * by + bz * bz, 1e-18))
        f = size * size / max(size - (bx * wx + by * wy + bz * wz), 0.3 * size)
    return f * bx / size, f * by / size, f * bz / size


ROUNDS = 4
"""Of the iteration in :func:`thrust_for`: within 2e-3 of the force in level wind at half a thrust of drag; wind against the thrust converges
more slowly."""
