"""Whether somebody pulls as it says, or as it said before it fell silent: else its share is missing in what moves the load.

A drone adds up the pulls of all, its own as flown and the others' as heard, and what it feels that all cables do to the load.
What is left is slow where masses are told wrongly; it jumps by a drone's pull when that drone is gone, and by the change of what
a drone says when that is a lie.
"""

from __future__ import annotations

import math

from colift.control.agents._message import MOST
from colift.control.agents._pairs import WIDTH, Q
from colift.kernel.jit import inline

FAST, SLOW = 0.02, 1.0
"""Time constants with which what is left is followed, and learned while nobody is silent or doubted, s."""
HALF = 0.5
"""Part of a drone's pull that must be missing when it is silent; while it speaks, the largest part that may be otherwise."""
CHANGE = 0.3
"""Part of its usual pull by which what a drone says must have changed to be held against it."""
SURE = 0.1
"""Time for which a drone that speaks must be in doubt before it is left out, s."""


@inline
def weigh(memory, peers, lack, felt, own, team, late, dt):  # type: ignore[no-untyped-def]
    """Follow what is left (3) and what of it is usual (3) at place ``lack``; ``felt`` and the own pull at ``own`` are of the frame.

    Beside it doubt grows, where the pull of a drone that speaks is missing.
    """
    if not math.isfinite(felt[0] + felt[1] + felt[2]):
        return
    calm = True
    for j in range(MOST):
        o = peers + WIDTH * j
        if memory[o + Q.inside] != 0.0:
            calm = calm and memory[o + Q.silent] <= 0.5 * late and memory[o + Q.doubt] == 0.0
    for k in range(3):
        left = felt[k] + memory[own + k]
        for j in range(MOST):
            o = peers + WIDTH * j
            if memory[o + Q.inside] != 0.0:
                pull = memory[o + Q.share + k] - memory[o + Q.wish + k] / team
                left += pull
                if calm:
                    share = dt / (dt + SLOW) if memory[o + Q.met] != 0.0 else 1.0
                    memory[o + Q.usual + k] += share * (pull - memory[o + Q.usual + k])
        memory[lack + k] += dt / (dt + FAST) * (left - memory[lack + k])
        if calm:
            memory[lack + 3 + k] += dt / (dt + SLOW) * (memory[lack + k] - memory[lack + 3 + k])
    for j in range(MOST):
        o = peers + WIDTH * j
        if memory[o + Q.inside] == 0.0:
            continue
        memory[o + Q.met] = 1.0
        speaks = memory[o + Q.silent] <= 0.5 * late
        doubt = memory[o + Q.doubt] + (dt if speaks and _lies(memory, o, lack, team) else -dt)
        memory[o + Q.doubt] = max(doubt, 0.0)


@inline
def missing(memory, o, lack, team):  # type: ignore[no-untyped-def]
    """Whether the pull of the silent peer at ``o`` is missing."""
    along = square = 0.0
    for k in range(3):
        pull = memory[o + Q.share + k] - memory[o + Q.wish + k] / team
        along += pull * (memory[lack + k] - memory[lack + 3 + k])
        square += pull * pull
    return along > HALF * square


@inline
def _lies(memory, o, lack, team):  # type: ignore[no-untyped-def]
    """Whether all of what the peer at ``o`` says that it pulls is missing, or all by which that has changed."""
    whole = whole_off = change = change_off = usual = 0.0
    for k in range(3):
        pull = memory[o + Q.share + k] - memory[o + Q.wish + k] / team
        more = pull - memory[o + Q.usual + k]
        gone = memory[lack + k] - memory[lack + 3 + k]
        usual += memory[o + Q.usual + k] ** 2
        whole, whole_off = whole + pull * pull, whole_off + (gone - pull) ** 2
        change, change_off = change + more * more, change_off + (gone - more) ** 2
    if whole_off < HALF * HALF * whole:
        return True
    return change > CHANGE * CHANGE * usual and change_off < HALF * HALF * change
