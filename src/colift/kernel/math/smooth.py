"""Smooth ramps inside kernels, with their derivatives."""

from __future__ import annotations

import math

from colift.kernel.jit import inline


@inline
def decay(dt, time_constant):  # type: ignore[no-untyped-def]
    """Share of its old value that a first-order filter keeps over ``dt``; none without a time constant."""
    return math.exp(-dt / time_constant) if time_constant > 0.0 else 0.0


@inline
def phase(t, duration, rate):  # type: ignore[no-untyped-def]
    """Phase whose rate grows smoothly from 0 to ``rate`` over ``duration``: value and 3 derivatives.

    The rate follows the quintic ``10 s^3 - 15 s^4 + 6 s^5``, whose first two derivatives vanish at
    both ends, so that the phase is three times continuously differentiable.
    """
    if t <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    if t >= duration:
        return rate * (t - 0.5 * duration), rate, 0.0, 0.0
    s = t / duration
    s3 = s * s * s
    value = rate * duration * s3 * s * (2.5 - 3.0 * s + s * s)
    first = rate * s3 * (10.0 - 15.0 * s + 6.0 * s * s)
    second = rate / duration * 30.0 * s * s * (1.0 - s) * (1.0 - s)
    third = rate / (duration * duration) * 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s)
    return value, first, second, third


@inline
def rest_to_rest(s):  # type: ignore[no-untyped-def]
    """Septic from 0 to 1 on ``0 <= s <= 1`` and three derivatives, all zero at both ends."""
    if s <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    if s >= 1.0:
        return 1.0, 0.0, 0.0, 0.0
    r = 1.0 - s
    value = s * s * s * s * (35.0 + s * (-84.0 + s * (70.0 - 20.0 * s)))
    first = 140.0 * s * s * s * r * r * r
    second = 420.0 * s * s * r * r * (1.0 - 2.0 * s)
    third = 840.0 * s * r * (1.0 - 5.0 * s + 5.0 * s * s)
    return value, first, second, third


@inline
def gently(s):  # type: ignore[no-untyped-def]
    """From 0 to 1 on ``0 <= s <= 1`` and three derivatives, of which the next two vanish at both ends as well."""
    if s <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    if s >= 1.0:
        return 1.0, 0.0, 0.0, 0.0
    r = 1.0 - s
    y = s * r
    value = s**6 * (462.0 + s * (-1980.0 + s * (3465.0 + s * (-3080.0 + s * (1386.0 - 252.0 * s)))))
    y3 = y * y * y
    first = 2772.0 * y3 * y * y
    second = 13860.0 * y3 * y * (1.0 - 2.0 * s)
    third = 13860.0 * y3 * (4.0 - 18.0 * y)
    return value, first, second, third


PEAK_SPEED, PEAK_BEND = 35.0 / 16.0, 84.0 * math.sqrt(5.0) / 25.0
"""Of :func:`rest_to_rest` over one metre in one second."""


@inline
def soonest(way, speed, acceleration):  # type: ignore[no-untyped-def]
    """Time for a way by :func:`rest_to_rest` on which neither speed nor acceleration is more than this."""
    return max(PEAK_SPEED * way / speed, math.sqrt(PEAK_BEND * way / acceleration))


@inline
def sinusoid(amplitude, factor, p0, p1, p2, p3, sine, cosine):  # type: ignore[no-untyped-def]
    """``amplitude * sin(factor * p)`` and three time derivatives along the phase p(t).

    ``sine`` and ``cosine`` are of ``factor * p``; pass (cos, -sin) to get a cosine.
    """
    w1 = factor * p1
    w2 = factor * p2
    w3 = factor * p3
    return (
        amplitude * sine,
        amplitude * cosine * w1,
        amplitude * (cosine * w2 - sine * w1 * w1),
        amplitude * (cosine * w3 - 3.0 * sine * w1 * w2 - cosine * w1 * w1 * w1),
    )
