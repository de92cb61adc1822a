"""Many cables: the matrix by columns, pairs that are left out of it, and work that is bounded."""

from __future__ import annotations

import math

import numpy as np
import pytest

from colift.kernel.jit import i8, kernel, vector, void
from colift.kernel.math import vectors
from colift.study.bench.problems import Problem
from colift.study.bench.timing import Compiled
from colift.team.geometry import pairwise_angles


@kernel(void(vector, i8))
def _eliminate(numbers, count):  # type: ignore[no-untyped-def]
    vectors.eliminate(numbers, count, 3, 40, 71, 101, 0.3, -1.7, 2.9, 0.6)


def test_quads_are_what_plain_python_does() -> None:
    begin = np.random.default_rng(3).standard_normal(150)
    found, wanted = begin.copy(), begin.copy()
    _eliminate(found, 22)
    for k in range(0, 22, vectors.QUAD):
        vectors.eliminate_quad(wanted, 3 + k, 40 + k, 71 + k, 101 + k, 0.3, -1.7, 2.9, 0.6)
    changed = np.flatnonzero(found != begin)
    assert list(changed) == [*range(3, 27), *range(40, 64)]  # whole quads
    assert found == pytest.approx(wanted, abs=1e-15)


@pytest.mark.parametrize("n", [9, 16, 40])
def test_steps_by_columns_are_newtons(n) -> None:
    """A wrong matrix would still converge, but not in two or three steps."""
    problem = Problem("safe", n)
    turn = Compiled(problem.own, problem).turn(problem.forces(100, "smooth"))
    assert turn.solved.all()
    assert turn.iterations.max() <= 3


def test_hostile_cycles_are_bounded_and_within_the_limits() -> None:
    problem = Problem("safe", 12)
    rng = np.random.default_rng(8)
    weight = problem.forces(1, "smooth")[0, 2]
    forces = weight * (rng.choice([-1.0, 0.0, 1.0], (400, 3)) * [0.5, 0.5, 0.4] + [0.0, 0.0, 1.0])
    turn = Compiled(problem.own, problem).turn(np.repeat(forces, 5, axis=0))
    assert 18 <= turn.iterations.max() <= problem.own.max_iterations
    assert pairwise_angles(turn.directions).min() > math.radians(problem.own.min_angle_deg)
    assert turn.tensions.max() < 5.0
    assert turn.tensions.min() > 0.05
