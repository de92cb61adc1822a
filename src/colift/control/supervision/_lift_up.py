"""From the ground into the air: stand, climb, hook, tension, rise."""

from __future__ import annotations

import math

from colift.control.supervision._lift_memory import (
    CLIMB,
    FLY,
    RISE,
    TENSION,
    M,
    P,
    begin_to_hook,
    give_up,
    go,
    try_again,
)
from colift.control.supervision._lift_senses import (
    alone,
    arm_of,
    forget,
    hold_out,
    length,
    make_up,
    pull,
    span_of,
)
from colift.control.supervision._lift_ways import arc, set_off
from colift.kernel.jit import inline
from colift.kernel.math.smooth import decay, rest_to_rest

LOOK = 1.0
"""Time over which load and drones are averaged before take-off, s."""
NEAR = 0.9
"""Distance from the load at which a cable is slack, over its length."""
SOON = 0.94
"""The same from which on the drones go out slowly."""
AROUND, BOUND = 0.015, 0.03
"""Share of a cable before its end in which they are slowest, and the most of it, m; beyond its end three tenths of that share."""
FAR = 1.08
"""The same at which a cable that does not pull is given up."""
SETTLE, LEARN = 0.8, 2.0
"""Times in hover from which and until which the forces on the drones are averaged, s."""
PULL = 0.12
"""Tension over a cable's share of the weight at which it counts as hooked."""
PULLING, HOLDING = 0.08, 0.2
"""Time for which it must last, and for which all must then hold, s."""
LOOSE, LOOSENED = 0.01, 0.15
"""By what share of its length a hooked cable is short when it counts as slack again, and for how long, s."""
STRAY = 3.0
"""Distance from its place, over what is asked for, at which a drone is given up that has had time enough."""
RAISE, SLOWLY = 1.5, 12.0
"""Time in which the lift share would rise by 1, s; at least so many times that of the velocity loop."""
MOST_SHARE = 2.5
"""Lift share at which a load that has not moved is given up."""
LIFTED, LIFTING = 0.01, 0.03
"""Height (m) and time (s) after which the load counts as lifted."""
AMISS = 0.4
"""Share by which what a load weighs differs from what lifted it, from which on it is given up."""
WEIGH, SWING_IN, HAND_OVER = 0.5, 0.15, 0.3
"""Time for which the lifted load is held, the first part of it that is not weighed, and the time to the flight's force, s."""


@inline
def strays(sees, params, memory):  # type: ignore[no-untyped-def]
    """How far the drones are from rest at their places in the formation: at most 1 where it is formed."""
    worst = 0.0
    for i in range(sees.estimated_positions.shape[0]):
        L = length(i, sees, params)
        away = fast = 0.0
        for k in range(3):
            place = (
                memory[M.place + k] + arm_of(i, k, sees) - NEAR * L * sees.received_directions[i, k]
            )
            away += (sees.estimated_positions[i, k] - place) ** 2
            fast += sees.estimated_velocities[i, k] ** 2
        worst = max(worst, math.sqrt(away) / (0.06 * max(L, 0.5)), math.sqrt(fast) / 0.15)
    return worst


@inline
def stand(t, time, sees, params, memory):  # type: ignore[no-untyped-def]
    """Average where load and drones stand."""
    load, x = sees.estimated_load, sees.estimated_positions
    place = memory[M.place : M.place + 3]
    memory[M.count] += 1.0
    for k in range(3):
        place[k] += (load[0, k] - place[k]) / memory[M.count]
    for i in range(x.shape[0]):
        o, L = M.rows + M.width * i, length(i, sees, params)
        memory[o + M.span] = (NEAR - 1.0) * L
        for k in range(3):
            memory[o + M.start + k] += (x[i, k] - memory[o + M.start + k]) / memory[M.count]
    memory[M.ground] = place[2]
    set_off(memory, place, place, 1.0, 1.0)
    if time >= LOOK:
        go(memory, CLIMB, t)
        for i in range(x.shape[0]):
            forget(i, sees, params, memory)


@inline
def climb(t, time, dt, sees, params, memory, courses):  # type: ignore[no-untyped-def]
    """On arcs about the load to the places of the formation."""
    n = sees.estimated_positions.shape[0]
    place = memory[M.place : M.place + 3]
    s, s1, s2, _ = rest_to_rest(time / params[P.climb])
    s1, s2 = s1 / params[P.climb], s2 / params[P.climb] ** 2
    for i in range(n):
        o, L = M.rows + M.width * i, length(i, sees, params)
        a = sees.received_directions[i]
        b = memory[o + M.start : o + M.start + 3]
        start = (b[0] - place[0], b[1] - place[1], b[2] - place[2])
        end = (
            arm_of(i, 0, sees) - NEAR * L * a[0],
            arm_of(i, 1, sees) - NEAR * L * a[1],
            arm_of(i, 2, sees) - NEAR * L * a[2],
        )
        arc(s, s1, s2, place, start, end, courses[i])
        make_up(i, 1.0 - decay(dt, 1.0 / params[P.learn]), memory)
    off = strays(sees, params, memory)
    late = time >= params[P.climb] + params[P.patience]
    if (s >= 1.0 and off <= 1.0) or late:
        begin_to_hook(n, t, memory)
        if off > STRAY:
            give_up(t, params, memory)
        for i in range(n):
            courses[i, 0, 0] = math.nan


@inline
def learn(time, dt, sees, params, memory):  # type: ignore[no-untyped-def]
    """Hover, and average what each drone feels and how much that scatters along its cable, beside the air that all feel."""
    if time >= SETTLE:
        memory[M.count] += 1.0
        for k in range(3):
            memory[M.calm + k] += (memory[M.air + k] - memory[M.calm + k]) / memory[M.count]
    for i in range(sees.estimated_positions.shape[0]):
        p, o = P.rows + P.width * i, M.rows + M.width * i
        make_up(i, 1.0 - decay(dt, 1.0 / params[P.learn]), memory)
        if time < SETTLE:
            continue
        _, along = span_of(i, sees)
        off = 0.0
        for k in range(3):
            step = memory[o + M.felt + k] - memory[o + M.mean + k]
            memory[o + M.mean + k] += step / memory[M.count]
            off += along[k] * (step - params[p + P.m] * (memory[M.air + k] - memory[M.calm + k]))
        if memory[M.count] > 1.0:
            memory[o + M.spread] += off * off


@inline
def hook(t, time, dt, sees, params, memory):  # type: ignore[no-untyped-def]
    """Learn, then go out until every cable pulls."""
    n = sees.estimated_positions.shape[0]
    share = params[P.m_L] * params[P.g] / n
    if time < LEARN:
        learn(time, dt, sees, params, memory)
        return
    if memory[M.stage] == 0.0:
        memory[M.stage] = 1.0
        for i in range(n):
            o = M.rows + M.width * i
            memory[o + M.spread] = math.sqrt(memory[o + M.spread] / max(memory[M.count], 1.0))
    hooked, lost = 0.0, 0.0
    for i in range(n):
        o, L = M.rows + M.width * i, length(i, sees, params)
        hold_out(i, dt, params, memory)
        distance, tension = pull(i, sees, params, memory)
        if memory[o + M.hooked] == 0.0:
            span = memory[o + M.span]
            near = distance > (SOON - LOOSE) * L
            slowly = span > (SOON - 1.0) * L - 0.15 * params[P.hook]
            memory[o + M.want] = params[P.hook] * (1.0 if slowly else 4.0)
            if -min(AROUND * L, BOUND) < span < 0.3 * AROUND * L:
                memory[o + M.want] = params[P.catch]
            pulls = near and tension > max(PULL * share, 3.0 * memory[o + M.spread])
            memory[o + M.sign] = memory[o + M.sign] + dt if pulls else 0.0
            if memory[o + M.sign] > PULLING:
                memory[o + M.hooked] = 1.0
                memory[o + M.want] = 0.0
                memory[o + M.length] = distance - sees.reeled[i, 0]
            if span > (FAR - 1.0) * L:
                lost = 1.0
        elif distance < memory[o + M.length] + sees.reeled[i, 0] - LOOSE * L:
            memory[o + M.hooked] = memory[o + M.sign] = 0.0
        else:
            hooked += 1.0
    memory[M.signed] = memory[M.signed] + dt if hooked == n else 0.0
    if memory[M.signed] > HOLDING:
        go(memory, TENSION, t)
        for i in range(n):
            memory[M.rows + M.width * i + M.sign] = 0.0
    elif lost != 0.0 or time > LEARN + params[P.patience] + 3.0 * way_out(sees, params):
        give_up(t, params, memory)


@inline
def way_out(sees, params):  # type: ignore[no-untyped-def]
    """Time in which the first drone goes from where its cable is slack to where it is given up, s."""
    L = length(0, sees, params)
    return (FAR - NEAR) * L / params[P.hook] + 2.0 * min(AROUND * L, BOUND) / params[P.catch]


@inline
def loosened(dt, sees, params, memory):  # type: ignore[no-untyped-def]
    """Whether a cable that was hooked is slack again."""
    for i in range(sees.estimated_positions.shape[0]):
        o, L = M.rows + M.width * i, length(i, sees, params)
        distance, _ = span_of(i, sees)
        short = distance < memory[o + M.length] + sees.reeled[i, 0] - LOOSE * L
        memory[o + M.sign] = memory[o + M.sign] + dt if short else 0.0
        if memory[o + M.sign] > LOOSENED:
            return True
    return False


@inline
def tension(t, dt, sees, params, memory, home):  # type: ignore[no-untyped-def]
    """Raise the share until the load is off the ground, weigh it, go over to the force of the flight."""
    n = sees.estimated_positions.shape[0]
    W = params[P.m_L] * params[P.g]
    load = sees.estimated_load
    for i in range(n):
        hold_out(i, dt, params, memory)
    if memory[M.stage] == 0.0:
        memory[M.share] += dt / params[P.rise]
        lifted = load[0, 2] - memory[M.place + 2] > LIFTED
        memory[M.signed] = memory[M.signed] + dt if lifted else 0.0
        if memory[M.signed] >= LIFTING:
            memory[M.stage], memory[M.slow] = 1.0, 0.0
            memory[M.rising], memory[M.top] = memory[M.share], load[0, 2]
        elif memory[M.share] > MOST_SHARE:
            give_up(t, params, memory)
        elif loosened(dt, sees, params, memory):
            try_again(t, params, memory)
        return
    memory[M.slow] += dt
    if memory[M.stage] == 1.0:
        # Hover near the height at which it was found lifted: what lifted it is more than it weighs.
        back = params[P.stiff] * (load[0, 2] - memory[M.top]) + params[P.damp] * load[1, 2]
        memory[M.share] = memory[M.rising] * min(max(1.0 - back / params[P.g], 0.5), 1.5)
        if memory[M.slow] > SWING_IN:
            weigh(sees, params, memory)
        if memory[M.slow] >= WEIGH:
            memory[M.stage], memory[M.slow] = 2.0, 0.0
            if abs(memory[M.pull + 2] / (memory[M.share] * W) - 1.0) > AMISS:
                give_up(t, params, memory)
                return
            memory[M.weighed] = memory[M.pull + 2] / params[P.g]
            memory[M.rising] = memory[M.share]
        return
    part = min(memory[M.slow] / HAND_OVER, 1.0)
    # What the cables do not bear of the weight that is told, and what they bear aside.
    for k in range(3):
        memory[M.held + k] = part * ((W if k == 2 else 0.0) - memory[M.pull + k])
    memory[M.share] = memory[M.rising] * W / (W - memory[M.held + 2])
    if part < 1.0:
        return
    go(memory, RISE, t)
    memory[M.above] = max(memory[M.ground] + params[P.clear] - home[2], 0.0)
    begin = (home[0], home[1], home[2] + memory[M.above])
    set_off(memory, load[0], begin, params[P.speed], 2.0)
    memory[M.rising] = memory[M.share]
    for k in range(3):
        memory[M.calm + k] = memory[M.air + k]
        for i in range(n):
            o = M.rows + M.width * i
            memory[o + M.mean + k] = memory[o + M.bias + k]


@inline
def weigh(sees, params, memory):  # type: ignore[no-untyped-def]
    """Average what all cables bear, and their lengths."""
    n = sees.estimated_positions.shape[0]
    memory[M.count] += 1.0
    for k in range(3):
        borne = 0.0
        for i in range(n):
            felt = memory[M.rows + M.width * i + M.felt + k]
            borne += alone(i, k, params, memory) - felt
        memory[M.pull + k] += (borne - memory[M.pull + k]) / memory[M.count]
    for i in range(n):
        o = M.rows + M.width * i
        distance, _ = span_of(i, sees)
        bare = distance - sees.reeled[i, 0]
        if memory[M.count] == 1.0:
            memory[o + M.length] = bare
        memory[o + M.length] += (bare - memory[o + M.length]) / memory[M.count]


@inline
def rise(t, time, sees, params, memory, n):  # type: ignore[no-untyped-def]
    """To where the reference begins; spans become the cables' lengths as they were measured."""
    part = min(time / HAND_OVER, 1.0)
    memory[M.share] = memory[M.rising] + part * (1.0 - memory[M.rising])
    done = time >= memory[M.way]
    for i in range(n):
        o, L = M.rows + M.width * i, length(i, sees, params)
        measured = memory[o + M.length] + sees.reeled[i, 0]
        pace = min(max(measured, 0.9 * L), 1.1 * L) - L - memory[o + M.span]
        memory[o + M.want] = 0.0 if done else min(max(2.0 * pace, -0.05 * L), 0.05 * L)
    if done:
        go(memory, FLY, t)
