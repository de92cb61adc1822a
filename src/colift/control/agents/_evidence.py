"""Whether somebody pulls as it says, or as it said before it fell silent: else its share is missing in what moves the load.

A drone adds up the pulls of all, its own as flown and the others' as heard, and what it feels that all cables do to the load: as it
is measured, or by how the load that it sees moves. What is left is slow where masses are told wrongly; it jumps by a drone's pull
when that drone is gone, and by the change of what a drone says when that is a lie.
"""

from __future__ import annotations

import math

from colift.control.agents import _frame as frame
from colift.control.agents._message import MOST
from colift.control.agents._pairs import WIDTH, Q
from colift.kernel.jit import inline

FAST, SLOW = 0.02, 1.0
"""Time constants with which what is left is followed, and learned while nobody is silent or doubted, s."""
MISSING, HALF = 0.35, 0.5
"""Part of a drone's pull that must be missing when it is silent; while it speaks, the largest part that may be otherwise."""
CHANGE = 0.3
"""Part of its usual pull by which what a drone says must have changed to be held against it."""
SURE, SILENT = 0.1, 0.05
"""Time for which a drone that speaks, or that does not, must be in doubt before it is left out, s."""
QUIET = 0.3
"""Part of the patience after which a drone counts as silent: while that has lasted less than twice the patience, what is missing adds up."""
SINKING = 0.5
"""Share of gravity below which a planned acceleration says nothing of the load's mass."""


@inline
def feel(memory, velocity, steady, up, plan, v, g, dt):  # type: ignore[no-untyped-def]
    """Force of all cables on the load (world), of how its velocity ``v`` has changed since the last call; not numbers if it is none.

    ``m (dv / dt + g)`` with the mass that bears the ``steady`` wish, which has learned what was told wrongly. That is in the frame about
    ``up``; the last velocity stands at place ``velocity``, behind whether there is one.
    """
    if not math.isfinite(v[0] + v[1] + v[2]):
        memory[velocity] = 0.0
        return math.nan, math.nan, math.nan
    x, y, z = memory[steady], memory[steady + 1], memory[steady + 2]
    x, y, z = frame.to_world(memory, up, x, y, z)
    p, q, r = plan[2, 0], plan[2, 1], plan[2, 2] + g
    square = p * p + q * q + r * r
    if not square > (SINKING * g) ** 2:
        p, q, r, square = 0.0, 0.0, g, g * g
    mass = max((x * p + y * q + z * r) / max(square, 1e-6), 0.0)
    known, o = memory[velocity] != 0.0, velocity + 1
    x, y, z = v[0] - memory[o], v[1] - memory[o + 1], v[2] - memory[o + 2]
    memory[velocity], memory[o], memory[o + 1], memory[o + 2] = 1.0, v[0], v[1], v[2]
    if not known:
        return math.nan, math.nan, math.nan
    return mass * x / dt, mass * y / dt, mass * (z / dt + g)


@inline
def weigh(memory, peers, lack, felt, measured, own, team, late, dt):  # type: ignore[no-untyped-def]
    """Follow what is left (3), what of it is usual (3) and for how long it has been (1) at place ``lack``; ``felt`` and the own pull at ``own`` are of the frame.

    Beside it doubt grows, where the pull of a silent drone is missing, and of one that speaks if what is felt is ``measured``: what the load's motion
    says is half as large in a gust as a drone's pull.
    """
    if not math.isfinite(felt[0] + felt[1] + felt[2]):
        return
    calm = True
    for j in range(MOST):
        o = peers + WIDTH * j
        if memory[o + Q.inside] != 0.0:
            calm = calm and memory[o + Q.silent] <= QUIET * late and memory[o + Q.doubt] == 0.0
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
        if calm:  # at first as the mean of all until now
            share = dt / (dt + min(SLOW, memory[lack + 6]))
            memory[lack + 3 + k] += share * (memory[lack + k] - memory[lack + 3 + k])
    memory[lack + 6] = min(memory[lack + 6] + dt, SLOW)
    for j in range(MOST):
        o = peers + WIDTH * j
        if memory[o + Q.inside] == 0.0:
            continue
        memory[o + Q.met] = 1.0
        silent = memory[o + Q.silent]
        if silent <= QUIET * late:
            more = dt if measured and _lies(memory, o, lack, team) else -dt
            memory[o + Q.doubt] = max(memory[o + Q.doubt] + more, 0.0)
        else:  # who is heard again is no liar yet
            more = -dt if silent > 2.0 * late else 0.0
            if _missing(memory, o, lack, team):
                more = dt
            memory[o + Q.doubt] = min(max(memory[o + Q.doubt] + more, 0.0), SURE)


@inline
def _missing(memory, o, lack, team):  # type: ignore[no-untyped-def]
    """Whether the pull of the silent peer at ``o`` is missing."""
    along = square = 0.0
    for k in range(3):
        pull = memory[o + Q.share + k] - memory[o + Q.wish + k] / team
        along += pull * (memory[lack + k] - memory[lack + 3 + k])
        square += pull * pull
    return along > MISSING * square


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
