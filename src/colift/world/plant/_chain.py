"""Cables as chains of springs that only pull, with or without masses between them.

A cable is ``k + 1`` equal segments with ``k`` beads between; the ends are the drone and the load. A segment that is
longer than its share ``l`` of the cable by ``s`` pulls with ``max(0, (EA / l) (s + tau ds/dt))``. The state of load and
drones is followed by 6 numbers per bead, position and velocity, drone by drone.

Waves along a cable are so much faster than anything else that viscous damping, which grows with frequency as no
braid's does, would dictate the step for their sake. So a segment is damped by its own rate only as far as the undamped
waves' step allows; the rest of ``tau`` acts on the mean rate of the cable's segments, which is how load and drone bounce.
It takes energy, too: where it would push, it is cut for all segments alike. On a bent cable it moves beads as well, and is
limited to what the step can follow.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math.columns import column
from colift.kernel.math.winch import turning
from colift.part import Places, Vector
from colift.team import Team
from colift.team.geometry import matrix_of
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
    normalise,
    parting_speed,
    raise_peaks,
    runge_kutta,
    state_size,
    wind,
    yielding,
)
from colift.world.plant._contact import (
    anchors_of,
    contact_size,
    press,
    rate,
    rub,
    settle,
    spare_of,
    touch,
)
from colift.world.plant._load import end_place, end_speed, push_end
from colift.world.plant._params import P
from colift.world.plant.base import STEP_SIGNATURE, Start

BEAD = 6
STIFFEST = 1e9
CABLES = Layout(drone={"stiffness": 1, "damping": 1, "together": 1, "bead_mass": 1, "drag": 1})
"""Parameters of each cable, after those of the bodies: stiffness of a segment, its damping by its own rate and (``together``)
by the mean rate of its cable's segments."""
C = CABLES.at
CABLE: int = C.width
SCRATCH = Layout(drone={"T": 1, "parting": 1, "length": 1, "rate": 1, "bend": 1})
"""In columns, behind the state and three of its size for the integrator."""
SPANS = SCRATCH.spans
COURANT = 1.5
"""Substep times the fastest rate; the integrator is stable to 2.6 at least."""
MILD = 0.5
"""Substep times the rate at which damping of the mean rate may slow it down."""
SHORTEST = 1e-6
"""Shortest substep that a plant may ask for, s."""


@inline
def segment(y, a, b, i, params):  # type: ignore[no-untyped-def]
    """Unit vector from node a to node b, their distance, and its rate; node 0 is the end of cable i on the load."""
    px, py, pz, vx, vy, vz = y[b], y[b + 1], y[b + 2], y[b + 3], y[b + 4], y[b + 5]
    if b == 0:
        px, py, pz = end_place(i, y, params)
        vx, vy, vz = end_speed(i, y, params)
    x, y_, z = px - y[a], py - y[a + 1], pz - y[a + 2]
    d = math.sqrt(x * x + y_ * y_ + z * z)
    scale = 1.0 / max(d, 1e-12)
    x *= scale
    y_ *= scale
    z *= scale
    rate = x * (vx - y[a + 3]) + y_ * (vy - y[a + 4]) + z * (vz - y[a + 5])
    return x, y_, z, d, rate


@inline
def rest(y, o, w, params, dy):  # type: ignore[no-untyped-def]
    """Add to the derivative what the ground does to the bead at ``o``, per mass; friction only brakes it, without an anchor."""
    N = press(1.0, params[P.height] - y[o + 2], -y[o + 5], w, params[P.damping])
    fx, fy = rub(1.0, 0.0, 0.0, y[o + 3], y[o + 4], w, params[P.friction] * N)
    dy[o + 3] += fx
    dy[o + 4] += fy
    dy[o + 5] += N


@inline
def derivative(  # type: ignore[no-untyped-def]
    n,
    k,
    y,
    thrusts,
    torques,
    external,
    moment,
    attached,
    longest,
    anchors,
    w,
    params,
    lengths,
    rates,
    T,
    forces,
    dy,
):
    """Time derivative of the state; fills the tensions ``T`` at the load's end and the ground's ``forces``.

    Cables have these ``lengths``, which grow at ``rates``: what is wound up stretches no more.
    """
    free_motion(n, y, thrusts, torques, external, moment, params, dy)
    grounded, rigid = params[P.ground] > 0.0, params[P.rigid] > 0.0
    if grounded:
        touch(n, y, anchors, w, params, forces, dy)
    beads, cables = LOAD + DRONE * n, MASS + BODY * n
    wind = cables + CABLE * n
    for i in range(n):
        c = cables + CABLE * i
        stiffer = params[MASS + BODY * i + 1] / lengths[i]
        stiffness, damping = stiffer * params[c + C.stiffness], stiffer * params[c + C.damping]
        together, bead_mass = stiffer * params[c + C.together], params[c + C.bead_mass]
        drag = params[c + C.drag]
        length, growth = lengths[i] / (k + 1), rates[i] / (k + 1)
        for j in range(k):
            o = beads + BEAD * (k * i + j)
            dy[o], dy[o + 1], dy[o + 2] = y[o + 3], y[o + 4], y[o + 5]
            dy[o + 3], dy[o + 4], dy[o + 5] = 0.0, 0.0, -params[1]
            if grounded and y[o + 2] < params[P.height]:
                rest(y, o, w, params, dy)
        T[i] = 0.0
        segments = k + 1 if attached[i] > 0.0 else k
        common = 0.0
        if together > 0.0 and attached[i] > 0.0:
            least, total = math.inf, 0.0
            px = py = pz = 0.0
            bend = 0.0
            a = LOAD + DRONE * i
            for j in range(k + 1):
                b = beads + BEAD * (k * i + j) if j < k else 0
                x, y_, z, d, rate = segment(y, a, b, i, params)
                total += rate - growth
                least = min(least, d - length)
                if j > 0:
                    bend += (x - px) ** 2 + (y_ - py) ** 2 + (z - pz) ** 2
                px, py, pz = x, y_, z
                a = b
            if least > 0.0:
                yields = 1.0 / params[0]
                if rigid:
                    yields = yielding(i, y, px, py, pz, params)
                mobility = 1.0 / params[MASS + BODY * i] + bend / bead_mass + yields
                together = min(together, MILD * (k + 1) / (longest * mobility))
                common = max(together * total / (k + 1), -stiffness * least)
        a, mass_a = LOAD + DRONE * i, params[MASS + BODY * i]
        for j in range(segments):
            b, mass_b = beads + BEAD * (k * i + j), bead_mass
            if j == k:
                b, mass_b = 0, params[0]
            x, y_, z, d, rate = segment(y, a, b, i, params)
            if d > length:
                pull = max(0.0, stiffness * (d - length) + damping * (rate - growth) + common)
                fx, fy, fz = pull * x, pull * y_, pull * z
                dy[a + 3] += fx / mass_a
                dy[a + 4] += fy / mass_a
                dy[a + 5] += fz / mass_a
                dy[b + 3] -= fx / mass_b
                dy[b + 4] -= fy / mass_b
                dy[b + 5] -= fz / mass_b
                if j == k:
                    T[i] = pull
                    if rigid:
                        push_end(i, -fx, -fy, -fz, y, params, dy)
            if (
                drag > 0.0
            ):  # across the segment, by the air's speed past its middle; half to each end
                far = (y[b + 3], y[b + 4], y[b + 5])
                if j == k:
                    far = end_speed(i, y, params)
                vx = params[wind] - 0.5 * (y[a + 3] + far[0])
                vy = params[wind + 1] - 0.5 * (y[a + 4] + far[1])
                vz = params[wind + 2] - 0.5 * (y[a + 5] + far[2])
                along = vx * x + vy * y_ + vz * z
                vx -= along * x
                vy -= along * y_
                vz -= along * z
                half = 0.5 * drag * d * math.sqrt(vx * vx + vy * vy + vz * vz)
                dy[a + 3] += half * vx / mass_a
                dy[a + 4] += half * vy / mass_a
                dy[a + 5] += half * vz / mass_a
                dy[b + 3] += half * vx / mass_b
                dy[b + 4] += half * vy / mass_b
                dy[b + 5] += half * vz / mass_b
                if rigid and j == k:
                    push_end(i, half * vx, half * vy, half * vz, y, params, dy)
            a, mass_a = b, mass_b


@inline
def note_catches(n, y, attached, T, params, lengths, rates, parting, catch_impulses):  # type: ignore[no-untyped-def]
    """Keep how fast the ends of each slack cable part (-1 while taut), and the catch when they are its length apart.

    Beads pull a little before that: what counts is the speed before they did.
    """
    for i in range(n):
        if parting[i] < 0.0 and T[i] > 0.0:
            continue
        x, y_, z, d = line(i, y, params)
        if attached[i] == 0.0:
            parting[i] = 0.0
        elif d > lengths[i]:
            if parting[i] > 0.0:
                catch_impulses[i] = max(catch_impulses[i], catch_impulse(i, y, parting[i], params))
            parting[i] = -1.0
        else:
            vx, vy, vz = parting_speed(i, y, params)
            along = x * vx + y_ * vy + z * vz - rates[i]
            free = T[i] == 0.0 or along <= 0.0
            parting[i] = max(along, 0.0 if free else parting[i])


@kernel(STEP_SIGNATURE)
def _step(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    thrusts, torques, external = sees.applied_thrusts, sees.applied_torques, sees.external_forces
    moment = sees.external_moment
    attached = sees.attached
    tensions, peak_tensions = writes.tensions, writes.peak_tensions
    catch_impulses, slack_times = writes.catch_impulses, writes.slack_times
    n = thrusts.shape[0]
    k, longest = int(params[params.shape[0] - 1]), params[params.shape[0] - 2]
    size = LOAD + DRONE * n + BEAD * k * n
    y = memory[:size]
    begin = memory[size : 2 * size]
    total = memory[2 * size : 3 * size]
    slope = memory[3 * size : 4 * size]
    T = column(memory, 4 * size, n, SPANS.T)
    parting = column(memory, 4 * size, n, SPANS.parting)
    L, rates = column(memory, 4 * size, n, SPANS.length), column(memory, 4 * size, n, SPANS.rate)
    bends = column(memory, 4 * size, n, SPANS.bend)
    winches, moving = sees.winches, turning(n, sees.winches, now.time, dt)
    wind(n, winches, now.time, params, L, rates, bends)
    shortest = 1.0
    for i in range(n):  # a shorter cable is stiffer
        shortest = min(shortest, L[i] / params[MASS + BODY * i + 1])
    longest *= math.sqrt(max(shortest, 1e-6))
    substeps = math.ceil(dt / longest)
    h = dt / substeps
    anchors, w, forces = anchors_of(memory, n), rate(h), writes.ground_forces
    for substep in range(substeps):
        for m in range(size):
            begin[m] = y[m]
        for stage in range(4):
            if moving:
                at = now.time + (substep + STAGES[stage]) * h
                wind(n, winches, at, params, L, rates, bends)
            derivative(
                n, k, y, thrusts, torques, external, moment, attached, longest, anchors, w, params, L, rates,
                T, forces, slope,
            )  # fmt: skip
            runge_kutta(stage, size, h, begin, slope, total, y)
            if stage > 0:
                continue
            forces = spare_of(memory, n)
            raise_peaks(n, T, peak_tensions)
            note_catches(n, begin, attached, T, params, L, rates, parting, catch_impulses)
            for i in range(n):
                if substep == 0:
                    tensions[i] = T[i]
                if T[i] == 0.0 and attached[i] > 0.0:
                    slack_times[i] += h
        normalise(n, params, y)
        if params[P.ground] > 0.0:
            settle(n, begin, y, w, params, anchors, writes.touch_speeds)


def level_arc(
    a: NDArray[np.float64], b: NDArray[np.float64], length: float, k: int
) -> NDArray[np.float64]:
    """Points (k, 3) that divide a cable of this length from ``a`` to ``b`` into chords of a circle, all equal, bent to a side.

    The circle's chords ``l`` and the distance ``D`` of the ends see its centre under ``phi / (k + 1)`` and ``phi``; the half angle
    follows from ``sin(phi / 2) / sin(phi / 2 / (k + 1)) = D / l``, which falls from k + 1 to 0.
    """
    m, along = k + 1, b - a
    D = float(np.linalg.norm(along))
    low, high = 0.0, math.pi
    for _ in range(60):
        half = 0.5 * (low + high)
        low, high = (
            (half, high) if math.sin(half) * length > D * m * math.sin(half / m) else (low, half)
        )
    radius = 0.5 * length / m / math.sin(half / m)
    ahead = along / D if D > 1e-9 else np.array([1.0, 0.0, 0.0])
    side = np.cross([0.0, 0.0, 1.0], ahead)
    size = np.linalg.norm(side)
    side = side / size if size > 1e-9 else np.array([0.0, 1.0, 0.0])
    angle = half * (2.0 * np.arange(1, m) / m - 1.0)[:, None]
    bow = radius * (np.cos(angle) - math.cos(half))
    return np.asarray(0.5 * (a + b) + radius * np.sin(angle) * ahead + bow * side)


ROPE = 4e4
"""EA of braided Dyneema of 1 mm, N: about."""
CARRIED = 0.225
"""Load that a rope of 1 mm is taken for, kg: the paper's. Held by one such rope, it stretches it by 0.055 per mille."""
Stiffness = Annotated[float, Field(gt=0.0, le=STIFFEST)]


def rope(team: Team) -> float:
    """EA of a rope as thick as the team's load asks for, N."""
    return min(ROPE * (team.load_mass / CARRIED), STIFFEST)


class ChainPart(BodiesPart):
    """Base of the plants with springs for cables."""

    kernel = _step

    damping_ratio: Annotated[float, Field(ge=0.0, le=1.0)] = 0.02
    """Of drone and load bouncing on one cable."""

    def tautness(self, team: Team) -> Vector:
        """EA of each cable (n,), force per relative stretch, N."""
        raise NotImplementedError

    @property
    def bead_count(self) -> int:
        """Beads per cable."""
        return 0

    @property
    def line_density(self) -> float:
        """Mass of the cables per length, kg/m."""
        return 0.0

    @property
    def line_drag(self) -> float:
        """Drag of the cables per length and squared speed across them, kg/m^2."""
        return 0.0

    @property
    def wind(self) -> tuple[float, float, float]:
        """Velocity of the air around the cables, world, m/s."""
        return (0.0, 0.0, 0.0)

    def _cables(self, team: Team) -> tuple[Team, NDArray[np.float64], float]:
        """The team with the ends' share of the cables' mass, parameters of the cables, longest substep."""
        k, n = self.bead_count, team.n
        share = self.line_density * team.cable_lengths / (k + 1)
        loaded = replace(
            team,
            load_mass=team.load_mass + 0.5 * float(share.sum()),
            masses=team.masses + 0.5 * share,
            body=team.body and team.body.with_masses(team.load_mass, 0.5 * share),
        )
        EA = self.tautness(team)
        stiffness = EA * (k + 1) / team.cable_lengths
        yields = _yields(team)
        bounce = np.sqrt(EA / team.cable_lengths * (1.0 / team.masses + yields))
        delay = 2.0 * self.damping_ratio / bounce
        # Gershgorin: squared rate of a segment's mode, by the segments that share its two ends.
        ends = np.array([n * _yields(loaded) + 1.0 / loaded.masses])
        if k:
            beads = 2.0 / share
            ends = np.array([1.0 / loaded.masses + beads, 2.0 * beads, beads + n * _yields(loaded)])
        fastest = np.sqrt((stiffness * ends).max(axis=0))
        own = np.minimum(delay, 1.0 / fastest)
        cables = CABLES.pack(
            n, stiffness=stiffness, damping=stiffness * own, together=stiffness * (delay - own),
            bead_mass=share, drag=self.line_drag,
        )  # fmt: skip
        return loaded, cables, COURANT / float(fastest.max())

    def params(self, team: Team) -> Vector:
        loaded, cables, longest = self._cables(team)
        tail = [*self.wind, longest, float(self.bead_count)]
        return np.concatenate([super().params(loaded), cables, tail])

    def memory(self, team: Team) -> Vector:
        size = state_size(team.n) + BEAD * self.bead_count * team.n
        return np.zeros(4 * size + SCRATCH.size(team.n) + contact_size(team.n))

    def stretched(self, team: Team, tensions: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(team.cable_lengths * (1.0 + tensions / self.tautness(team)))

    def initial(self, team: Team, start: Start) -> NDArray[np.float64]:
        """Straight cables, as long as the tensions that hold the load make them; slack ones lie in a level arc."""
        team = replace(team, body=self._cables(team)[0].body)
        memory = super().initial(team, start)
        k, first = self.bead_count, state_size(team.n)
        drones = memory[LOAD:first].reshape(team.n, 1, DRONE)
        levers = team.levers @ matrix_of(start.load_attitude).T
        beads = memory[first : first + BEAD * k * team.n].reshape(team.n, k, BEAD)
        if start.places is None:
            down = np.arange(1, k + 1)[:, None] / (k + 1)
            ends = np.tile(memory[:BEAD], (team.n, 1, 1))
            ends[:, 0, :3] += levers
            beads[:] = (1.0 - down) * drones[:, :, :BEAD] + down * ends
        else:
            cables = zip(start.places, memory[:3] + levers, team.cable_lengths, strict=True)
            beads[:, :, :3] = [level_arc(a, b, length, k) for a, b, length in cables]
        return memory

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        width = BEAD * self.bead_count
        now, before = state_size(places.size), state_size(_team_size(old, width))
        beads = fresh[now : now + width * places.size].reshape(-1, BEAD)
        beads += old[:BEAD] - fresh[:BEAD]
        for new, place in enumerate(places):
            if place >= 0:
                begin = before + width * place
                fresh[now + width * new : now + width * (new + 1)] = old[begin : begin + width]
        return super().carry_over(old, fresh, places)

    def check(self, team: Team) -> list[tuple[str, str]]:
        longest = self._cables(team)[2]
        if longest >= SHORTEST:
            return []
        allowed = float(self.tautness(team).max()) * (longest / SHORTEST) ** 2
        return [
            (
                "stiffness",
                f"is so stiff for these masses that it needs steps of {longest:.1g} s, and {SHORTEST:g} s "
                f"is the least; with the other settings at most {allowed:.2g} N",
            )
        ]


def _yields(team: Team) -> NDArray[np.float64]:
    """How far the load's end of each cable yields to a unit impulse (n,), at most, 1/kg."""
    if team.body is None:
        return np.full(team.n, 1.0 / team.load_mass)
    least = float(np.linalg.eigvalsh(team.body.inertia)[0])
    return np.asarray(1.0 / team.load_mass + np.sum(team.levers**2, axis=1) / least)


def _team_size(memory: Vector, width: int) -> int:
    """Drones whose memory this is, with ``width`` numbers for the beads of each."""
    once = 4 * LOAD + contact_size(0)
    each = 4 * (DRONE + width) + SCRATCH.size(1) + contact_size(1) - contact_size(0)
    return (memory.size - once) // each
