"""Rigid massless cables that go slack, and taut again with a plastic jerk.

A cable is taut while its drone is at full length and does not come nearer. Among the taut cables tensions solve a
complementarity problem: none pulls negative, and one without tension does not grow longer. Between events the
cables that pull are constraints as in :mod:`colift.world.plant._rigid`, the other drones fly free. A tension that falls
below zero and a slack drone that reaches its full length are events. The instant of the first within the step is found by
flying to where cubics through both ends of the last trial have it, mostly twice. At a catch, impulses along all taut cables solve the same complementarity problem with velocities
for accelerations; they take kinetic energy away and never add any (the plastic law of Newton, restitution 0).
"""

from __future__ import annotations

import math

import numpy as np

from colift.kernel.jit import aside, inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math.columns import column
from colift.kernel.math.winch import paid_out, turning
from colift.part import Vector
from colift.team import Team
from colift.world.plant._bodies import (
    BODY,
    DRONE,
    LOAD,
    MASS,
    STAGES,
    BodiesPart,
    catch_impulse,
    free_motion,
    line,
    parting_speed,
    raise_peaks,
    runge_kutta,
    state_size,
    wind,
)
from colift.world.plant._contact import (
    anchors_of,
    contact_size,
    rate,
    settle,
    spare_of,
    touch,
)
from colift.world.plant._params import P
from colift.world.plant._rigid import (
    closing,
    demand,
    derivative,
    lever,
    lines,
    moment_of,
    project,
    pull,
    solve,
    tighten,
)
from colift.world.plant.base import STEP_SIGNATURE

GUESSES = 8
"""Trials for the instant of an event where cubics have it, before the interval in which it lies is halved instead."""
BISECTIONS = 40
"""Halvings after that: to 1e-15 s of a step of 1 ms."""
EVENTS = 8
"""Events per cable that one step resolves one by one; the cables then at full length stay together to its end."""
NEAR = 1e-11
"""Missing length that counts as none, m."""
WEAK = 1e-9
"""Pull that counts as none, of what the drone's mass times what the cable takes away would be."""
SLOW = 1e-5
"""Speed along the cable that counts as none, m/s: what one catch throws off another bounces ever faster."""

SCRATCH = Layout(
    drone={
        "T": 1, "b": 1, "taut": 1, "held": 1, "alpha": 3, "length": 1, "rate": 1, "bend": 1,
        "at_first": 1, "midway": 1, "parting": 1,
    }
)  # fmt: skip
"""In columns, behind the state and four of its size for the integrator: ``T`` ``at_first`` and ``midway`` of a trial; behind the
``parting`` speeds the time since a catch."""
S, SPANS = SCRATCH.at, SCRATCH.spans


@inline
def complementarity(n, y, alpha, b, taut, params, held, T):  # type: ignore[no-untyped-def]
    """Pulls ``T >= 0`` of the taut cables that leave no demand, with equality where a cable pulls.

    Exchanges the first offender until there is none (Murty 1974), which ends as the matrix is positive definite; mostly
    at once, as all cables pull. ``held`` tells who does.
    """
    largest = 0.0
    for i in range(n):
        held[i] = taut[i]
        if taut[i] > 0.0:
            largest = max(largest, abs(b[i]))
    tolerance = 1e-12 * largest
    for _ in range(10 * n + 10):
        solve(n, y, alpha, b, held, params, T)
        ax = ay = az = 0.0
        if params[P.rigid] > 0.0:
            ax, ay, az = moment_of(n, y, alpha, T, params)
        px = py = pz = 0.0
        for i in range(n):
            px += T[i] * alpha[3 * i]
            py += T[i] * alpha[3 * i + 1]
            pz += T[i] * alpha[3 * i + 2]
        offender = -1
        for i in range(n):
            if held[i] > 0.0:
                wrong = T[i] < -tolerance * params[MASS + BODY * i]
            else:
                along = alpha[3 * i] * px + alpha[3 * i + 1] * py + alpha[3 * i + 2] * pz
                yields = along / params[P.m_L]
                if params[P.rigid] > 0.0:
                    _, _, _, p, q, r = lever(i, y, alpha, params)
                    yields += p * ax + q * ay + r * az
                wrong = taut[i] > 0.0 and b[i] - yields > tolerance
            if wrong:
                offender = i
                break
        if offender < 0:
            break
        held[offender] = 1.0 - held[offender]
    for i in range(n):
        T[i] = max(T[i], 0.0)


CONTACT = 0.01
"""Within what time of each other catches are one burst, s: as long as a braided cable pulls before it rebounds."""


@inline
def note_parting(n, y, dt, params, rates, parting):  # type: ignore[no-untyped-def]
    """Keep how fast the ends of each slack cable part, unless a burst of catches is on; last, the time since a catch.

    What stops a drone and the load is judged by the speed before any cable of the burst was caught: which of them
    is caught a microsecond before the others is chance, and each catch changes the load's speed for the next.
    """
    parting[n] += dt
    if parting[n] <= CONTACT:
        return
    for i in range(n):
        x, y_, z, _ = line(i, y, params)
        vx, vy, vz = parting_speed(i, y, params)
        parting[i] = x * vx + y_ * vy + z * vz - rates[i]


@inline
def catch(  # type: ignore[no-untyped-def]
    n, y, attached, slow, params, lengths, rates, taut, held, T, alpha, b, parting, catch_impulses
):
    """Find the taut cables, those at full length that shorten at most ``slow``; impulses stop any that grow."""
    lines(n, y, params, alpha, b)
    beyond = False
    for i in range(n):
        over = b[i] - lengths[i]
        taut[i] = 1.0 if attached[i] > 0.0 and over > -NEAR else 0.0
        beyond = beyond or (taut[i] > 0.0 and over > 0.5 * NEAR)
    if beyond:  # or a cable that is not held would overrun again at once
        tighten(n, y, taut, params, lengths, T, alpha, b)
        lines(n, y, params, alpha, b)
    closing(n, y, params, alpha, rates, b)
    jerk = False
    for i in range(n):
        if taut[i] > 0.0 and b[i] > SLOW:
            jerk = True
            speed = parting[i] if parting[i] > SLOW else b[i]
            catch_impulses[i] = max(catch_impulses[i], catch_impulse(i, y, speed, params))
            parting[i] = parting[n] = 0.0
    if jerk:
        complementarity(n, y, alpha, b, taut, params, held, T)
        pull(n, y, alpha, T, params, 3, y)
        closing(n, y, params, alpha, rates, b)
    for i in range(n):
        if b[i] < -slow:
            taut[i] = 0.0


@inline
def excess(i, y, attached, held, lengths, T, b, params):  # type: ignore[no-untyped-def]
    """How far cable i is beyond its event, N or m, above 0 where that has happened; and how much of it is still near."""
    if held[i] > 0.0:
        near = WEAK * params[MASS + BODY * i] * max(1.0, abs(b[i]))
        return -T[i] - near, near
    if attached[i] > 0.0:
        return line(i, y, params)[3] - lengths[i] - NEAR, NEAR
    return -1.0, 1.0


@inline
def crossing(x0, v0, x1, v1, goal, low, high):  # type: ignore[no-untyped-def]
    """Between ``low`` and ``high``, where the cubic from ``x0`` at 0 to ``x1`` at 1 with these slopes is ``goal``; Newton's method from 1 on."""
    c2, c3 = 3.0 * (x1 - x0) - 2.0 * v0 - v1, 2.0 * (x0 - x1) + v0 + v1
    s = 1.0
    for _ in range(30):
        x = x0 + s * (v0 + s * (c2 + s * c3)) - goal
        v = v0 + s * (2.0 * c2 + 3.0 * s * c3)
        if x > 0.0:
            high = s
        else:
            low = s
        if abs(x) < 0.1 * goal:
            break
        s = s - x / v if v > 0.0 else low
        if not low < s < high:
            s = 0.5 * (low + high)
    return s


@aside
def guess(  # type: ignore[no-untyped-def]
    n,
    begin,
    y,
    winches,
    since,
    low,
    high,
    h,
    attached,
    held,
    lengths,
    at_first,
    midway,
    T,
    b,
    params,
):
    """When the first event is, by the trial that has just been flown from ``begin`` to ``y`` in ``h``; s after ``since``.

    What becomes of lengths is known at both ends with their rates, of tensions at both and in the middle.
    """
    best = high
    for i in range(n):
        x1, near = excess(i, y, attached, held, lengths, T, b, params)
        if attached[i] == 0.0 or (h == high and x1 <= 0.0):
            continue
        if held[i] > 0.0:
            a, m, e = at_first[i], midway[i], T[i]
            x0, v0, v1 = -a - near, 3.0 * a - 4.0 * m + e, 4.0 * m - a - 3.0 * e
        else:
            x, y_, z, d = line(i, begin, params)
            vx, vy, vz = parting_speed(i, begin, params)
            more, rate_, _ = paid_out(winches, i, since)
            x0 = d - params[MASS + BODY * i + 1] - more - NEAR
            v0 = h * (x * vx + y_ * vy + z * vz - rate_)
            x, y_, z, _ = line(i, y, params)
            vx, vy, vz = parting_speed(i, y, params)
            _, rate_, _ = paid_out(winches, i, since + h)
            v1 = h * (x * vx + y_ * vy + z * vz - rate_)
        best = min(best, h * crossing(x0, v0, x1, v1, 0.5 * near, low / h, high / h))
    return best if low < best < high else 0.5 * (low + high)


@kernel(STEP_SIGNATURE, counted=False)
def _step(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    thrusts, torques, external = sees.applied_thrusts, sees.applied_torques, sees.external_forces
    moment = sees.external_moment
    attached = sees.attached
    tensions, peak_tensions = writes.tensions, writes.peak_tensions
    catch_impulses, slack_times = writes.catch_impulses, writes.slack_times
    n = thrusts.shape[0]
    size = LOAD + DRONE * n
    y = memory[:size]
    begin = memory[size : 2 * size]
    total = memory[2 * size : 3 * size]
    slope, first = memory[3 * size : 4 * size], memory[4 * size : 5 * size]
    T, b = column(memory, 5 * size, n, SPANS.T), column(memory, 5 * size, n, SPANS.b)
    taut, held = column(memory, 5 * size, n, SPANS.taut), column(memory, 5 * size, n, SPANS.held)
    alpha, parting = column(memory, 5 * size, n, SPANS.alpha), memory[5 * size + n * S.parting :]
    at_first = column(memory, 5 * size, n, SPANS.at_first)
    midway = column(memory, 5 * size, n, SPANS.midway)
    anchors, w, spare = anchors_of(memory, n), rate(dt), spare_of(memory, n)
    L, rates = column(memory, 5 * size, n, SPANS.length), column(memory, 5 * size, n, SPANS.rate)
    bends = column(memory, 5 * size, n, SPANS.bend)
    winches, moving = sees.winches, turning(n, sees.winches, now.time, dt)
    wind(n, winches, now.time, params, L, rates, bends)
    note_parting(n, y, dt, params, rates, parting)
    left = dt
    for event in range(EVENTS * n + 1):
        last = event == EVENTS * n
        slow = math.inf if last else SLOW
        since = now.time + dt - left
        if moving:
            wind(n, winches, since, params, L, rates, bends)
        catch(
            n, y, attached, slow, params, L, rates, taut, held, T, alpha, b, parting,
            catch_impulses,
        )  # fmt: skip
        free_motion(n, y, thrusts, torques, external, moment, params, first)
        if params[P.ground] > 0.0:
            forces = writes.ground_forces if event == 0 else spare
            touch(n, y, anchors, w, params, forces, first)
        lines(n, y, params, alpha, b)
        demand(n, y, first, params, alpha, bends, b)
        complementarity(n, y, alpha, b, taut, params, held, T)
        pull(n, y, alpha, T, params, 3, first)
        raise_peaks(n, T, peak_tensions)
        for i in range(n):
            at_first[i] = T[i]
            if event == 0:
                tensions[i] = T[i]
        for k in range(size):
            begin[k] = y[k]
        low, high, h = 0.0, left, left
        for trial in range(GUESSES + BISECTIONS + 1):
            runge_kutta(0, size, h, begin, first, total, y)
            for stage in range(1, 5):  # the last looks at the tensions of the end
                if moving:
                    part = STAGES[stage] if stage < 4 else 1.0
                    wind(n, winches, since + part * h, params, L, rates, bends)
                derivative(
                    n, y, thrusts, torques, external, moment, held, anchors, w, params, bends, T, alpha, b,
                    spare, slope,
                )  # fmt: skip
                if stage < 4:
                    runge_kutta(stage, size, h, begin, slope, total, y)
                if stage == 2:
                    for i in range(n):
                        midway[i] = T[i]
            happened, far = False, False
            for i in range(n):
                beyond, near = excess(i, y, attached, held, L, T, b, params)
                happened = happened or beyond > 0.0
                far = far or beyond > near
            if last:
                break
            if happened:
                high = h
                if not far:
                    break
            elif h == left:
                break
            else:
                low = h
            if trial < GUESSES:
                h = guess(
                    n, begin, y, winches, since, low, high, h, attached, held, L, at_first, midway, T, b,
                    params,
                )  # fmt: skip
            else:
                h = high if trial == GUESSES + BISECTIONS - 1 else 0.5 * (low + high)
        project(n, y, held, params, L, rates, T, alpha, b)
        if params[P.ground] > 0.0:
            settle(n, begin, y, w, params, anchors, writes.touch_speeds)
        for i in range(n):
            if attached[i] > 0.0 and held[i] == 0.0:
                slack_times[i] += high
        left -= high
        if left <= 0.0:
            break


class SlackCables(BodiesPart):
    """Rigid massless cables that go slack instead of pushing and are caught plastically; no settings."""

    kernel = _step

    def memory(self, team: Team) -> Vector:
        return np.zeros(5 * state_size(team.n) + SCRATCH.size(team.n) + 1 + contact_size(team.n))
