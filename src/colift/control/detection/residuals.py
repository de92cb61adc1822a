"""Lost drones from residuals: a cable that lengthens, a thrust that is not there, sensors without news."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from colift.control.detection.base import SIGNATURE, DetectionPart
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion
from colift.kernel.math.ages import newer
from colift.kernel.math.smooth import decay
from colift.part import Places, Vector
from colift.team import Team

PARAMS = Layout(
    team={
        "filter": 1, "hold": 1, "speed": 1, "length": 1, "learning": 1, "deficit": 1, "frozen": 1,
        "g": 1, "astray": 1, "tug": 1, "grace": 1,
    },
    drone={"m": 1},
)  # fmt: skip
MEMORY = Layout(
    team={"changed": 1, "tumbled": 1},
    drone={
        "started": 1, "length": 1, "distance": 1, "speed": 1, "velocity": 3, "expected": 3,
        "cable": 1, "thrust": 1, "still": 1, "ages": 2, "now": 1, "steady": 1, "lack": 3,
        "counts": 1, "reeled": 1,
    }
)  # fmt: skip
"""How long ago the team ``changed``, s, 0 where that is no matter any more, and how long after that the load ``tumbled`` last. Of each drone filtered ``distance``, ``speed``, ``velocity`` and ``expected`` acceleration; for how long the signs of ``cable`` and
``thrust`` last; time without anything new (``still``) of tracking and attitude, and their ``ages``; whether the distance
changes faster than that of a taut cable (``now``), and time in which it did not (``steady``); the acceleration that lacks
(``lack``), and whether it ``counts`` as wind for the others."""
P, M = PARAMS.at, MEMORY.at

BRAKED = 0.8
"""Speed over its filtered value below which the ends of a cable are stopped: it has come taut, and is not cut."""
SOON, GRACE = 1e-9, 4.0
"""Just after a change of the team, and how long a rigid load takes to hang anew, s."""
TUMBLES, CALM, LONGEST = 2.0, 1.0, 4.0
"""Turn of the load, rad/s, from which on it does not hang yet; time since then until it does, s; most that both make of the grace."""
LEAST_UP = 0.5
"""Least vertical part of the axis by which a drone alone judges its thrust."""


@inline
def _lacking(i, axis, windy, across, along, memory):  # type: ignore[no-untyped-def]
    """The acceleration that a drone lacks along its thrust, less the level one that the others lack on average.

    ``windy`` drones count, with the sums ``across`` and ``along`` of what they lack. Where none of the others
    does, all that this one lacks in the level is taken for wind, and its thrust is judged by what lacks upwards.
    """
    o = M.rows + M.width * i
    x, y, z = memory[o + M.lack], memory[o + M.lack + 1], memory[o + M.lack + 2]
    own = memory[o + M.counts]
    rest = windy - own
    if rest < 0.5:
        return z / max(axis[2], LEAST_UP)
    wx, wy = (across - own * x) / rest, (along - own * y) / rest
    return axis[0] * (x - wx) + axis[1] * (y - wy) + axis[2] * z


@inline
def _turning(n, ends):  # type: ignore[no-untyped-def]
    """How fast the ends on the load turn about the first of them, rad/s."""
    fastest = 0.0
    for i in range(1, n):
        apart = speed = 0.0
        for k in range(3):
            apart += (ends[i, 0, k] - ends[0, 0, k]) ** 2
            speed += (ends[i, 1, k] - ends[0, 1, k]) ** 2
        if apart > 0.0:
            fastest = max(fastest, speed / apart)
    return math.sqrt(fastest)


@kernel(SIGNATURE)
def judge(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    ends, positions = sees.estimated_ends, sees.estimated_positions
    velocities, attitudes = sees.estimated_velocities, sees.estimated_attitudes
    thrusts, tensions = sees.thrusts, sees.received_tensions
    carrying = writes.carrying
    n = positions.shape[0]
    if sees.lift_share[0] == 0.0:  # cables that are slack on purpose
        memory[:] = 0.0
        return
    hold, fast, longer = params[P.hold], params[P.speed], params[P.length]
    learn, deficit, g = params[P.learning], params[P.deficit], params[P.g]
    frozen, astray, tug = params[P.frozen], params[P.astray], params[P.tug]
    keep = decay(dt, params[P.filter])
    if memory[M.changed] > 0.0:
        memory[M.changed] += dt
        since, grace = memory[M.changed], params[P.grace]
        if _turning(n, ends) > TUMBLES:
            memory[M.tumbled] = since
        hangs = memory[M.tumbled] == 0.0 or since > memory[M.tumbled] + CALM
        if since > LONGEST * grace or (since > grace and hangs):
            memory[M.changed] = memory[M.tumbled] = 0.0
    settles = memory[M.changed] > 0.0
    moving = windy = across = along = 0.0
    for i in range(n):
        o = M.rows + M.width * i
        m = params[P.rows + P.width * i + P.m]
        x, y, z = (
            ends[i, 0, 0] - positions[i, 0], ends[i, 0, 1] - positions[i, 1],
            ends[i, 0, 2] - positions[i, 2],
        )  # fmt: skip
        d = max(math.sqrt(x * x + y * y + z * z), 1e-9)
        alpha = (x / d, y / d, z / d)
        axis = quaternion.third_axis(
            attitudes[i, 0], attitudes[i, 1], attitudes[i, 2], attitudes[i, 3]
        )
        if memory[o + M.started] == 0.0:
            memory[o + M.started] = 1.0
            memory[o + M.length] = memory[o + M.distance] = d
            memory[o + M.reeled] = sees.reeled[i, 0]
            for k in range(3):
                memory[o + M.velocity + k] = velocities[i, k]
        # What a winch pays out is no sign.
        memory[o + M.length] += sees.reeled[i, 0] - memory[o + M.reeled]
        memory[o + M.reeled] = sees.reeled[i, 0]
        went, speed = 0.0, -sees.reeled[i, 1]
        for k in range(3):
            speed += alpha[k] * (ends[i, 1, k] - velocities[i, k])
            expected = (thrusts[i] * axis[k] + tensions[i] * alpha[k]) / m
            if k == 2:
                expected -= g
            # Both through the same filter: what is new in the speed, over the step, is the filtered acceleration.
            fresh = (1.0 - keep) * (velocities[i, k] - memory[o + M.velocity + k])
            memory[o + M.expected + k] = keep * memory[o + M.expected + k] + (1.0 - keep) * expected
            memory[o + M.velocity + k] += fresh
            memory[o + M.lack + k] = memory[o + M.expected + k] - fresh / dt
            went += velocities[i, k] * velocities[i, k]
        memory[o + M.speed] = keep * memory[o + M.speed] + (1.0 - keep) * speed
        memory[o + M.distance] = keep * memory[o + M.distance] + (1.0 - keep) * d

        # A taut cable keeps its length, which is learned while it does; a slack one says nothing of it.
        changing = abs(memory[o + M.speed]) > fast
        memory[o + M.now] = 1.0 if changing else 0.0
        moving += memory[o + M.now]
        stretch = memory[o + M.distance] - memory[o + M.length]
        if abs(memory[o + M.speed]) < 0.5 * fast and stretch > -longer:
            memory[o + M.steady] = min(memory[o + M.steady] + dt, learn)
            memory[o + M.length] += dt / memory[o + M.steady] * stretch
        known = memory[o + M.steady] > 0.5 * learn
        apart = changing and memory[o + M.speed] > 0.0 and speed > BRAKED * memory[o + M.speed]
        apart = apart and known and stretch > longer and not settles
        memory[o + M.cable] = memory[o + M.cable] + dt if apart else 0.0

        still = True
        for k in range(2):
            age = sees.estimated_ages[i, k]
            if newer(memory, o + M.ages + k, age, dt):
                still = False
            memory[o + M.ages + k] = age
        memory[o + M.still] = memory[o + M.still] + dt if still else 0.0
        went = math.sqrt(went) * memory[o + M.still]

        # Who is under suspicion says nothing of the wind.
        trusted = memory[o + M.thrust] == 0.0 and not apart and memory[o + M.still] <= hold
        memory[o + M.counts] = 1.0 if trusted else 0.0
        windy += memory[o + M.counts]
        across += memory[o + M.counts] * memory[o + M.lack]
        along += memory[o + M.counts] * memory[o + M.lack + 1]
        if 0.0 < frozen <= memory[o + M.still] or 0.0 < astray <= went:
            carrying[i] = 0.0
    for i in range(n):
        o = M.rows + M.width * i
        m = params[P.rows + P.width * i + P.m]
        axis = quaternion.third_axis(
            attitudes[i, 0], attitudes[i, 1], attitudes[i, 2], attitudes[i, 3]
        )
        lacking = _lacking(i, axis, windy, across, along, memory)
        weak = thrusts[i] > 0.0 and m * lacking > deficit * max(thrusts[i], 0.5 * m * g)
        weak = weak and not settles
        memory[o + M.thrust] = memory[o + M.thrust] + dt if weak else 0.0
        # If most distances change, it is the load that is seen wrongly, or let go.
        if memory[o + M.cable] >= hold and (n == 1 or 2.0 * moving <= n):
            carrying[i] = 0.0
        # A drone that falls lets its cable go slack; as long as that is taut, it may pull more than it should.
        loose = (
            memory[o + M.speed] < -0.5 * fast
            or memory[o + M.distance] < memory[o + M.length] - longer
        )
        if memory[o + M.thrust] >= (hold if n == 1 or loose else max(hold, tug)):
            carrying[i] = 0.0


class Residuals(DetectionPart):
    """A cable is gone when its ends move apart; a drone is gone when its acceleration lacks its thrust.

    First: the distance between the ends of a cable is constant while the cable is taut, whatever the wind and the
    masses. It grows beyond the learned length, at some speed, when the cable is cut. If that of more than half of
    the team changes, the load's sensors are suspected instead and no cable is. Ends that slow down have been caught
    by their cable; late measurements, carried forward, overshoot its length meanwhile.

    Second: along its thrust, a drone's filtered acceleration is compared with what commanded thrust, wanted
    tension and weight would give (a momentum observer; De Luca and Mattone, ICRA 2005). The wind is part of the
    difference. It blows level and on all alike, so what the other drones lack in the level, on average, is taken
    from it; who is under suspicion does not count among them. A drone with no such others is judged by what it
    lacks upwards. A cable that pulls more than it should looks the same, but only while it is taut: a drone that falls
    slackens its cable. One that does not is given up only after ``tug``, unless it is alone.

    Third: a drone of whose place and attitude nothing new comes is not measured any more when its own speed says that it
    went on for ``astray`` meanwhile, or, where asked for, after a while (``frozen``).
    """

    kernel = judge
    remembers = MEMORY

    filter: Annotated[float, Field(ge=0.002, le=1.0)] = 0.03
    """Time constant of the filters, s."""
    hold: Annotated[float, Field(ge=0.0, le=1.0)] = 0.01
    """Time for which a sign must last, s."""
    speed: Annotated[float, Field(gt=0.0, le=10.0)] = 0.12
    """Speed at which the ends of a cable move apart, m/s."""
    length: Annotated[float, Field(ge=0.0, le=10.0)] = 0.004
    """Length by which they do, m."""
    learning: Annotated[float, Field(gt=0.0, le=100.0)] = 1.0
    """Time over which a cable's length is averaged, s; after half of it the cable is watched."""
    deficit: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.45
    """Share of the commanded thrust that lacks."""
    frozen: Annotated[float, Field(ge=0.0, le=10.0)] = 0.0
    """Time for which nothing new of a drone comes, s; 0: not looked at."""
    astray: Annotated[float, Field(ge=0.0, le=10.0)] = 0.1
    """Distance that a drone would have gone at its speed while nothing new of it comes, m; 0: not looked at."""
    tug: Annotated[float, Field(ge=0.0, le=10.0)] = 0.2
    """Time for which thrust must lack on a cable that stays taut, s."""

    grace: Annotated[float, Field(ge=0.0, le=100.0)] | None = None
    """Time after a change of the team for which neither cables nor thrusts are judged, s; while the load tumbles up to four times as long. None: 4 with a
    rigid load, whose cables go slack and come taut until it hangs on those that are left; else none."""

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        kept = super().carry_over(old, fresh, places)
        MEMORY.view(kept, "changed")[:], MEMORY.view(kept, "tumbled")[:] = SOON, 0.0
        return kept

    def grace_of(self, team: Team) -> float:
        """The grace for this team, s."""
        return (0.0 if team.body is None else GRACE) if self.grace is None else self.grace

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, filter=self.filter, hold=self.hold, speed=self.speed, length=self.length,
            learning=self.learning, deficit=self.deficit, frozen=self.frozen, g=team.gravity,
            astray=self.astray, tug=self.tug, m=team.masses, grace=self.grace_of(team),
        )  # fmt: skip
