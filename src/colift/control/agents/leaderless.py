"""n equal agents: each bears its own share of what all want, inside planes that two agree on at a time."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated

from pydantic import Field

from colift.control.agents import _evidence as evidence
from colift.control.agents import _frame as frame
from colift.control.agents import _message as message
from colift.control.agents import _pairs as pairs
from colift.control.agents._message import MOST
from colift.control.agents._pairs import FIRST, LEAST, OFFERED, SETTLED, WIDTH, Q
from colift.control.agents._speaking import Speaking
from colift.control.agents.base import SIGNATURE, Status
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import message as numbers
from colift.part import Setup, Vector
from colift.team import Team
from colift.team.geometry import pairwise_angles

PARAMS = Layout(
    team={
        "g": 1, "least": 1, "cone": 1, "rate": 1, "settling": 1, "patience": 1, "stale": 1, "period": 1, "wish_unit": 1, "share_unit": 1,
        "key": 2,
    },
    drone={"low": 1, "high": 1},
)  # fmt: skip
"""``least``: sine of half of the angle that pairs keep; ``cone``: cosine of the largest lean; ``wish_unit``, ``share_unit``: N in one step of a message."""
MEMORY = Layout(
    drone={
        "started": 1, "asked": 1, "planned": 1, "turn": 1, "session": 1, "up": 3, "a": 3, "w": 3, "b": 3,
        "target": 3, "mean": 3, "agreed": 3, "wish": 3, "steady": 3, "said": 6, "lack": 7, "velocity": 4, "flown": 3, "pull": 3, "peers": WIDTH * MOST,
    }
)  # fmt: skip
"""``up``: axis of the planned frame, ``a``: direction in it, ``b``: pull beside the share of the wish, ``target``: where the plan of the formation
wants it, ``mean``: mean of the steady wishes, ``agreed``: while nobody held; ``lack``: force on the load that nobody explains, and what of it is usual, and since when; ``velocity`` of the load, and whether it is known; ``pull``: as flown, ``flown``: ``b`` of it; ``said``: own
wish and pull as the others hear them, so that all see the same; ``turn``: peer that was written to last; ``session``: 1 to 15, the next after
a restart, which is told from outside; ``w``: scratch."""
P, M = PARAMS.at, MEMORY.at
AHEAD = 0.3
"""Largest distance of an offered reference from the own direction, rad."""
TURN = 6.0
"""Fastest turn of the planned frame, rad/s."""
ROUNDS = 3
"""How often the wanted direction is pushed back inside of all planes."""
HALVINGS = 5
BALANCE = 0.5
"""Time in which pulls beside the shares come to balance when nobody is asked for the formation, s."""
CODE = 0.12
"""By how much two directions may be nearer, degrees, than the nearest codes for them."""
FOR_GOOD = 1e3
"""Time that is told to the allocator, s: so long that it answers with what it would settle to. A step on the way there depends on where each has heard
the others to be, the end does not; the own way there is ``settling``."""
ROOM = 4.0
"""By how much more than the least angle the allocator should plan, degrees."""
WISHES, SHARES = 4.0, 1.0
"""Largest wish and pull beside its share that a message can say, in weights of the load."""
FREE, HOLDING, CLIPPED = int(Status.FREE), int(Status.HOLDING), int(Status.CLIPPED)


@inline
def _take(memory, at, F, most):  # type: ignore[no-untyped-def]
    """A force in the frame, no larger than a message can say; the one before where it is no number."""
    if math.isfinite(F[0] + F[1] + F[2]):
        x, y, z = frame.to_frame(
            memory, M.up, min(max(F[0], -most), most), min(max(F[1], -most), most),
            min(max(F[2], -most), most),
        )  # fmt: skip
        memory[at], memory[at + 1], memory[at + 2] = x, y, z


@inline
def _begin(now, sees, params, memory, writes, n):  # type: ignore[no-untyped-def]
    """Stand where the cable is: with an equal share at the start, else with the pull that the drone has."""
    memory[M.started] = 1.0
    memory[M.session] = max(memory[M.session], 1.0)
    memory[M.up], memory[M.up + 1], memory[M.up + 2] = 0.0, 0.0, 1.0
    plan = sees.reference
    frame.follow_plan(memory, M.up, plan[2, 0], plan[2, 1], plan[2, 2] + params[P.g], math.pi)
    d = writes.direction
    x, y, z = frame.to_frame(memory, M.up, d[0], d[1], d[2])
    memory[M.a], memory[M.a + 1], memory[M.a + 2] = x, y, z
    for k in range(3):
        memory[M.wish + k] = memory[M.steady + k] = 0.0
    _take(memory, M.steady, sees.steady_wish, numbers.MOST * params[P.wish_unit])
    pull = max(writes.tension[0], 0.0)
    if now.step == 0 and z < -0.1:
        pull = -memory[M.steady + 2] / (n * z)
    for k in range(3):
        wish = memory[M.steady + k]
        memory[M.wish + k] = memory[M.said + k] = memory[M.agreed + k] = wish
        memory[M.b + k] = memory[M.said + 3 + k] = pull * memory[M.a + k] + wish / n
    for j in range(MOST):
        memory[M.peers + WIDTH * j + Q.count] = -1.0


@inline
def hears(now, sees, params, memory, me, row):  # type: ignore[no-untyped-def]
    """Whether the message of who has this row is new, sealed and fresh; then what it says of its sender and of the team is taken."""
    j = int(sees.members[row])
    if row == me or j < 0 or j >= MOST:
        return False
    o, text = M.peers + WIDTH * j, sees.inbox[row]
    memory[o + Q.silent] += 1.0
    if sees.heard[row] == 0.0:
        return False
    count = message.count_near(message.get16(text, message.COUNT), now.step)
    if abs(count - now.step) * now.dt > params[P.stale]:
        return False
    if count <= memory[o + Q.count] or int(text[message.WHO]) & 15 != j:
        return False
    key_0, key_1 = int(params[P.key]), int(params[P.key + 1])
    if not message.is_sealed(text, (count >> 16) & 0xFFFFFFFF, key_0, key_1):
        return False
    memory[o + Q.count] = count
    memory[o + Q.silent] = 0.0
    team = message.get16(text, message.TEAM)
    memory[o + Q.holds] = 1.0 if (team >> j) & 1 == 0 else 0.0
    memory[o + Q.left] = 1.0 if team == message.NOBODY else 0.0
    session = (int(text[message.WHO]) >> 4) & 15
    if session != memory[o + Q.session]:
        memory[o + Q.session] = session
        memory[o + Q.liar] = 0.0
        if memory[o + Q.inside] != 0.0:
            pairs.stand(memory, o, M.a)
    return True


@inline
def hear_pair(sees, params, memory, o, text, at):  # type: ignore[no-untyped-def]
    """Take what the peer at ``o`` says of both references, if it speaks to this drone as it is now."""
    peer, version, first, answered, yes, known, code = message.get_pair(text, at)
    if peer == int(sees.number[0]) and known == memory[M.session]:
        pairs.decide(memory, o, M.a, M.w, version, first, yes, code, params[P.least])
        pairs.hear_answer(memory, o, first, answered, yes)


@inline
def _listen(now, sees, params, memory, me, n):  # type: ignore[no-untyped-def]
    """Take what is new of those in the team."""
    wish_unit, share_unit = params[P.wish_unit], params[P.share_unit]
    for row in range(n):
        if not hears(now, sees, params, memory, me, row):
            continue
        o, text = M.peers + WIDTH * int(sees.members[row]), sees.inbox[row]
        for k in range(3):
            memory[o + Q.wish + k] = wish_unit * numbers.get(text, message.WISH + 2 * k)
            memory[o + Q.share + k] = share_unit * numbers.get(text, message.SHARE + 2 * k)
        if memory[o + Q.inside] != 0.0:
            for half in range(2):
                hear_pair(sees, params, memory, o, text, message.PAIRS + message.PAIR * half)


@inline
def view_team(sees, memory, me, n, count, late, started):  # type: ignore[no-untyped-def]
    """Who is in the team, of ``count`` until now: silence alone lets nobody out. Returns how many, with this drone."""
    for j in range(MOST):
        o = M.peers + WIDTH * j
        there = False
        for row in range(n):
            if row != me and int(sees.members[row]) == j:
                here = memory[o + Q.inside] != 0.0 and memory[o + Q.silent] <= late
                there = sees.evidence[row] != 0.0 or here
        if memory[o + Q.inside] != 0.0 and memory[o + Q.silent] > late:
            if memory[o + Q.doubt] > evidence.SILENT:
                memory[o + Q.gone] = 1.0
        elif memory[o + Q.doubt] > evidence.SURE:
            memory[o + Q.gone] = memory[o + Q.liar] = 1.0
            memory[o + Q.doubt] = 0.0
            for k in range(3):  # what it usually pulled is what is missing
                memory[o + Q.share + k] = memory[o + Q.usual + k] + memory[M.mean + k] / count
        elif memory[o + Q.silent] == 0.0 and memory[o + Q.liar] == 0.0:
            memory[o + Q.gone] = 0.0
        there = there and memory[o + Q.gone] == 0.0 and memory[o + Q.left] == 0.0
        if there and memory[o + Q.inside] == 0.0:
            memory[o + Q.inside] = 1.0
            pairs.stand(memory, o, M.a)
            memory[o + Q.silent] = memory[o + Q.met] = memory[o + Q.doubt] = 0.0
            for k in range(3):
                if memory[o + Q.count] < 0.0:
                    memory[o + Q.wish + k] = memory[M.steady + k]
                if started:  # it begins with nothing: what we bear stays
                    memory[M.b + k] -= memory[M.mean + k] / (count * (count + 1))
            count += 1
            memory[M.planned] = 0.0
        elif not there and memory[o + Q.inside] != 0.0:
            memory[o + Q.inside] = 0.0
            for k in range(3):  # each takes its part of what is missing
                memory[M.b + k] += memory[o + Q.share + k] / (count - 1)
            count -= 1
            memory[M.planned] = 0.0
    return count


@inline
def _push_in(memory, params, x, y, z):  # type: ignore[no-untyped-def]
    """The direction (x, y, z), pushed to the near side of every plane that it is beyond, and into the cone."""
    for _ in range(ROUNDS):
        moved = False
        for m in range(2 * MOST + 1):
            o = M.peers + WIDTH * (m >> 1)
            nx, ny, nz, least = 0.0, 0.0, -1.0, params[P.cone]
            if m < 2 * MOST:
                if not pairs.here(memory, o):
                    continue
                if m & 1 == 1 and memory[o + Q.state] != OFFERED:
                    continue
                r = o + Q.r0 if m & 1 == 0 else o + Q.r1
                _, nx, ny, nz, least = pairs.plane(memory, o, r, o + Q.rb, params[P.least])
            least += 1e-6
            if abs(least) >= 1.0:  # nowhere, or everywhere
                continue
            rest = math.sqrt(1.0 - least * least)
            along = x * nx + y * ny + z * nz
            if along >= least:
                continue
            moved = True
            tx, ty, tz = x - along * nx, y - along * ny, z - along * nz
            size = math.sqrt(tx * tx + ty * ty + tz * tz)
            if size < 1e-9:
                return memory[M.a], memory[M.a + 1], memory[M.a + 2]
            share = rest / size
            x, y, z = least * nx + share * tx, least * ny + share * ty, least * nz + share * tz
        if not moved:
            break
    norm = 1.0 / math.sqrt(x * x + y * y + z * z)
    return x * norm, y * norm, z * norm


@inline
def move(memory, params, x, y, z, most):  # type: ignore[no-untyped-def]
    """Turn towards the unit vector (x, y, z) as far as all planes allow; where it stands is always allowed."""
    for j in range(MOST):
        o = M.peers + WIDTH * j
        if memory[o + Q.inside] != 0.0 and memory[o + Q.known] == 0.0:
            return False
    x, y, z = _push_in(memory, params, x, y, z)
    angle = most
    for _ in range(HALVINGS):
        for k in range(3):
            memory[M.w + k] = memory[M.a + k]
        frame.turn_to(memory, M.w, x, y, z, angle)
        if pairs.allowed(memory, M.peers, M.w, M.a, params[P.least], params[P.cone]):
            for k in range(3):
                memory[M.a + k] = memory[M.w + k]
            return True
        angle *= 0.5
    return False


@inline
def offer(memory, params, x, y, z):  # type: ignore[no-untyped-def]
    """Offer every peer that has answered a reference on the way to where we want to be."""
    for j in range(MOST):
        o = M.peers + WIDTH * j
        ready = memory[o + Q.inside] != 0.0 and memory[o + Q.known] != 0.0
        if not ready or memory[o + Q.state] != SETTLED:
            continue
        for k in range(3):
            memory[M.w + k] = memory[M.a + k]
        reach = memory[o + Q.reach]
        if reach > LEAST:
            c = memory[M.a] * x + memory[M.a + 1] * y + memory[M.a + 2] * z
            way = math.acos(min(max(c, -1.0), 1.0))
            frame.turn_to(memory, M.w, x, y, z, reach * min(way, AHEAD))
        w, a, least = M.w, M.a, params[P.least]
        if not pairs.offer(memory, o, a, memory[w], memory[w + 1], memory[w + 2], least):
            pairs.offer(memory, o, a, memory[a], memory[a + 1], memory[a + 2], least)
        if reach <= LEAST:
            memory[o + Q.reach] = 1.0


@inline
def _next_peer(memory, turn):  # type: ignore[no-untyped-def]
    """Who is written to after the peer ``turn``: the next that waits for something, else the next; -1 if there is none."""
    found = -1
    for k in range(1, MOST + 1):
        j = (turn + k) % MOST
        o = M.peers + WIDTH * j
        if memory[o + Q.inside] == 0.0:
            continue
        if memory[o + Q.due] != 0.0 or memory[o + Q.state] != SETTLED:
            return j
        if found < 0:
            found = j
    return found


@inline
def begin_message(now, sees, memory, text, holding, leaves):  # type: ignore[no-untyped-def]
    """Say who speaks, when, and whom it takes to be in the team: not itself while it is ``holding``, nobody once it ``leaves``."""
    number = int(sees.number[0])
    text[message.WHO] = number | int(memory[M.session]) << 4
    message.put16(text, message.COUNT, now.step & 0xFFFF)
    team = 0 if holding else 1 << number
    for j in range(MOST):
        team |= int(memory[M.peers + WIDTH * j + Q.inside]) << j
    message.put16(text, message.TEAM, message.NOBODY if leaves else team)


@inline
def speak_to_next(sees, memory, text, at):  # type: ignore[no-untyped-def]
    """Say to the peer whose turn it is where both references are."""
    j = _next_peer(memory, int(memory[M.turn]))
    if j < 0:
        message.put_pair(text, at, int(sees.number[0]), 0, 0, 0, 0, 0, 0)
        return
    memory[M.turn] = j
    o = M.peers + WIDTH * j
    memory[o + Q.due] = 0.0
    first = 1 if memory[o + Q.state] == FIRST else 0
    message.put_pair(
        text, at, j, int(memory[o + Q.version]), first, int(memory[o + Q.seen]),
        int(memory[o + Q.yes]), int(memory[o + Q.session]), int(memory[o + Q.code]),
    )  # fmt: skip


@inline
def seal(now, params, text):  # type: ignore[no-untyped-def]
    """End the message."""
    key_0, key_1 = int(params[P.key]), int(params[P.key + 1])
    message.seal(text, (now.step >> 16) & 0xFFFFFFFF, key_0, key_1)


@inline
def _speak(now, sees, params, memory, writes, holding, leaves):  # type: ignore[no-untyped-def]
    text = writes.outbox
    wish_unit, share_unit = params[P.wish_unit], params[P.share_unit]
    begin_message(now, sees, memory, text, holding, leaves)
    for k in range(3):
        wish, share = message.WISH + 2 * k, message.SHARE + 2 * k
        numbers.put(text, wish, memory[M.steady + k] / wish_unit)
        numbers.put(text, share, memory[M.flown + k] / share_unit)
        memory[M.said + k] = wish_unit * numbers.get(text, wish)
        memory[M.said + 3 + k] = share_unit * numbers.get(text, share)
    for half in range(2):
        speak_to_next(sees, memory, text, message.PAIRS + message.PAIR * half)
    seal(now, params, text)


@inline
def _ask(sees, memory, writes, me, n):  # type: ignore[no-untyped-def]
    """Ask for the formation of all for the mean wish, from what is known of everybody's pull."""
    m = M.mean
    writes.asking[0] = FOR_GOOD
    memory[M.asked] = 1.0
    x, y, z = frame.to_world(memory, M.up, memory[m], memory[m + 1], memory[m + 2])
    writes.asked_force[0], writes.asked_force[1], writes.asked_force[2] = x, y, z
    for row in range(n):
        o = M.said + 3 if row == me else M.peers + WIDTH * int(sees.members[row]) + Q.share
        x, y, z = (
            memory[o] - memory[m] / n,
            memory[o + 1] - memory[m + 1] / n,
            memory[o + 2] - memory[m + 2] / n,
        )
        x, y, z = frame.to_world(memory, M.up, x, y, z)
        size = math.sqrt(x * x + y * y + z * z)
        writes.team_tensions[row] = size
        if size > 1e-6:
            writes.team_directions[row, 0] = x / size
            writes.team_directions[row, 1] = y / size
            writes.team_directions[row, 2] = z / size


@kernel(SIGNATURE, counted=False)
def _agree(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    n, dt = sees.members.shape[0], now.dt
    me = 0
    for row in range(n):
        if sees.members[row] == sees.number[0]:
            me = row
    started = memory[M.started] != 0.0
    if not started:
        _begin(now, sees, params, memory, writes, n)

    # What the last question was answered, in the frame in which it was asked.
    if memory[M.asked] != 0.0:
        memory[M.asked] = 0.0
        T, d = writes.team_tensions[me], writes.team_directions
        x, y, z = frame.to_frame(memory, M.up, T * d[me, 0], T * d[me, 1], T * d[me, 2])
        if math.isfinite(x + y + z):
            memory[M.planned] = 1.0
            memory[M.target] = x + memory[M.mean] / n
            memory[M.target + 1] = y + memory[M.mean + 1] / n
            memory[M.target + 2] = z + memory[M.mean + 2] / n

    most = params[P.rate] * dt
    plan = sees.reference
    frame.follow_plan(memory, M.up, plan[2, 0], plan[2, 1], plan[2, 2] + params[P.g], TURN * dt)
    _take(memory, M.wish, sees.wish, numbers.MOST * params[P.wish_unit])
    _take(memory, M.steady, sees.steady_wish, numbers.MOST * params[P.wish_unit])

    _listen(now, sees, params, memory, me, n)
    late = params[P.patience] / dt
    team = 1
    for j in range(MOST):
        team += int(memory[M.peers + WIDTH * j + Q.inside])
    x, y, z = evidence.feel(
        memory, M.velocity, M.steady, M.up, plan, sees.velocity, params[P.g], dt
    )
    measured = math.isfinite(sees.felt[0] + sees.felt[1] + sees.felt[2])
    if measured:
        x, y, z = sees.felt[0], sees.felt[1], sees.felt[2]
    x, y, z = frame.to_frame(memory, M.up, x, y, z)
    evidence.weigh(memory, M.peers, M.lack, (x, y, z), measured, M.pull, team, late, dt)
    team = view_team(sees, memory, me, n, team, late, started)

    holding = others = False
    for k in range(3):
        memory[M.mean + k] = memory[M.said + k]
    for j in range(MOST):
        o = M.peers + WIDTH * j
        if memory[o + Q.inside] == 0.0:
            continue
        if memory[o + Q.silent] > late or memory[o + Q.known] == 0.0:
            holding = True
        others = others or memory[o + Q.holds] != 0.0  # then all hold, so that the sum does
        for k in range(3):
            memory[M.mean + k] += memory[o + Q.wish + k]
    for k in range(3):
        memory[M.mean + k] /= team
    if memory[M.planned] != 0.0 and not (holding or others):
        follow = dt / (dt + params[P.settling])
        for k in range(3):
            memory[M.b + k] += follow * (memory[M.target + k] - memory[M.b + k])

    # Whatever happens, each takes its part of what the pulls heard of do not balance.
    share = dt / (dt + BALANCE) / team
    for k in range(3):
        left = memory[M.said + 3 + k]
        for j in range(MOST):
            o = M.peers + WIDTH * j
            if memory[o + Q.inside] != 0.0 and memory[o + Q.count] >= 0.0:
                left += memory[o + Q.share + k]
        memory[M.b + k] -= share * left

    # f = b - F / |V|
    x, y, z = (
        memory[M.b] - memory[M.wish] / team,
        memory[M.b + 1] - memory[M.wish + 1] / team,
        memory[M.b + 2] - memory[M.wish + 2] / team,
    )
    size = math.sqrt(x * x + y * y + z * z)
    if size > 1e-9:
        move(memory, params, x / size, y / size, z / size, most)
        offer(memory, params, x / size, y / size, z / size)
    a = M.a
    row = P.rows + P.width * me
    along = x * memory[a] + y * memory[a + 1] + z * memory[a + 2]
    T = min(max(along, params[row + P.low]), params[row + P.high])
    writes.tension[0] = T
    missing = 0.0
    for k in range(3):
        missing = max(missing, abs((x if k == 0 else y if k == 1 else z) - T * memory[a + k]))
        memory[M.pull + k] = T * memory[a + k]
        memory[M.flown + k] = memory[M.pull + k] + memory[M.wish + k] / team
    x, y, z = frame.to_world(memory, M.up, memory[a], memory[a + 1], memory[a + 2])
    writes.direction[0], writes.direction[1], writes.direction[2] = x, y, z

    m = M.agreed
    if not (holding or others):
        for k in range(3):
            memory[m + k] = memory[M.mean + k]
    x, y, z = frame.to_world(memory, M.up, memory[m], memory[m + 1], memory[m + 2])
    writes.agreed[0], writes.agreed[1], writes.agreed[2] = x, y, z
    writes.asking[0] = 0.0
    period = max(1, int(params[P.period] / dt + 0.5))
    if team == n and n > 1 and not (holding or others) and now.step % period == 0:
        _ask(sees, memory, writes, me, n)
    for row in range(n):
        inside = row == me or memory[M.peers + WIDTH * int(sees.members[row]) + Q.inside] != 0.0
        writes.inside[row] = 1.0 if inside else 0.0
    _speak(now, sees, params, memory, writes, holding, sees.evidence[me] == 0.0)
    return (HOLDING if holding or others else FREE) | (CLIPPED if missing > 1e-3 * size else FREE)


class Leaderless(Speaking):
    """Each drone bears its own pull beside an equal share of the wanted force, and turns only inside planes agreed with each other drone.

    The formation follows the answers of the mission's allocator, which each drone asks for itself; its limits, such as
    ``min_angle_deg``, should be narrower than those here, which hold whatever is lost.
    """

    kernel = _agree
    remembers = MEMORY
    least_share = 0.5

    min_angle_deg: Annotated[float, Field(gt=0.0, lt=120.0)] = 25.0
    """Least angle between any two cables, degrees, whatever is lost."""
    frame_deg: Annotated[float, Field(ge=0.0, le=30.0)] = 1.0
    """By how much the frames of two drones may differ, degrees: the fastest turn of the planned force times the largest difference of
    their clocks. Cables keep so much more."""
    max_cone_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 75.0
    """Largest angle between a cable and the planned force, degrees."""
    max_rate: Annotated[float, Field(gt=0.0, le=1e3)] = 6.0
    """Fastest turn of a cable's direction in the planned frame, rad/s."""
    settling: Annotated[float, Field(ge=0.0, le=10.0)] = 0.1
    """Time with which the own pull follows what the formation wants, s."""
    period: Annotated[float, Field(gt=0.0, le=10.0)] = 0.1
    """Time between two questions to the allocator, s."""

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        planned = getattr(mission.allocation, "min_angle_deg", None)
        if planned is None:
            kind = mission.kinds["allocation"]
            yield (
                "min_angle_deg",
                f'allocation.kind = "{kind}" plans no least angle: planes may stand in its way',
            )
        elif planned < self.min_angle_deg + ROOM:
            yield (
                "min_angle_deg",
                f"allocation.min_angle_deg = {planned:g} plans cables where planes at {self.min_angle_deg:g} stand "
                f"in their way: leave {ROOM:g} degrees between them",
            )
        rate = getattr(mission.allocation, "max_rate", None)
        if rate is not None and rate < self.max_rate:
            yield (
                "max_rate",
                f"turns cables by {self.max_rate:g} rad/s where allocation.max_rate = {rate:g}: drones that do not follow let the load swing",
            )
        least = math.degrees(pairwise_angles(mission.start_directions()).min(initial=math.pi))
        if least < self.min_angle_deg:
            yield (
                "min_angle_deg",
                f"cables start {least:.3g} degrees apart (start): they are led apart first",
            )

    def params(self, team: Team) -> Vector:
        keep = math.radians(min(self.min_angle_deg + self.frame_deg + CODE, 150.0))
        weight = team.load_mass * max(team.gravity, 1e-3)
        return PARAMS.pack(
            team.n, g=team.gravity, least=math.sin(0.5 * keep), cone=math.cos(math.radians(self.max_cone_deg)), rate=self.max_rate,
            settling=self.settling, patience=self.patience, stale=self.stale, period=self.period,
            wish_unit=WISHES * weight / numbers.MOST, share_unit=SHARES * weight / numbers.MOST, key=self.secret,
            low=self.settled("tension_min", team), high=self.settled("tension_max", team),
        )  # fmt: skip
