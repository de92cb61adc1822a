"""A load's wanted attitude, from angles that are functions of time.

The angles turn it about its third axis (yaw), then its second (pitch), then its first (roll), ``R = Rz(psi) Ry(theta) Rx(phi)``, so::

    Omega = (phi' - psi' sin theta,  theta' cos phi + psi' cos theta sin phi,  psi' cos theta cos phi - theta' sin phi)

Derivatives are carried along as truncated series ``(value, first, second)``; of angles with the third, too.
"""

from __future__ import annotations

import math

import numpy as np

from colift.kernel.jit import aside, inline


@inline
def _times(a, b):  # type: ignore[no-untyped-def]
    """Product of two series."""
    return a[0] * b[0], a[1] * b[0] + a[0] * b[1], a[2] * b[0] + 2.0 * a[1] * b[1] + a[0] * b[2]


@inline
def _waves(angle):  # type: ignore[no-untyped-def]
    """Series of sine and cosine of an angle with its derivatives."""
    s, c = math.sin(angle[0]), math.cos(angle[0])
    a1, a2 = angle[1], angle[2]
    return (s, c * a1, c * a2 - s * a1 * a1), (c, -s * a1, -s * a2 - c * a1 * a1)


@aside
def turn_to(roll, pitch, yaw, attitude, rates):  # type: ignore[no-untyped-def]
    """Fill the attitude (4,) and the rates with two derivatives (3, 3) from three angles, each with three derivatives (4,), rad."""
    cr, sr = math.cos(0.5 * roll[0]), math.sin(0.5 * roll[0])
    cp, sp = math.cos(0.5 * pitch[0]), math.sin(0.5 * pitch[0])
    cy, sy = math.cos(0.5 * yaw[0]), math.sin(0.5 * yaw[0])
    attitude[0] = cy * cp * cr + sy * sp * sr
    attitude[1] = cy * cp * sr - sy * sp * cr
    attitude[2] = cy * sp * cr + sy * cp * sr
    attitude[3] = sy * cp * cr - cy * sp * sr
    sine_r, cosine_r = _waves(roll)
    sine_p, cosine_p = _waves(pitch)
    d_roll = (roll[1], roll[2], roll[3])
    d_pitch = (pitch[1], pitch[2], pitch[3])
    d_yaw = (yaw[1], yaw[2], yaw[3])
    sunk, level = _times(d_yaw, sine_p), _times(d_yaw, cosine_p)
    q1, q2 = _times(d_pitch, cosine_r), _times(level, sine_r)
    r1, r2 = _times(level, cosine_r), _times(d_pitch, sine_r)
    for m in range(3):
        rates[m, 0] = d_roll[m] - sunk[m]
        rates[m, 1] = q1[m] + q2[m]
        rates[m, 2] = r1[m] - r2[m]


def angles_of(attitude, rates):  # type: ignore[no-untyped-def]
    """Roll, pitch and yaw with three derivatives (4, 3), rad, of which :func:`turn_to` makes an attitude and its rates; plain Python.

    Near a pitch of 90 degrees, where there are no such angles, their derivatives are bounded.
    """
    w, x, y, z = attitude
    found = np.zeros((4, 3))
    found[0] = (
        math.atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
        math.asin(min(max(2.0 * (w * y - z * x), -1.0), 1.0)),
        math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z)),
    )
    p, q, r = (tuple(rates[:, k].tolist()) for k in range(3))
    for k in range(3):  # each round knows one derivative more
        roll, pitch = (tuple(found[:, j].tolist()) for j in range(2))
        (sine_r, cosine_r), (sine_p, (c, c1, c2)) = _waves(roll), _waves(pitch)
        c = max(c, 0.05)
        secant = (1.0 / c, -c1 / c**2, (2.0 * c1 * c1 / c - c2) / c**2)
        across = tuple(a + b for a, b in zip(_times(q, sine_r), _times(r, cosine_r), strict=True))
        turning = _times(across, secant)
        found[k + 1] = (
            p[k] + _times(turning, sine_p)[k],
            _times(q, cosine_r)[k] - _times(r, sine_r)[k],
            turning[k],
        )
    return found


@inline
def times_of_four(a, b):  # type: ignore[no-untyped-def]
    """Product of two series with three derivatives each."""
    p0, p1, p2 = _times(a, b)
    return p0, p1, p2, a[3] * b[0] + 3.0 * (a[2] * b[1] + a[1] * b[2]) + a[0] * b[3]


@inline
def _arctan(u):  # type: ignore[no-untyped-def]
    """Angle with this tangent, and its cosine, both with three derivatives."""
    angle = math.atan(u[0])
    s, c = math.sin(angle), math.cos(angle)
    twice, across = 2.0 * s * c, c * c - s * s
    # angle' = u' c^2
    a1 = u[1] * c * c
    a2 = u[2] * c * c - u[1] * twice * a1
    a3 = u[3] * c * c - 2.0 * u[2] * twice * a1 - u[1] * (2.0 * across * a1 * a1 + twice * a2)
    cosine = (c, -s * a1, -s * a2 - c * a1 * a1, -s * a3 - 3.0 * c * a1 * a2 + s * a1 * a1 * a1)
    return (angle, a1, a2, a3), cosine


@inline
def lean_along(x, y):  # type: ignore[no-untyped-def]
    """Roll and pitch that turn the third axis along ``(x, y, 1)``, of which x and y have three derivatives; so have the angles."""
    pitch, cosine = _arctan(x)
    roll, _ = _arctan(times_of_four(y, cosine))
    return (-roll[0], -roll[1], -roll[2], -roll[3]), pitch
