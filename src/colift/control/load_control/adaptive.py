"""The paper's load law with the mass of the load learned in flight, at gains that the delay allows."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Annotated, ClassVar

from pydantic import Field

from colift.control.load_control._upright import keep_upright
from colift.control.load_control.base import DRAWN, SIGNATURE, LoadControlPart
from colift.control.margins import Hanging
from colift.control.tuning import LEAN, Delays
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.part import Setup, Vector
from colift.team import Team

PARAMS = Layout(
    team={
        "m": 1, "g": 1, "k_p": 1, "k_d": 1, "k_i": 1, "learn": 1, "slope": 1, "lower": 1, "upper": 1,
        "tangent": 1,
    }
)  # fmt: skip
MEMORY = Layout(team={"mass": 1, "lean": 2})
"""Learned over told mass, less 1, so that zero is the start; force against a steady horizontal one."""
P, M = PARAMS.at, MEMORY.at


@kernel(SIGNATURE)
def _adaptive(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    load, reference = sees.estimated_load, sees.reference
    u_L, agreed = writes.force, sees.agreed_force
    m, g, k_p, k_d, k_i = params[P.m], params[P.g], params[P.k_p], params[P.k_d], params[P.k_i]
    learn, slope, tangent = params[P.learn], params[P.slope], params[P.tangent]
    lower, upper = params[P.lower], params[P.upper]
    lean = M.lean
    along = 0.0
    for k in range(3):
        e = load[0, k] - reference[0, k]
        e_dot = load[1, k] - reference[1, k]
        regressor = reference[2, k] + (g if k == 2 else 0.0)
        # m_hat' = -gamma (g e3 + xdd_d) . (edot + lambda e)
        along += regressor * (e_dot + slope * e)
    memory[M.mass] = min(max(memory[M.mass] - dt * learn * along / m, lower - 1.0), upper - 1.0)
    up = m * (g + reference[2, 2])
    if (
        math.isfinite(agreed[0] + agreed[1] + agreed[2]) and up > 0.1 * m * g
    ):  # what all have learned
        drawn = min(dt / DRAWN, 1.0)
        memory[M.mass] += drawn * (agreed[2] / up - 1.0 - memory[M.mass])
        memory[M.mass] = min(max(memory[M.mass], lower - 1.0), upper - 1.0)
        for k in range(2):
            wanted = agreed[k] - m * (1.0 + memory[M.mass]) * reference[2, k]
            memory[lean + k] += drawn * (wanted - memory[lean + k])
    m_hat = m * (1.0 + memory[M.mass])
    memory[lean] -= dt * k_i * (load[0, 0] - reference[0, 0])
    memory[lean + 1] -= dt * k_i * (load[0, 1] - reference[0, 1])
    size = math.sqrt(memory[lean] * memory[lean] + memory[lean + 1] * memory[lean + 1])
    if size > tangent * m_hat * g:
        memory[lean] *= tangent * m_hat * g / size
        memory[lean + 1] *= tangent * m_hat * g / size
    for k in range(3):
        e = load[0, k] - reference[0, k]
        e_dot = load[1, k] - reference[1, k]
        known = m_hat * g if k == 2 else memory[lean + k]
        u_L[k] = known + m_hat * reference[2, k] - k_p * e - k_d * e_dot
    keep_upright(m_hat * g, tangent, u_L)
    grown = 1.0 + memory[M.mass]
    for k in range(3):
        steady = m * g * grown if k == 2 else memory[lean + k]
        writes.steady_force[k] = steady + m * reference[2, k] * grown


class Adaptive(LoadControlPart, Delays):
    """PID whose mass follows ``m_hat' = -gamma (g e3 + xdd_d) . (edot + lambda e)``, kept in bounds.

    The adaptation of Villa, Brandao, Sarcinelli-Filho (2021) and of Slotine and Li (1987), with the
    projection of Ioannou and Sun (1996). It takes the place of the vertical integral. The feedback is weak
    on purpose: the drones' own position loops hold a load that hangs on three cables or more, and a load
    error that leans the cables comes back through the drones' lag.
    """

    kernel = _adaptive
    remembers = MEMORY
    gain_setting: ClassVar[str] = "delay"

    learning: Annotated[float, Field(gt=0.0, le=2.0)] = 0.3
    """Rate at which the mass is learned over the bandwidth of the drones' position loops."""
    leaning: Annotated[float, Field(gt=0.0, le=2.0)] = 0.05
    """Rate at which the cables are leant against a steady horizontal force on the load, likewise."""
    lower: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    """Least mass that is believed, over the one told."""
    upper: Annotated[float, Field(ge=1.0, le=10.0)] = 2.5
    """Largest mass that is believed, over the one told."""
    max_lean_deg: Annotated[float, Field(gt=0.0, lt=90.0)] = 30.0
    """Most lean of the wanted force from the vertical, degrees."""

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        yield from self.delay_warnings(mission, "load_control")

    def hanging(self, team: Team, axis: int) -> Hanging:
        band = self.bandwidths(team)
        k_p = LEAN * team.load_mass * team.gravity / float(team.cable_lengths.mean())
        stiffness = float(team.masses.sum()) * band.velocity * band.position + k_p
        k_i = stiffness * self.leaning * band.position
        return Hanging(k_p, 0.5 * k_p / band.position, k_i)

    def params(self, team: Team) -> Vector:
        band = self.bandwidths(team)
        k_p = LEAN * team.load_mass * team.gravity / float(team.cable_lengths.mean())
        stiffness = float(team.masses.sum()) * band.velocity * band.position + k_p
        slope = band.position
        learn = self.learning * stiffness / max(team.gravity, 1e-3) ** 2
        return PARAMS.pack(
            team.n, m=team.load_mass, g=team.gravity, k_p=k_p, k_d=0.5 * k_p / band.position,
            k_i=stiffness * self.leaning * band.position, learn=learn, slope=slope,
            lower=self.lower, upper=self.upper, tangent=math.tan(math.radians(self.max_lean_deg)),
        )  # fmt: skip
