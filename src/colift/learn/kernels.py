"""Many teams of one mission in one compiled call: act, fly, judge, observe, begin anew.

Each team is a copy of all that its flight changes (:mod:`colift.learn.arena`); it is put where the flight's own loop
(:func:`colift.flight.loop.advance`) runs, and taken back. So the numbers are those of a flight, whatever its parts.
"""

from __future__ import annotations

import math
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from colift.flight.loop import SIGNATURE as LOOP
from colift.flight.loop import advance
from colift.kernel.by_reference import named_signals, signals_type
from colift.kernel.jit import i8, inline, kernel, matrix, tensor, vector, void
from colift.kernel.math import noise, quaternion
from colift.kernel.ports import type_of
from colift.learn.numbers import (
    BELOW,
    CABLES,
    CENTRAL,
    FAR,
    FORCES,
    NO_NUMBERS,
    NUMBERS,
    PART,
    RATES,
    TOUCHED,
)  # fmt: skip
from colift.world.actuation.motors import FORWARD, LEFT, SPIN

Eyes = named_signals(
    "Eyes",
    [
        "row", "load", "load_attitude", "load_rates", "reference", "reference_attitude", "reference_rates", "force", "moment",
        "positions", "ends", "directions", "attached", "estimated_load", "estimated_load_attitude", "estimated_load_rates",
        "estimated_positions", "estimated_velocities", "estimated_attitudes", "estimated_rates", "estimated_ends",
        "desired_tensions", "desired_directions", "drone_forces", "thrusts", "desired_attitudes", "desired_rates",
        "desired_turning", "torques",
    ],
    __name__,
)  # fmt: skip
"""What the environment sees and writes of the bus."""
EYES = signals_type(Eyes, [type_of(name) for name in Eyes._fields])
N = NUMBERS.at
WIRES = LOOP.args[3]

SPAN = 0.5
"""Largest change of a force over what holds the load at rest."""
TURNS = (6.0, 6.0, 2.0)
"""Largest rates that are asked for, body axes, rad/s."""
LIMIT = 1e3
"""Observations are clipped to this."""
FASTEST = 10.0
"""No speed counts for more, m/s."""


@intrinsic
def _keyed(typingctx, wires, keys, row, first):  # type: ignore[no-untyped-def]
    """The same wires with the keys of random numbers in a row of ``keys``, from its place ``first`` on."""

    def codegen(context, builder, signature, args):  # type: ignore[no-untyped-def]
        found, keys, row, first = args
        array = context.make_array(signature.args[1])(context, builder, keys)
        begin = cgutils.get_item_pointer(
            context, builder, signature.args[1], array, [row, first], wraparound=False
        )
        for i in range(len(signature.args[0])):
            key = builder.load(builder.gep(begin, [ir.Constant(row.type, i)]))
            wire = builder.insert_value(builder.extract_value(found, i), key, 1)
            found = builder.insert_value(found, wire, i)
        return found

    return wires(wires, keys, row, first), codegen


keyed: Any = _keyed


@inline
def within(a):  # type: ignore[no-untyped-def]
    """An action within -1 and 1; what is no number is 0."""
    return min(max(a, -1.0), 1.0) if a == a else 0.0


@inline
def put(level, action, numbers, eyes):  # type: ignore[no-untyped-def]
    """What an action (n k,) commands."""
    n = eyes.attached.shape[0]
    for i in range(n):
        o = N.rows + N.width * i
        if level == CABLES:
            size = SPAN * numbers[N.weight] / n
            x = numbers[o + N.pull] + size * within(action[3 * i])
            y = numbers[o + N.pull + 1] + size * within(action[3 * i + 1])
            z = numbers[o + N.pull + 2] + size * within(action[3 * i + 2])
            T = math.sqrt(x * x + y * y + z * z)
            eyes.desired_tensions[i] = T
            if T > 1e-9:
                eyes.desired_directions[i, 0] = -x / T
                eyes.desired_directions[i, 1] = -y / T
                eyes.desired_directions[i, 2] = -z / T
            continue
        u0, v0, w0 = numbers[o + N.thrust], numbers[o + N.thrust + 1], numbers[o + N.thrust + 2]
        most = math.sqrt(u0 * u0 + v0 * v0 + w0 * w0)
        if level == FORCES:
            x = u0 + SPAN * most * within(action[3 * i])
            y = v0 + SPAN * most * within(action[3 * i + 1])
            z = w0 + SPAN * most * within(action[3 * i + 2])
            f = math.sqrt(x * x + y * y + z * z)
            eyes.drone_forces[i, 0], eyes.drone_forces[i, 1], eyes.drone_forces[i, 2] = x, y, z
            eyes.thrusts[i] = f
            if f > 1e-9:
                q = quaternion.from_thrust_direction(x / f, y / f, z / f)
                for k in range(4):
                    eyes.desired_attitudes[i, k] = q[k]
        elif level == RATES:
            eyes.thrusts[i] = most * (1.0 + SPAN * within(action[4 * i]))
            for k in range(3):
                eyes.desired_rates[i, k] = TURNS[k] * within(action[4 * i + 1 + k])
        else:
            f = tau_x = tau_y = tau_z = 0.0
            for j in range(4):
                T = 0.25 * most * (1.0 + SPAN * within(action[4 * i + j]))
                f += T
                tau_x += numbers[o + N.lever] * LEFT[j] * T
                tau_y -= numbers[o + N.lever] * FORWARD[j] * T
                tau_z += numbers[o + N.ratio] * SPIN[j] * T
            eyes.thrusts[i] = f
            eyes.torques[i, 0], eyes.torques[i, 1], eyes.torques[i, 2] = tau_x, tau_y, tau_z


@inline
def missing(q, q_d):  # type: ignore[no-untyped-def]
    """By which rotation vector an attitude is off the wanted one, to second order, rad."""
    w, x, y, z = quaternion.multiply(q_d[0], -q_d[1], -q_d[2], -q_d[3], q[0], q[1], q[2], q[3])
    sign = -2.0 if w < 0.0 else 2.0
    return sign * x, sign * y, sign * z


@inline
def in_boxes(x, y, z, r, numbers):  # type: ignore[no-untyped-def]
    """Whether a ball touches an obstacle."""
    for m in range(int(numbers[N.boxes])):
        o = N.box + 6 * m
        a = max(abs(x - numbers[o]) - numbers[o + 3], 0.0)
        b = max(abs(y - numbers[o + 1]) - numbers[o + 4], 0.0)
        c = max(abs(z - numbers[o + 2]) - numbers[o + 5], 0.0)
        if a * a + b * b + c * c <= r * r:
            return True
    return False


@inline
def touching(numbers, eyes):  # type: ignore[no-untyped-def]
    """Whether drones touch each other or their cables' ends, or anything touches an obstacle; drones half as tall as wide."""
    n, x, ends = eyes.attached.shape[0], eyes.positions, eyes.ends
    for i in range(n):
        r = numbers[N.rows + N.width * i + N.radius]
        a, b, c = x[i, 0] - ends[i, 0, 0], x[i, 1] - ends[i, 0, 1], x[i, 2] - ends[i, 0, 2]
        if eyes.attached[i] > 0.0 and a * a + b * b + 4.0 * c * c < r * r:
            return True
        for j in range(i):
            s = r + numbers[N.rows + N.width * j + N.radius]
            a, b, c = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1], x[i, 2] - x[j, 2]
            if a * a + b * b + 4.0 * c * c < s * s:
                return True
        if numbers[N.boxes] > 0.0:
            if in_boxes(x[i, 0], x[i, 1], x[i, 2], r, numbers):
                return True
            for m in range(8 if eyes.attached[i] > 0.0 else 0):
                s = m / 8.0
                a = ends[i, 0, 0] + s * (x[i, 0] - ends[i, 0, 0])
                b = ends[i, 0, 1] + s * (x[i, 1] - ends[i, 0, 1])
                c = ends[i, 0, 2] + s * (x[i, 2] - ends[i, 0, 2])
                if in_boxes(a, b, c, 0.0, numbers):
                    return True
    return False


@inline
def judge(action, numbers, eyes):  # type: ignore[no-untyped-def]
    """Reward of a step, and why it is the last one; 0 where it is not."""
    off = fast = effort = level = 0.0
    for k in range(3):
        off += (eyes.load[0, k] - eyes.reference[0, k]) ** 2
        fast += (eyes.load[1, k] - eyes.reference[1, k]) ** 2
    for k in range(action.shape[0]):
        effort += within(action[k]) ** 2
    off, fast = math.sqrt(off), math.sqrt(fast)
    if numbers[N.rigid] > 0.0:
        x, y, z = missing(eyes.load_attitude, eyes.reference_attitude)
        level = numbers[N.level] * math.exp(-2.0 * math.sqrt(x * x + y * y + z * z))
    over = 0
    if off > numbers[N.reach]:
        over = FAR
    if touching(numbers, eyes):
        over = TOUCHED
    for i in range(eyes.attached.shape[0]):
        if eyes.attached[i] > 0.0 and -eyes.directions[i, 2] < numbers[N.least_height]:
            over = BELOW
    for k in range(eyes.row.shape[0]):
        if not math.isfinite(eyes.row[k]):
            over = NO_NUMBERS
    if over == NO_NUMBERS:
        return numbers[N.over], over
    reward = numbers[N.near] * math.exp(-off / numbers[N.scale]) - numbers[N.slow] * min(
        fast, FASTEST
    )
    reward += level - numbers[N.effort] * effort / action.shape[0]
    return (reward + numbers[N.over] if over else reward), over


@inline
def note(value, out, at):  # type: ignore[no-untyped-def]
    """Write a number that is observed, and say where the next one comes."""
    out[at] = min(max(value, -LIMIT), LIMIT) if value == value else 0.0
    return at + 1


@inline
def look_shared(numbers, eyes, out, at):  # type: ignore[no-untyped-def]
    """What all drones see: the load from where it is wanted, what is wanted, a gap to fly through."""
    load, wanted = eyes.estimated_load, eyes.reference
    for k in range(3):
        at = note((load[0, k] - wanted[0, k]) / numbers[N.length], out, at)
    for k in range(3):
        at = note(load[1, k] - wanted[1, k], out, at)
    for k in range(3):
        at = note(wanted[1, k], out, at)
    for k in range(3):
        at = note(wanted[2, k] / numbers[N.g], out, at)
    if numbers[N.rigid] > 0.0:
        off = missing(eyes.estimated_load_attitude, eyes.reference_attitude)
        for k in range(3):
            at = note(off[k], out, at)
        for k in range(3):
            at = note(eyes.estimated_load_rates[k] - eyes.reference_rates[0, k], out, at)
    if numbers[N.boxes] > 0.0:
        for k in range(3):
            at = note((numbers[N.gap + k] - load[0, k]) / numbers[N.length], out, at)
    return at


@inline
def look_own(i, numbers, eyes, out, at):  # type: ignore[no-untyped-def]
    """What is seen of drone i."""
    x, ends, q = eyes.estimated_positions, eyes.estimated_ends, eyes.estimated_attitudes
    for k in range(3):
        at = note((x[i, k] - ends[i, 0, k]) / numbers[N.length], out, at)
    for k in range(3):
        at = note(eyes.estimated_velocities[i, k] - ends[i, 1, k], out, at)
    first = quaternion.into_world(q[i, 0], q[i, 1], q[i, 2], q[i, 3], 1.0, 0.0, 0.0)
    third = quaternion.third_axis(q[i, 0], q[i, 1], q[i, 2], q[i, 3])
    for k in range(3):
        at = note(first[k], out, at)
    for k in range(3):
        at = note(third[k], out, at)
    for k in range(3):
        at = note(eyes.estimated_rates[i, k], out, at)
    return at


@inline
def look_part(i, numbers, eyes, out, at):  # type: ignore[no-untyped-def]
    """What an allocator sees that decides for drone i: the wanted force and acceleration, a rigid load's moment, its pull at rest."""
    weight, o = numbers[N.weight], N.rows + N.width * i + N.pull
    for k in range(3):
        at = note(eyes.force[k] / weight - (1.0 if k == 2 else 0.0), out, at)
    for k in range(3):
        at = note(eyes.reference[2, k] / numbers[N.g], out, at)
    for k in range(3 if numbers[N.rigid] > 0.0 else 0):
        at = note(eyes.moment[k] / (weight * numbers[N.length]), out, at)
    for k in range(3):
        at = note(eyes.attached.shape[0] * numbers[o + k] / weight, out, at)
    return at


@inline
def look(kind, numbers, eyes, out):  # type: ignore[no-untyped-def]
    """Write an observation."""
    n, at = eyes.attached.shape[0], 0
    if kind == PART:
        for i in range(n):
            at = look_part(i, numbers, eyes, out, at)
    elif kind == CENTRAL:
        at = look_shared(numbers, eyes, out, at)
        for i in range(n):
            at = look_own(i, numbers, eyes, out, at)
    else:
        x = eyes.estimated_positions
        for i in range(n):
            at = look_shared(numbers, eyes, out, at)
            at = look_own(i, numbers, eyes, out, at)
            for m in range(1, n):
                j = (i + m) % n
                for k in range(3):
                    at = note((x[j, k] - x[i, k]) / numbers[N.length], out, at)


f4s = types.float32[:, ::1]
i8s = types.int64[::1]


@kernel(
    void(
        i8, i8, i8, i8, i8, i8, LOOP.args[2], *LOOP.args[3:8], matrix, matrix, EYES, vector, matrix, types.int64[:, ::1], tensor,
        matrix, f4s, matrix, i8s, i8s, i8s, i8s, matrix, f4s, f4s, vector, i8s, i8s,
    ),
    counted=False,
)  # fmt: skip
def fly(  # type: ignore[no-untyped-def]
    begin, end, level, kind, skip, last, every, wires, leaderless, disturbances, disturbing, bus, log, cycles, eyes, arena,
    bank, keys, due, numbers, first, teams, world, step, seeds, episode, action, seen, final, reward, over, late,
):  # fmt: skip
    """One step of the teams ``begin <= i < end``, each ``skip`` physics steps; who is done begins anew in another world.

    ``arena`` is where the loop's arrays are; worlds (w,) begin as the rows of ``bank`` (w, size), with the ``keys`` (w, wires) of their
    random numbers, changes ``due`` (w, d, 3: step, place in the arena, value), ``numbers`` (w, :data:`NUMBERS`) and the
    ``first`` observation. Teams (i,) are the rows of ``teams`` (i, size), of ``world`` number and ``step`` to come.
    Written are observations ``seen``, those at an end ``final``, ``reward``, why it is ``over`` and whether it is ``late``: the
    time is up.
    """
    size = arena.shape[0]
    for i in range(begin, end):
        w = world[i]
        for m in range(size):
            arena[m] = teams[i, m]
        put(level, action[i], numbers[w], eyes)
        k, stop = step[i], step[i] + skip
        for _ in range(due.shape[1] + 1):
            to = stop
            for m in range(due.shape[1]):
                if due[w, m, 0] == k:
                    arena[int(due[w, m, 1])] = due[w, m, 2]
                elif due[w, m, 0] > k:
                    to = min(to, int(due[w, m, 0]))
            if k < stop:
                k = advance(
                    k, to, every, keyed(wires, keys, w, 0), leaderless, disturbances,
                    keyed(disturbing, keys, w, len(wires)), bus, log, cycles,
                )  # fmt: skip
        step[i] = stop
        reward[i], over[i] = judge(action[i], numbers[w], eyes)
        late[i] = 1 if over[i] == 0 and stop >= last else 0
        look(kind, numbers[w], eyes, seen[i])
        if over[i] == 0 and late[i] == 0:
            for m in range(size):
                teams[i, m] = arena[m]
            continue
        for m in range(seen.shape[1]):
            final[i, m] = seen[i, m]
        episode[i] += 1
        w = int(noise.uniforms(seeds[i], episode[i], 0)[0] * bank.shape[0])
        world[i], step[i] = w, 1
        for m in range(size):
            teams[i, m] = bank[w, m]
        for m in range(seen.shape[1]):
            seen[i, m] = first[w, m]


@kernel(
    void(
        i8, i8, LOOP.args[2], *LOOP.args[3:8], matrix, matrix, EYES, vector, vector, types.float32[::1],
    ),
    counted=False,
)  # fmt: skip
def begin(  # type: ignore[no-untyped-def]
    level, kind, every, wires, leaderless, disturbances, disturbing, bus, log, cycles, eyes, numbers, action, seen,
):  # fmt: skip
    """The first physics step of a world, under the action 0, and what is observed after it."""
    put(level, action, numbers, eyes)
    advance(
        0, 1, every, wires, leaderless, disturbances, disturbing, bus, log, cycles,
    )  # fmt: skip
    look(kind, numbers, eyes, seen)


@kernel(void(i8, vector, vector, EYES), counted=False)
def command(level, action, numbers, eyes):  # type: ignore[no-untyped-def]
    """Put an action into the bus of a flight."""
    put(level, action, numbers, eyes)
