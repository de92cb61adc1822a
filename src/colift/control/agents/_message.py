"""What a drone says, in 30 bytes: who it is, what it wants, what it bears, two pairs, and a seal.

====== ===========================================================================================
bytes  what
====== ===========================================================================================
0      number of the drone (4 bits), session (4): 1 to 15, the next after a restart
1-2    count of its cycles, the low 16 bits
3-4    its view of the team: a bit for each number; its own is 0 while it holds, as it misses somebody; 0: it has left
5-10   steady wish, three numbers of 16 bits, in the team's unit, in the planned frame
11-16  pull beside its share of the wish, likewise
17-21  a pair: peer (4 bits), version (3) and first (1) of its own reference, answered version (3), yes (1),
       session of the peer (4; 0: never heard), reference (24)
22-26  another pair; of a team on a rigid load what is learned of the moment, three numbers of 13 bits, in the frame of the wanted load, as the pull
       beside the plan then is; the wish is what is learned of the force, in the world
27-29  seal over all of it and the high bits of the count
====== ===========================================================================================

Directions are octahedral (Cigolle et al., "A survey of efficient representations for independent unit vectors", JCGT 2014):
every code is a unit vector, so that no message says what is not a number. The seal is that of
HalfSipHash-2-4 (Aumasson and Bernstein, "SipHash: a fast short-input PRF", 2012), of which 24 bits are sent.
"""

from __future__ import annotations

import math

from colift.kernel.jit import inline

MOST = 16
"""Drones in a team: as many as four bits can number."""
WHO, COUNT, TEAM, WISH, SHARE, PAIRS, SEAL = 0, 1, 3, 5, 11, 17, 27
PAIR = 5
MOMENT = PAIRS + PAIR
LARGEST = 4095
"""Largest number that 13 bits hold."""
NOBODY = 0
"""The view of the team of one that has left it."""
SIDE = 4094
"""Steps along a side of the octahedron's map: even, so that its middle has a code."""
_WORD = 0xFFFFFFFF
_HALF = 32768


@inline
def get16(message, at):  # type: ignore[no-untyped-def]
    """Two bytes as a number without sign."""
    return int(message[at]) | int(message[at + 1]) << 8


@inline
def put16(message, at, number):  # type: ignore[no-untyped-def]
    """A number without sign into two bytes."""
    message[at] = number & 255
    message[at + 1] = (number >> 8) & 255


@inline
def count_near(low, own):  # type: ignore[no-untyped-def]
    """The count with these low 16 bits that is nearest to a drone's own."""
    return own + ((low - own + _HALF) & 0xFFFF) - _HALF


@inline
def code_of(x, y, z):  # type: ignore[no-untyped-def]
    """24 bits for a unit vector."""
    size = abs(x) + abs(y) + abs(z)
    u, v = x / size, y / size
    if z < 0.0:
        u, v = math.copysign(1.0 - abs(v), u), math.copysign(1.0 - abs(u), v)
    a, b = int((u + 1.0) * (0.5 * SIDE) + 0.5), int((v + 1.0) * (0.5 * SIDE) + 0.5)
    return a | b << 12


@inline
def direction_of(code):  # type: ignore[no-untyped-def]
    """The unit vector of 24 bits, whatever they are."""
    u = min((code & 4095) * (2.0 / SIDE) - 1.0, 1.0)
    v = min(((code >> 12) & 4095) * (2.0 / SIDE) - 1.0, 1.0)
    z = 1.0 - abs(u) - abs(v)
    if z < 0.0:
        u, v = math.copysign(1.0 - abs(v), u), math.copysign(1.0 - abs(u), v)
    norm = 1.0 / math.sqrt(u * u + v * v + z * z)
    return u * norm, v * norm, z * norm


@inline
def put_pair(message, at, peer, version, first, answered, yes, session, code):  # type: ignore[no-untyped-def]
    """Write a pair into five bytes."""
    bits = peer | version << 4 | first << 7 | answered << 8 | yes << 11 | session << 12 | code << 16
    for k in range(PAIR):
        message[at + k] = (bits >> 8 * k) & 255


@inline
def get_pair(message, at):  # type: ignore[no-untyped-def]
    """Peer, version, first, answered version, yes, session and code of a pair."""
    bits = 0
    for k in range(PAIR):
        bits |= int(message[at + k]) << 8 * k
    return (
        bits & 15, (bits >> 4) & 7, (bits >> 7) & 1, (bits >> 8) & 7, (bits >> 11) & 1, (bits >> 12) & 15, bits >> 16,
    )  # fmt: skip


@inline
def put_moment(message, k, value):  # type: ignore[no-untyped-def]
    """Write the number k of a moment, rounded, into its 13 bits; what is no number as 0."""
    number = LARGEST
    if value == value:
        number = int(min(max(value, -LARGEST), LARGEST) + LARGEST + 0.5)
    for bit in range(13):
        at = 13 * k + bit
        byte = int(message[MOMENT + (at >> 3)])
        message[MOMENT + (at >> 3)] = byte ^ ((byte >> (at & 7) ^ number >> bit) & 1) << (at & 7)


@inline
def get_moment(message, k):  # type: ignore[no-untyped-def]
    """That number."""
    number = 0
    for bit in range(13):
        at = 13 * k + bit
        number |= ((int(message[MOMENT + (at >> 3)]) >> (at & 7)) & 1) << bit
    return float(min(number - LARGEST, LARGEST))


@inline
def _round(a, b, c, d):  # type: ignore[no-untyped-def]
    """SipRound of 32-bit words."""
    a = (a + b) & _WORD
    b = ((b << 5 | b >> 27) & _WORD) ^ a
    a = (a << 16 | a >> 16) & _WORD
    c = (c + d) & _WORD
    d = ((d << 8 | d >> 24) & _WORD) ^ c
    a = (a + d) & _WORD
    d = ((d << 7 | d >> 25) & _WORD) ^ a
    c = (c + b) & _WORD
    b = ((b << 13 | b >> 19) & _WORD) ^ c
    c = (c << 16 | c >> 16) & _WORD
    return a, b, c, d


@inline
def half_sip(message, size, high, tail, key_0, key_1):  # type: ignore[no-untyped-def]
    """HalfSipHash-2-4 (32 bits) of the first ``size`` bytes and of the ``tail`` (0 to 4) low bytes of ``high`` behind them."""
    a, b, c, d = key_0, key_1, 0x6C796765 ^ key_0, 0x74656462 ^ key_1
    length = size + tail
    for begin in range(0, length + 1, 4):
        word = 0
        for k in range(4):
            at = begin + k
            byte = 0
            if at < size:
                byte = int(message[at])
            elif at < length:
                byte = (high >> 8 * (at - size)) & 255
            word |= byte << 8 * k
        if begin + 4 > length:
            word |= (length & 255) << 24
        d ^= word
        a, b, c, d = _round(a, b, c, d)
        a, b, c, d = _round(a, b, c, d)
        a ^= word
    c ^= 0xFF
    for _ in range(4):
        a, b, c, d = _round(a, b, c, d)
    return b ^ d


@inline
def seal_of(message, high, key_0, key_1):  # type: ignore[no-untyped-def]
    """What the last three bytes must be."""
    return half_sip(message, SEAL, high, 4, key_0, key_1) & 0xFFFFFF


@inline
def seal(message, high, key_0, key_1):  # type: ignore[no-untyped-def]
    """Write the seal."""
    found = seal_of(message, high, key_0, key_1)
    put16(message, SEAL, found & 0xFFFF)
    message[SEAL + 2] = found >> 16


@inline
def is_sealed(message, high, key_0, key_1):  # type: ignore[no-untyped-def]
    """Whether the seal is right."""
    return (get16(message, SEAL) | int(message[SEAL + 2]) << 16) == seal_of(
        message, high, key_0, key_1
    )
