"""Back to the ground: lower, touch, unload, slacken, land."""

from __future__ import annotations

import math

from colift.control.supervision._lift_memory import (
    DONE,
    LAND,
    RELEASE,
    SLACKEN,
    TOUCH,
    UNLOAD,
    M,
    P,
    begin_to_hook,
    go,
)
from colift.control.supervision._lift_senses import arm_of, hold_out, length, make_up, usual
from colift.control.supervision._lift_up import NEAR
from colift.control.supervision._lift_ways import arc, set_off, steady
from colift.kernel.jit import inline
from colift.kernel.math.smooth import decay, phase, rest_to_rest

PRESS, PRESSING = 0.25, 0.06
"""Force of the ground over the load's weight (1), and time (s), by which a touch-down is told."""
CLOSE, STOPPED, STOPPING = 0.015, 0.6, 0.025
"""Height (m) near which a load that lacks this share of its speed for this time (s) has touched down."""
WINDOW = 0.03
"""Height within which the ground is looked for, m."""
DEEP = 0.1
"""How far below the ground the reference is led at most, m: a load that has not touched by then is unloaded where it is."""
EAGER = 2.0
"""Speed with which the drones go on as the tensions vanish, over that of touch-down."""
BRAKING = 0.08
"""For how long the drones are accelerated towards a load that has touched, s."""
UNLOADING, VANISH = 0.6, 0.02
"""Time to unload, and time in which the tensions vanish, s."""
TOUCHED = 0.3
"""Force of the ground over a drone's weight at which its motors stop."""
SINK = 0.05
"""Speed with which a drone comes onto the ground, m/s."""
REST = 0.3
"""Least time for the drones to calm down once the cables are slack, s."""
APART = 1.25
"""Distance from the load at which released drones come down, over the cable's length."""


@inline
def touched(dt, sinking, sees, params, memory):  # type: ignore[no-untyped-def]
    """Whether the load has come onto the ground; ``sinking`` is the speed that it is led down with, m/s."""
    height = sees.estimated_load[0, 2] - memory[M.ground]
    if height > WINDOW:
        usual(dt, sees, memory)
        memory[M.signed] = memory[M.slow] = 0.0
        return False
    weight = params[P.m_L] * params[P.g] - memory[M.normal_mean]  # as it has been felt
    least = max(PRESS * weight, 2.5 * math.sqrt(memory[M.normal_spread]))
    memory[M.signed] = (
        memory[M.signed] + dt if memory[M.normal] - memory[M.normal_mean] > least else 0.0
    )
    stopped = height < CLOSE and sees.estimated_load[1, 2] + sinking > STOPPED * params[P.touch]
    memory[M.slow] = memory[M.slow] + dt if stopped else 0.0
    return memory[M.signed] > PRESSING or memory[M.slow] > STOPPING


@inline
def land(t, time, dt, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    """Down on arcs about the load, then slowly on until the ground carries."""
    n = sees.estimated_positions.shape[0]
    courses = writes.courses
    away = APART if memory[M.phase] == RELEASE else NEAR
    s, s1, s2, _ = rest_to_rest(time / params[P.climb])
    s1, s2 = s1 / params[P.climb], s2 / params[P.climb] ** 2
    sink = phase(time - params[P.climb], 0.5, SINK)
    standing = True
    for i in range(n):
        p, o = P.rows + P.width * i, M.rows + M.width * i
        L, m = length(i, sees, params), params[p + P.m]
        b = memory[o + M.start : o + M.start + 3]
        centre = memory[M.goal : M.goal + 3]
        start = (b[0] - centre[0], b[1] - centre[1], b[2] - centre[2])
        level = math.hypot(start[0], start[1])
        out, low = away * L + memory[o + M.out], 0.02 - params[P.sole]
        if level > 1e-6:
            end = (out * start[0] / level, out * start[1] / level, low)
        else:
            end = (out, 0.0, low)
        arc(s, s1, s2, centre, start, end, courses[i])
        for k in range(3):
            courses[i, k, 2] -= sink[k]
        if s < 0.8:
            make_up(i, 1.0 - decay(dt, 1.0 / params[P.learn]), memory)
        else:
            height = sees.estimated_positions[i, 2] - memory[M.ground] + params[P.sole]
            speed = sees.estimated_velocities[i, 2]
            borne = memory[o + M.felt + 2] - memory[o + M.bias + 2] > TOUCHED * m * params[P.g]
            rests = sink[1] > 0.9 * SINK and speed > -0.3 * SINK
            there = height < WINDOW and (borne or rests)
            memory[o + M.sign] = memory[o + M.sign] + dt if there else 0.0
            late = time > params[P.climb] + params[P.patience]
            if memory[o + M.sign] > (0.03 if borne else 0.2) or late:
                memory[o + M.down] = 1.0
        standing = standing and memory[o + M.down] != 0.0
        if memory[M.phase] == RELEASE:
            writes.unhooked[i] = 1.0
    if standing:
        go(memory, DONE, t)


@inline
def lower(t, time, dt, sees, params, memory):  # type: ignore[no-untyped-def]
    """Over the place, then down to where the descent is slow."""
    if memory[M.stage] == 0.0 and time >= memory[M.way]:
        memory[M.stage], memory[M.since], time = 1.0, t, 0.0
        top = (memory[M.goal], memory[M.goal + 1], memory[M.goal + 2])
        low = min(memory[M.ground] + params[P.margin], top[2])
        set_off(memory, top, (top[0], top[1], low), params[P.speed], 1.0)
    usual(dt, sees, memory)
    if memory[M.stage] == 1.0 and time >= memory[M.way]:
        go(memory, TOUCH, t)


@inline
def touch(t, time, dt, sees, params, memory):  # type: ignore[no-untyped-def]
    """Straight down until the ground is felt; the drones are braked, which the cables' pull still throws up."""
    gone = phase(time, 0.5, params[P.touch])
    deep = memory[M.goal + 2] - gone[0] < memory[M.ground] - DEEP
    if not (touched(dt, gone[1], sees, params, memory) or deep):
        return
    go(memory, UNLOAD, t)
    memory[M.rising] = memory[M.share]
    for i in range(sees.estimated_positions.shape[0]):
        o = M.rows + M.width * i
        memory[o + M.span + 1] = -params[P.touch] * (1.0 if params[P.brake] > 0.0 else EAGER)
        memory[o + M.span + 2] = -params[P.brake]
    for k in range(3):
        memory[M.begin + k] = memory[M.goal + k]
        memory[M.place + k] = sees.estimated_load[0, k]
    memory[M.begin + 2] = memory[M.goal + 2] = memory[M.goal + 2] - gone[0]


@inline
def unload(t, time, dt, params, memory, n):  # type: ignore[no-untyped-def]
    """The tensions vanish, the drones go on towards the load."""
    memory[M.share] = memory[M.rising] * max(1.0 - time / VANISH, 0.0)
    for i in range(n):
        o = M.rows + M.width * i
        hold_out(i, dt, params, memory)
        if time < BRAKING and params[P.brake] > 0.0 and memory[o + M.span + 1] < 0.0:
            steady(o, memory)
        else:
            memory[o + M.want] = -EAGER * params[P.touch] * math.exp(-time / params[P.fade])
    if time >= UNLOADING:
        go(memory, SLACKEN, t)


@inline
def slacken(t, time, dt, sees, params, memory):  # type: ignore[no-untyped-def]
    """Back to where no cable pulls; then the load is hooked once more, or the drones land."""
    n = sees.estimated_positions.shape[0]
    done = time >= REST
    for i in range(n):
        o, L = M.rows + M.width * i, length(i, sees, params)
        pace = (NEAR - 1.0) * L - memory[o + M.span]
        memory[o + M.want] = min(max(2.0 * pace, -0.1 * L), 0.1 * L)
        done = done and abs(pace) < 0.01 * L
        if abs(pace) < 0.05 * L:
            make_up(i, 1.0 - decay(dt, 1.0 / params[P.learn]), memory)
        else:
            hold_out(i, dt, params, memory)
    if not done:
        return
    if memory[M.again] == 0.0:
        memory[M.round] += 1.0
    if memory[M.round] < params[P.rounds]:
        begin_to_hook(n, t, memory)
        return
    go(memory, RELEASE if params[P.release] != 0.0 else LAND, t)
    for i in range(n):
        o, L = M.rows + M.width * i, length(i, sees, params)
        memory[o + M.want] = memory[o + M.sign] = memory[o + M.down] = 0.0
        memory[o + M.out] = math.hypot(arm_of(i, 0, sees), arm_of(i, 1, sees))
        for k in range(3):
            away = (L + memory[o + M.span]) * sees.received_directions[i, k]
            memory[o + M.start + k] = memory[M.goal + k] + arm_of(i, k, sees) - away
