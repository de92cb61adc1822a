"""What a team that has changed makes of the reference: the load leans, and the reference's clock runs at another pace.

Both go from rest to rest, with as many derivatives as the reference has.
"""

from __future__ import annotations

import math

import numpy as np

from colift.kernel.jit import aside, inline
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion
from colift.kernel.math.small import cross
from colift.kernel.math.smooth import gently, phase

LEAN = Layout(team={"before": 4, "turn": 3, "begin": 1, "duration": 1})
"""A turn of the load beside that which its reference wants: from the attitude ``before`` by the rotation vector ``turn``, both in the
wanted load's frame; when it begins, and for how long, s."""
PACE = Layout(team={"clock": 1, "begin": 1, "before": 1, "after": 1, "duration": 1})
"""The reference's ``clock`` when its pace begins to change, s, and how fast it runs ``before`` and ``after``."""
L, P = LEAN.at, PACE.at
EASE = 1.0
"""Time in which the pace changes, s."""


@inline
def paced(pace, t):  # type: ignore[no-untyped-def]
    """The reference's clock at a time, how fast it runs, and two derivatives of that."""
    before, change = pace[P.before], pace[P.after] - pace[P.before]
    since = t - pace[P.begin]
    if change == 0.0:
        return pace[P.clock] + before * since, before, 0.0, 0.0
    way, p1, p2, p3 = phase(since, pace[P.duration], 1.0)
    return (
        pace[P.clock] + before * since + change * way,
        before + change * p1,
        change * p2,
        change * p3,
    )


@aside
def leaned(lean, t, attitude, rates):  # type: ignore[no-untyped-def]
    """Turn a wanted attitude (4,) and its rates with two derivatives (3, 3) by the lean at a time, where they are; the share of it.

    With the lean ``S``, which turns at ``omega = s' v`` about a fixed axis, ``R = R_d S`` and ``Omega = S^T Omega_d + omega``.
    """
    v = (lean[L.turn], lean[L.turn + 1], lean[L.turn + 2])
    duration = max(lean[L.duration], 1e-9)
    s0, s1, s2, s3 = gently((t - lean[L.begin]) / duration)
    w, x, y, z = quaternion.turn(
        lean[L.before], lean[L.before + 1], lean[L.before + 2], lean[L.before + 3],
        s0 * v[0], s0 * v[1], s0 * v[2],
    )  # fmt: skip
    s1, s2, s3 = s1 / duration, s2 / duration**2, s3 / duration**3
    omega, turning = (s1 * v[0], s1 * v[1], s1 * v[2]), (s2 * v[0], s2 * v[1], s2 * v[2])
    r0 = quaternion.into_body(w, x, y, z, rates[0, 0], rates[0, 1], rates[0, 2])
    r1 = quaternion.into_body(w, x, y, z, rates[1, 0], rates[1, 1], rates[1, 2])
    r2 = quaternion.into_body(w, x, y, z, rates[2, 0], rates[2, 1], rates[2, 2])
    swept, bent, twisted = cross(omega, r0), cross(omega, r1), cross(turning, r0)
    again = cross(omega, (r1[0] - swept[0], r1[1] - swept[1], r1[2] - swept[2]))
    for k in range(3):
        rates[0, k] = r0[k] + omega[k]
        rates[1, k] = r1[k] - swept[k] + turning[k]
        rates[2, k] = r2[k] - bent[k] - twisted[k] - again[k] + s3 * v[k]
    attitude[0], attitude[1], attitude[2], attitude[3] = quaternion.multiply(
        attitude[0], attitude[1], attitude[2], attitude[3], w, x, y, z
    )
    return s0


def lean_of(before, after, begin, duration):  # type: ignore[no-untyped-def]
    """A lean that goes from one attitude (4,) to another, both in the wanted load's frame; plain Python."""
    w, x, y, z = before
    c, *axis = quaternion.multiply(w, -x, -y, -z, *after)
    turn = np.copysign(1.0, c) * np.array(axis)
    size = float(np.linalg.norm(turn))
    angle = 2.0 * math.atan2(size, abs(c))
    turn *= angle / size if size > 1e-12 else 0.0
    return LEAN.pack(0, before=before, turn=turn, begin=begin, duration=duration)


def run_at(pace, after, t) -> None:  # type: ignore[no-untyped-def]
    """From a time on let the reference's clock go over to this pace; plain Python."""
    clock, now, change, _ = paced(pace, t)
    if now == after and change == 0.0:
        return
    pace[:] = PACE.pack(0, clock=clock, begin=t, before=now, after=after, duration=EASE)
