"""The load's model: where the cables end on it. All else asks for these ends.

A load that is a point has one place for all of them, so they are equal rows. On a rigid load with the attitude ``R`` and the
rates ``Omega`` the end at ``rho`` is where the load is and ``R rho`` on, and::

    d(R v)/dt = R (Omega x v + dv/dt),    from v = rho on, for as many derivatives as are asked for
"""

from __future__ import annotations

from colift.kernel.jit import inline
from colift.kernel.math import quaternion


@inline
def is_rigid(attachments):  # type: ignore[no-untyped-def]
    """Whether any cable ends elsewhere than where the load is."""
    for i in range(attachments.shape[0]):
        for k in range(3):
            if attachments[i, k] != 0.0:
                return True
    return False


@inline
def ends_of(load, ends):  # type: ignore[no-untyped-def]
    """Fill ``ends`` (n, K, 3): places where the cables end and K - 1 derivatives, from those of the load (K or more, 3)."""
    for m in range(ends.shape[1]):
        x, y, z = load[m, 0], load[m, 1], load[m, 2]
        for i in range(ends.shape[0]):
            ends[i, m, 0], ends[i, m, 1], ends[i, m, 2] = x, y, z


@inline
def add_arms(attachments, attitude, p, q, r, ends):  # type: ignore[no-untyped-def]
    """Add to the ends of a point and their velocities what the attitude (4,) of a rigid load and its rates (p, q, r) make of them."""
    w, x, y, z = attitude[0], attitude[1], attitude[2], attitude[3]
    for i in range(ends.shape[0]):
        a, b, c = attachments[i, 0], attachments[i, 1], attachments[i, 2]
        place = quaternion.into_world(w, x, y, z, a, b, c)
        speed = quaternion.into_world(w, x, y, z, q * c - r * b, r * a - p * c, p * b - q * a)
        for k in range(3):
            ends[i, 0, k] += place[k]
            ends[i, 1, k] += speed[k]


@inline
def add_wanted_arms(attachments, attitude, rates, ends):  # type: ignore[no-untyped-def]
    """The same with accelerations and jerks, from the rates and two derivatives (3, 3)."""
    w, x, y, z = attitude[0], attitude[1], attitude[2], attitude[3]
    p, q, r = rates[0, 0], rates[0, 1], rates[0, 2]
    add_arms(attachments, attitude, p, q, r, ends)
    p1, q1, r1 = rates[1, 0], rates[1, 1], rates[1, 2]
    p2, q2, r2 = rates[2, 0], rates[2, 1], rates[2, 2]
    for i in range(ends.shape[0]):
        a, b, c = attachments[i, 0], attachments[i, 1], attachments[i, 2]
        u1, v1, w1 = q * c - r * b, r * a - p * c, p * b - q * a
        # Omega' x rho, and the same of Omega''
        e1, f1, g1 = q1 * c - r1 * b, r1 * a - p1 * c, p1 * b - q1 * a
        e2, f2, g2 = q2 * c - r2 * b, r2 * a - p2 * c, p2 * b - q2 * a
        u2, v2, w2 = q * w1 - r * v1 + e1, r * u1 - p * w1 + f1, p * v1 - q * u1 + g1
        u3 = q * w2 - r * v2 + e2 + q1 * w1 - r1 * v1 + q * g1 - r * f1
        v3 = r * u2 - p * w2 + f2 + r1 * u1 - p1 * w1 + r * e1 - p * g1
        w3 = p * v2 - q * u2 + g2 + p1 * v1 - q1 * u1 + p * f1 - q * e1
        acceleration = quaternion.into_world(w, x, y, z, u2, v2, w2)
        jerk = quaternion.into_world(w, x, y, z, u3, v3, w3)
        for k in range(3):
            ends[i, 2, k] += acceleration[k]
            ends[i, 3, k] += jerk[k]
