"""The allocators for rigid loads beside the safe one: the paper's cost, internal forces, the cascade of QPs."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize
from test_rigid_loads import MASS, WEIGHT, missing, team_of, turn

from colift import part
from colift.control.allocation.base import Allocator, Status
from colift.control.allocation.common.oracle import paper_objective
from colift.control.allocation.internal_force_wrench import InternalForceWrench
from colift.control.allocation.sqp import SqpAllocator
from colift.control.allocation.sqp_wrench import SqpWrench
from colift.control.allocation.wahba_hoenig import least_forces
from colift.control.allocation.wahba_hoenig_wrench import (
    half_spaces,
    pair_forces,
    rows_of,
    separating_plane,
)
from colift.control.allocation.wrench_min_norm import WrenchMinNorm
from colift.team.geometry import matrix_of
from colift.team.plan import plan, wrench_map

KINDS = [
    kind
    for kind in part.names("allocation")
    if kind != "external" and part.find("allocation", kind).wrenches
]


def made(kind, **settings):
    found = part.find("allocation", kind)
    if message := found.missing():
        pytest.skip(message)
    return found(**settings)


def allocator_of(settings, n):
    """With the plan's formation to start from."""
    allocator = Allocator(settings, team_of(n))
    allocator.reset(*plan(allocator.team))
    return allocator


def flown(n, calls):
    """Wrenches and attitudes of a slow motion; the attitude is wanted and measured."""
    for k in range(calls):
        t = 0.05 * k
        force = MASS * np.array([2.0 * math.sin(t), 2.0 * math.sin(1.3 * t), 9.81])
        moment = 0.02 * np.sin([t, 2.0 * t, 3.0 * t])
        roll = 0.0 if n == 2 else 0.15
        attitude = turn(roll * math.sin(1.1 * t), 0.1 * math.sin(0.9 * t), 0.5 * math.sin(0.7 * t))
        yield force, moment, attitude


def line_of(team, attitude):
    """Unit vector along the ends of two cables."""
    line = matrix_of(attitude) @ (team.levers[1] - team.levers[0])
    return line / np.linalg.norm(line)


def makeable(team, force, moment, attitude):
    """The moment less what two cables cannot make."""
    if team.n != 2:
        return moment
    line, ends = line_of(team, attitude), team.levers @ matrix_of(attitude).T
    return moment - line * (line @ (moment - np.cross(ends.mean(axis=0), force)))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [2, 3, 4, 6])
def test_the_whole_wrench_is_given_and_what_is_missing_of_it_told(kind, n):
    allocator = allocator_of(made(kind), n)
    for force, moment, attitude in flown(n, 40):
        answer = allocator.allocate(
            force, moment=moment, attitude=attitude, wanted_attitude=attitude
        )
        assert answer.status.ok
        left = missing(allocator.team, answer, force, moment, attitude)
        assert answer.force_residual == pytest.approx(np.linalg.norm(left[:3]), abs=1e-12)
        assert answer.moment_residual == pytest.approx(np.linalg.norm(left[3:]), abs=1e-12)
        asked = makeable(allocator.team, force, moment, attitude)
        assert_allclose(left[:3], 0.0, atol=1e-9)
        assert_allclose(left[3:], moment - asked, atol=1e-9)


@pytest.mark.parametrize("kind", KINDS)
def test_a_moment_about_the_line_of_two_cables_is_left_out_and_told(kind):
    allocator = allocator_of(made(kind), 2)
    about = line_of(allocator.team, [1.0, 0.0, 0.0, 0.0])
    free = allocator.allocate([0.0, 0.0, WEIGHT]).moment_residual
    answer = allocator.allocate([0.0, 0.0, WEIGHT], moment=0.3 * about)
    assert free == pytest.approx(0.0, abs=1e-9)
    assert answer.moment_residual == pytest.approx(0.3, abs=1e-9)
    assert answer.force_residual < 1e-9
    assert answer.status.ok


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("n", [2, 4])
def test_what_is_no_number_repeats_the_last_answer_and_nothing_is_ever_none(kind, n):
    allocator = allocator_of(made(kind), n)
    level, rest, nan = [1.0, 0.0, 0.0, 0.0], [0.0] * 3, math.nan
    good = allocator.allocate([0.1, 0.0, WEIGHT], moment=[0.0, 0.01, 0.0])
    for force, moment, attitude in (
        ([nan, 0.0, 1.0], rest, level),
        ([0.0, 0.0, 1.0], [0.0, math.inf, 0.0], level),
        ([0.0, 0.0, 0.0], [0.0, nan, 0.0], level),
        ([0.0, 0.0, 1.0], rest, [nan, 0.0, 0.0, 0.0]),
        ([0.0, 0.0, 1.0], rest, [0.0] * 4),
    ):
        answer = allocator.allocate(force, moment=moment, attitude=attitude)
        assert answer.status is Status.INVALID_FORCE
        assert np.array_equal(answer.tensions, good.tensions)
        assert np.array_equal(answer.directions, good.directions)
        assert math.isnan(answer.moment_residual)
        assert answer.active_limits == 0
    for force, moment in (
        (rest, rest),
        (rest, [1.0, 0.0, 0.0]),
        ([0.0, 0.0, -WEIGHT], rest),
        ([1e9, -1e9, 1e9], [1e9, 1e9, -1e9]),
        ([0.0, 0.0, 1e-9], [1e9, 0.0, 0.0]),
        ([1e-300, 0.0, 0.0], [5e-324, 0.0, 0.0]),
    ):
        for _ in range(5):
            answer = allocator.allocate(force, moment=moment, attitude=level)
            assert np.isfinite(answer.tensions).all()
            assert np.all(answer.tensions >= 0.0)
            assert_allclose(np.linalg.norm(answer.directions, axis=1), 1.0, atol=1e-9)
    assert any(allocator.allocate([0.0, 0.0, WEIGHT]).status.ok for _ in range(300))


# ---------------------------------------------------------------- sqp-wrench


def free_forces(team, force, moment, attitude):
    """Forces (3 n,) that make the wrench, and a basis (3 n, k) of those that make none."""
    ends = team.levers @ matrix_of(attitude).T
    wanted = -np.concatenate([force, makeable(team, force, moment, attitude)])
    balance = wrench_map(ends)
    _, sizes, rows = np.linalg.svd(balance)
    return np.linalg.lstsq(balance, wanted, rcond=1e-9)[0], rows[np.count_nonzero(sizes > 1e-9) :].T


def cost(mu, w):
    """The paper's, of cable forces (3 n,)."""
    pulls = w.reshape(-1, 3)
    tensions = np.linalg.norm(pulls, axis=1)
    return paper_objective(mu, tensions, pulls / np.maximum(tensions, 1e-12)[:, None])


@pytest.mark.parametrize("n", [2, 3, 4, 6])
@pytest.mark.parametrize("mu", [0.15, 0.4])
def test_no_forces_that_make_the_same_wrench_cost_less_nearby_nor_for_another_solver(n, mu):
    """Without constraints, in the null space of the balance: tensions are lengths there, and never negative."""
    allocator, rng = allocator_of(SqpWrench(mu=mu), n), np.random.default_rng(n)
    h = 1e-6
    for k, (force, moment, attitude) in enumerate(flown(n, 25)):
        answer = allocator.allocate(force, moment=moment, attitude=attitude)
        assert answer.status is Status.CONVERGED
        w = (answer.tensions[:, None] * answer.directions).ravel()
        assert answer.objective == pytest.approx(cost(mu, w), rel=1e-12)
        assert answer.optimality_gap >= -1e-9
        start, free = free_forces(allocator.team, force, moment, attitude)
        slope = [(cost(mu, w + h * d) - cost(mu, w - h * d)) / (2.0 * h) for d in free.T]
        assert np.abs(slope).max() < 1e-5
        if k % 8 == 0:
            tries = [
                minimize(
                    lambda y, start=start, free=free: cost(mu, start + free @ y),
                    free.T @ (w + spread * rng.normal(size=3 * n) - start),
                    method="BFGS",
                    options={"gtol": 1e-9},
                ).fun
                for spread in (0.0, 0.2, 0.2)
            ]
            assert answer.objective <= min(tries) + 1e-6


@pytest.mark.parametrize("n", [4, 6, 8])
def test_a_load_that_asks_for_no_moment_is_carried_at_the_cost_of_a_point(n):
    allocator = allocator_of(SqpWrench(mu=0.4), n)
    for _ in range(3):
        answer = allocator.allocate([0.0, 0.0, WEIGHT])
    point = SqpAllocator(n, mu=0.4).allocate([0.0, 0.0, WEIGHT])
    assert answer.objective == pytest.approx(point.objective, rel=1e-9)
    assert answer.optimality_gap == pytest.approx(0.0, abs=1e-7)


@pytest.mark.parametrize("n", [3, 4])
def test_parallel_cables_are_a_saddle_that_is_left(n):
    allocator = Allocator(SqpWrench(mu=0.75), team_of(n))
    down = np.tile([0.0, 0.0, -1.0], (n, 1))
    allocator.reset(down, np.full(n, WEIGHT / n))
    answer = allocator.allocate([0.0, 0.0, WEIGHT])
    shares = np.linalg.lstsq(
        wrench_map(allocator.team.levers)[:, 2::3], [0, 0, WEIGHT, 0, 0, 0], rcond=None
    )[0]
    assert answer.status is Status.CONVERGED
    assert answer.objective < paper_objective(0.75, shares, down) - 0.1


def test_an_iteration_that_is_cut_short_balances_the_wrench():
    allocator = allocator_of(SqpWrench(mu=0.75, max_iterations=1), 4)
    rng, seen = np.random.default_rng(2), set()
    for _ in range(30):
        force = np.array([0.0, 0.0, WEIGHT]) + rng.normal(size=3)
        moment = 0.1 * rng.normal(size=3)
        answer = allocator.allocate(force, moment=moment)
        seen.add(answer.status)
        assert answer.iterations <= 1
        assert_allclose(missing(allocator.team, answer, force, moment), 0.0, atol=1e-9)
    assert Status.ITERATION_LIMIT in seen


def test_on_a_point_it_is_the_allocator_for_points():
    one, other = Allocator(SqpWrench(mu=0.4), 5), SqpAllocator(5, mu=0.4)
    for k in range(10):
        force = [0.3 * math.sin(k), 0.3 * math.cos(k), 2.2]
        a, b = one.allocate(force), other.allocate(force)
        assert a.objective == pytest.approx(b.objective, rel=1e-9)
        assert_allclose(a.directions, b.directions, atol=1e-5)


# ---------------------------------------------------------------- internal-force-wrench


@pytest.mark.parametrize("n", [2, 3, 4, 8])
def test_internal_forces_pull_the_ends_apart_and_make_no_wrench(n):
    bare, pulled = (
        Allocator(InternalForceWrench(internal_force=size), team_of(n)) for size in (0.0, 0.6)
    )
    for force, moment, attitude in flown(n, 10):
        one, other = (
            each.allocate(force, moment=moment, attitude=attitude) for each in (bare, pulled)
        )
        ends = bare.team.levers @ matrix_of(attitude).T
        internal = one.tensions[:, None] * one.directions
        internal -= other.tensions[:, None] * other.directions  # on the load
        assert_allclose(wrench_map(ends) @ internal.ravel(), 0.0, atol=1e-12)
        away = ends - ends.mean(axis=0)
        assert_allclose(np.cross(internal, away), 0.0, atol=1e-12)
        assert np.linalg.norm(internal, axis=1).max() == pytest.approx(0.6)
        assert np.all(np.sum(internal * away, axis=1) >= -1e-12)
        # And without them no forces that make the wrench are smaller.
        least = free_forces(bare.team, force, moment, attitude)[0].reshape(n, 3)
        assert_allclose(one.tensions[:, None] * one.directions, least, atol=1e-9)


def test_two_robots_pull_a_beam_apart_as_in_the_paper():
    allocator = allocator_of(InternalForceWrench(internal_force=0.7), 2)
    beam = line_of(allocator.team, [1.0, 0.0, 0.0, 0.0])
    answer = allocator.allocate([0.0, 0.0, WEIGHT])
    pulls = -answer.tensions[:, None] * answer.directions
    half = np.array([0.0, 0.0, 0.5 * WEIGHT])
    assert_allclose(pulls, [half - 0.7 * beam, half + 0.7 * beam], atol=1e-12)


def test_by_itself_the_internal_force_leans_cables_on_corners_by_thirty_degrees():
    answer = allocator_of(InternalForceWrench(), 4).allocate([0.0, 0.0, WEIGHT])
    assert_allclose(np.degrees(np.arccos(-answer.directions[:, 2])), 30.0, atol=1e-9)


# ---------------------------------------------------------------- wahba-hoenig-wrench


def asked_of(allocator, force, moment, attitude):
    """What the cascade is asked: the problem in units of the force."""
    ends = allocator.team.levers @ matrix_of(attitude).T
    size, middle = np.linalg.norm(force), ends.mean(axis=0)
    unit = np.asarray(force) / size
    return type("Asked", (), {
        "force": unit, "moment": moment / size - np.cross(middle, unit), "ends": ends - middle,
    })  # fmt: skip


def test_a_pair_s_forces_are_the_least_squares_of_themselves_and_the_missing_moment():
    rng = np.random.default_rng(3)
    for _ in range(20):
        ends, force, moment = rng.normal(size=(2, 3)), rng.normal(size=3), rng.normal(size=3)
        found = pair_forces(ends, force, moment)
        assert_allclose(found.sum(axis=0), force, atol=1e-12)
        balance = wrench_map(ends)

        def price(g, balance=balance, force=force, moment=moment):
            pair = np.concatenate([g, force - g])
            return pair @ pair + np.sum((balance[3:] @ pair - moment) ** 2)

        assert price(found[0]) == pytest.approx(minimize(price, np.zeros(3)).fun, rel=1e-6)


def test_a_plane_has_cables_on_either_side_as_far_as_any_can():
    pytest.importorskip("daqp", reason="optional: the extra qp")
    rng = np.random.default_rng(4)
    for _ in range(20):
        near, far = rng.normal(size=(2, 3)), rng.normal(size=(2, 3)) + [4.0, 0.0, 0.0]
        normal, offset = separating_plane(near, far, (near[0], far[0]), 1000.0)
        room = min((offset - near @ normal).min(), (far @ normal - offset).min())
        assert room > 0.0
        # No plane has more room than half of the distance between two of their points.
        s, t = np.meshgrid(np.linspace(0, 1, 101), np.linspace(0, 1, 101))
        gap = (
            near[0] + s[..., None] * (near[1] - near[0]) - far[0] - t[..., None] * (far[1] - far[0])
        )
        assert room == pytest.approx(0.5 * np.linalg.norm(gap, axis=2).min(), abs=2e-3)
    assert separating_plane(near, near, (near[0], near[1]), 1000.0) is None


@pytest.mark.parametrize("n", [3, 4, 6])
def test_the_last_qp_of_the_cascade_agrees_with_another_solver(n):
    allocator = allocator_of(made("wahba-hoenig-wrench", settling=0.0), n)
    team, settings = allocator.team, allocator.part
    for k, (force, moment, attitude) in enumerate(flown(n, 25)):
        before = allocator._directions.copy()
        answer = allocator.allocate(force, moment=moment, attitude=attitude)
        assert answer.status.ok
        pulls = -answer.tensions[:, None] * answer.directions / np.linalg.norm(force)
        problem = asked_of(allocator, force, moment, attitude)
        owners, normals = half_spaces(
            problem.ends, team.cable_lengths, before, problem, settings.tilts(team), settings.plane_weight,
        )  # fmt: skip
        assert np.max(np.sum(normals * pulls[owners], axis=1), initial=0.0) < 1e-7
        if k % 8 != 4:
            continue
        balance, wanted = rows_of(problem)
        other = minimize(
            lambda x: 0.5 * x @ x,
            pulls.ravel(),
            jac=lambda x: x,
            method="SLSQP",
            constraints=[
                {"type": "eq", "fun": lambda x, b=balance, f=wanted: b @ x - f},
                {
                    "type": "ineq",
                    "fun": lambda x, o=owners, s=normals: -np.sum(s * x.reshape(n, 3)[o], axis=1),
                },
            ],
            options={"ftol": 1e-14, "maxiter": 500},
        )
        assert_allclose(pulls, other.x.reshape(n, 3), atol=1e-5)
        assert least_forces(owners, normals, wanted, 0.0 * pulls, np.zeros(len(owners)), balance)


def test_drones_over_the_box_s_short_side_are_kept_apart():
    """Where least forces alone would be parallel, as far from each other as the corners."""
    allocator = allocator_of(made("wahba-hoenig-wrench", settling=0.0, distance=0.6), 4)
    for _ in range(5):
        answer = allocator.allocate([0.0, 0.0, WEIGHT])
    drones = allocator.team.levers - answer.directions
    i, j = np.triu_indices(4, k=1)
    nearest = np.linalg.norm(drones[i] - drones[j], axis=1).min()
    assert answer.active_limits == 64
    assert nearest == pytest.approx(0.6, abs=0.01)
    bare = Allocator(InternalForceWrench(internal_force=0.0), allocator.team)
    assert np.ptp(bare.allocate([0.0, 0.0, WEIGHT]).directions, axis=0).max() < 1e-9


def test_drones_that_stand_on_the_wrong_sides_start_anew_from_the_ring():
    allocator = Allocator(made("wahba-hoenig-wrench"), team_of(4))
    crossed = np.column_stack([3.0 * allocator.team.levers[:, :2], np.full(4, -1.0)])
    allocator.reset(crossed)
    first = allocator.allocate([0.0, 0.0, WEIGHT])
    assert first.status is Status.RECOVERING
    assert first.moment_residual < 1e-9
    assert allocator.allocate([0.0, 0.0, WEIGHT]).status.ok


def test_the_plan_is_what_the_pseudo_inverse_is_nearest_to_whatever_is_missing():
    """One that leaves a moment out has no worse force for it."""
    allocator = allocator_of(WrenchMinNorm(), 2)
    answer = allocator.allocate([0.2, 0.1, WEIGHT], moment=[0.1, 0.2, 0.3])
    assert answer.force_residual < 1e-12
    assert answer.status is Status.CONVERGED
