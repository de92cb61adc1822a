"""The paper's load controller: PID with gravity and acceleration feed-forward (paper eq. 6)."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar, Literal

from pydantic import Field

from colift.control.load_control.base import DRAWN, SIGNATURE, LoadControlPart
from colift.control.margins import Hanging
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout
from colift.part import Vector
from colift.team import Team

Gain = Annotated[float, Field(ge=0.0)]

PARAMS = Layout(
    team={
        "m_L": 1, "g": 1, "k_p": 3, "k_d": 3, "k_i": 3, "limit": 1, "sign": 1, "feed_forward": 1
    }
)  # fmt: skip
MEMORY = Layout(team={"integral": 3})
P, M = PARAMS.at, MEMORY.at


@kernel(SIGNATURE, counted=False)
def _pid(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    load, reference = sees.estimated_load, sees.reference
    u_L, agreed = writes.force, sees.agreed_force
    # u_L = m_L (g e3 + xdd_d) - k_p e - k_d edot - k_i int e
    m_L, g, sign, limit = params[P.m_L], params[P.g], params[P.sign], params[P.limit]
    for k in range(3):
        e = load[0, k] - reference[0, k]
        e_dot = load[1, k] - reference[1, k]
        S = M.integral + k
        memory[S] = min(max(memory[S] + dt * e, -limit), limit)
        gravity = g if k == 2 else 0.0
        if math.isfinite(agreed[k]) and params[P.k_i + k] > 0.0:  # what all have learned
            known = sign * m_L * (gravity + params[P.feed_forward] * reference[2, k])
            wanted = (known - agreed[k]) / params[P.k_i + k]
            memory[S] += min(dt / DRAWN, 1.0) * (min(max(wanted, -limit), limit) - memory[S])
        u_L[k] = (
            sign * m_L * (gravity + params[P.feed_forward] * reference[2, k])
            - params[P.k_p + k] * e
            - params[P.k_d + k] * e_dot
            - params[P.k_i + k] * memory[S]
        )
        writes.steady_force[k] = (
            sign * m_L * (gravity + params[P.feed_forward] * reference[2, k])
            - params[P.k_i + k] * memory[S]
        )


class Pid(LoadControlPart):
    """Load PID with the paper's gains; the integral gain, unpublished, is chosen.

    The paper prints ``-m_L (g e3 + xdd_d)`` where its own force balance needs ``+``; ``sign =
    "as-printed"`` flies the misprint, for demonstration.
    """

    kernel = _pid
    remembers = MEMORY
    gain_setting: ClassVar[str] = "k_p"

    k_p: tuple[Gain, Gain, Gain] = (8.0, 8.0, 8.0)
    """Proportional gain per world axis, N/m (paper: 8)."""
    k_d: tuple[Gain, Gain, Gain] = (2.0, 2.0, 2.0)
    """Derivative gain, N s/m (paper: 2)."""
    k_i: tuple[Gain, Gain, Gain] = (3.0, 3.0, 3.0)
    """Integral gain, N/(m s) (unpublished; chosen)."""
    integral_limit: Annotated[float, Field(gt=0.0)] = 1.0
    """Bound on the integral of the error per axis, m s."""
    feed_forward: Annotated[float, Field(ge=0.0, le=1.0)] = 1.0
    """Share of the wanted acceleration that is fed forward; 1 in the paper."""
    sign: Literal["corrected", "as-printed"] = "corrected"
    """Sign of the feed-forward term."""

    def hanging(self, team: Team, axis: int) -> Hanging:
        return Hanging(self.k_p[axis], self.k_d[axis], self.k_i[axis])

    def params(self, team: Team) -> Vector:
        return PARAMS.pack(
            team.n, m_L=team.load_mass, g=team.gravity, k_p=self.k_p, k_d=self.k_d, k_i=self.k_i,
            limit=self.integral_limit, sign=1.0 if self.sign == "corrected" else -1.0,
            feed_forward=self.feed_forward,
        )  # fmt: skip
