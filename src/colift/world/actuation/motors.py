"""Four motors with lag, limits and noise behind a mixer that gives up yaw first."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from colift.kernel.jit import inline, kernel
from colift.kernel.layout import Layout
from colift.kernel.math import noise
from colift.kernel.math.smooth import decay
from colift.part import Vector
from colift.team import Team
from colift.world.actuation.base import SIGNATURE, ActuationPart

Thrust = Annotated[float, Field(gt=0.0, le=1e4)]
Offset = Annotated[float, Field(ge=-0.5, le=0.5)]

# Motors stand at (x, y) = arm / sqrt(2) times these, and turn their drone about z by the third.
_X = (1.0, -1.0, -1.0, 1.0)
_Y = (1.0, 1.0, -1.0, -1.0)
_SPIN = (1.0, -1.0, 1.0, -1.0)

_ROUNDING = 1e-9  # N, by which a thrust may miss its limits before the mixer gives something up

PARAMS = Layout(
    team={
        "lever": 1, "ratio": 1, "lag": 1, "rate": 1, "keep": 1, "kick": 1, "offset": 2, "least": 1,
    },
    drone={"most": 1},
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
        out[j] = 0.25 * (_Y[j] * tau_x - _X[j] * tau_y) / lever
        least, most = min(least, out[j]), max(most, out[j])
        exact = 0.25 * f + out[j] + _SPIN[j] * yaw
        fits = fits and low - _ROUNDING <= exact <= high + _ROUNDING
    common, shrink, share = 0.25 * f, 1.0, 1.0
    if not fits:
        common = min(max(common, low), high)
        shrink = min(1.0, (high - low) / max(most - least, 1e-300))
        shrink = min(shrink, (common - low) / max(-least, 1e-300))
        common = min(common, high - shrink * most)
        for j in range(4):
            step = _SPIN[j] * yaw
            held = common + shrink * out[j]
            if step > 0.0:
                share = min(share, max(high - held, 0.0) / step)
            elif step < 0.0:
                share = min(share, max(held - low, 0.0) / -step)
    for j in range(4):
        out[j] = min(max(common + shrink * out[j] + share * _SPIN[j] * yaw, low), high)
    return fits


@kernel(SIGNATURE)
def _turn(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    step, key, dt = now.step, now.key, now.dt
    thrusts, torques, motor_health = sees.thrusts, sees.torques, sees.motor_health
    applied_thrusts, applied_torques = writes.applied_thrusts, writes.applied_torques
    saturated_times = writes.saturated_times
    n = thrusts.shape[0]
    lever, ratio, lag, rate = params[P.lever], params[P.ratio], params[P.lag], params[P.rate]
    keep = decay(dt, lag)
    now = noise.tick(step, dt)
    for i in range(n):
        o = M.rows + M.width * i
        wanted = memory[o + M.wanted : o + M.wanted + 4]
        fits = mix(
            thrusts[i], torques[i, 0], torques[i, 1], torques[i, 2], lever, ratio, params[P.least],
            params[P.rows + P.width * i + P.most], wanted,
        )  # fmt: skip
        if not fits:
            saturated_times[i] += dt
        fresh = memory[o + M.next] == 0.0
        for number in range(now if fresh else int(memory[o + M.next]), now + 1):
            for pair in range(2):
                kick = noise.normals(key, number, 2 * i + pair)
                for j in range(2):
                    N = o + M.noise + 2 * pair + j
                    memory[N] = params[P.keep] * memory[N] + params[P.kick] * kick[j]
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
            tau_x += (lever * _Y[j] - params[P.offset + 1]) * acting
            tau_y -= (lever * _X[j] - params[P.offset]) * acting
            tau_z += ratio * _SPIN[j] * acting
        applied_thrusts[i] = f
        applied_torques[i, 0] = tau_x
        applied_torques[i, 1] = tau_y
        applied_torques[i, 2] = tau_z


class Motors(ActuationPart):
    """A quadrotor's four motors, each a first-order lag with limits of thrust and of its rate.

    The motors stand on arms at 45 degrees to the body axes. The mixer inverts thrust and torques. Where limits do
    not allow all, yaw gives way first; near full thrust, thrust gives way to roll and pitch, for a drone that
    cannot turn cannot aim; near none, they give way to it. A weak motor gives its share; the mixer is not told.

    Defaults are chosen for the paper's drone of 0.5 kg: 2.4 times its weight, a lag between those of RotorS'
    Hummingbird (12.5 ms up, 25 ms down) and a torque ratio near that model's 0.016 m.
    """

    kernel = _turn
    remembers = MEMORY
    per_drone = ("max_thrust",)
    thrust_setting: ClassVar[str] = "max_thrust"

    arm_length: Annotated[float, Field(gt=0.0, le=5.0)] = 0.2
    """From the centre to a rotor, m."""
    torque_ratio: Annotated[float, Field(gt=0.0, le=1.0)] = 0.016
    """Torque about a motor's axis per thrust, m."""
    max_thrust: Thrust | list[Thrust] = 3.0
    """Largest thrust of one motor, N; one value, or one for each drone."""
    min_thrust: Annotated[float, Field(ge=0.0, le=1e3)] = 0.0
    """Least thrust of one motor, N: motors that must not stop."""
    time_constant: Annotated[float, Field(ge=0.0, le=1.0)] = 0.02
    """Of the lag of a motor's thrust, s."""
    max_rate: Annotated[float, Field(gt=0.0, le=1e6)] = 100.0
    """Fastest change of a motor's thrust, N/s."""
    noise: Annotated[float, Field(ge=0.0, le=100.0)] = 0.01
    """Standard deviation of a motor's thrust, N; it has the motor's bandwidth."""
    centre_offset: tuple[Offset, Offset] = (0.0, 0.0)
    """Centre of gravity from the centre of the rotors, body x and y, m; the mixer is not told."""

    def check(self, team: Team) -> list[tuple[str, str]]:
        if problems := self.wrong_lengths(team.n):
            return problems
        if self.min_thrust >= np.min(self.max_thrust):
            return [("min_thrust", f"must be below max_thrust = {np.min(self.max_thrust):g} N")]
        return []

    def motor_lag(self) -> float:
        return self.time_constant

    def thrust_limits(self, team: Team) -> Vector:
        return np.array(np.broadcast_to(4.0 * np.asarray(self.max_thrust, dtype=float), team.n))

    def conflicts(self, team: Team) -> list[tuple[str, str]]:
        spare = self.thrust_limits(team) - team.masses * team.gravity
        if np.min(spare) <= 0.0:
            i = int(np.argmin(spare))
            own = team.masses[i] * team.gravity
            return [("max_thrust", f"must exceed {0.25 * own:.4g} N: drone {i} weighs {own:.4g} N")]
        if np.sum(spare) <= team.load_mass * team.gravity:
            most = np.sum(spare) / team.gravity
            message = f"{team.n} drones lift less than {most:.4g} kg beside their own weight"
            return [("max_thrust", f"{message}; load.mass is {team.load_mass:.4g} kg")]
        return []

    def params(self, team: Team) -> Vector:
        lever = self.arm_length / math.sqrt(2.0)
        keep = math.exp(-noise.TICK / self.time_constant) if self.time_constant > 0.0 else 0.0
        kick = self.noise * math.sqrt(1.0 - keep * keep)
        return PARAMS.pack(
            team.n, lever=lever, ratio=self.torque_ratio, lag=self.time_constant,
            rate=self.max_rate, keep=keep, kick=kick, offset=self.centre_offset,
            least=self.min_thrust, most=self.max_thrust,
        )  # fmt: skip
