"""Observers of momentum: of the whole team, which needs no tension, and of each drone across its cable."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from colift.control.observation.base import SIGNATURE, ObservationPart
from colift.control.tuning import Delays
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import quaternion, rotors
from colift.kernel.math.small import solve_symmetric
from colift.kernel.math.smooth import decay
from colift.part import Places, Setup, Vector
from colift.team import Team

PARAMS = Layout(
    team={
        "g": 1, "m_L": 1, "total": 1, "own": 1, "limit": 1, "lag": 1, "delay": 1, "breeze": 1,
        "rotors": 1, "learn": 1, "doubt": 1, "middle": 1,
    },
    drone={"m": 1, "drag": 1, "L": 1},
)  # fmt: skip
"""Bandwidths of the observers of the ``total`` momentum and of each drone's ``own``, 1/s; ``limit`` over weight;
``middle``: by how much of a period before its end what acts in it is taken."""
MEMORY = Layout(
    team={"started": 1, "momentum": 3, "common": 3, "wind": 3, "led": 1},
    drone={
        "here": 1, "carried": 3, "own": 3, "felt": 3, "direction": 3, "thrust": 1, "apart": 3,
        "length": 1, "known": 1, "wrong": 1, "pull": 1, "pulled": 1,
    },
)  # fmt: skip
"""``momentum`` and ``own``: as far as explained; of a drone that is ``here`` what it has ``carried`` of the whole, so that who leaves
takes it along; ``felt``: force beyond thrust, weight and the wanted pull; ``common``: per mass;
``apart``: by how much what a drone felt while its cable was slack differs from what all felt in common; ``length`` found beyond
the one told, time for which it is ``known``, whether it is ``wrong`` enough to be used; ``pull`` along the cable
by specific force, and whether there is any (``pulled``); whether the load has been ``led`` off the ground."""
P, M = PARAMS.at, MEMORY.at

DOUBT = 0.05
"""Difference from the common wind, in g, from which the observation of a drone counts for little."""

PULLS = 0.25
"""Share of the wanted tension from which on a cable counts as taut."""
PROMPT = 0.05
"""Time constant of the tension by which that is judged, s."""
STEADY = 0.1
"""Speed at which the ends of a taut cable may seem to part, m/s."""
MIDDLE = 0.5
"""Of a rigid load, and where the cables are planned: there thrusts are led by half a period so that they are right on average, and what has acted in a period
is that of its middle. Of another point they are not, act as much later, and are observed as late: a correction of half of it would be a force on the load."""
FIRST = 0.05
"""Time over which a length is known by before it is used, s."""

Drag = Annotated[float, Field(ge=0.0, le=1.0)]

MOST = 40.0
"""Most wind that is believed along an axis, m/s."""


@inline
def _common(n, params, memory):  # type: ignore[no-untyped-def]
    """The force per mass that all drones feel alike, by weighted least squares of what they feel across their cables.

    Whose observation differs much from the last answer counts for little (Cauchy's weight): it has troubles of its own.
    """
    c = M.common
    xx = yy = zz = 1e-6
    xy = xz = yz = bx = by = bz = 0.0
    scale = DOUBT * max(params[P.g], 1e-3)
    for i in range(n):
        o, m = M.rows + M.width * i, params[P.rows + P.width * i + P.m]
        a, d = o + M.direction, o + M.felt
        ax, ay, az = memory[a], memory[a + 1], memory[a + 2]
        dx, dy, dz = memory[d] / m, memory[d + 1] / m, memory[d + 2] / m
        rx, ry, rz = dx - memory[c], dy - memory[c + 1], dz - memory[c + 2]
        along = ax * dx + ay * dy + az * dz
        strange = ax * rx + ay * ry + az * rz
        s = 1.0 / (1.0 + (rx * rx + ry * ry + rz * rz - strange * strange) / (scale * scale))
        xx, yy, zz = xx + s * (1.0 - ax * ax), yy + s * (1.0 - ay * ay), zz + s * (1.0 - az * az)
        xy, xz, yz = xy - s * ax * ay, xz - s * ax * az, yz - s * ay * az
        bx, by, bz = (
            bx + s * (dx - along * ax),
            by + s * (dy - along * ay),
            bz + s * (dz - along * az),
        )
    return solve_symmetric(xx, xy, xz, yy, yz, zz, bx, by, bz)


@inline
def _feel(i, dt, sees, params, memory):  # type: ignore[no-untyped-def]
    """Tension of cable i beside what is common, and not taken for wind: by specific force, at once; without one as observed, by and by."""
    p, o, v = P.rows + P.width * i, M.rows + M.width * i, sees.estimated_velocities
    f, q, m = sees.measured_specific_forces[i], sees.estimated_attitudes, params[p + P.m]
    tension = sees.received_tensions[i]
    if f[0] == 0.0 and f[1] == 0.0 and f[2] == 0.0:  # nobody measures it
        for k in range(3):
            strange = memory[o + M.felt + k] - memory[o + M.apart + k] - m * memory[M.common + k]
            tension += memory[o + M.direction + k] * strange
        return tension
    world = quaternion.into_world(q[i, 0], q[i, 1], q[i, 2], q[i, 3], f[0], f[1], f[2])
    known = rotors.force_of(
        i, memory[o + M.thrust], q, sees.estimated_rates, params[P.delay], params[p + P.drag],
        memory[M.wind : M.wind + 3], v,
    )  # fmt: skip
    pull = 0.0
    for k in range(3):
        strange = m * (world[k] - memory[M.common + k]) - known[k]
        pull += memory[o + M.direction + k] * strange
    keep = decay(dt, PROMPT) if memory[o + M.pulled] != 0.0 else 0.0
    memory[o + M.pull] = keep * memory[o + M.pull] + (1.0 - keep) * pull
    if memory[o + M.pulled] != 0.0:
        tension = memory[o + M.pull]
    memory[o + M.pulled] = 1.0
    return tension


@kernel(SIGNATURE)
def _measure(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    """Learn how much longer than told each cable is, while it is taut."""
    x, v, ends = sees.estimated_positions, sees.estimated_velocities, sees.estimated_ends
    dt, n = now.dt, x.shape[0]
    for i in range(n):
        p, o = P.rows + P.width * i, M.rows + M.width * i
        size = speed = 0.0
        for k in range(3):
            size += (ends[i, 0, k] - x[i, k]) ** 2
            speed += memory[o + M.direction + k] * (ends[i, 1, k] - v[i, k])
        T, tension = sees.received_tensions[i], _feel(i, dt, sees, params, memory)
        taut = tension > PULLS * T and T > 0.0 and abs(speed - sees.reeled[i, 1]) < STEADY
        if taut and sees.lift_share[0] >= 1.0:
            memory[o + M.known] = min(memory[o + M.known] + dt, params[P.learn])
            more = math.sqrt(size) - params[p + P.L] - sees.reeled[i, 0]
            memory[o + M.length] += dt / memory[o + M.known] * (more - memory[o + M.length])
        doubtful = abs(memory[o + M.length]) > params[P.doubt] * params[p + P.L]
        if doubtful and memory[o + M.known] >= FIRST:
            memory[o + M.wrong] = 1.0
        if memory[o + M.wrong] != 0.0:
            writes.found_lengths[i] = memory[o + M.length]


@kernel(SIGNATURE)
def _observe(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    load, x, v = sees.estimated_load, sees.estimated_positions, sees.estimated_velocities
    q, Omega, thrusts = sees.estimated_attitudes, sees.estimated_rates, sees.thrusts
    ends = sees.estimated_ends
    T, forces, wind = sees.received_tensions, writes.estimated_forces, writes.estimated_wind
    n = x.shape[0]
    middle = params[P.middle] if math.isnan(sees.nominal_forces[0, 0, 0]) else MIDDLE
    g, m_L = params[P.g], params[P.m_L]
    total, own, delay = params[P.total], params[P.own], params[P.delay]
    lag = decay(dt, params[P.lag])
    stands, held = sees.standing[n] != 0.0, sees.held_forces
    fresh = memory[M.started] == 0.0
    memory[M.started] = 1.0
    if fresh and stands:  # a team that takes off measures its cables when it hooks them
        memory[M.led] = 1.0
    weight = pull_of_wind = 0.0
    for i in range(n):
        o, m = M.rows + M.width * i, params[P.rows + P.width * i + P.m]
        weight += m * g
        # Along the cable wind cannot be told from tension.
        size = 0.0
        for k in range(3):
            memory[o + M.direction + k] = ends[i, 0, k] - x[i, k]
            size += memory[o + M.direction + k] ** 2
        size = 1.0 / math.sqrt(max(size, 1e-12))
        for k in range(3):
            memory[o + M.direction + k] *= size
        joins = memory[o + M.here] == 0.0
        memory[o + M.here] = 1.0
        if joins:
            memory[o + M.thrust] = thrusts[i]
            for k in range(3):
                memory[o + M.own + k] = m * v[i, k]
                memory[M.momentum + k] += m * v[i, k]
        else:
            before = memory[o + M.thrust]
            thrust = lag * before + (1.0 - lag) * thrusts[i]
            memory[o + M.thrust] = thrust
            thrust += middle * (before - thrust)
            drag = params[P.rows + P.width * i + P.drag]
            pull_of_wind += drag * thrust
            breeze = memory[M.wind : M.wind + 3]
            age = delay - middle * dt
            force = rotors.force_of(i, thrust, q, Omega, age, drag, breeze, v)
            for k in range(3):
                known = force[k] - (m * g if k == 2 else 0.0)
                memory[M.momentum + k] += dt * known
                pull = T[i] * memory[o + M.direction + k]
                memory[o + M.own + k] += dt * (known + pull + memory[o + M.felt + k])
                memory[o + M.felt + k] = own * (m * v[i, k] - memory[o + M.own + k])
        for k in range(3):
            memory[o + M.carried + k] = m * v[i, k]
        if stands:  # the cable's pull is not what is told, the ground's not to be learned
            for k in range(3):
                memory[o + M.felt + k] = held[i, k]
                memory[o + M.own + k] = m * v[i, k] - held[i, k] / own
    cx, cy, cz = _common(n, params, memory)
    common = (cx, cy, cz)
    if pull_of_wind > 0.0 and not stands:
        # What is common is wind, by and by, and rotors drag in it in proportion to their thrust.
        share = dt * params[P.breeze] * weight / (max(g, 1e-3) * pull_of_wind)
        for k in range(2):
            modelled = pull_of_wind * memory[M.wind + k] * max(g, 1e-3) / weight
            total_push = common[k] + modelled
            memory[M.wind + k] += share * (params[P.rotors] * total_push - modelled)
            memory[M.wind + k] = min(max(memory[M.wind + k], -MOST), MOST)
    for k in range(3):
        wind[k] = memory[M.wind + k]
    bound = params[P.limit] * weight
    size = 0.0
    for k in range(3):
        memory[M.common + k] = common[k]
        momentum = m_L * load[1, k]
        for i in range(n):
            momentum += params[P.rows + P.width * i + P.m] * v[i, k]
        if stands:
            known = 0.0
            for i in range(n + 1):
                known += held[i, k]
            memory[M.momentum + k] = momentum - known / total
        elif fresh:
            memory[M.momentum + k] = momentum
        else:
            memory[M.momentum + k] -= dt * m_L * g if k == 2 else 0.0
        forces[n, k] = total * (momentum - memory[M.momentum + k])
        size += forces[n, k] ** 2
    shrink = bound / math.sqrt(size) if size > bound * bound else 1.0
    for k in range(3):
        if shrink < 1.0:
            memory[M.momentum + k] += (1.0 - shrink) * forces[n, k] / total
            forces[n, k] *= shrink
        memory[M.momentum + k] += dt * forces[n, k]
    for i in range(n):
        o, m = M.rows + M.width * i, params[P.rows + P.width * i + P.m]
        along = 0.0
        for k in range(3):
            if stands:
                memory[o + M.apart + k] = held[i, k] - m * common[k]
            usual = m * common[k] + memory[o + M.apart + k]
            along += memory[o + M.direction + k] * (usual - memory[o + M.felt + k])
        size = 0.0
        if stands:
            along = 0.0
        for k in range(3):
            forces[i, k] = memory[o + M.felt + k] + along * memory[o + M.direction + k]
            size += forces[i, k] ** 2
        bound = params[P.limit] * m * g
        shrink = bound / math.sqrt(size) if size > bound * bound else 1.0
        for k in range(3):
            forces[i, k] *= shrink
            forces[n, k] -= forces[i, k]
    if params[P.learn] > 0.0 and not stands and memory[M.led] == 0.0:
        _measure(now, sees, params, memory, writes)


class Momentum(ObservationPart, Delays):
    """What drives the team as a whole, and of it the wind on each drone; the load has the rest.

    ``D = w (P - Phat)`` with ``P = sum m_i v_i + m_L v_L`` and ``dPhat/dt = sum u_i - M g e3 + D`` (a momentum observer,
    De Luca and Mattone 2003): cables pull at both of their ends, so no tension enters. A wrong mass of the load is part of D.
    An observer of each drone's own momentum finds what it feels beyond thrust, weight and the wanted pull: across the cable that is wind,
    along it nobody can tell wind from tension. That part is filled in from the wind per mass that all feel alike, and from what
    each drone felt beside that while its cable was slack, if it ever was.

    Each drone also measures its cable: how far the load's end is while the cable is taut, which it is where its accelerometer (or,
    without one, the observer) feels at least a quarter of the wanted tension and the ends do not part. A length that differs from the told one by more than ``length_doubt`` takes its place
    (``found_lengths``); a smaller difference is left to stretch, sag and the sensors.
    """

    kernel = _observe
    remembers = MEMORY

    paced_by = "position_control"
    per_drone = ("rotor_drag",)
    from_team: ClassVar[Mapping[str, float | None]] = {"rotor_drag": 0.0}

    total: Annotated[float, Field(gt=0.0, le=5.0)] = 1.2
    """Bandwidth of the observer of the whole momentum over that of the velocity loop."""
    own: Annotated[float, Field(gt=0.0, le=5.0)] = 1.2
    """Bandwidth of that of each drone, likewise. As fast as that of the whole: what one knows before the other is taken for a
    force on the load."""
    rotor_drag: Drag | list[Drag] | None = None
    """Force in the rotors' plane per thrust and speed across it, s/m. None: ``drones.rotor_drag``, or none."""
    breeze: Annotated[float, Field(gt=0.0, le=5.0)] = 0.15
    """How fast what all drones feel is taken for wind in their rotors, over the bandwidth of the velocity loop."""
    rotors: Annotated[float, Field(gt=0.0, le=1.0)] = 0.7
    """Share of what all drones feel that is the drag of rotors and not of bodies."""
    learning: Annotated[float, Field(ge=0.0, le=100.0)] = 2.0
    """Time over which the length of each cable is averaged while it is taut, s; 0: told lengths are believed."""
    length_doubt: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.03
    """Share of a cable's length by which it must be found longer or shorter than is told before what is found is used."""
    limit: Annotated[float, Field(ge=0.0, le=10.0)] = 1.2
    """Bound on a force over the drone's weight; on that of all, over the weight of all."""

    def left_open(self, team: Team) -> dict[str, Vector]:
        return {"rotor_drag": team.rotor_drags}

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        yield from self.delay_warnings(mission, "position_control")

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        kept = super().carry_over(old, fresh, places)
        gone = np.setdiff1d(np.arange(MEMORY.view(old, "here").shape[0]), places)
        MEMORY.view(kept, "momentum")[:] -= MEMORY.view(old, "carried")[gone].sum(axis=0)
        return kept

    def watching(self, team: Team) -> tuple[float, float]:
        velocity = self.bandwidths(team).velocity
        return self.total * velocity, self.own * velocity

    def axis_delay(self) -> float:
        return self.delay if self.predicted else 0.0

    def params(self, team: Team) -> Vector:
        velocity = self.bandwidths(team).velocity
        return PARAMS.pack(
            team.n, g=team.gravity, m_L=team.load_mass, total=self.total * velocity,
            own=self.own * velocity, drag=self.settled("rotor_drag", team),
            breeze=self.breeze * velocity, rotors=self.rotors, limit=self.limit, lag=self.lag,
            delay=self.delay if self.predicted else 0.0, m=team.masses,
            learn=self.learning, doubt=self.length_doubt, L=team.cable_lengths,
            middle=MIDDLE if team.body is not None else 0.0,
        )  # fmt: skip
