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


def _eliminate(numbers):  # type: ignore[no-untyped-def]
    vectors.eliminate(numbers, 4, 3, 40, 71, 101, 0.3, -1.7, 2.9, 0.6)


def _add(numbers):  # type: ignore[no-untyped-def]
    vectors.add_quad(numbers, 3, numbers, 71, -1.7)


def _solve(numbers):  # type: ignore[no-untyped-def]
    vectors.solve(numbers, 4, 3, 40, 0.3, -1.7, 2.9)


@pytest.mark.parametrize(
    ("step", "changes"), [(_eliminate, (3, 40)), (_add, (3,)), (_solve, (3, 40))]
)
def test_four_numbers_at_a_time_are_what_plain_python_does(step, changes) -> None:
    begin = np.random.default_rng(3).standard_normal(150)
    found, wanted = begin.copy(), begin.copy()
    kernel(void(vector))(step)(found)
    step(wanted)
    places = [place + k for place in changes for k in range(vectors.QUAD)]
    assert list(np.flatnonzero(found != begin)) == places
    assert found == pytest.approx(wanted, abs=1e-14)


@kernel(void(vector, i8))
def _whole_quads(numbers, count):  # type: ignore[no-untyped-def]
    vectors.eliminate(numbers, count, 3, 40, 71, 101, 0.3, -1.7, 2.9, 0.6)


def test_columns_end_with_whole_quads() -> None:
    begin = np.random.default_rng(3).standard_normal(150)
    found = begin.copy()
    _whole_quads(found, 22)
    assert list(np.flatnonzero(found != begin)) == [*range(3, 27), *range(40, 64)]


@pytest.mark.parametrize("n", [9, 16, 40])
def test_steps_by_columns_are_newtons(n) -> None:
    """A wrong matrix would still converge, but not in so few steps, of which up to two have the matrix of the first."""
    problem = Problem("safe", n)
    turn = Compiled(problem.own, problem).turn(problem.forces(100, "smooth"))
    assert turn.solved.all()
    assert turn.iterations.max() <= 4


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
