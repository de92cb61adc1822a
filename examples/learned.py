"""An allocator that was learned, from a file of plain numbers: ``learn_hover.py`` beside it writes one.

colift compare --with examples/learned.py
"""

import math
from pathlib import Path

import numpy as np
from pydantic import field_validator

from colift.control.allocation.base import INFO_BALANCE, SIGNATURE, AllocatorPart, Status
from colift.kernel.jit import kernel
from colift.kernel.layout import Layout

SEEN = 9
"""What decides each drone's pull: the wanted force and acceleration, and its pull at rest, as in ``colift.learn``."""
SPAN, STEEPEST = 0.5, 0.1
PARAMS = Layout(team={"weight": 1, "g": 1, "gains": 3 * SEEN, "bias": 3})
MEMORY = Layout(team={"begun": 1}, drone={"rest": 3})
P, M = PARAMS.at, MEMORY.at


@kernel(SIGNATURE, counted=False)
def decide(now, sees, params, memory, writes):
    F, motion = sees.force, sees.reference
    T, alpha, info = writes.desired_tensions, writes.desired_directions, writes.allocator_info
    n, weight = T.shape[0], params[P.weight]
    if not math.isfinite(F[0] * F[0] + F[1] * F[1] + F[2] * F[2]):
        return Status.INVALID_FORCE
    share, left_x, left_y, left_z = weight / n, F[0], F[1], F[2]
    for i in range(n):
        o = M.rows + M.width * i
        if memory[M.begun] == 0.0:  # the formation of the start, or of who is left
            tension = share / max(-alpha[i, 2], STEEPEST)
            for k in range(3):
                memory[o + M.rest + k] = -tension * alpha[i, k]
        for k in range(3):
            s, row = params[P.bias + k], P.gains + SEEN * k
            for m in range(3):
                s += params[row + m] * (F[m] / weight - (1.0 if m == 2 else 0.0))
                s += params[row + 3 + m] * motion[2, m] / params[P.g]
                s += params[row + 6 + m] * memory[o + M.rest + m] / share
            s = min(max(s, -1.0), 1.0) if s == s else 0.0
            alpha[i, k] = -(memory[o + M.rest + k] + SPAN * share * s)
        x, y, z = alpha[i, 0], alpha[i, 1], alpha[i, 2]
        left_x, left_y, left_z = left_x + x, left_y + y, left_z + z
        T[i] = math.sqrt(x * x + y * y + z * z)
        if T[i] > 1e-9:
            alpha[i, 0], alpha[i, 1], alpha[i, 2] = x / T[i], y / T[i], z / T[i]
        else:
            alpha[i, 0], alpha[i, 1], alpha[i, 2] = 0.0, 0.0, -1.0
    memory[M.begun] = 1.0
    for k in range(info.shape[0]):
        info[k] = 0.0
    info[INFO_BALANCE] = math.sqrt(left_x**2 + left_y**2 + left_z**2)
    return Status.CONVERGED


def read(path):
    """Gains (3, 9) and bias (3,) of a policy."""
    try:
        with np.load(path, allow_pickle=False) as file:
            found = {name: np.asarray(file[name], dtype=float) for name in ("gains", "bias")}
    except (OSError, KeyError, ValueError) as error:
        raise ValueError(f"{path}: is no policy: {error}") from None
    for name, shape in (("gains", (3, SEEN)), ("bias", (3,))):
        if found[name].shape != shape or not np.isfinite(found[name]).all():
            raise ValueError(f"{path}: {name} must be finite numbers of shape {shape}")
    return found["gains"], found["bias"]


class Learned(AllocatorPart):
    """A learned allocator for a point load: each drone's pull, by the wanted force and the formation of the start."""

    kernel = decide
    remembers = MEMORY

    file: str = str(Path(__file__).with_name("learned.npz"))
    """Of the policy."""

    @field_validator("file")
    @classmethod
    def _is_policy(cls, value):
        read(value)
        return value

    def params(self, team):
        gains, bias = read(self.file)
        weight = team.load_mass * team.gravity
        return PARAMS.pack(team.n, weight=weight, g=team.gravity, gains=gains.ravel(), bias=bias)

    def carry_over(self, old, fresh, places):
        return fresh
