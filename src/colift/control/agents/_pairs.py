"""What two drones have agreed on, so that their cables stay apart whatever is lost.

Drone i keeps for each peer its own reference ``r0``, which the peer has adopted, at most one more, ``r1``, that it has offered, and
``rb``, the peer's reference that it has adopted itself. Of two references the plane between them leaves each drone its side::

    a_i . (r_i - r_j) >= sin(theta / 2) |r_i - r_j|

Drone i obeys the planes of (r0, rb) and (r1, rb). What the peer has adopted of i is r0 or r1, and the other way
round: so there is always one plane that both obey, and between the caps on its two sides is the angle theta.

An offer is decided once: adopted if the drone is on its side of every plane that would follow, else refused for good. Whoever
knows nothing of a peer, at first or after a restart, stands still; what it offers then is marked as first, and is adopted
however near it is. A drone beyond a plane, as one that begins too near, may only come closer to it.

Cables that end on a body are kept apart in metres. A reference is the place of a drone then, ``-L_i r_i`` from its end, and the plane the one in the
middle between both, of which each drone keeps ``h`` with a cable of length ``L_i``::

    n . (L_i a_i + m) >= h        D = L_i r_i + E - L_j r_j,  n = D / |D|,  m = (E - L_i r_i - L_j r_j) / 2

``E`` is the peer's end from the own one. It is a cap of directions again. Both ends must lie on their sides: then so do the whole cables.
"""

from __future__ import annotations

import math

from colift.control.agents._message import MOST, code_of, direction_of
from colift.kernel.jit import inline
from colift.kernel.layout import Layout

PEER = Layout(
    team={
        "inside": 1, "gone": 1, "left": 1, "liar": 1, "holds": 1, "doubt": 1, "met": 1, "usual": 3, "count": 1, "silent": 1, "session": 1, "wish": 3, "share": 3,
        "state": 1, "version": 1, "code": 1, "r0": 3, "r1": 3, "reach": 1,
        "known": 1, "rb": 3, "seen": 1, "yes": 1, "due": 1,
        "own": 1, "other": 1, "end": 3, "gap": 1,
    }
)  # fmt: skip
"""What a drone keeps of each peer. ``silent``: cycles since it was heard; ``reach``: share of the way to where it wants to be that is
offered; ``gone``: left out by what the load did, as a ``liar``
though it speaks; ``left``: it has said so itself; ``usual``: pull, of one that was ``met``, for a while; ``seen``: version decided last; ``due``: it waits for an answer;
``own``, ``other``: lengths of both cables, 0 where all end in one point; ``end``: its end from the own one; ``gap``: how far either end is to be from the plane."""
Q, WIDTH = PEER.at, PEER.size(0)
SETTLED, OFFERED, FIRST = 0.0, 1.0, 2.0
"""``state`` of the own reference: r1 is out only in the second."""
APART = 1e-2
"""Least distance of two references of a plane."""
NEWS = 1e-2
"""Least distance of a new reference from the one before, rad."""
LEAST = 0.05
"""A share of the way below this is none."""


@inline
def plane(memory, o, p, q, least):  # type: ignore[no-untyped-def]
    """The plane between the own reference at ``p`` and that at ``q`` of the peer at ``o``.

    Whether there is one; its unit normal towards the own side; the least product of a direction with it.
    """
    own, other = memory[o + Q.own], memory[o + Q.other]
    rigid = own > 0.0
    if not rigid:
        own = other = 1.0
    x = own * memory[p] - other * memory[q]
    y = own * memory[p + 1] - other * memory[q + 1]
    z = own * memory[p + 2] - other * memory[q + 2]
    if rigid:
        x, y, z = x + memory[o + Q.end], y + memory[o + Q.end + 1], z + memory[o + Q.end + 2]
    square = x * x + y * y + z * z
    norm = 1.0 / math.sqrt(max(square, 1e-12))
    x, y, z = x * norm, y * norm, z * norm
    good = square > APART * APART
    if rigid:
        away = x * memory[o + Q.end] + y * memory[o + Q.end + 1] + z * memory[o + Q.end + 2]
        off = x * (own * memory[p] + other * memory[q])
        off += y * (own * memory[p + 1] + other * memory[q + 1])
        off += z * (own * memory[p + 2] + other * memory[q + 2])
        off = 0.5 * (away - off)
        good = good and off >= memory[o + Q.gap] and away - off >= memory[o + Q.gap]
        least = (least - off) / own
    return good, x, y, z, least


@inline
def keeps(memory, o, a, p, q, least):  # type: ignore[no-untyped-def]
    """Whether the direction at place ``a`` is on its own side of that plane."""
    good, x, y, z, least = plane(memory, o, p, q, least)
    return good and memory[a] * x + memory[a + 1] * y + memory[a + 2] * z >= least


@inline
def _no_worse(memory, o, w, a, p, q, least):  # type: ignore[no-untyped-def]
    """The same of one at place ``w``, or that it is no farther beyond than that at ``a``."""
    _, x, y, z, least = plane(memory, o, p, q, least)
    height = memory[w] * x + memory[w + 1] * y + memory[w + 2] * z
    return height >= least or height >= memory[a] * x + memory[a + 1] * y + memory[a + 2] * z


@inline
def stand(memory, o, a):  # type: ignore[no-untyped-def]
    """Forget what was agreed with the peer at ``o``; offer the own direction at ``a`` as first."""
    memory[o + Q.state] = FIRST
    memory[o + Q.version] = (memory[o + Q.version] + 1.0) % 8
    code = code_of(memory[a], memory[a + 1], memory[a + 2])
    memory[o + Q.code] = code
    x, y, z = direction_of(code)
    memory[o + Q.r0], memory[o + Q.r0 + 1], memory[o + Q.r0 + 2] = x, y, z
    memory[o + Q.reach] = 1.0
    memory[o + Q.known] = 0.0
    memory[o + Q.yes] = 0.0
    memory[o + Q.due] = 1.0


@inline
def decide(memory, o, a, scratch, version, first, yes, code, least):  # type: ignore[no-untyped-def]
    """Take or refuse what the peer at ``o`` offers."""
    known = memory[o + Q.known] != 0.0
    standing = memory[o + Q.state] == FIRST
    anew = first != 0 and (version != memory[o + Q.seen] or (yes == 0 and not standing))
    if known and anew:  # it has begun anew, and has forgotten what it had adopted
        stand(memory, o, a)
        known, standing = False, True
    if known and version == memory[o + Q.seen]:
        if first != 0:  # our answer was lost
            memory[o + Q.due] = 1.0
        return
    if not known and first == 0:
        return
    if known and version != (memory[o + Q.seen] + 1.0) % 8:
        return
    x, y, z = direction_of(code)
    memory[scratch], memory[scratch + 1], memory[scratch + 2] = x, y, z
    if known:
        good = keeps(memory, o, a, o + Q.r0, scratch, least)
        if memory[o + Q.state] == OFFERED:
            good = good and keeps(memory, o, a, o + Q.r1, scratch, least)
    else:
        good, _, _, _, _ = plane(memory, o, o + Q.r0, scratch, least)
    memory[o + Q.due] = 1.0
    if (
        not good and standing
    ):  # who stands refuses nothing: that would look as if nothing had been adopted
        return
    if good:
        for k in range(3):
            memory[o + Q.rb + k] = memory[scratch + k]
        memory[o + Q.known] = 1.0
    memory[o + Q.seen] = version
    memory[o + Q.yes] = 1.0 if good else 0.0


@inline
def hear_answer(memory, o, first, answered, yes):  # type: ignore[no-untyped-def]
    """The peer at ``o`` has decided on a version of ours; ``first`` is that of its own reference."""
    state = memory[o + Q.state]
    if state == SETTLED or answered != memory[o + Q.version]:
        return
    if (
        state == FIRST
    ):  # of what we have said since we stand here, not of what we said before a restart
        if yes != 0 and (first != 0 or memory[o + Q.known] != 0.0):
            memory[o + Q.state] = SETTLED
        return
    memory[o + Q.state] = SETTLED
    if yes != 0:
        memory[o + Q.reach] = 1.0
        for k in range(3):
            memory[o + Q.r0 + k] = memory[o + Q.r1 + k]
    else:
        memory[o + Q.reach] *= 0.5


@inline
def offer(memory, o, a, x, y, z, least):  # type: ignore[no-untyped-def]
    """Offer the peer at ``o`` a reference at (x, y, z), if that is new and the direction at ``a`` obeys what follows."""
    code = code_of(x, y, z)
    x, y, z = direction_of(code)
    square = 0.0
    for k in range(3):
        d = (x if k == 0 else y if k == 1 else z) - memory[o + Q.r0 + k]
        square += d * d
    if square < NEWS * NEWS:
        return False
    memory[o + Q.r1], memory[o + Q.r1 + 1], memory[o + Q.r1 + 2] = x, y, z
    if not keeps(memory, o, a, o + Q.r1, o + Q.rb, least):
        return False
    memory[o + Q.code] = code
    memory[o + Q.version] = (memory[o + Q.version] + 1.0) % 8
    memory[o + Q.state] = OFFERED
    memory[o + Q.due] = 1.0
    return True


@inline
def here(memory, o):  # type: ignore[no-untyped-def]
    """Whether planes with the peer at ``o`` are kept: with a liar too, which may still hang there."""
    there = memory[o + Q.inside] != 0.0 or memory[o + Q.liar] != 0.0
    return there and memory[o + Q.known] != 0.0


@inline
def allowed(memory, peers, w, a, least, cone):  # type: ignore[no-untyped-def]
    """Whether the direction at place ``w`` is within the cone and on its side of all planes, or no worse than that at ``a``."""
    if -memory[w + 2] < min(cone, -memory[a + 2]):
        return False
    for j in range(MOST):
        o = peers + WIDTH * j
        if not here(memory, o):
            continue
        if not _no_worse(memory, o, w, a, o + Q.r0, o + Q.rb, least):
            return False
        if memory[o + Q.state] == OFFERED and not _no_worse(
            memory, o, w, a, o + Q.r1, o + Q.rb, least
        ):
            return False
    return True
