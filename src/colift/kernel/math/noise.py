"""Random numbers that are a function of where they are asked for: no state, the same in every run.

A number belongs to a key (of the mission's seed and the part), a number along time and a channel. These three name
a *cell*; a cell holds two random numbers and is used for one purpose. Whether the loop runs in one stretch or in
many, compiled or not, they are the same. Who counts samples, packets or ticks (:func:`tick`) instead of physics
steps gets the same ones for any physics step, too.

The generator is Philox-4x32-10 (Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3",
SC 2011), a permutation of 2^128 counters for each of 2^64 keys.
"""

from __future__ import annotations

import math

from colift.kernel.jit import inline

TICK = 0.001
"""Noise without a sampling period of its own changes each tick, s, and stands in between."""

_WORD = 0xFFFFFFFF
_UNIT = 1.0 / 9007199254740992.0  # 2^-53
_EVEN = tuple((-1.0) ** k / math.factorial(2 * k) for k in range(1, 9))
_ODD = tuple(
    (-1.0) ** k / math.factorial(2 * k + 1) for k in range(1, 9)
)  # of cosine and sine, from the second term on


@inline
def philox(key_0, key_1, c_0, c_1, c_2, c_3):  # type: ignore[no-untyped-def]
    """Four random words of 32 bits from a key of two and a counter of four.

    Products are masked, so that wrapping and unbounded integers agree.
    """
    for _ in range(10):
        a = c_0 * 0xD2511F53
        b = c_2 * 0xCD9E8D57
        c_0, c_1, c_2, c_3 = (
            ((b >> 32) & _WORD) ^ c_1 ^ key_0,
            b & _WORD,
            ((a >> 32) & _WORD) ^ c_3 ^ key_1,
            a & _WORD,
        )
        key_0 = (key_0 + 0x9E3779B9) & _WORD
        key_1 = (key_1 + 0xBB67AE85) & _WORD
    return c_0, c_1, c_2, c_3


@inline
def uniforms(key, number, channel):  # type: ignore[no-untyped-def]
    """Two multiples of 2^-53, each evenly distributed over 0 <= u < 1; all arguments are 64-bit integers."""
    a, b, c, d = philox(
        key & _WORD, (key >> 32) & _WORD, channel & _WORD, (channel >> 32) & _WORD,
        number & _WORD, (number >> 32) & _WORD,
    )  # fmt: skip
    return (a * 2097152 + (b >> 11)) * _UNIT, (c * 2097152 + (d >> 11)) * _UNIT


@inline
def on_circle(share):  # type: ignore[no-untyped-def]
    """Cosine and sine of ``2 pi share`` for 0 <= share < 1, within 2e-16: Taylor's series about the nearest quarter.

    The same on every machine, and faster than a library's.
    """
    quarter = int(4.0 * share + 0.5)
    x = 2.0 * math.pi * (share - 0.25 * quarter)
    y = x * x
    even, odd = y * _EVEN[7], y * _ODD[7]
    for k in range(6, 0, -1):
        even, odd = y * (_EVEN[k] + even), y * (_ODD[k] + odd)
    c, s = 1.0 + y * (_EVEN[0] + even), x + x * y * (_ODD[0] + odd)
    if quarter & 1:
        c, s = -s, c
    if quarter & 2:
        c, s = -c, -s
    return c, s


@inline
def normals(key, number, channel):  # type: ignore[no-untyped-def]
    """Two independent standard normals (Box and Muller 1958), at most 8.57 in size."""
    u, v = uniforms(key, number, channel)
    radius = math.sqrt(-2.0 * math.log(1.0 - u))
    x, y = on_circle(v)
    return radius * x, radius * y


@inline
def uniform(key, number, channel):  # type: ignore[no-untyped-def]
    """The first of :func:`uniforms`."""
    return uniforms(key, number, channel)[0]


@inline
def normal(key, number, channel):  # type: ignore[no-untyped-def]
    """The first of :func:`normals`."""
    return normals(key, number, channel)[0]


@inline
def tick(step, dt):  # type: ignore[no-untyped-def]
    """Number of the tick in which a physics step begins: of time, whatever the step."""
    return int(step * (dt / TICK) + 1e-6)
