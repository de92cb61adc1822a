"""Random numbers that are a function of where they are asked for: no state, the same in every run.

A number belongs to a key (of the mission's seed and the part), a step and a channel. Whether the loop runs
in one stretch or in many, compiled or not, it is the same.
"""

from __future__ import annotations

import math

from colift.jit import inline

_WORD = 0xFFFFFFFF


@inline
def scramble(x):  # type: ignore[no-untyped-def]
    """A permutation of 32-bit words in which every bit of the input moves about half of the output's.

    Two rounds of shift and multiply; the constants are the low-bias ones found by C. Wellons, "Prospecting
    for hash functions", 2018. Products are masked, so that wrapping and unbounded integers agree.
    """
    x = x & _WORD
    x = ((x ^ (x >> 16)) * 0x7FEB352D) & _WORD
    x = ((x ^ (x >> 15)) * 0x846CA68B) & _WORD
    return x ^ (x >> 16)


@inline
def uniform(key, step, channel):  # type: ignore[no-untyped-def]
    """Uniform between 0 and 1, both excluded."""
    seed = scramble(scramble(key) + scramble((key >> 32) + 0x9E3779B9))
    cell = scramble(seed ^ scramble(step + 0x7F4A7C15)) + channel
    high, low = scramble(cell), scramble(cell ^ 0x5851F42D)
    return (high * 2097152.0 + (low >> 11) + 0.5) / 9007199254740992.0


@inline
def normal(key, step, channel):  # type: ignore[no-untyped-def]
    """Standard normal; uses the channels ``2 channel`` and ``2 channel + 1`` (Box and Muller 1958)."""
    radius = math.sqrt(-2.0 * math.log(uniform(key, step, 2 * channel)))
    return radius * math.cos(2.0 * math.pi * uniform(key, step, 2 * channel + 1))
