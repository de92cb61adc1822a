"""The paper's load controller: PID with gravity and acceleration feed-forward (paper eq. 6)."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from colift.jit import kernel
from colift.load_control.base import SIGNATURE, LoadControlPart
from colift.part import Vector
from colift.team import Team

Gain = Annotated[float, Field(ge=0.0)]


@kernel(SIGNATURE)
def _pid(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    dt = now.dt
    load, reference = sees.estimated_load, sees.reference
    u_L = writes.force
    # u_L = m_L (g e3 + xdd_d) - k_p e - k_d edot - k_i int e
    m_L = params[0]
    g = params[1]
    sign = params[12]
    for k in range(3):
        e = load[0, k] - reference[0, k]
        e_dot = load[1, k] - reference[1, k]
        memory[k] = min(max(memory[k] + dt * e, -params[11]), params[11])
        gravity = g if k == 2 else 0.0
        u_L[k] = (
            sign * m_L * (gravity + params[13] * reference[2, k])
            - params[2 + k] * e
            - params[5 + k] * e_dot
            - params[8 + k] * memory[k]
        )


class Pid(LoadControlPart):
    """Load PID with the paper's gains; the integral gain, unpublished, is chosen.

    The paper prints ``-m_L (g e3 + xdd_d)`` where its own force balance needs ``+``; ``sign =
    "as-printed"`` flies the misprint, for demonstration.
    """

    kernel = _pid

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

    def params(self, team: Team) -> Vector:
        sign = 1.0 if self.sign == "corrected" else -1.0
        head = [team.load_mass, team.gravity, *self.k_p, *self.k_d, *self.k_i]
        return np.array([*head, self.integral_limit, sign, self.feed_forward])

    def memory(self, team: Team) -> Vector:
        return np.zeros(3)
