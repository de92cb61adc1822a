"""Take-off, pick-up, set-down and landing: a load that stands on the ground, cables that are slack at first."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from colift.control.supervision.base import SIGNATURE, SupervisionPart
from colift.control.tuning import Delays
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import rotors
from colift.kernel.math.smooth import decay, phase, rest_to_rest
from colift.kernel.phase import Phase
from colift.part import Setup, Vector
from colift.team import Team

MOST_ROUNDS = 8
"""Most places where a load is set down in one flight."""

PARAMS = Layout(
    team={
        "g": 1, "m_L": 1, "feel": 1, "learn": 1, "delay": 1, "lag": 1, "fly": 1, "rounds": 1,
        "aside": 1,
        "places": 2 * MOST_ROUNDS, "speed": 1, "touch": 1, "release": 1, "ground": 1, "hook": 1, "climb": 1,
        "margin": 1, "rise": 1, "stiff": 1, "damp": 1,
        "clear": 1,
    },
    drone={"m": 1, "L": 1, "drag": 1},
)  # fmt: skip
"""``feel``: bandwidth of the observers, ``learn``: with which what they feel is made up for, 1/s; ``rounds``: how often the load is
lifted, ``fly``: time of the reference in each, s; ``aside``: whether it is set down at ``places``; speeds of the way (``speed``), of ``touch``-down and to ``hook``, m/s; time to ``climb``, s; ``margin``: height
from which on it goes down at the speed of touch-down, m; time in which the lift share would ``rise`` by 1, s; how a lifted load is held,
as accelerations of the load by the lift share: per height (``stiff``) and speed (``damp``); height
above the ground at which the reference begins at least (``clear``), m."""
MEMORY = Layout(
    team={
        "started": 1, "phase": 1, "since": 1, "clock": 1, "place": 3, "ground": 1, "begin": 3,
        "goal": 3, "way": 1, "stage": 1, "share": 1, "rising": 1, "held": 3, "weighed": 1,
        "momentum": 1, "normal": 1, "normal_mean": 1, "normal_spread": 1, "signed": 1, "slow": 1,
        "count": 1, "pull": 3, "round": 1, "top": 1, "above": 1,
    },
    drone={
        "own": 3, "felt": 3, "thrust": 1, "bias": 3, "start": 3, "span": 3, "want": 1, "mean": 3,
        "spread": 1, "sign": 1, "hooked": 1, "length": 1, "down": 1, "usual": 3,
    },
)  # fmt: skip
"""Of the team: ``phase``, ``since`` when; the ``round``, from 0; the ``clock``; ``place`` of the load on the ``ground``; the load's way from ``begin`` to ``goal``, its
time ``way`` and ``stage``; lift ``share``; force ``held`` on the load and ``weighed`` mass; height ``top`` at which it counted as lifted;
by how much the reference is flown ``above`` itself; observer of the vertical
``momentum`` and the ``normal`` force that it finds, mean and mean square of its noise; time for which a sign lasts (``signed``) and of
a ``slow`` descent.
Of a drone: ``own`` momentum as far as explained and the force ``felt``; ``bias`` made up for; where it ``start``ed; ``span`` with derivatives
and the rate that it ``want``s; ``usual`` force in flight."""
P, M = PARAMS.at, MEMORY.at

FLY, STAND, CLIMB, HOOK, TENSION, RISE = (
    float(Phase.FLY), float(Phase.STAND), float(Phase.CLIMB), float(Phase.HOOK),
    float(Phase.TENSION), float(Phase.RISE),
)  # fmt: skip
LOWER, TOUCH, UNLOAD, SLACKEN, RELEASE, LAND, DONE = (
    float(Phase.LOWER), float(Phase.TOUCH), float(Phase.UNLOAD), float(Phase.SLACKEN),
    float(Phase.RELEASE), float(Phase.LAND), float(Phase.DONE),
)  # fmt: skip

LOOK = 1.0
"""Time over which load and drones are averaged before take-off, s."""
NEAR = 0.9
"""Distance from the load at which a cable is slack, over its length."""
SOON = 0.94
"""The same from which on the drones go out slowly."""
FAR = 1.08
"""The same at which a cable that does not pull is given up."""
SETTLE, LEARN = 0.8, 2.0
"""Times in hover from which and until which the forces on the drones are averaged, s."""
PULL = 0.12
"""Tension over a cable's share of the weight at which it counts as hooked."""
PULLING = 0.08
"""Time for which it must last, s."""
SERVO = 15.0
"""Bandwidth with which spans follow the rate that is wanted, 1/s."""
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
PRESS, PRESSING = 0.25, 0.06
"""Force of the ground over the load's weight (1), and time (s), by which a touch-down is told."""
CLOSE, STOPPED, STOPPING = 0.015, 0.6, 0.025
"""Height (m) near which a load that lacks this share of its speed for this time (s) has touched down."""
WINDOW = 0.03
"""Height within which the ground is looked for, m."""
USUAL = 0.5
"""Time constant of what counts as usual in flight, s."""
EAGER = 2.0
"""Speed with which the drones go on as the tensions vanish, over that of touch-down."""
UNLOADING, VANISH, FADE = 0.6, 0.02, 0.3
"""Time to unload, time in which the tensions vanish, time constant of the drones' speed then, s."""
PEAK = 35.0 / 16.0
"""Peak speed of a smooth way from rest to rest over its mean."""
TOUCHED = 0.3
"""Force of the ground over a drone's weight at which its motors stop."""
SINK = 0.05
"""Speed with which a drone comes onto the ground, m/s."""
REST = 0.3
"""Least time for the drones to calm down once the cables are slack, s."""
MOVING = 0.02
"""Speed of a reference from which on it does not rest, m/s."""
RODS = ("rigid-cables",)
"""Plants whose cables cannot be slack."""
APART = 1.25
"""Distance from the load at which released drones come down, over the cable's length."""


@inline
def _feel(sees, params, memory, dt):  # type: ignore[no-untyped-def]
    """Observers: what drones feel beyond thrust, drag and weight, and the vertical force on the whole."""
    x, v, q = sees.estimated_positions, sees.estimated_velocities, sees.estimated_attitudes
    Omega, thrusts, load = sees.estimated_rates, sees.thrusts, sees.estimated_load
    g, w, delay = params[P.g], params[P.feel], params[P.delay]
    keep = decay(dt, params[P.lag])
    fresh = memory[M.started] == 0.0
    upward, carried = 0.0, params[P.m_L] * load[1, 2]
    for i in range(x.shape[0]):
        p, o = P.rows + P.width * i, M.rows + M.width * i
        m = params[p + P.m]
        carried += m * v[i, 2]
        if fresh:
            memory[o + M.thrust] = thrusts[i]
            for k in range(3):
                memory[o + M.own + k] = m * v[i, k]
        thrust = keep * memory[o + M.thrust] + (1.0 - keep) * thrusts[i]
        memory[o + M.thrust] = thrust
        force = rotors.force_of(
            i, thrust, q, Omega, delay, params[p + P.drag], sees.estimated_wind, v
        )
        for k in range(3):
            known = force[k] - (m * g if k == 2 else 0.0)
            memory[o + M.own + k] += dt * (known + memory[o + M.felt + k])
            memory[o + M.felt + k] = w * (m * v[i, k] - memory[o + M.own + k])
            if k == 2:
                upward += known
    if fresh:
        memory[M.momentum] = carried
    memory[M.momentum] += dt * (upward - params[P.m_L] * g + memory[M.normal])
    memory[M.normal] = w * (carried - memory[M.momentum])


@inline
def _length(i, sees, params):  # type: ignore[no-untyped-def]
    """Length of cable i as it is wound out, m."""
    return params[P.rows + P.width * i + P.L] + sees.reeled[i, 0]


@inline
def _forget(i, sees, params, memory):  # type: ignore[no-untyped-def]
    """Begin to feel drone i anew, without the ground."""
    p, o = P.rows + P.width * i, M.rows + M.width * i
    for k in range(3):
        memory[o + M.felt + k] = 0.0
        memory[o + M.own + k] = params[p + P.m] * sees.estimated_velocities[i, k]


@inline
def _make_up(i, rate, memory):  # type: ignore[no-untyped-def]
    """What is made up for follows what is felt, by this share."""
    o = M.rows + M.width * i
    for k in range(3):
        memory[o + M.bias + k] += rate * (memory[o + M.felt + k] - memory[o + M.bias + k])


@inline
def _go(memory, number, time):  # type: ignore[no-untyped-def]
    memory[M.phase] = number
    memory[M.since] = time
    memory[M.stage] = memory[M.signed] = memory[M.slow] = memory[M.count] = 0.0
    for k in range(3):
        memory[M.pull + k] = 0.0


@inline
def _begin_to_hook(n, time, memory):  # type: ignore[no-untyped-def]
    _go(memory, HOOK, time)
    memory[M.share] = 0.0
    for k in range(3):
        memory[M.held + k] = 0.0
    for i in range(n):
        o = M.rows + M.width * i
        memory[o + M.hooked] = memory[o + M.sign] = memory[o + M.spread] = memory[o + M.want] = 0.0
        for k in range(3):
            memory[o + M.mean + k] = 0.0


@inline
def _give_up(time, params, memory):  # type: ignore[no-untyped-def]
    """Slacken the cables of a load that cannot be lifted, for good."""
    memory[M.round] = params[P.rounds]
    _go(memory, UNLOAD, time)
    memory[M.rising] = memory[M.share]


@inline
def _set_off(memory, begin, goal, speed, least):  # type: ignore[no-untyped-def]
    """A smooth way of the load from rest to rest."""
    away = 0.0
    for k in range(3):
        memory[M.begin + k], memory[M.goal + k] = begin[k], goal[k]
        away += (goal[k] - begin[k]) ** 2
    memory[M.way] = max(least, 1e-3, PEAK * math.sqrt(away) / speed)


@inline
def _on_the_way(memory, time, shift, home):  # type: ignore[no-untyped-def]
    """Shift of the reference, which stands at ``home``, so that the load is on its way since ``time`` (s)."""
    T = memory[M.way]
    s0, s1, s2, s3 = rest_to_rest(time / T)
    for k in range(3):
        step = memory[M.goal + k] - memory[M.begin + k]
        shift[0, k] = memory[M.begin + k] + step * s0 - home[k]
        shift[1, k] = step * s1 / T
        shift[2, k] = step * s2 / (T * T)
        shift[3, k] = step * s3 / (T * T * T)


@inline
def _arc(s, s1, s2, centre, start, end, course):  # type: ignore[no-untyped-def]
    """A place (3, 3) with derivatives on the arc about ``centre`` from ``start`` to ``end`` (3,), both relative to it.

    Distance, elevation and azimuth change in proportion to ``s``, whose rate and acceleration are ``s1`` and ``s2``.
    """
    h0, h1 = math.hypot(start[0], start[1]), math.hypot(end[0], end[1])
    r, r1 = math.hypot(h0, start[2]), math.hypot(h1, end[2])
    e, e1 = math.atan2(start[2], h0), math.atan2(end[2], h1)
    a1 = math.atan2(end[1], end[0]) if h1 > 1e-6 else math.atan2(start[1], start[0])
    a = math.atan2(start[1], start[0]) if h0 > 1e-6 else a1
    dr, de = r1 - r, e1 - e
    da = (a1 - a + math.pi) % (2.0 * math.pi) - math.pi
    r, e, a = r + s * dr, e + s * de, a + s * da
    ce, se, ca, sa = math.cos(e), math.sin(e), math.cos(a), math.sin(a)
    h, hd = r * ce, dr * ce - r * se * de
    hdd = -2.0 * dr * se * de - r * ce * de * de
    z, zd, zdd = r * se, dr * se + r * ce * de, 2.0 * dr * ce * de - r * se * de * de
    x, xd, xdd = h * ca, hd * ca - h * sa * da, hdd * ca - 2.0 * hd * sa * da - h * ca * da * da
    y, yd, ydd = h * sa, hd * sa + h * ca * da, hdd * sa + 2.0 * hd * ca * da - h * sa * da * da
    place, turn, bend = (x, y, z), (xd, yd, zd), (xdd, ydd, zdd)
    for k in range(3):
        course[0, k] = centre[k] + place[k]
        course[1, k] = turn[k] * s1
        course[2, k] = bend[k] * s1 * s1 + turn[k] * s2


@inline
def _reel(i, dt, memory):  # type: ignore[no-untyped-def]
    """Span of cable i follows the wanted rate; twice continuously differentiable."""
    o = M.rows + M.width * i + M.span
    want = memory[M.rows + M.width * i + M.want]
    # Implicitly, stable for any step.
    bend = (memory[o + 2] + dt * SERVO * SERVO * (want - memory[o + 1])) / (
        1.0 + 2.0 * SERVO * dt + SERVO * SERVO * dt * dt
    )
    memory[o + 2] = bend
    memory[o + 1] += dt * bend
    memory[o] += dt * memory[o + 1]


@inline
def _formed(sees, params, memory):  # type: ignore[no-untyped-def]
    """Whether all drones are at rest at their places in the formation."""
    for i in range(sees.estimated_positions.shape[0]):
        L = _length(i, sees, params)
        away = fast = 0.0
        for k in range(3):
            place = memory[M.place + k] - NEAR * L * sees.received_directions[i, k]
            away += (sees.estimated_positions[i, k] - place) ** 2
            fast += sees.estimated_velocities[i, k] ** 2
        if math.sqrt(away) > 0.06 * max(L, 0.5) or math.sqrt(fast) > 0.15:
            return False
    return True


@inline
def _pull(i, sees, memory):  # type: ignore[no-untyped-def]
    """Length of cable i's span and the tension that is felt: by how much more than ``mean`` it pulls its drone."""
    o = M.rows + M.width * i
    size = tension = 0.0
    for k in range(3):
        apart = sees.estimated_ends[i, 0, k] - sees.estimated_positions[i, k]
        size += apart * apart
        tension += apart * (memory[o + M.felt + k] - memory[o + M.mean + k])
    size = math.sqrt(max(size, 1e-12))
    return size, tension / size


@inline
def _hook(time, dt, sees, params, memory):  # type: ignore[no-untyped-def]
    """Hover and learn, then go out until every cable pulls."""
    n = sees.estimated_positions.shape[0]
    share = params[P.m_L] * params[P.g] / n
    if time < LEARN:
        if time >= SETTLE:
            memory[M.count] += 1.0
        for i in range(n):
            o = M.rows + M.width * i
            _make_up(i, 1.0 - decay(dt, 1.0 / params[P.learn]), memory)
            if time >= SETTLE:
                _, off = _pull(i, sees, memory)
                new = off / memory[M.count]
                for k in range(3):
                    step = memory[o + M.felt + k] - memory[o + M.mean + k]
                    memory[o + M.mean + k] += step / memory[M.count]
                if memory[M.count] > 1.0:
                    memory[o + M.spread] += off * (off - new)
        return 0.0
    if memory[M.stage] == 0.0:
        memory[M.stage] = 1.0
        for i in range(n):
            o = M.rows + M.width * i
            memory[o + M.spread] = math.sqrt(memory[o + M.spread] / max(memory[M.count], 1.0))
            for k in range(3):
                memory[o + M.bias + k] = memory[o + M.mean + k]
    hooked, lost = 0.0, 0.0
    for i in range(n):
        o, L = M.rows + M.width * i, _length(i, sees, params)
        distance, tension = _pull(i, sees, memory)
        if memory[o + M.hooked] == 0.0:
            span = memory[o + M.span]
            slowly = span > (SOON - 1.0) * L - 0.15 * params[P.hook]
            memory[o + M.want] = params[P.hook] * (1.0 if slowly else 4.0)
            pulls = slowly and tension > max(PULL * share, 3.0 * memory[o + M.spread])
            memory[o + M.sign] = memory[o + M.sign] + dt if pulls else 0.0
            if memory[o + M.sign] > PULLING:
                memory[o + M.hooked] = 1.0
                memory[o + M.want] = 0.0
                memory[o + M.length] = distance
            if span > (FAR - 1.0) * L:
                lost = 1.0
        else:
            hooked += 1.0
    if lost != 0.0:
        return -1.0
    memory[M.signed] = memory[M.signed] + dt if hooked == n else 0.0
    return 1.0 if memory[M.signed] > 0.2 else 0.0


@inline
def _tension(dt, sees, params, memory):  # type: ignore[no-untyped-def]
    """Raise the share until the load is off the ground, weigh it, go over to the force of the flight. Tells when that is done."""
    n = sees.estimated_positions.shape[0]
    W = params[P.m_L] * params[P.g]
    if memory[M.stage] == 0.0:
        memory[M.share] += dt / params[P.rise]
        up = sees.estimated_load[0, 2] - memory[M.place + 2] > LIFTED
        memory[M.signed] = memory[M.signed] + dt if up else 0.0
        if memory[M.signed] >= LIFTING:
            memory[M.stage], memory[M.slow] = 1.0, 0.0
            memory[M.rising], memory[M.top] = memory[M.share], sees.estimated_load[0, 2]
        elif memory[M.share] > MOST_SHARE:
            return -1.0
        return 0.0
    memory[M.slow] += dt
    if memory[M.stage] == 1.0:
        # Hover near the height at which it was found lifted: what lifted it is more than it weighs.
        back = params[P.stiff] * (sees.estimated_load[0, 2] - memory[M.top])
        back += params[P.damp] * sees.estimated_load[1, 2]
        memory[M.share] = memory[M.rising] * min(max(1.0 - back / params[P.g], 0.5), 1.5)
        if memory[M.slow] > SWING_IN:
            memory[M.count] += 1.0
            for k in range(3):
                pull = 0.0
                for i in range(n):
                    o = M.rows + M.width * i
                    pull += memory[o + M.bias + k] - memory[o + M.felt + k]
                memory[M.pull + k] += (pull - memory[M.pull + k]) / memory[M.count]
            for i in range(n):
                o = M.rows + M.width * i
                distance, _ = _pull(i, sees, memory)
                if memory[M.count] == 1.0:
                    memory[o + M.length] = distance
                memory[o + M.length] += (distance - memory[o + M.length]) / memory[M.count]
        if memory[M.slow] >= WEIGH:
            memory[M.stage], memory[M.slow] = 2.0, 0.0
            if abs(memory[M.pull + 2] / (memory[M.share] * W) - 1.0) > AMISS:
                return -1.0
            memory[M.weighed] = memory[M.pull + 2] / params[P.g]
            memory[M.rising] = memory[M.share]
        return 0.0
    part = min(memory[M.slow] / HAND_OVER, 1.0)
    # What the cables do not bear of the weight that is told, and what they bear aside.
    for k in range(3):
        memory[M.held + k] = part * ((W if k == 2 else 0.0) - memory[M.pull + k])
    memory[M.share] = memory[M.rising] * W / (W - memory[M.held + 2])
    return 1.0 if part >= 1.0 else 0.0


@inline
def _usual(dt, sees, memory):  # type: ignore[no-untyped-def]
    """What is usual in flight: the force on the whole, with its spread, and the forces on the drones and the load."""
    follow = 1.0 - decay(dt, USUAL)
    off = memory[M.normal] - memory[M.normal_mean]
    memory[M.normal_mean] += follow * off
    memory[M.normal_spread] += follow * (off * off - memory[M.normal_spread])
    n = sees.estimated_positions.shape[0]
    for i in range(n):
        o = M.rows + M.width * i + M.usual
        for k in range(3):
            memory[o + k] += follow * (sees.estimated_forces[i, k] - memory[o + k])
    for k in range(3):
        memory[M.held + k] += follow * (sees.estimated_forces[n, k] - memory[M.held + k])


@inline
def _touched(dt, sinking, sees, params, memory):  # type: ignore[no-untyped-def]
    """Whether the load has come onto the ground; ``sinking`` is the speed that it is led down with, m/s."""
    height = sees.estimated_load[0, 2] - memory[M.ground]
    if height > WINDOW:
        _usual(dt, sees, memory)
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
def _land(time, dt, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    """Down on arcs about the load, then slowly on until the ground carries."""
    n = sees.estimated_positions.shape[0]
    courses = writes.courses
    away = APART if memory[M.phase] == RELEASE else NEAR
    s, s1, s2, _ = rest_to_rest(time / params[P.climb])
    s1, s2 = s1 / params[P.climb], s2 / params[P.climb] ** 2
    sink = phase(time - params[P.climb], 0.5, SINK)
    for i in range(n):
        p, o = P.rows + P.width * i, M.rows + M.width * i
        L, m = _length(i, sees, params), params[p + P.m]
        b = memory[o + M.start : o + M.start + 3]
        centre = memory[M.goal : M.goal + 3]
        start = (b[0] - centre[0], b[1] - centre[1], b[2] - centre[2])
        level = math.hypot(start[0], start[1])
        if level > 1e-6:
            end = (away * L * start[0] / level, away * L * start[1] / level, 0.02)
        else:
            end = (away * L, 0.0, 0.02)
        _arc(s, s1, s2, centre, start, end, courses[i])
        for k in range(3):
            courses[i, k, 2] -= sink[k]
        if s < 0.8:
            _make_up(i, 1.0 - decay(dt, 1.0 / params[P.learn]), memory)
        else:
            height = sees.estimated_positions[i, 2] - memory[M.ground]
            speed = sees.estimated_velocities[i, 2]
            borne = memory[o + M.felt + 2] - memory[o + M.bias + 2] > TOUCHED * m * params[P.g]
            rests = sink[1] > 0.9 * SINK and speed > -0.3 * SINK
            there = height < WINDOW and (borne or rests)
            memory[o + M.sign] = memory[o + M.sign] + dt if there else 0.0
            if memory[o + M.sign] > (0.03 if borne else 0.2):
                memory[o + M.down] = 1.0


@kernel(SIGNATURE)
def _lift(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    t, dt = now.time, now.dt
    load, x, home = sees.estimated_load, sees.estimated_positions, sees.reference[0]
    shift, courses, standing = writes.reference_shift, writes.courses, writes.standing
    n = x.shape[0]
    place = memory[M.place : M.place + 3]
    if memory[M.started] == 0.0:
        above = 0.0
        for i in range(n):
            above += (x[i, 2] - load[0, 2]) / _length(i, sees, params) / n
        memory[M.ground] = params[P.ground]
        memory[M.phase], memory[M.since] = (STAND, t) if above < 0.2 else (FLY, t)
        memory[M.share] = 0.0 if above < 0.2 else 1.0
    _feel(sees, params, memory, dt)
    memory[M.started] = 1.0
    now_in = memory[M.phase]
    time = t - memory[M.since]
    rate = 0.0
    if now_in == STAND:
        memory[M.count] += 1.0
        for k in range(3):
            place[k] += (load[0, k] - place[k]) / memory[M.count]
        for i in range(n):
            o, L = M.rows + M.width * i, _length(i, sees, params)
            memory[o + M.span] = (NEAR - 1.0) * L
            for k in range(3):
                memory[o + M.start + k] += (x[i, k] - memory[o + M.start + k]) / memory[M.count]
        memory[M.ground] = place[2]
        _set_off(memory, place, place, 1.0, 1.0)
        if time >= LOOK:
            _go(memory, CLIMB, t)
            for i in range(n):
                _forget(i, sees, params, memory)
    elif now_in == CLIMB:
        s, s1, s2, _ = rest_to_rest(time / params[P.climb])
        s1, s2 = s1 / params[P.climb], s2 / params[P.climb] ** 2
        for i in range(n):
            o, L = M.rows + M.width * i, _length(i, sees, params)
            a = sees.received_directions[i]
            b = memory[o + M.start : o + M.start + 3]
            start = (b[0] - place[0], b[1] - place[1], b[2] - place[2])
            end = (-NEAR * L * a[0], -NEAR * L * a[1], -NEAR * L * a[2])
            _arc(s, s1, s2, place, start, end, courses[i])
            _make_up(i, 1.0 - decay(dt, 1.0 / params[P.learn]), memory)
        if s >= 1.0 and _formed(sees, params, memory):
            _begin_to_hook(n, t, memory)
            for i in range(n):
                courses[i, 0, 0] = math.nan
    elif now_in == HOOK:
        result = _hook(time, dt, sees, params, memory)
        if result > 0.0:
            _go(memory, TENSION, t)
        elif result < 0.0:
            _give_up(t, params, memory)
    elif now_in == TENSION:
        result = _tension(dt, sees, params, memory)
        if result > 0.0:
            _go(memory, RISE, t)
            memory[M.above] = max(memory[M.ground] + params[P.clear] - home[2], 0.0)
            begin = (home[0], home[1], home[2] + memory[M.above])
            _set_off(memory, load[0], begin, params[P.speed], 2.0)
            memory[M.rising] = memory[M.share]
            for i in range(n):
                o = M.rows + M.width * i
                for k in range(3):
                    memory[o + M.usual + k] = memory[o + M.bias + k]
        elif result < 0.0:
            _give_up(t, params, memory)
    elif now_in == RISE:
        part = min(time / HAND_OVER, 1.0)
        memory[M.share] = memory[M.rising] + part * (1.0 - memory[M.rising])
        for i in range(n):
            o, L = M.rows + M.width * i, _length(i, sees, params)
            found = min(max(memory[o + M.length], 0.9 * L), 1.1 * L) - L
            pace = found - memory[o + M.span]
            memory[o + M.want] = min(max(2.0 * pace, -0.05 * L), 0.05 * L)
        if time >= memory[M.way]:
            _go(memory, FLY, t)
            for i in range(n):
                memory[M.rows + M.width * i + M.want] = 0.0
    elif now_in == FLY:
        flown = params[P.fly] * memory[M.round]
        memory[M.clock], rate = flown + time, 1.0
        if time >= params[P.fly]:
            memory[M.clock], rate = flown + params[P.fly], 0.0
            _go(memory, LOWER, t)
            ax, ay = home[0], home[1]
            if params[P.aside] != 0.0:
                spot = P.places + 2 * int(memory[M.round])
                ax, ay = params[spot], params[spot + 1]
            high = home[2] + memory[M.above]
            _set_off(memory, (home[0], home[1], high), (ax, ay, high), params[P.speed], 0.0)
    elif now_in == LOWER:
        if memory[M.stage] == 0.0 and time >= memory[M.way]:
            memory[M.stage], memory[M.since], time = 1.0, t, 0.0
            top = (memory[M.goal], memory[M.goal + 1], memory[M.goal + 2])
            low = min(memory[M.ground] + params[P.margin], top[2])
            _set_off(memory, top, (top[0], top[1], low), params[P.speed], 1.0)
        _usual(dt, sees, memory)
        if memory[M.stage] == 1.0 and time >= memory[M.way]:
            _go(memory, TOUCH, t)
    elif now_in == TOUCH:
        gone = phase(time, 0.5, params[P.touch])
        if _touched(dt, gone[1], sees, params, memory):
            _go(memory, UNLOAD, t)
            memory[M.rising] = memory[M.share]
            for i in range(n):
                o = M.rows + M.width * i
                memory[o + M.span + 1] = -EAGER * params[P.touch]
                memory[o + M.span + 2] = 0.0
                for k in range(3):
                    memory[o + M.bias + k] = memory[o + M.usual + k]
            for k in range(3):
                memory[M.begin + k] = memory[M.goal + k]
            memory[M.begin + 2] = memory[M.goal + 2] = memory[M.goal + 2] - gone[0]
            for k in range(3):
                place[k] = load[0, k]
    elif now_in == UNLOAD:
        memory[M.share] = memory[M.rising] * max(1.0 - time / VANISH, 0.0)
        for i in range(n):
            memory[M.rows + M.width * i + M.want] = (
                -EAGER * params[P.touch] * math.exp(-time / FADE)
            )
        if time >= UNLOADING:
            _go(memory, SLACKEN, t)
    elif now_in == SLACKEN:
        done = time >= REST
        for i in range(n):
            o, L = M.rows + M.width * i, _length(i, sees, params)
            pace = (NEAR - 1.0) * L - memory[o + M.span]
            memory[o + M.want] = min(max(2.0 * pace, -0.1 * L), 0.1 * L)
            done = done and abs(pace) < 0.01 * L
            if abs(pace) < 0.05 * L:
                _make_up(i, 1.0 - decay(dt, 1.0 / params[P.learn]), memory)
        memory[M.round] += 1.0 if done else 0.0
        if done and memory[M.round] < params[P.rounds]:
            _begin_to_hook(n, t, memory)
        elif done:
            _go(memory, RELEASE if params[P.release] != 0.0 else LAND, t)
            for i in range(n):
                o, L = M.rows + M.width * i, _length(i, sees, params)
                memory[o + M.want] = memory[o + M.sign] = memory[o + M.down] = 0.0
                for k in range(3):
                    memory[o + M.start + k] = (
                        memory[M.goal + k]
                        - (L + memory[o + M.span]) * sees.received_directions[i, k]
                    )
    elif now_in in (RELEASE, LAND):
        _land(time, dt, sees, params, memory, writes)
        standing_all = True
        for i in range(n):
            standing_all = standing_all and memory[M.rows + M.width * i + M.down] != 0.0
            if now_in == RELEASE:
                writes.unhooked[i] = 1.0
        if standing_all:
            _go(memory, DONE, t)

    now_in = memory[M.phase]
    airborne = now_in in (RISE, FLY, LOWER, TOUCH)
    writes.phase[0] = now_in
    writes.clock[0], writes.clock[1] = memory[M.clock], rate
    writes.lift_share[0] = memory[M.share]
    writes.lifted_mass[0] = memory[M.weighed]
    standing[n] = 0.0 if airborne else 1.0
    for k in range(3):
        writes.held_forces[n, k] = memory[M.held + k]
    for i in range(n):
        o = M.rows + M.width * i
        down = now_in in (STAND, DONE) or memory[o + M.down] != 0.0
        standing[i] = 1.0 if down else 0.0
        _reel(i, dt, memory)
        for k in range(3):
            writes.spans[i, k] = memory[o + M.span + k]
            writes.held_forces[i, k] = 0.0 if down else memory[o + M.bias + k]
    if now_in == FLY:
        for m in range(4):
            for k in range(3):
                shift[m, k] = memory[M.above] if m == 0 and k == 2 else 0.0
    elif now_in == TOUCH:
        _on_the_way(memory, memory[M.way], shift, home)
        gone = phase(t - memory[M.since], 0.5, params[P.touch])
        for m in range(4):
            shift[m, 2] -= gone[m]
    else:
        moving = now_in in (RISE, LOWER)
        _on_the_way(memory, t - memory[M.since] if moving else memory[M.way], shift, home)


Coordinate = Annotated[float, Field(ge=-1e6, le=1e6)]
Place = tuple[Coordinate, Coordinate]


class Lift(SupervisionPart, Delays):
    """From the ground to the ground: drones climb, cables come taut, the load is lifted, flown, set down, drones land.

    Everything is told from what is measured. The flight's reference begins once the load has risen to where it begins, and ends after
    ``fly`` seconds of its own; from there the load goes to where it is set down. A flight that begins in the air begins with the reference.
    """

    kernel = _lift
    remembers = MEMORY

    paced_by = "position_control"
    works_with: ClassVar[Mapping[str, tuple[str, ...]]] = {
        "load_control": ("balance",),
        "position_control": ("formation",),
        "observation": ("momentum",),
        "agents": ("central",),
    }

    fly: Annotated[float, Field(gt=0.0, le=1e6)] = 10.0
    """For how long the reference is flown, s; it should rest by then."""
    set_down: Place | Annotated[list[Place], Field(min_length=1, max_length=MOST_ROUNDS)] | None = (
        None
    )
    """Where the load is set down, world x and y, m; below where the reference ends where not given. Of a list one after the other: at
    each but the last the load is picked up again, and the reference goes on for another ``fly``."""
    afterwards: Literal["land", "release"] = "land"
    """Whether the drones land with their cables hooked, or release the load before."""
    speed: Annotated[float, Field(gt=0.0, le=10.0)] = 0.4
    """Most speed of the load on its way to and from the reference, m/s."""
    touch_speed: Annotated[float, Field(gt=0.0, le=0.5)] | None = None
    """Speed at which it is led onto the ground, m/s. None: 0.08, or 0.06 where the cables' pull would throw the drones up."""
    ground: Annotated[float, Field(ge=-1e6, le=1e6)] = 0.0
    """Height of the load when it is set down, m, for a flight that begins in the air; otherwise where it stood."""

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        yield from self.delay_warnings(mission, "position_control")
        rounds = len(self.set_down) if isinstance(self.set_down, list) else 1
        ends = self.fly * np.arange(1, rounds + 1)
        velocity = mission.reference.sample(ends, mission.team)[:, 1]
        speed = float(np.linalg.norm(velocity, axis=1).max())
        if speed > MOVING:
            message = f"ends the reference where it moves at {speed:.2g} m/s: the load is stopped there at once"
            yield "fly", message
        kind = mission.kinds["plant"]
        if kind in RODS:
            message = f'slackens cables, but those of plant.kind = "{kind}" are rods; set plant.kind = "slack-cables"'
            yield "kind", message

    def params(self, team: Team) -> Vector:
        band = self.bandwidths().velocity
        L = float(team.cable_lengths.mean())
        pull = team.load_mass * team.gravity / float(team.masses.sum())
        ratio = 1.0 + float(team.masses.sum()) / team.load_mass
        touch = self.touch_speed or (0.06 if pull > 2.0 else 0.08)
        places = self.set_down if isinstance(self.set_down, list) else [self.set_down or (0.0, 0.0)]
        spots = np.zeros((MOST_ROUNDS, 2))
        spots[: len(places)] = places
        drag = [d if math.isfinite(d) else 0.0 for d in team.rotor_drags]
        return PARAMS.pack(
            team.n, g=team.gravity, m_L=team.load_mass, feel=1.5 * band, learn=0.4 * band,
            delay=self.delay if self.predicted else 0.0, lag=self.lag, fly=self.fly,
            rounds=len(places), aside=float(self.set_down is not None), places=spots.ravel(), speed=self.speed, touch=touch,
            release=float(self.afterwards == "release"), ground=self.ground,
            hook=0.01 * max(1.0, math.sqrt(L)), climb=max(2.0, 5.0 * math.sqrt(L)),
            rise=max(RAISE, SLOWLY / band), stiff=0.1 * band * band * ratio,
            damp=0.5 * band * ratio, margin=0.08 * max(1.0, math.sqrt(L)),
            clear=0.15 * max(1.0, math.sqrt(L)), m=team.masses, L=team.cable_lengths, drag=drag,
        )  # fmt: skip
