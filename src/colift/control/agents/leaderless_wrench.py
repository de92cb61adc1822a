"""n equal agents on a rigid load: each bears its row of the plan that all know, corrected to the force and moment that they agree on."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated

import numpy as np
from pydantic import Field

from colift.control.agents import _evidence as evidence
from colift.control.agents import _message as message
from colift.control.agents import leaderless
from colift.control.agents._message import MOST
from colift.control.agents._pairs import WIDTH, Q
from colift.control.agents._speaking import Speaking
from colift.control.agents.base import SIGNATURE, Status
from colift.control.agents.leaderless import BALANCE, WISHES
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import message as numbers
from colift.kernel.math import quaternion, wrench
from colift.kernel.math.columns import column
from colift.kernel.spans import LINE, POINT
from colift.part import Setup, Vector
from colift.team import Team
from colift.team.plan import plan, shares, spanned

PARAMS = Layout(
    team={**leaderless.PARAMS.team, "m": 1, "moment_unit": 1, "gap": 1, "kind": 1, "axis": 3},
    drone={**leaderless.PARAMS.drone, "length": 1, "arm": 3, "plan": 3},
)
"""Those of :mod:`~colift.control.agents.leaderless`, whose planes are kept here; ``least``: half of the least distance, m, ``kind`` and
``axis`` of the wrenches that the cables can make."""
MEMORY = Layout(
    drone={
        **leaderless.MEMORY.drone,
        "frame": 4, "turn_wish": 3, "turn_steady": 3, "said_turn": 3, "beside": 3, "wished": 6 * MOST, "held": 3 * MOST,
        "end": 3 * MOST, "arm": 3 * MOST, "plan": 3 * MOST, "pulls": 3 * MOST,
    }
)  # fmt: skip
"""What the planes need, as there, in the ``frame`` of the wanted load; wishes of force and moment in the world. ``target``: force that the motion
asks for. ``said``: what is wanted lastingly beside it (world) and pull beside the plan (frame) as the others hear them, ``said_turn``: lasting moment (frame);
``beside``: pull beside the plan; of each peer what it ``wished`` and ``held`` beside; then, of those in the team, where cables end (world, load), the plan, and the pulls."""
P, M, C = PARAMS.at, MEMORY.at, MEMORY.spans
CALM = 5.0
"""Time in which pulls beside the plan fade while nobody is unheard, s."""
MOMENTS = 1.0
"""Largest moment that a message can say, over the load's weight and its longest arm."""
SPREAD = 30.0
"""Angle of the plan's cables from the vertical, degrees."""
FREE, HOLDING, CLIPPED = int(Status.FREE), int(Status.HOLDING), int(Status.CLIPPED)


@inline
def _take(memory, at, wish, most):  # type: ignore[no-untyped-def]
    """A wish, no larger than a message can say; the one before where it is no number."""
    if math.isfinite(wish[0] + wish[1] + wish[2]):
        for k in range(3):
            memory[at + k] = min(max(wish[k], -most), most)


@inline
def _in_frame(memory, at):  # type: ignore[no-untyped-def]
    """A vector of the world in the frame of the wanted load."""
    q = M.frame
    return quaternion.into_body(
        memory[q], memory[q + 1], memory[q + 2], memory[q + 3], memory[at], memory[at + 1], memory[at + 2]
    )  # fmt: skip


@inline
def _in_world(memory, x, y, z):  # type: ignore[no-untyped-def]
    q = M.frame
    return quaternion.into_world(
        memory[q], memory[q + 1], memory[q + 2], memory[q + 3], x, y, z
    )  # fmt: skip


@inline
def _begin(memory, writes):  # type: ignore[no-untyped-def]
    """Stand where the cable is, with what the plan asks of it."""
    memory[M.started] = 1.0
    memory[M.session] = max(memory[M.session], 1.0)
    memory[M.up + 2] = 1.0
    d = writes.direction
    for k in range(3):
        memory[M.w + k] = d[k]
    x, y, z = _in_frame(memory, M.w)
    memory[M.a], memory[M.a + 1], memory[M.a + 2] = x, y, z
    for k in range(3):
        memory[M.wish + k] = memory[M.steady + k] = memory[M.agreed + k] = memory[M.target + k]
    for j in range(MOST):
        memory[M.peers + WIDTH * j + Q.count] = -1.0


@inline
def _know(sees, params, memory, me, n):  # type: ignore[no-untyped-def]
    """Lengths and ends that the planes between this drone's cable and each other are made of."""
    own = P.rows + P.width * me
    for row in range(n):
        j = int(sees.members[row])
        if row == me or j < 0 or j >= MOST:
            continue
        o, other = M.peers + WIDTH * j, P.rows + P.width * row
        memory[o + Q.own], memory[o + Q.other] = params[own + P.length], params[other + P.length]
        memory[o + Q.gap] = params[P.gap]
        for k in range(3):
            memory[o + Q.end + k] = params[other + P.arm + k] - params[own + P.arm + k]


@inline
def _listen(now, sees, params, memory, me, n):  # type: ignore[no-untyped-def]
    """Take what is new of those in the team."""
    for row in range(n):
        if not leaderless.hears(now, sees, params, memory, me, row):
            continue
        j, text = int(sees.members[row]), sees.inbox[row]
        for k in range(3):
            at, share = M.wished + 6 * j + k, message.SHARE + 2 * k
            memory[at] = params[P.wish_unit] * numbers.get(text, message.WISH + 2 * k)
            memory[at + 3] = params[P.moment_unit] * message.get_moment(text, k)
            memory[M.held + 3 * j + k] = params[P.share_unit] * numbers.get(text, share)
        o = M.peers + WIDTH * j
        if memory[o + Q.inside] != 0.0:
            leaderless.hear_pair(sees, params, memory, o, text, message.PAIRS)


@inline
def _speak(now, sees, params, memory, writes, holding, leaves):  # type: ignore[no-untyped-def]
    text = writes.outbox
    leaderless.begin_message(now, sees, memory, text, holding, leaves)
    turn = _in_frame(memory, M.turn_steady)
    wish_unit, share_unit, moment_unit = params[P.wish_unit], params[P.share_unit], params[P.moment_unit]  # fmt: skip
    for k in range(3):
        at, share = message.WISH + 2 * k, message.SHARE + 2 * k
        numbers.put(text, at, (memory[M.steady + k] - memory[M.target + k]) / wish_unit)
        numbers.put(text, share, memory[M.flown + k] / share_unit)
        message.put_moment(text, k, turn[k] / moment_unit)
        memory[M.said + k] = wish_unit * numbers.get(text, at)
        memory[M.said + 3 + k] = share_unit * numbers.get(text, share)
        memory[M.said_turn + k] = moment_unit * message.get_moment(text, k)
    leaderless.speak_to_next(sees, memory, text, message.PAIRS)
    leaderless.seal(now, params, text)


@inline
def _mean_wish(memory, late):  # type: ignore[no-untyped-def]
    """Lasting force beside the plan's (world, in ``mean``) and moment (frame) that all in the team want on average; whether somebody is unheard, or says so of others."""
    team, holding, others = 1.0, False, False
    for k in range(3):
        memory[M.mean + k] = memory[M.said + k]
    x, y, z = memory[M.said_turn], memory[M.said_turn + 1], memory[M.said_turn + 2]
    for j in range(MOST):
        o = M.peers + WIDTH * j
        if memory[o + Q.inside] == 0.0:
            continue
        holding = holding or memory[o + Q.silent] > late or memory[o + Q.known] == 0.0
        others = others or memory[o + Q.holds] != 0.0
        heard = memory[o + Q.count] >= 0.0
        w = M.wished + 6 * j
        for k in range(3):
            memory[M.mean + k] += memory[w + k] if heard else memory[M.said + k]
        x += memory[w + 3] if heard else memory[M.said_turn]
        y += memory[w + 4] if heard else memory[M.said_turn + 1]
        z += memory[w + 5] if heard else memory[M.said_turn + 2]
        team += 1.0
    for k in range(3):
        memory[M.mean + k] /= team
    return x / team, y / team, z / team, holding, others


@inline
def _gather(sees, params, memory, me, n):  # type: ignore[no-untyped-def]
    """Levers (frame of the load) and plan of those in the team, one after the other; how many, and the place of this drone."""
    count = place = 0
    known = sees.formation[me, 2] != 0.0
    for row in range(n):
        o, r = M.peers + WIDTH * int(sees.members[row]), P.rows + P.width * row
        if row != me and memory[o + Q.inside] == 0.0:
            continue
        if row == me:
            place = count
        for k in range(3):
            memory[M.arm + 3 * count + k] = params[r + P.arm + k]
            share = sees.formation[row, k] if known else params[r + P.plan + k]
            memory[M.plan + 3 * count + k] = share
        count += 1
    return count, place


@inline
def _kind(count, params, arms):  # type: ignore[no-untyped-def]
    """What wrenches so many cables can make: kind and axis, in the frame of the load."""
    kind = params[P.kind]
    x, y, z = params[P.axis], params[P.axis + 1], params[P.axis + 2]
    if count == 1:
        kind = POINT
    elif count == 2 and kind != POINT:
        kind = LINE
        x, y, z = arms[3] - arms[0], arms[4] - arms[1], arms[5] - arms[2]
        size = math.sqrt(x * x + y * y + z * z)
        if size > 1e-9:
            x, y, z = x / size, y / size, z / size
        else:
            kind = POINT
    return kind, x, y, z


@inline
def _share(sees, params, memory, q, count, moment):  # type: ignore[no-untyped-def]
    """Fill the pulls of the team (world): the plan, turned and scaled with the planned force, and what is nearest to it of those that make the wish."""
    arms, ends = column(memory, 0, 1, C.arm), column(memory, 0, 1, C.end)
    pulls, formation = column(memory, 0, 1, C.pulls), column(memory, 0, 1, C.plan)
    wrench.turned(q[0], q[1], q[2], q[3], count, arms, ends)
    kind, ax, ay, az = _kind(count, params, arms)
    ax, ay, az = quaternion.into_world(q[0], q[1], q[2], q[3], ax, ay, az)
    m, g = params[P.m], params[P.g]
    fx, fy, fz = memory[M.target], memory[M.target + 1], max(memory[M.target + 2], 0.1 * m * g)
    W = math.sqrt(fx * fx + fy * fy + fz * fz)
    p = M.frame
    cos_yaw, sin_yaw = wrench.heading(memory[p], memory[p + 1], memory[p + 2], memory[p + 3])
    wrench.planned(count, fx, fy, fz, max(W, 1e-9), cos_yaw, sin_yaw, formation, pulls)
    # The own wish, but for its steady part, of which all take the mean.
    fx = memory[M.wish] - memory[M.steady] + memory[M.target] + memory[M.mean]
    fy = memory[M.wish + 1] - memory[M.steady + 1] + memory[M.target + 1] + memory[M.mean + 1]
    fz = memory[M.wish + 2] - memory[M.steady + 2] + memory[M.target + 2] + memory[M.mean + 2]
    x, y, z = _in_world(memory, moment[0], moment[1], moment[2])
    mx = memory[M.turn_wish] - memory[M.turn_steady] + x
    my = memory[M.turn_wish + 1] - memory[M.turn_steady + 1] + y
    mz = memory[M.turn_wish + 2] - memory[M.turn_steady + 2] + z
    mx, my, mz = wrench.possible(count, kind, ax, ay, az, fx, fy, fz, mx, my, mz, ends)
    fx, fy, fz, mx, my, mz = wrench.unmet(count, fx, fy, fz, mx, my, mz, ends, pulls)
    wrench.correct(count, kind, ax, ay, az, fx, fy, fz, mx, my, mz, ends, pulls)


@inline
def _balance(sees, params, memory, me, n, place, count, share):  # type: ignore[no-untyped-def]
    """Take the own part of what the pulls beside the plan do to the load together."""
    arms, ends = column(memory, 0, 1, C.arm), column(memory, 0, 1, C.end)
    fx = fy = fz = mx = my = mz = 0.0
    for row in range(n):
        j = int(sees.members[row])
        o = M.peers + WIDTH * j
        if row != me and (memory[o + Q.inside] == 0.0 or memory[o + Q.count] < 0.0):
            continue
        b, r = (M.said + 3 if row == me else M.held + 3 * j), P.rows + P.width * row + P.arm
        x, y, z = memory[b], memory[b + 1], memory[b + 2]
        fx, fy, fz = fx + x, fy + y, fz + z
        mx += params[r + 1] * z - params[r + 2] * y
        my += params[r + 2] * x - params[r] * z
        mz += params[r] * y - params[r + 1] * x
    if fx == 0.0 and fy == 0.0 and fz == 0.0 and mx == 0.0 and my == 0.0 and mz == 0.0:
        return
    for k in range(3 * count):
        ends[k] = 0.0
    kind, ax, ay, az = _kind(count, params, arms)
    wrench.correct(count, kind, ax, ay, az, fx, fy, fz, mx, my, mz, arms, ends)
    if math.isfinite(ends[3 * place] + ends[3 * place + 1] + ends[3 * place + 2]):
        for k in range(3):
            memory[M.beside + k] += share * ends[3 * place + k]


@inline
def _weigh(sees, params, memory, plan, n, team, late, dt):  # type: ignore[no-untyped-def]
    """Compare what all say that they pull with what the load does (:mod:`~colift.control.agents._evidence`)."""
    at = 0
    for row in range(n):
        j = int(sees.members[row])
        o = M.peers + WIDTH * j
        if j == int(sees.number[0]):
            at += 1
            continue
        if memory[o + Q.inside] == 0.0:
            continue
        x, y, z = _in_frame(memory, M.pulls + 3 * at)
        for k in range(3):
            planned = x if k == 0 else y if k == 1 else z
            memory[o + Q.wish + k] = 0.0
            memory[o + Q.usual + k] = planned  # whatever it says
            memory[o + Q.share + k] = planned + memory[M.held + 3 * j + k]
        at += 1
    x, y, z = evidence.feel(memory, M.velocity, M.steady, M.up, plan, sees.velocity, params[P.g], dt)  # fmt: skip
    measured = math.isfinite(sees.felt[0] + sees.felt[1] + sees.felt[2])
    if measured:
        x, y, z = sees.felt[0], sees.felt[1], sees.felt[2]
    memory[M.w], memory[M.w + 1], memory[M.w + 2] = x, y, z
    evidence.weigh(memory, M.peers, M.lack, _in_frame(memory, M.w), measured, M.pull, team, late, dt)  # fmt: skip


@kernel(SIGNATURE, counted=False)
def _agree_on_wrench(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    n, dt = sees.members.shape[0], now.dt
    writes.asking[0] = 0.0
    me = 0
    for row in range(n):
        if sees.members[row] == sees.number[0]:
            me = row
    known, qw, qx, qy, qz = wrench.unit_attitude(sees.load_attitude)
    wanted, pw, px, py, pz = wrench.unit_attitude(sees.reference_attitude)
    if wanted:
        memory[M.frame], memory[M.frame + 1] = pw, px
        memory[M.frame + 2], memory[M.frame + 3] = py, pz
    elif memory[M.started] == 0.0:
        return HOLDING
    if not known:
        qw, qx = memory[M.frame], memory[M.frame + 1]
        qy, qz = memory[M.frame + 2], memory[M.frame + 3]
    a = sees.reference
    for k in range(3):
        planned = params[P.m] * (a[2, k] + (params[P.g] if k == 2 else 0.0))
        if math.isfinite(planned):
            memory[M.target + k] = planned
    started = memory[M.started] != 0.0
    if not started:
        _begin(memory, writes)
    most = numbers.MOST * params[P.wish_unit]
    twist = message.LARGEST * params[P.moment_unit]
    _take(memory, M.wish, sees.wish, most)
    _take(memory, M.steady, sees.steady_wish, most)
    _take(memory, M.turn_wish, sees.wish_moment, twist)
    _take(memory, M.turn_steady, sees.steady_moment, twist)

    _know(sees, params, memory, me, n)
    _listen(now, sees, params, memory, me, n)
    late = params[P.patience] / dt
    team = 1
    for j in range(MOST):
        team += int(memory[M.peers + WIDTH * j + Q.inside])
    if started:
        _weigh(sees, params, memory, sees.reference, n, team, late, dt)
    # What the view makes of them is of no use here: the plan tells each its share.
    for k in range(3):
        memory[M.mean + k] = memory[M.b + k] = 0.0
    leaderless.view_team(sees, memory, me, n, team, late, started)
    mx, my, mz, holding, others = _mean_wish(memory, late)

    count, place = _gather(sees, params, memory, me, n)
    _share(sees, params, memory, (qw, qx, qy, qz), count, (mx, my, mz))
    _balance(sees, params, memory, me, n, place, count, dt / (dt + BALANCE))
    fade = 1.0 if holding or others else CALM / (CALM + dt)
    o = M.pulls + 3 * place
    x, y, z = _in_frame(memory, o)
    for k in range(3):
        memory[M.beside + k] *= fade
    hx, hy, hz = x, y, z
    x, y, z = x + memory[M.beside], y + memory[M.beside + 1], z + memory[M.beside + 2]
    size = math.sqrt(x * x + y * y + z * z)
    if not math.isfinite(size):  # as it was
        for k in range(3):
            memory[M.beside + k] = memory[M.flown + k] = 0.0
        hx = hy = hz = x = y = z = size = 0.0
    elif size > 1e-9:
        turn = params[P.rate] * dt
        leaderless.move(memory, params, x / size, y / size, z / size, turn)
        leaderless.offer(memory, params, x / size, y / size, z / size)
    row, o = P.rows + P.width * me, M.a
    along = x * memory[o] + y * memory[o + 1] + z * memory[o + 2]
    T = min(max(along, params[row + P.low]), params[row + P.high])
    writes.tension[0] = T
    missing = 0.0
    for k in range(3):
        planned = hx if k == 0 else hy if k == 1 else hz
        asked = x if k == 0 else y if k == 1 else z
        missing = max(missing, abs(asked - T * memory[o + k]))
        memory[M.pull + k] = T * memory[o + k]
        memory[M.flown + k] = T * memory[o + k] - planned
    x, y, z = _in_world(memory, memory[o], memory[o + 1], memory[o + 2])
    writes.direction[0], writes.direction[1], writes.direction[2] = x, y, z

    if not (holding or others):
        for k in range(3):
            memory[M.agreed + k] = memory[M.target + k] + memory[M.mean + k]
    for k in range(3):
        writes.agreed[k] = memory[M.agreed + k]
    for row in range(n):
        inside = row == me or memory[M.peers + WIDTH * int(sees.members[row]) + Q.inside] != 0.0
        writes.inside[row] = 1.0 if inside else 0.0
    _speak(now, sees, params, memory, writes, holding, sees.evidence[me] == 0.0)
    return (HOLDING if holding or others else FREE) | (CLIPPED if missing > 1e-3 * size else FREE)


Distance = Annotated[float, Field(ge=0.0, le=100.0)]


class LeaderlessWrench(Speaking):
    """Each drone bears its row of a formation that all know, corrected to the wanted force and moment, inside of planes agreed with each other drone.

    Planes keep drones and cables metres apart. No allocator is asked: the answer is that of ``safe-wrench`` where no limit stands in the way, and what a drone's own limit leaves of it the
    others take. Of what drones learn each for themselves they take the mean.
    """

    kernel = _agree_on_wrench
    remembers = MEMORY
    wrenches = True
    least_share = 0.15

    cone_deg: Annotated[float, Field(ge=1.0, lt=75.0)] = SPREAD
    """Angle of the plan's cables from the vertical in hover, degrees, where the flight plans no formation."""
    min_distance: Distance = 0.4
    """Least distance between two drones, m, whatever is lost."""
    cable_gap: Distance = 0.05
    """Least distance between two cables, m; no more than half of that between the nearest two attachments."""
    buffer: Distance = 0.02
    """By how much more drones keep, m: frames of two of them differ by the turn of the wanted load in the difference of their clocks, and the load is
    not turned just as wanted."""
    max_cone_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 75.0
    """Largest angle between a cable and the wanted load's upright axis, degrees."""
    max_rate: Annotated[float, Field(gt=0.0, le=1e3)] = 3.0
    """Fastest turn of a cable's direction in the frame of the wanted load, rad/s."""

    def check(self, team: Team) -> list[tuple[str, str]]:
        found = super().check(team)
        if team.body is None:
            found.append(("kind", 'shares force and moment of a rigid load: a point needs "leaderless"'))  # fmt: skip
        return found

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        team = mission.team
        if team.body is None or team.n < 2:
            return
        places = team.levers - team.cable_lengths[:, None] * mission.start_directions()
        i, j = np.triu_indices(team.n, k=1)
        nearest = float(np.linalg.norm(places[i] - places[j], axis=1).min())
        if nearest < self.min_distance + self.buffer:
            yield (
                "min_distance",
                f"drones start {nearest:.3g} m apart (start): they are led apart first",
            )

    def _gap(self, team: Team) -> float:
        i, j = np.triu_indices(team.n, k=1)
        nearest = np.linalg.norm(team.levers[i] - team.levers[j], axis=1).min(initial=math.inf)
        return min(self.cable_gap, 0.5 * float(nearest))

    def params(self, team: Team) -> Vector:
        weight = team.load_mass * max(team.gravity, 1e-3)
        kind, axis = spanned(team)
        distance = self.min_distance + self.buffer
        arm = max(float(np.abs(team.levers).max(initial=0.0)), 1e-3)
        formation = plan(team, lean=math.radians(self.cone_deg), distance=distance)
        return PARAMS.pack(
            team.n, g=team.gravity, least=0.5 * distance, cone=math.cos(math.radians(self.max_cone_deg)), rate=self.max_rate,
            settling=0.0, patience=self.patience, stale=self.stale, period=0.0,
            wish_unit=WISHES * weight / numbers.MOST, share_unit=leaderless.SHARES * weight / numbers.MOST,
            key=self.secret, m=team.load_mass, moment_unit=MOMENTS * weight * arm / message.LARGEST,
            gap=0.5 * self._gap(team), kind=kind, axis=axis,
            low=self.settled("tension_min", team), high=self.settled("tension_max", team),
            length=team.cable_lengths, arm=team.levers, plan=shares(team, *formation),
        )  # fmt: skip
