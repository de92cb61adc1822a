"""Properties of any single answer: feasibility, symmetry, the certificate."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from colift.control.allocation.base import Status
from colift.control.allocation.sqp import Sqp, SqpAllocator
from colift.team.geometry import ring

sizes = st.integers(1, 9)
seeds = st.integers(0, 2**32 - 1)
weights = st.floats(-4.0, 2.0).map(lambda e: 10.0**e)
forces = st.tuples(*[st.floats(-30.0, 30.0)] * 3).map(np.array)


def solve(n, mu, start, force, tensions=None, **settings_):
    allocator = SqpAllocator(n, mu, **settings_)
    allocator.reset(directions=start, tensions=tensions)
    return allocator.allocate(force)


@settings(max_examples=150, deadline=None)
@given(n=sizes, mu=st.one_of(st.just(0.0), weights), force=forces, seed=seeds)
def test_every_answer_is_feasible_and_above_the_certificate(n, mu, force, seed):
    W = np.linalg.norm(force)
    assume(W > 1e-6)
    rng = np.random.default_rng(seed)
    answer = solve(n, mu, rng.normal(size=(n, 3)), force, tensions=rng.uniform(0.0, 3.0, n))
    assert answer.status in (Status.CONVERGED, Status.ITERATION_LIMIT)
    assert (answer.tensions >= 0.0).all()
    assert_allclose(np.linalg.norm(answer.directions, axis=1), 1.0, atol=1e-14)
    imbalance = np.linalg.norm(answer.tensions @ answer.directions + force)
    assert imbalance <= 1e-12 * W * n
    assert abs(answer.force_residual - imbalance) <= 1e-14 * W * n
    assert answer.optimality_gap >= -1e-12 * (W**2 + mu * n**2)
    if answer.status.ok:
        assert answer.kkt_residual <= 1e-8


@settings(max_examples=40, deadline=None)
@given(n=sizes, seed=seeds, cap=st.integers(1, 3))
def test_an_answer_cut_short_is_feasible_and_no_worse_than_its_start(n, seed, cap):
    rng = np.random.default_rng(seed)
    force = np.array([0.2, 0.1, 2.2])
    start = rng.normal(size=(n, 3))
    costs = []
    for iterations in (cap, cap + 1):
        answer = solve(n, 0.15, start, force, max_iterations=iterations)
        assert answer.iterations <= iterations
        assert (answer.tensions >= 0.0).all()
        assert_allclose(answer.tensions @ answer.directions, -force, atol=1e-13)
        costs.append(answer.objective)
    assert costs[1] <= costs[0] + 1e-12 * n


def random_rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0.0 else -q


@example(n=3, mu=0.8802456675221252, seed=27498)
@settings(max_examples=60, deadline=None)
@given(n=st.integers(3, 8), mu=st.floats(0.05, 1.0), seed=seeds)
def test_turning_the_problem_turns_the_whole_answer(n, mu, seed):
    # Tangent bases differ, but the convexified blocks are functions of the blocks' eigenvalues.
    rng = np.random.default_rng(seed)
    R = random_rotation(rng)
    start = ring(n, 0.6) + 0.1 * rng.normal(size=(n, 3))
    force = np.array([0.0, 0.0, 2.2]) + 0.3 * rng.normal(size=3)
    one = solve(n, mu, start, force)
    two = solve(n, mu, start @ R.T, R @ force)
    if two.iterations != one.iterations:  # rounding decides where the residual is at the tolerance
        fewer = min(one, two, key=lambda answer: answer.iterations)
        assert abs(two.iterations - one.iterations) == 1
        assert fewer.kkt_residual > 0.99 * Sqp().tolerance
    assert abs(two.objective - one.objective) <= 1e-10 * (1.0 + mu)
    assert_allclose(two.tensions, one.tensions, atol=1e-7)
    assert_allclose(two.directions, one.directions @ R.T, atol=1e-7)


@settings(max_examples=60, deadline=None)
@given(n=st.integers(2, 8), mu=st.floats(0.05, 1.0), seed=seeds)
def test_renaming_the_drones_renames_the_answer(n, mu, seed):
    rng = np.random.default_rng(seed)
    order = rng.permutation(n)
    start = ring(n, 0.6) + 0.1 * rng.normal(size=(n, 3))
    force = np.array([0.0, 0.0, 2.2]) + 0.3 * rng.normal(size=3)
    one = solve(n, mu, start, force)
    two = solve(n, mu, start[order], force)
    assert abs(two.objective - one.objective) <= 1e-10 * (1.0 + mu)
    assert_allclose(two.tensions, one.tensions[order], atol=1e-7)
    assert_allclose(two.directions, one.directions[order], atol=1e-7)


@settings(max_examples=30, deadline=None)
@given(n=st.integers(2, 8), seed=seeds)
def test_warm_and_cold_answers_cost_the_same(n, seed):
    rng = np.random.default_rng(seed)
    allocator = SqpAllocator(n, 0.15)
    for _ in range(5):
        force = np.array([0.0, 0.0, 2.2]) + 0.3 * rng.normal(size=3)
        warm = allocator.allocate(force)
        assert warm.status.ok
        assert abs(warm.objective - SqpAllocator(n, 0.15).allocate(force).objective) <= 1e-8
