"""Newton's and Euler's laws of a rigid load about the origin of its frame: linear in ten numbers.

These are its mass ``m``, first moment ``h = m c`` and inertia ``I`` about the origin, as ``theta = (m, h, I_xx, I_yy, I_zz, I_yz, I_xz, I_xy)``. Where
it turns with the rates ``W`` and their derivative ``a``, and ``u`` is the acceleration of the origin less gravity, all in its frame, it needs::

    F = m u + a x h + W x (W x h),      M = I a + W x I W + h x u
"""

from __future__ import annotations

from colift.kernel.jit import inline
from colift.kernel.math.small import cross

COUNT = 10
"""How many numbers these are."""


@inline
def _inertia_times(theta, w):  # type: ignore[no-untyped-def]
    xx, yy, zz, yz, xz, xy = theta[4], theta[5], theta[6], theta[7], theta[8], theta[9]
    return (
        xx * w[0] + xy * w[1] + xz * w[2],
        xy * w[0] + yy * w[1] + yz * w[2],
        xz * w[0] + yz * w[1] + zz * w[2],
    )


@inline
def needed(theta, W, a, u):  # type: ignore[no-untyped-def]
    """Force and moment about the origin, in the load's frame, that the motion of a load with these numbers needs."""
    m, h = theta[0], (theta[1], theta[2], theta[3])
    twist, bend = cross(a, h), cross(W, cross(W, h))
    turn, gyration, lever = (
        _inertia_times(theta, a),
        cross(W, _inertia_times(theta, W)),
        cross(h, u),
    )
    return (
        (
            m * u[0] + twist[0] + bend[0],
            m * u[1] + twist[1] + bend[1],
            m * u[2] + twist[2] + bend[2],
        ),
        (
            turn[0] + gyration[0] + lever[0],
            turn[1] + gyration[1] + lever[1],
            turn[2] + gyration[2] + lever[2],
        ),
    )


@inline
def slopes(s, W, a, u):  # type: ignore[no-untyped-def]
    """By how much ``s . M`` grows with each of the numbers but the mass: nine."""
    hx, hy, hz = cross(u, s)
    p = cross(s, W)
    return (
        hx,
        hy,
        hz,
        s[0] * a[0] + p[0] * W[0],
        s[1] * a[1] + p[1] * W[1],
        s[2] * a[2] + p[2] * W[2],
        s[1] * a[2] + s[2] * a[1] + p[1] * W[2] + p[2] * W[1],
        s[0] * a[2] + s[2] * a[0] + p[0] * W[2] + p[2] * W[0],
        s[0] * a[1] + s[1] * a[0] + p[0] * W[1] + p[1] * W[0],
    )
