"""What allocators are asked to compare C with Python: smooth, noisy and rough forces, and Python's own answers."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from colift.control.allocation.base import INFO_SIZE
from colift.deploy.c.machines import Answers, Calls
from colift.kernel.ports import PORTS
from colift.part import Part, make
from colift.team import Team
from colift.team.geometry import ring

Array = NDArray[np.float64]

CASES = ("smooth", "noisy", "rough")
W = 2.2
"""Weight of the load, N."""
LIMITED: dict[str, Any] = {"max_thrust": 9.0, "max_tilt_deg": 45.0}
"""Settings of the safe allocator with limits on the drones' thrust."""

_PORT = PORTS["allocation"]
_invoke = _PORT.invoke


def allocator(kind: str, n: int, **settings: Any) -> tuple[Part, Team]:
    """A part and a team of n drones, whose cables have room for their least angle."""
    if kind == "safe" and n > 4:
        settings = {"min_angle_deg": 60.0 / n**0.5 - 8.0, **settings}
    return make("allocation", {"kind": kind, **settings}), Team.uniform(n, load_mass=W / 9.81)


def calls(part: Part, team: Team, case: str, count: int, seed: int) -> Calls:
    """Forces about the load's weight: a manoeuvre, the same with noise, or anything (no force, no number, too much)."""
    rng, t = np.random.default_rng(seed), 0.01 * np.arange(count)
    turns = np.stack([np.sin(0.9 * t), np.cos(0.7 * t), np.sin(1.3 * t)], axis=1)
    forces = W * (np.array([0.25, 0.25, 0.15]) * turns + np.array([0.0, 0.0, 1.0]))
    if case == "noisy":
        forces += rng.normal(0.0, 0.05 * W, forces.shape)
    if case == "rough":
        forces = rng.normal(0.0, W, forces.shape)
        forces[rng.random(count) < 0.02] *= 30.0
        forces[rng.random(count) < 0.01] = 0.0
        forces[rng.random(count) < 0.005, 0] = np.nan
        forces[rng.random(count) < 0.002, 1] = np.inf
    start = ring(team.n, np.radians(35.0))
    nothing = np.zeros((count, 3))
    return Calls(
        part.params(team), part.memory(team), start, forces, nothing, np.zeros((team.n, 3))
    )


@numba.njit
def _all(wire, forces, moments, dt, answers):  # type: ignore[no-untyped-def]
    n = wire.writes.desired_tensions.shape[0]
    for k in range(forces.shape[0]):
        for j in range(3):
            wire.sees.force[j] = forces[k, j]
            wire.sees.moment[j] = moments[k, j]
        answers[k, 0] = _invoke(wire, k, k * dt, dt)
        for j in range(INFO_SIZE):
            answers[k, 1 + j] = wire.writes.allocator_info[j]
        for i in range(n):
            answers[k, 1 + INFO_SIZE + i] = wire.writes.desired_tensions[i]
            for j in range(3):
                answers[k, 1 + INFO_SIZE + n + 3 * i + j] = wire.writes.desired_directions[i, j]


def by_python(part: Part, asked: Calls) -> Answers:
    """Answers of the kernel that Numba compiled."""
    n, count = len(asked.directions), len(asked.forces)
    signals = _PORT.signals(
        n, desired_directions=asked.directions.copy(), formation=asked.formation
    )
    wire = _PORT.wire(type(part).kernel, asked.params, asked.memory.copy(), signals)
    answers = np.empty((count, 1 + INFO_SIZE + 4 * n))
    _all(wire.compiled(), asked.forces, asked.moments, asked.dt, answers)
    end = 1 + INFO_SIZE + n
    return Answers(
        answers[:, 0], answers[:, 1 : 1 + INFO_SIZE], answers[:, 1 + INFO_SIZE : end],
        answers[:, end:].reshape(count, n, 3), np.zeros(count), 0,
    )  # fmt: skip


def the_same(one: Answers, other: Answers) -> NDArray[np.bool_]:
    """For each call whether the answers are the same in every bit; what is no number is that in both.

    The other may hold the answers to more calls than the one.
    """
    found = np.ones(len(one.status), dtype=bool)
    for a, b in zip(one[:4], other[:4], strict=True):
        flat = (np.ascontiguousarray(each[: len(found)]).reshape(len(found), -1) for each in (a, b))
        left, right = flat
        equal = left.view(np.int64) == right.view(np.int64)
        found &= np.all(equal | (np.isnan(left) & np.isnan(right)), axis=1)
    return found


def within(part: Part, asked: Calls, answers: Answers) -> dict[str, float]:
    """By how much the worst answer is outside of the safe allocator's limits: angle and cone in degrees, tension in N, turn in rad/s."""
    limits: Any = part.filled(Team.uniform(len(asked.directions), load_mass=W / 9.81))
    directions, tensions = answers.directions, answers.tensions
    before = np.concatenate([asked.directions[None], directions[:-1]])
    step = np.linalg.norm(directions - before, axis=2)
    i, j = np.triu_indices(directions.shape[1], 1)
    chords = np.linalg.norm(directions[:, i] - directions[:, j], axis=2)
    sideways = np.linalg.norm(directions[:, :, :2], axis=2)
    closest = np.degrees(2.0 * np.arcsin(0.5 * chords)).min() if len(i) else np.inf
    low, high = np.min(limits.tension_min), np.max(limits.tension_max)
    return {
        "angle": float(max(limits.min_angle_deg - closest, -180.0)),
        "cone": float(
            np.degrees(np.arctan2(sideways, -directions[:, :, 2])).max() - limits.max_cone_deg
        ),
        "tension": float(max(low - tensions[tensions > 0.0].min(), tensions.max() - high)),
        "turn": float(2.0 * np.arcsin(0.5 * step).max() / asked.dt - limits.max_rate),
    }
