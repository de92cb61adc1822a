"""Winches inside kernels: how much cable each has paid out, with two derivatives.

A winch goes from rest to rest. Its drum is known exactly, to the plant and to the drone that carries it: what nobody may
know exactly is the length from which it began.
"""

from __future__ import annotations

from colift.kernel.jit import inline
from colift.kernel.layout import Layout
from colift.kernel.math.smooth import rest_to_rest, soonest

W = Layout(team={"before": 1, "change": 1, "begin": 1, "duration": 1}).at
"""Numbers of a winch: what is paid out ``before`` it begins to turn, by how much it goes on, m; when, and for how long, s."""

MOST = 1.0
"""Most acceleration of a winch's cable, m/s^2."""


@inline
def winding(change, rate):  # type: ignore[no-untyped-def]
    """Time that a winch of this rate (m/s) takes for a change of its cable's length (m), s."""
    return soonest(abs(change), rate, MOST)


@inline
def paid_out(winches, i, t):  # type: ignore[no-untyped-def]
    """Cable that winch i has paid out by the time ``t`` since the flight began, m, and two derivatives."""
    before, change = winches[i, W.before], winches[i, W.change]
    duration = winches[i, W.duration]
    if duration <= 0.0:
        return before, 0.0, 0.0
    s0, s1, s2, _ = rest_to_rest((t - winches[i, W.begin]) / duration)
    return before + change * s0, change * s1 / duration, change * s2 / (duration * duration)


@inline
def turning(n, winches, t, dt):  # type: ignore[no-untyped-def]
    """Whether any winch turns between ``t`` and ``t + dt``."""
    for i in range(n):
        begin, duration = winches[i, W.begin], winches[i, W.duration]
        if duration > 0.0 and t < begin + duration and t + dt > begin:
            return True
    return False
