"""Hold the places of the formation, and damp the pendulum of a load that hangs on one or two drones."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from colift.control.margins import Places
from colift.control.position_control._aim import AHEAD, AIM_ALONG, aim_along, limit, look_ahead
from colift.control.position_control._cable import (
    CABLE,
    course_of,
    lead,
    size_of,
    swing,
)
from colift.control.position_control._nominal import keep_courses, numbers, plan_pulls, room
from colift.control.position_control.base import SIGNATURE, PositionControlPart
from colift.control.tuning import Delays, pendulum_gains, sway
from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import inertial, rotors
from colift.kernel.math.smooth import decay
from colift.part import Setup, Vector
from colift.team import Team
from colift.team.geometry import Array
from colift.team.load import Pose

PARAMS = Layout(
    team={
        "g": 1, "m_L": 1, "velocity": 1, "stiffness": 1, "band": 1, "frequency": 1,
        "thrust_filter": 1, "max_swing": 1, "max_push": 1, "tangent": 1, "total": 1, "rigid": 1, "lag": 1, "swing": 1,
    },
    drone={"m": 1, "L": 1, "least": 1, "most": 1, "drag": 1},
)  # fmt: skip
"""``band``: bandwidth of the velocity loop, 1/s; thrusts ``least`` and ``most``, N; ``total``: mass of all drones."""
MEMORY = Layout(
    team={"planned": 3},
    drone={
        "started": 1, "direction": CABLE, "aim": AIM_ALONG, "ahead": AHEAD, "jerk": 3, "snap": 3, "change": 9,
        "told": 1, "beside": 1, "tension": 1,
    },
)  # fmt: skip
"""``planned``: thrust vector as far as it is free of noise, where the cables are planned of any feedback; ``change``: pull that the load's motion asks for, two derivatives;
of a rigid load the ``tension`` as it is now, by what was ``told`` last ``beside`` the plan."""
P, M = PARAMS.at, MEMORY.at


Thrust = Annotated[float, Field(gt=0.0, le=1e6)]
Drag = Annotated[float, Field(ge=0.0, le=1.0)]

FULL = 0.95
"""Share of a drone's largest thrust that it is asked for."""
CALM = 0.6
"""Share of the bandwidth and of ``max_push`` that is left while the load stands: when the tensions go, no attitude follows faster."""
SMOOTH, PLANNED = 2.0, 0.5
"""Time constants of the filters of the reference's fourth derivative and of what a plan has of it, in periods."""
IDLE = 0.1
"""Thrust of a drone that stands on the ground, over its weight."""
UNKNOWN = 2.5
"""Most thrust where nobody knows it, over the weight of a drone and its share of the load."""


@inline
def _ask_for(i, share, wanted, dt, keep, memory, o):  # type: ignore[no-untyped-def]
    """What the wanted motion of the end of cable i asks of it, with two derivatives; ``share`` of the load's mass, kg."""
    for k in range(3):
        jerk = wanted[i, 3, k]
        step = 0.0 if memory[o + M.started] == 0.0 else (jerk - memory[o + M.jerk + k]) / dt
        memory[o + M.jerk + k] = jerk
        memory[o + M.snap + k] = keep * memory[o + M.snap + k] + (1.0 - keep) * step
        memory[o + M.change + k] = -share * wanted[i, 2, k]
        memory[o + M.change + 3 + k] = -share * jerk
        memory[o + M.change + 6 + k] = -share * memory[o + M.snap + k]


@inline
def _tension_now(i, told, nominal, memory, o):  # type: ignore[no-untyped-def]
    """Of what is held between two answers only the difference from the plan, which goes on meanwhile."""
    planned, _, _ = size_of(i, nominal)
    if told != memory[o + M.told] or memory[o + M.started] == 0.0:
        memory[o + M.told] = told
        memory[o + M.beside] = told - planned
    memory[o + M.tension] = max(planned + memory[o + M.beside], 0.0)


@inline
def nominal_thrust(i, m, g, span, wanted, nominal, thrust):  # type: ignore[no-untyped-def]
    """What drone i must give where all goes as planned (3,), N."""
    T, T1, T2 = size_of(i, nominal)
    for k in range(3):
        direction, _, turning = course_of(i, k, nominal, T, T1, T2)
        thrust[k] = m * (wanted[i, 2, k] - span * turning) - T * direction
    thrust[2] += m * g


@kernel(SIGNATURE)
def _hold_formation(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    ends, x, v = sees.estimated_ends, sees.estimated_positions, sees.estimated_velocities
    reference, wanted, forces = sees.reference, sees.wanted_ends, sees.estimated_forces
    T, alpha, nominal = sees.received_tensions, sees.received_directions, sees.nominal_forces
    u, thrusts, attitudes = writes.drone_forces, writes.thrusts, writes.desired_attitudes
    spans, courses, reeled = sees.spans, sees.courses, sees.reeled
    found = sees.found_lengths
    rates, planned = writes.desired_rates, memory[M.planned : M.planned + 3]
    n = x.shape[0]
    g, m_L, omega = params[P.g], params[P.m_L], params[P.frequency]
    keep = decay(dt, params[P.thrust_filter])
    # A reference of corners steps in its jerk.
    keep_snap, keep_plan = decay(dt, SMOOTH * dt), decay(dt, PLANNED * dt)
    # By how much what the cables are told to do for the load falls short: the drones do it together.
    short_x = forces[n, 0] - m_L * reference[2, 0]
    short_y = forces[n, 1] - m_L * reference[2, 1]
    short_z = forces[n, 2] - m_L * (reference[2, 2] + g)
    stands = sees.standing[n] != 0.0
    if params[P.rigid] > 0.0:
        own, kept = params[P.rows + P.width * n :], memory[M.rows + M.width * n :]
        # Until the plan's derivatives are known: what is led has them already.
        replanned = kept[0] < 2.0 and memory[M.rows + M.started] != 0.0
        plan_pulls(
            n, sees.formation, reference, sees.reference_attitude, sees.reference_rates, sees.learned_load, dt, keep_plan, own, kept
        )  # fmt: skip
        if replanned:
            keep_courses(n, kept, memory, M.rows + M.direction, M.width)
        if math.isnan(nominal[0, 0, 0]):
            nominal = kept[kept.shape[0] - 9 * n :].reshape(n, 3, 3)
    follows = params[P.rigid] > 0.0 or not math.isnan(nominal[0, 0, 0])  # the cables are planned
    smooth = 0.0 if params[P.rigid] > 0.0 else 1.0  # by a reference, not by answers that are held
    height = 0.0
    for i in range(n):
        o, L = M.rows + M.width * i, params[P.rows + P.width * i + P.L] + reeled[i, 0] + found[i]
        d = o + M.direction
        height += (x[i, 2] - ends[i, 0, 2]) / n
        swinging = n <= 2 and not stands and math.isnan(nominal[i, 0, 0])
        if swinging:
            _ask_for(i, m_L / n, wanted, dt, keep_snap, memory, o)
        change = memory[o + M.change : o + M.change + 9]
        if memory[o + M.started] == 0.0:
            for k in range(3):
                memory[d + k] = alpha[i, k]
                if swinging:
                    memory[d + 9 + k] = T[i] * alpha[i, k] - change[k]
        reach = params[P.max_swing] / (omega * omega * L)
        if swinging:
            swing(i, alpha, T, change, omega, dt, memory, d, reach)
        else:
            lead(i, alpha, nominal, omega, dt, memory, d, reach)
            if n <= 2 and stands:  # from here the pull goes on once the load swings
                for k in range(3):
                    memory[d + 9 + k], memory[d + 12 + k] = T[i] * memory[d + k], 0.0
        pull = T[i]
        if follows:
            _tension_now(i, T[i], nominal, memory, o)
            pull = memory[o + M.tension]
        short_x -= pull * memory[d]
        short_y -= pull * memory[d + 1]
        short_z -= pull * memory[d + 2]
    # A load that stands is carried by the ground.
    short = (0.0, 0.0, 0.0) if stands else (short_x, short_y, short_z)
    soft = CALM if stands else 1.0
    k1, k2, k3, k4 = soft * params[P.velocity], soft * soft * params[P.stiffness], 0.0, 0.0
    upright, lift = k1, k2
    if (n <= 2 or params[P.rigid] > 0.0) and not stands:
        L = params[P.rows + P.L] + reeled[0, 0] + found[0]
        p1, p2, p3, p4 = pendulum_gains(g, min(max(height, 0.2 * L), 2.0 * L), params[P.band])
        swing_in = params[P.swing]
        k1, k2 = k1 + swing_in * (p1 - k1), k2 + swing_in * (p2 - k2)
        k3, k4 = swing_in * p3, swing_in * p4
    for i in range(n):
        p, o = P.rows + P.width * i, M.rows + M.width * i
        m, L = params[p + P.m], params[p + P.L] + reeled[i, 0] + found[i]
        span = L + spans[i, 0]
        rate, bend = spans[i, 1] + reeled[i, 1], spans[i, 2] + reeled[i, 2]
        led = not math.isnan(courses[i, 0, 0])
        tension = memory[o + M.tension] if follows else T[i]
        push = 0.0
        for k in range(3):
            a = o + M.direction + k
            y = x[i, k] - (wanted[i, 0, k] - span * memory[a])
            y_dot = v[i, k] - (wanted[i, 1, k] - span * memory[a + 3] - rate * memory[a])
            if led:
                y, y_dot = x[i, k] - courses[i, 0, k], v[i, k] - courses[i, 1, k]
            if k < 2:
                u[i, k] = -k1 * y_dot - k2 * y - k3 * (ends[i, 1, k] - wanted[i, 1, k])
                u[i, k] -= k4 * (ends[i, 0, k] - wanted[i, 0, k])
            else:
                u[i, k] = -upright * y_dot - lift * y
            push += u[i, k] * u[i, k]
        # No more than the attitude can follow: it needs long to turn from one bank to the other.
        most = min(1.0, soft * params[P.max_push] / math.sqrt(max(push, 1e-12)))
        for k in range(3):
            a = o + M.direction + k
            # Where the load swings freely, the drone carries it along the cable that is there.
            pull = (ends[i, 0, k] - x[i, k]) / L if n <= 2 and k < 2 else memory[a]
            turning = span * memory[a + 6] + 2.0 * rate * memory[a + 3] + bend * memory[a]
            motion = courses[i, 2, k] if led else wanted[i, 2, k] - turning
            needed = m * (motion + (g if k == 2 else 0.0))
            planned[k] = needed - tension * memory[a]
            known = tension * pull + forces[i, k] + m / params[P.total] * short[k]
            u[i, k] = needed + m * most * u[i, k] - known
        for k in range(3):
            writes.desired_turning[i, k] = 0.0
        wind = sees.estimated_wind
        past = (wind[0] - v[i, 0], wind[1] - v[i, 1], wind[2] - v[i, 2])
        ux, uy, uz = rotors.thrust_for(u[i, 0], u[i, 1], u[i, 2], params[p + P.drag], past)
        u[i, 0], u[i, 1], u[i, 2] = ux, uy, uz
        if sees.standing[i] != 0.0:  # motors idle
            for k in range(3):
                u[i, k] = planned[k] = 0.0 if k < 2 else IDLE * m * g
        else:
            if follows and not led:
                nominal_thrust(i, m, g, span, wanted, nominal, planned)
            limit(i, u, params[p + P.least], params[p + P.most], params[P.tangent])
        norm = math.sqrt(u[i, 0] * u[i, 0] + u[i, 1] * u[i, 1] + u[i, 2] * u[i, 2])
        fresh = memory[o + M.started] == 0.0
        memory[o + M.started] = 1.0
        aim_along(
            i, fresh, dt, keep, planned, u, norm, memory, o + M.aim, thrusts, attitudes, rates
        )
        if follows and not led and sees.standing[i] == 0.0:
            more = look_ahead(
                i, fresh, dt, keep_plan, params[P.lag], smooth, planned, memory, o + M.ahead, sees.estimated_attitudes,
                rates, writes.desired_turning,
            )  # fmt: skip
            thrusts[i] += more
            for k in range(3):  # a difference is that of the middle of the last period
                rates[i, k] += 0.5 * smooth * dt * writes.desired_turning[i, k]


class Formation(PositionControlPart, Delays):
    """PD on the places of the formation at gains that the delay allows; external forces are observed and made up for.

    Together the drones make up for the whole of what the observers see, so that neither a wrong mass of the load nor
    tensions that are not what was wanted leave an error. On one or two drones the load is a pendulum:
    then four poles are placed, and the drone knows where its cable is.
    """

    kernel = _hold_formation
    remembers = MEMORY
    gain_setting: ClassVar[str] = "gain"

    per_drone = ("max_thrust", "rotor_drag")
    of_all = ("max_thrust",)
    from_team: ClassVar[Mapping[str, float | None]] = {"max_thrust": None, "rotor_drag": 0.0}

    gain: Annotated[float, Field(gt=0.0, le=3.0)] = 0.85
    """Gain of the velocity error over the bandwidth of the velocity loop."""
    stiffness: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    """Gain of the position error over the square of that of the velocity error."""
    frequency: Annotated[float, Field(gt=0.0, le=10.0)] = 0.55
    """Natural frequency of the reference filter on the sphere over the bandwidth of the velocity loop; lower below heavy drones."""
    rigid_frequency: Annotated[float, Field(gt=0.0, le=10.0)] = 0.12
    """The same for cables that hold a rigid load."""
    swing: Annotated[float, Field(ge=0.0, le=1.0)] = 0.25
    """How much three drones or more damp the swing of a rigid load as one or two damp that of a point."""
    thrust_filter: Annotated[float, Field(ge=0.0, le=10.0)] = 1.4
    """Time constant of the derivative of the thrust direction, times that bandwidth."""
    max_swing: Annotated[float, Field(gt=0.0, le=100.0)] = 3.0
    """Most acceleration that a drone is asked for to turn its cable, m/s^2."""
    max_push: Annotated[float, Field(gt=0.0, le=100.0)] = 4.0
    """Most acceleration by which place and speed are corrected, m/s^2."""
    rotor_drag: Drag | list[Drag] | None = None
    """Force in the rotors' plane per thrust and speed across it, s/m. None: ``drones.rotor_drag``, or none."""
    min_thrust: Annotated[float, Field(ge=0.0, le=1.0)] = 0.2
    """Least vertical thrust over the drone's weight."""
    max_thrust: Thrust | list[Thrust] | None = None
    """Most thrust of a drone, N. None: 0.95 of ``drones.max_thrust``; where that is not known, 2.5 times what drone and share of
    the load weigh."""
    max_tilt_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 60.0
    """Most tilt, degrees."""

    def left_open(self, team: Team) -> dict[str, Vector]:
        known = np.isfinite(team.max_thrusts)
        share = team.masses + team.load_mass / team.n
        most = np.where(known, FULL * team.max_thrusts, UNKNOWN * share * max(team.gravity, 1e-3))
        return {"max_thrust": most, "rotor_drag": team.rotor_drags}

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        yield from self.delay_warnings(mission, "position_control")

    def places(self, team: Team, axis: int) -> Places:
        band = self.bandwidths(team).velocity
        k1, k3, k4 = self.gain * band, 0.0, 0.0
        k2 = self.stiffness * k1 * k1
        if team.n <= 2:
            height = float(team.cable_lengths.mean())
            k1, k2, k3, k4 = pendulum_gains(team.gravity, height, band)
        return Places(
            k1, k2, lead=self.answers(team), thrust_filter=self.thrust_filter / band,
            swing=(k3, k4), follows=True,
        )  # fmt: skip

    def answers(self, team: Team) -> float:
        """Natural frequency of the filter of cable directions, rad/s."""
        band = self.bandwidths(team).velocity
        if team.body is not None:  # attitude is fed back through them
            return self.rigid_frequency * band
        return min(self.frequency * band, sway(team))

    def params(self, team: Team) -> Vector:
        band = self.bandwidths(team).velocity
        k = self.gain * band
        own = PARAMS.pack(
            team.n, g=team.gravity, m_L=team.load_mass, velocity=k, stiffness=self.stiffness * k * k,
            band=band, frequency=self.answers(team), rigid=float(team.body is not None), lag=self.lag,
            swing=self.swing if team.body is not None and team.n > 2 else 1.0, thrust_filter=self.thrust_filter / band,
            max_swing=self.max_swing, max_push=self.max_push,
            tangent=math.tan(math.radians(self.max_tilt_deg)), total=float(team.masses.sum()),
            m=team.masses, L=team.cable_lengths, least=self.min_thrust * team.masses * team.gravity,
            most=self.settled("max_thrust", team), drag=self.settled("rotor_drag", team),
        )  # fmt: skip
        return np.concatenate([own, numbers(team)])

    def planned_pulls(
        self, team: Team, poses: Sequence[Pose], formations: Sequence[Array]
    ) -> tuple[Array, Array] | None:
        if team.body is None:
            return None
        own, kept = numbers(team), np.zeros(room(team))
        told = np.zeros(inertial.COUNT)
        found, taut = np.empty((len(poses), team.n, 3)), np.empty((len(poses), team.n))
        for row, asked, formation, (motion, attitude, rates) in zip(
            found, taut, formations, poses, strict=True
        ):
            plan_pulls(team.n, formation, motion, attitude, rates, told, 1.0, 0.0, own, kept)
            row[:] = kept[-9 * team.n :].reshape(team.n, 3, 3)[:, 0]
            asked[:] = kept[-13 * team.n : -12 * team.n]
        return found, taut

    def memory(self, team: Team) -> Vector:
        return np.concatenate([super().memory(team), np.zeros(room(team))])
