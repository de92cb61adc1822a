"""Four motors with lag, limits and noise behind a mixer that gives up yaw first."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import noise
from colift.kernel.math.smooth import decay
from colift.part import Vector
from colift.team import Team, vehicles
from colift.world.actuation.base import SIGNATURE, ActuationPart

Thrust = Annotated[float, Field(gt=0.0, le=1e4)]
Offset = Annotated[float, Field(ge=-0.5, le=0.5)]
Length = Annotated[float, Field(gt=0.0, le=5.0)]
Ratio = Annotated[float, Field(gt=0.0, le=1.0)]
Lag = Annotated[float, Field(ge=0.0, le=1.0)]
Rate = Annotated[float, Field(gt=0.0, le=1e6)]
Noise = Annotated[float, Field(ge=0.0, le=100.0)]

RISE = 0.03
"""Time in which a motor whose largest thrust is known gets there from none, s."""
INNER = 0.65
"""Arm over radius of a drone of which only the radius is known, at most: rotors are about half as large as arms."""
NOISE = 1.0 / 300.0
"""Standard deviation of such a motor's thrust over its largest."""

OF_DRONES = {
    "max_thrust": "max_thrust", "motor_lag": "time_constant", "arm": "arm_length", "torque_ratio": "torque_ratio",
}  # fmt: skip
"""Settings here, by the field of the drones that says the same of all four motors."""

# Motors stand at (x, y) = arm / sqrt(2) times these, and turn their drone about z by the third.
FORWARD = (1.0, -1.0, -1.0, 1.0)
LEFT = (1.0, 1.0, -1.0, -1.0)
SPIN = (1.0, -1.0, 1.0, -1.0)

_ROUNDING = 1e-9  # N, by which a thrust may miss its limits before the mixer gives something up

PARAMS = Layout(
    team={
        "offset": 2, "least": 1,
    },
    drone={"lever": 1, "ratio": 1, "lag": 1, "rate": 1, "keep": 1, "kick": 1, "most": 1},
)  # fmt: skip
"""``keep`` and ``kick``: share of the noise that stays over a tick, and what is added; thrusts ``least`` and ``most``."""
MEMORY = Layout(drone={"next": 1, "thrust": 4, "noise": 4, "wanted": 4})
"""``next``: number of the tick whose noise comes next, 0 at the start; then of each motor."""
P, M = PARAMS.at, MEMORY.at


@inline
def mix(f, tau_x, tau_y, tau_z, lever, ratio, low, high, out):  # type: ignore[no-untyped-def]
    """Thrusts (4) within ``low`` and ``high`` for a thrust and three torques.

    Where not all can be had: roll and pitch keep their ratio and, as far as the motors' range and the wanted thrust
    allow, their size; thrust is lowered, never raised, to make room for them; yaw takes what is left. Tells whether all
    can be had.
    """
    yaw = 0.25 * tau_z / ratio
    fits = True
    least, most = math.inf, -math.inf
    for j in range(4):
        out[j] = 0.25 * (LEFT[j] * tau_x - FORWARD[j] * tau_y) / lever
        least, most = min(least, out[j]), max(most, out[j])
        exact = 0.25 * f + out[j] + SPIN[j] * yaw
        fits = fits and low - _ROUNDING <= exact <= high + _ROUNDING
    common, shrink, share = 0.25 * f, 1.0, 1.0
    if not fits:
        common = min(max(common, low), high)
        shrink = min(1.0, (high - low) / max(most - least, 1e-300))
        shrink = min(shrink, (common - low) / max(-least, 1e-300))
        common = min(common, high - shrink * most)
        for j in range(4):
            step = SPIN[j] * yaw
            held = common + shrink * out[j]
            if step > 0.0:
                share = min(share, max(high - held, 0.0) / step)
            elif step < 0.0:
                share = min(share, max(held - low, 0.0) / -step)
    for j in range(4):
        out[j] = min(max(common + shrink * out[j] + share * SPIN[j] * yaw, low), high)
    return fits


@kernel(SIGNATURE, counted=False)
def _turn(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    step, key, dt = now.step, now.key, now.dt
    thrusts, torques, motor_health = sees.thrusts, sees.torques, sees.motor_health
    applied_thrusts, applied_torques = writes.applied_thrusts, writes.applied_torques
    saturated_times = writes.saturated_times
    n = thrusts.shape[0]
    now = noise.tick(step, dt)
    for i in range(n):
        o, p = M.rows + M.width * i, P.rows + P.width * i
        lever, ratio, rate = params[p + P.lever], params[p + P.ratio], params[p + P.rate]
        keep = decay(dt, params[p + P.lag])
        wanted = memory[o + M.wanted : o + M.wanted + 4]
        fits = mix(
            thrusts[i], torques[i, 0], torques[i, 1], torques[i, 2], lever, ratio, params[P.least],
            params[p + P.most], wanted,
        )  # fmt: skip
        if not fits:
            saturated_times[i] += dt
        fresh = memory[o + M.next] == 0.0
        for number in range(now if fresh else int(memory[o + M.next]), now + 1):
            for pair in range(2):
                kick = noise.normals(key, number, 2 * i + pair)
                for j in range(2):
                    N = o + M.noise + 2 * pair + j
                    memory[N] = params[p + P.keep] * memory[N] + params[p + P.kick] * kick[j]
        memory[o + M.next] = now + 1
        f = tau_x = tau_y = tau_z = 0.0
        for j in range(4):
            T = memory[o + M.thrust + j]
            if fresh:
                T = wanted[j]
            else:
                change = (1.0 - keep) * (wanted[j] - T)
                T += min(max(change, -rate * dt), rate * dt)
            memory[o + M.thrust + j] = T
            acting = motor_health[i, j] * max(T + memory[o + M.noise + j], 0.0)
            f += acting
            tau_x += (lever * LEFT[j] - params[P.offset + 1]) * acting
            tau_y -= (lever * FORWARD[j] - params[P.offset]) * acting
            tau_z += ratio * SPIN[j] * acting
        applied_thrusts[i] = f
        applied_torques[i, 0] = tau_x
        applied_torques[i, 1] = tau_y
        applied_torques[i, 2] = tau_z


class Motors(ActuationPart):
    """A quadrotor's four motors, each a first-order lag with limits of thrust and of its rate.

    The motors stand on arms at 45 degrees to the body axes. The mixer inverts thrust and torques. Where limits do
    not allow all, yaw gives way first; near full thrust, thrust gives way to roll and pitch, for a drone that
    cannot turn cannot aim; near none, they give way to it. A weak motor gives its share; the mixer is not told.

    What is left out is the vehicle's (``drones``); what that does not tell either is usual: 2.4 times the drone's weight, 20 ms
    of lag, between those of RotorS' Hummingbird (12.5 ms up, 25 ms down), an arm that goes with mass and inertia, and
    a torque ratio that grows with it and is near that model's 0.016 m at 0.2 m. With six or eight rotors, each motor here stands for a quarter of them, on an arm
    that turns the drone as much as they can about their weaker axis: with N rotors at distance a, of which the
    outermost may change by d, these are 4 (d N / 4) a / 2.
    """

    kernel = _turn
    remembers = MEMORY
    per_drone = (
        "arm_length", "torque_ratio", "max_thrust", "time_constant", "max_rate", "noise",
    )  # fmt: skip
    from_team: ClassVar[Mapping[str, float | None]] = dict.fromkeys(per_drone)
    thrust_setting: ClassVar[str] = "max_thrust"

    arm_length: Length | list[Length] | None = None
    """From the centre to a rotor, m; one value, or one for each drone, as of all that follow but ``min_thrust`` and
    ``centre_offset``. None: ``drones.arm``, or the usual."""
    torque_ratio: Ratio | list[Ratio] | None = None
    """Torque about a motor's axis per thrust, m. None: ``drones.torque_ratio``, or the usual."""
    max_thrust: Thrust | list[Thrust] | None = None
    """Largest thrust of one motor, N. None: a quarter of ``drones.max_thrust``, or 6 for each kg."""
    min_thrust: Annotated[float, Field(ge=0.0, le=1e3)] = 0.0
    """Least thrust of one motor, N: motors that must not stop."""
    time_constant: Lag | list[Lag] | None = None
    """Of the lag of a motor's thrust, s. None: ``drones.motor_lag``, or 0.02."""
    max_rate: Rate | list[Rate] | None = None
    """Fastest change of a motor's thrust, N/s. None: what reaches the largest thrust from none in 30 ms."""
    noise: Noise | list[Noise] | None = None
    """Standard deviation of a motor's thrust, N; it has the motor's bandwidth. None: a 300th of its
    largest thrust."""
    centre_offset: tuple[Offset, Offset] = (0.0, 0.0)
    """Centre of gravity from the centre of the rotors, body x and y, m; the mixer is not told."""

    def check(self, team: Team) -> list[tuple[str, str]]:
        if problems := self.wrong_lengths(team.n):
            return problems
        most = float(np.min(self.settled("max_thrust", team)))
        if self.min_thrust >= most:
            return [("min_thrust", f"must be below max_thrust = {most:g} N")]
        return []

    def left_open(self, team: Team) -> dict[str, Vector]:
        bodies = zip(team.masses.tolist(), team.inertias.tolist(), strict=True)
        usual = [vehicles.usual_arm(mass, tuple(inertia)) for mass, inertia in bodies]
        inner = np.fmin(usual, INNER * team.radii)
        arms = np.where(np.isfinite(team.arms), team.arms, inner)
        ratios = [vehicles.usual_torque_ratio(arm) for arm in arms.tolist()]
        known = np.isfinite(team.max_thrusts)
        weak = np.where(known, team.max_thrusts, vehicles.THRUST_PER_MASS * team.masses)
        given = self.max_thrust
        told = given is not None and np.size(given) in (1, team.n)
        most = np.broadcast_to(np.asarray(given), team.n) if told else 0.25 * weak
        lags = np.where(np.isfinite(team.motor_lags), team.motor_lags, vehicles.USUAL_LAG)
        return {
            "arm_length": arms,
            "torque_ratio": np.where(np.isfinite(team.torque_ratios), team.torque_ratios, ratios),
            "max_thrust": 0.25 * weak, "time_constant": lags, "max_rate": most / RISE,
            "noise": NOISE * most,
        }  # fmt: skip

    def together(self, team: Team, motors: Vector) -> tuple[Vector, Vector]:
        """Thrust (n,) and torques (n, 3) of all motors of each drone, of the thrust of each (n, 4), N: what the mixer inverts.

        Motors are numbered front left, rear left, rear right, front right, x forward and y left.
        """
        levers, ratios = self.levers(team), self.settled("torque_ratio", team)
        arms = np.array([LEFT, [-x for x in FORWARD], SPIN])
        torques = motors @ arms.T * np.stack([levers, levers, ratios], axis=1)
        return motors.sum(axis=1), torques

    def levers(self, team: Team) -> Vector:
        """Distance of each drone's motors from its body axes x and y (n,), m."""
        arms = self.settled("arm_length", team)
        return np.where(team.rotors > 4.0, 0.5 * arms, arms / math.sqrt(2.0))

    def assumed(self, team: Team) -> dict[str, Vector]:
        own = {field: self.settled(name, team) for field, name in OF_DRONES.items()}
        return own | {"max_thrust": 4.0 * own["max_thrust"]}

    def guessed(self, team: Team) -> set[str]:
        return {field for field, name in OF_DRONES.items() if name not in self.model_fields_set}

    def motor_lag(self) -> float:
        if self.time_constant is None:
            return vehicles.USUAL_LAG
        return float(np.max(self.time_constant))

    def thrust_limits(self, team: Team) -> Vector:
        return 4.0 * self.settled("max_thrust", team)

    def conflicts(self, team: Team) -> list[tuple[str, str]]:
        spare = self.thrust_limits(team) - team.masses * team.gravity
        if np.min(spare) <= 0.0:
            i = int(np.argmin(spare))
            own = team.masses[i] * team.gravity
            if self.thrust_path(team) == "drones.max_thrust":
                message = f"must exceed {own:.4g} N: drone {i} weighs that"
            else:
                message = f"must exceed {0.25 * own:.4g} N: drone {i} weighs {own:.4g} N"
            return [(self._thrust_field(team), message)]
        if np.sum(spare) <= team.load_mass * team.gravity:
            most = np.sum(spare) / team.gravity
            message = f"{team.n} drones lift less than {most:.4g} kg beside their own weight"
            message = f"{message}; load.mass is {team.load_mass:.4g} kg"
            return [(self._thrust_field(team), message)]
        return []

    def _thrust_field(self, team: Team) -> str:
        return self.thrust_path(team).removeprefix(f"{self.layer}.")

    def params(self, team: Team) -> Vector:
        lag, noises = self.settled("time_constant", team), self.settled("noise", team)
        keep = [math.exp(-noise.TICK / each) if each > 0.0 else 0.0 for each in lag.tolist()]
        kick = [
            each * math.sqrt(1.0 - k * k) for each, k in zip(noises.tolist(), keep, strict=True)
        ]
        return PARAMS.pack(
            team.n, lever=self.levers(team), ratio=self.settled("torque_ratio", team), lag=lag,
            rate=self.settled("max_rate", team), keep=keep, kick=kick, offset=self.centre_offset,
            least=self.min_thrust, most=self.settled("max_thrust", team),
        )  # fmt: skip
