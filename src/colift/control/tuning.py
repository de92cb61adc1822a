"""Gains that a loop with a given delay can bear: one rule for the attitude, position and load controllers."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from colift.kernel.jit import inline
from colift.part import Declared, Part, Setup, Vector
from colift.team import Team

RATE_MARGIN = math.radians(60.0)
"""Phase margin of the body-rate loop."""

VELOCITY_MARGIN = math.radians(52.0)
"""Phase margin of the velocity loop."""

DOUBT = 0.25
"""Share of a predicted delay or lag that still counts: the prediction's model is not the truth."""

MOST_VELOCITY = 12.0
"""Most bandwidth of a velocity loop that moves cables, 1/s, however short the delay: they and the allocator have their own time."""

SNAP = 0.15
"""Error of the attitude at which all the torque of the rotors is asked for, rad, at least: smaller ones are everyday."""

TILTING, YAWING = 1.1, 0.9
"""Most torque asked for, over what all rotors between hover and their nearer limit give: a little more is clipped by the mixer."""

MISJUDGED = 0.05
"""Share of the force that moves the drones which may be taken for one on the load."""

LEAN = 0.5
"""Most that the wanted cable directions answer to a load error: metres that the drones move for a metre."""


class Bandwidths(NamedTuple):
    """Of the cascade, from the inside out, rad/s; each outer loop is critically damped by its inner one."""

    rate: float
    attitude: float
    velocity: float
    position: float


class Delays(Part):
    """What stands between a motion and the answer to it; the settings that delay-aware parts share."""

    delay: Annotated[float, Field(ge=0.0, le=0.5)] = 0.02
    """Age of the measurements, s; that of the mission's sensors, or its ``timing.delay``, where not given."""
    period: Annotated[float, Field(gt=0.0, le=0.5)] = 0.01
    """Control period, s; the layer's own in the mission where not given."""
    lag: Annotated[float, Field(ge=0.0, le=0.5)] = 0.0
    """Time constant of the motors, s; that of the mission's where not given."""
    predicted: bool = True
    """Whether the delay is made up for by predictors (in the attitude controller and the estimator)."""

    delays_declared = ("delay",)
    paced_by: ClassVar[str] = ""
    """Layer at whose period the part is called, where it is not its own."""

    @classmethod
    def declared(cls, mission: Declared) -> dict[str, Any]:
        found = {"period": getattr(mission.timing, cls.paced_by or cls.layer)}
        if mission.sensing is not None:
            delays = mission.sensing.delays()
            found["delay"] = max(
                (delays[sensor] for sensor in getattr(cls, "senses", ())), default=0.0
            )
        if mission.actuation is not None:
            found["lag"] = mission.actuation.motor_lag()
        return found | super().declared(mission)

    def bandwidths(self, team: Team) -> Bandwidths:
        """The rule.

        ``J dOmega/dt = -K_d Omega(t - tau)`` crosses over at ``w = K_d / J`` with the phase margin
        ``pi/2 - w tau``; ``tau`` is the delay, half a period of the hold, and the motors' lag. What
        is predicted counts by a quarter. The angle's loop around it is critically damped at a quarter
        of ``w`` (so ``rho = w / 2``, for the manifold's ``q_e`` is half an angle). An error ``theta`` asks for
        ``w^2 theta / 4``, which no drone of the team may be unable to give already for a small one. The velocity loop
        sees ``tau`` and the lag ``1 / w`` of an attitude whose wanted rate is fed forward, and is bounded; position again
        a quarter.
        """
        share = DOUBT if self.predicted else 1.0
        tau = share * (self.delay + self.lag) + 0.5 * self.period
        rate = (0.5 * math.pi - RATE_MARGIN) / tau
        least = float(np.min(np.nan_to_num(turning(team)[0], nan=math.inf)))
        if math.isfinite(least):
            rate = min(rate, math.sqrt(4.0 * least / SNAP))
        velocity = min((0.5 * math.pi - VELOCITY_MARGIN) / (tau + 2.0 / rate), MOST_VELOCITY)
        return Bandwidths(rate, 0.25 * rate, velocity, 0.25 * velocity)

    def delay_warnings(self, mission: Setup, layer: str) -> Iterable[tuple[str, str]]:
        """Where the part of a layer is told less than what the sensors, motors and timing of a mission have."""
        delays = mission.sensing.delays()
        for sensor in getattr(self, "senses", ()):
            yield from shorter("delay", self.delay, f"sensing.{sensor}_delay", delays[sensor])
        yield from lag_warnings(self.lag, mission)
        yield from shorter("period", self.period, f"timing.{layer}", getattr(mission.timing, layer))


def turning(team: Team) -> tuple[Vector, Vector]:
    """Angular accelerations (n,) that the rotors can give beside hover, in roll and pitch, and in yaw, rad/s^2.

    NaN where thrust, arm or torque ratio are not known, and without gravity, where nobody hovers.
    """
    hover = (team.masses + team.load_mass / team.n) * team.gravity
    spare = np.maximum(np.minimum(hover, team.max_thrusts - hover), 0.05 * hover)
    spare = np.where(np.isfinite(team.max_thrusts) & (hover > 0.0), spare, math.nan)
    lever = np.where(team.rotors > 4, 0.5, math.sqrt(0.5)) * team.arms
    tilting = TILTING * lever * spare / team.inertias[:, :2].max(axis=1)
    return tilting, YAWING * team.torque_ratios * spare / team.inertias[:, 2]


def sway(team: Team) -> float:
    """How fast the cables may answer what is observed of the load, 1/s.

    A motion x of all drones at the rate r asks for ``M r^2 x``. The share of it that is misjudged looks like a force on the
    load and leans the cables, which moves their drones by ``L / (m_L g)`` of it: by no more than x.
    """
    heavy = MISJUDGED * float(team.masses.sum()) * float(team.cable_lengths.mean())
    return math.sqrt(team.load_mass * max(team.gravity, 1e-3) / heavy)


def shorter(field: str, told: float, other: str, real: float) -> Iterable[tuple[str, str]]:
    """A warning where a part is told less time than there is."""
    if told < real - 1e-9:
        message = f"is {told:g} s, but {other} is {real:g} s: the part's gains and predictions are for less"
        yield field, message


def lag_warnings(told: float, mission: Setup) -> Iterable[tuple[str, str]]:
    """A warning where the lag that a part is told is far from that of the motors."""
    real = mission.actuation.motor_lag()
    if abs(told - real) > max(0.5 * real, 1e-3):
        setting = f"actuation of kind {mission.kinds['actuation']} has a lag of {real:g} s"
        yield "lag", f"is {told:g} s, but {setting}: the controller is tuned for other motors"


def loop_growth(
    gain: float,
    slope: float,
    inertia: float,
    *,
    period: float,
    delay: float = 0.0,
    lag: float = 0.0,
) -> float:
    """Factor by which a turn about one axis grows in a control period; above 1 it diverges.

    Of ``J dOmega/dt = tau`` under the sampled law ``tau = -gain (Omega + slope theta / 2)`` (a quaternion holds half
    of the angle), small angles, with the motors' ``lag`` and measurements that are ``delay`` (s) old: the
    spectral radius of the loop from one period to the next.
    """
    t = period
    decay = math.exp(-t / lag) if lag > 0.0 else 0.0
    rest = lag * (1.0 - decay)  # integral of the decay, and its integral
    rest2 = lag * (t - rest)
    # theta, Omega, torque that acts
    A = np.array([[1.0, t, rest2 / inertia], [0.0, 1.0, rest / inertia], [0.0, 0.0, decay]])
    B = np.array([(0.5 * t * t - rest2) / inertia, (t - rest) / inertia, 1.0 - decay])
    whole = min(int(delay / t + 1e-9), LONGEST)
    part = min(max(delay / t - whole, 0.0), 1.0) if whole < LONGEST else 0.0
    size = 3 + 2 * (whole + 1)
    M = np.zeros((size, size))
    law = np.zeros(size)
    feedback = -gain * np.array([0.5 * slope, 1.0])
    now = 0 if whole == 0 else 3 + 2 * (whole - 1)
    law[now : now + 2] += (1.0 - part) * feedback
    law[3 + 2 * whole :] += part * feedback
    M[:3, :3] = A
    M[:3] += np.outer(B, law)
    M[3:5, :2] = np.eye(2)
    for k in range(whole):
        M[5 + 2 * k : 7 + 2 * k, 3 + 2 * k : 5 + 2 * k] = np.eye(2)
    return float(np.abs(np.linalg.eigvals(M)).max())


@inline
def pendulum_gains(g, height, band):  # type: ignore[no-untyped-def]
    """Gains of ``a = -k1 y' - k2 y - k3 x' - k4 x`` for a load below one or two drones; y is their error, x the load's.

    The load swings below drones that move freely, ``x'' = wp^2 (y - x)`` with ``wp^2 = g / height``. The poles are
    those of ``s^2 + 2 zeta wp s + wp^2``, which damps the swing, and of ``s^2 + 2 zeta_b b s + b^2``, which brings the load to
    its place. Both are held back where the swing comes near ``band``, the bandwidth of the velocity loop, 1/s.
    """
    wp = math.sqrt(max(g, 1e-3) / height)
    slow = min(1.0, 0.4 * band / wp)
    zeta, zeta_b = 0.5 * slow, 0.5
    b = min(2.0 * slow * wp, 0.3 * band)
    k1 = 2.0 * zeta * wp + 2.0 * zeta_b * b
    k2 = b * b + 4.0 * zeta * zeta_b * wp * b
    k3 = 2.0 * zeta * b * b / wp + 2.0 * zeta_b * b - k1
    return k1, k2, k3, b * b - k2


LONGEST = 50
"""Most control periods of delay that :func:`loop_growth` looks at."""
