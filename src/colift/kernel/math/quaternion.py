"""Unit quaternions ``wxyz`` inside kernels: scalars in, tuples out.

``q`` turns body vectors into world vectors; the product is Hamilton's.
"""

from __future__ import annotations

import math

from colift.kernel.jit import inline
from colift.kernel.rounding import DOWNWARD


@inline
def multiply(aw, ax, ay, az, bw, bx, by, bz):  # type: ignore[no-untyped-def]
    """Hamilton product a b."""
    return (
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    )


@inline
def third_axis(w, x, y, z):  # type: ignore[no-untyped-def]
    """``R(q) e3``: the direction of thrust in the world frame."""
    return (2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z)


@inline
def into_body(w, x, y, z, a, b, c):  # type: ignore[no-untyped-def]
    """``R(q)^T v``: a world vector ``(a, b, c)`` in the body frame."""
    pw, px, py, pz = multiply(w, -x, -y, -z, 0.0, a, b, c)
    _, bx, by, bz = multiply(pw, px, py, pz, w, x, y, z)
    return bx, by, bz


@inline
def into_world(w, x, y, z, a, b, c):  # type: ignore[no-untyped-def]
    """``R(q) v``: a vector ``(a, b, c)`` of the body frame in the world's."""
    return into_body(w, -x, -y, -z, a, b, c)


@inline
def from_thrust_direction(ux, uy, uz):  # type: ignore[no-untyped-def]
    """Zero-yaw attitude whose third axis is the unit vector u (paper section 2.3).

    Near ``u = -e3``, where the formula divides by zero, the limit along x is returned.
    """
    squared = 2.0 * uz + 2.0
    if squared < DOWNWARD:
        return (0.0, 1.0, 0.0, 0.0)
    root = math.sqrt(squared)
    return (0.5 * root, -uy / root, ux / root, 0.0)


@inline
def turn(w, x, y, z, ax, ay, az):  # type: ignore[no-untyped-def]
    """The attitude turned by the rotation vector a (rad) of the body frame; exact, unit length kept."""
    angle = math.sqrt(ax * ax + ay * ay + az * az)
    half = math.cos(0.5 * angle)
    scale = math.sin(0.5 * angle) / angle if angle > 1e-9 else 0.5
    return multiply(w, x, y, z, half, scale * ax, scale * ay, scale * az)
