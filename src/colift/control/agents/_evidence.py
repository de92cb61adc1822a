"""Whether somebody who is silent still pulls: its share is missing in what moves the load, or it is not.

A drone adds up the pulls of all, its own as flown and the others' as heard, and what it feels that all cables do to the load.
What is left is slow where masses are told wrongly, and jumps by a drone's pull when that drone is gone.
"""

from __future__ import annotations

import math

from colift.control.agents._message import MOST
from colift.control.agents._pairs import WIDTH, Q
from colift.kernel.jit import inline

FAST, SLOW = 0.02, 1.0
"""Time constants with which what is left is followed, and learned while everybody is heard, s."""
HALF = 0.5
"""Part of a drone's pull that must be missing."""


@inline
def weigh(memory, peers, lack, felt, own, team, late, dt):  # type: ignore[no-untyped-def]
    """Follow what is left (3) and what of it is usual (3) at place ``lack``; ``felt`` and the own pull at ``own`` are of the frame."""
    if not math.isfinite(felt[0] + felt[1] + felt[2]):
        return
    silent = False
    for j in range(MOST):
        o = peers + WIDTH * j
        silent = silent or (memory[o + Q.inside] != 0.0 and memory[o + Q.silent] > 0.5 * late)
    for k in range(3):
        left = felt[k] + memory[own + k]
        for j in range(MOST):
            o = peers + WIDTH * j
            if memory[o + Q.inside] != 0.0:
                left += memory[o + Q.share + k] - memory[o + Q.wish + k] / team
        memory[lack + k] += dt / (dt + FAST) * (left - memory[lack + k])
        if not silent:
            memory[lack + 3 + k] += dt / (dt + SLOW) * (memory[lack + k] - memory[lack + 3 + k])


@inline
def missing(memory, o, lack, team):  # type: ignore[no-untyped-def]
    """Whether the pull of the peer at ``o`` is missing."""
    along = square = 0.0
    for k in range(3):
        pull = memory[o + Q.share + k] - memory[o + Q.wish + k] / team
        along += pull * (memory[lack + k] - memory[lack + 3 + k])
        square += pull * pull
    return along > HALF * square
