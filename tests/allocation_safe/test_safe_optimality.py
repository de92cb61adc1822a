"""The safe allocator's answer is a stationary point of its own problem, and near the paper's."""

from __future__ import annotations

import math

import numpy as np
import pytest

from colift.control.allocation.limits.cycle import JUMP, TURN
from colift.control.allocation.safe import RATE_BARRIER, SafeAllocator
from colift.team import Team
from colift.team.geometry import ring, rotation_between


def barrier_problem(allocator: SafeAllocator, before, home, acceleration, w):
    """The function that one cycle minimises, written down a second time from the docstring."""
    part, team = allocator.part, allocator.team
    sigma = team.load_mass * team.gravity / team.n
    T = np.linalg.norm(w, axis=1)
    alpha = w / T[:, None]
    gram = alpha @ alpha.T
    i, j = np.triu_indices(team.n, 1)
    rho, delta = part.settling / allocator.dt, part.turn_rate(allocator.team) * allocator.dt
    least = math.radians(part.min_angle_deg)
    edge = math.cos(least + max(part._reach(team.n, least), 2 * delta))
    fade = np.clip(((before @ before.T)[i, j] - edge) / (math.cos(least) - edge), 0.0, 1.0)
    kappa_pair = part.spread * (fade * (2.0 - fade)) ** 2
    thrust = team.masses[:, None] / sigma * (acceleration + [0, 0, team.gravity]) - w
    size = np.linalg.norm(thrust, axis=1)
    limits = [
        part.tension_caps(team) / sigma - T,
        T - part.tension_floors(team) / sigma,
        -w[:, 2] - math.cos(math.radians(part.max_cone_deg)) * T,
        part.max_thrust / sigma - size,
        thrust[:, 2] - math.cos(math.radians(part.max_tilt_deg)) * size,
    ]
    rate = np.sum(before * alpha, axis=1) - math.cos(delta)
    value = 0.5 * T @ T + part.penalty(allocator.team) / sigma**2 * np.sum(gram[i, j] ** 2)
    value += rho * np.sum(1.0 - np.sum(alpha * home, axis=1))
    value -= part.barrier * sum(np.sum(np.log(g)) for g in limits)
    value -= 0.5 * RATE_BARRIER * max(rho, 1.0) * delta**2 * np.sum(np.log(rate))
    return value - np.sum(kappa_pair * np.log(math.cos(least) - gram[i, j]))


def turned(allocator, before, facing, force):
    """Centre of the proximal term, and the direction of the force that it follows."""
    aim = force / np.linalg.norm(force)
    if facing is None:
        return before, aim
    part, dt = allocator.part, allocator.dt
    way = aim - facing
    size = np.linalg.norm(way)
    share = min(dt / (part.turning + dt), TURN * part.turn_rate(allocator.team) * dt / size)
    fresh = facing + share / (1.0 + (size / JUMP) ** 4) * way
    fresh /= np.linalg.norm(fresh)
    turn = rotation_between(facing, fresh).T
    return before @ turn @ turn, fresh


@pytest.mark.parametrize("n", [2, 3, 4, 6])
def test_the_answer_is_stationary_in_every_direction_that_keeps_the_force(n):
    allocator = SafeAllocator(n, max_thrust=12.0, max_tilt_deg=60.0, tolerance=1e-10)
    rng, facing = np.random.default_rng(n), None
    directions = ring(n, math.radians(60.0))
    allocator.reset(directions=directions)
    for _ in range(20):
        before = directions
        acceleration = 0.2 * rng.standard_normal(3)
        force = 0.225 * (acceleration + [0.0, 0.0, 9.81])
        home, facing = turned(allocator, before, facing, force)
        answer = allocator.allocate(force, acceleration)
        directions = answer.directions
        if not answer.status.ok:
            continue
        sigma = 0.225 * 9.81 / n
        w = answer.tensions[:, None] * answer.directions / sigma
        for _ in range(5):
            step = rng.standard_normal((n, 3))
            step -= step.mean(axis=0)
            h = 1e-6
            up = barrier_problem(allocator, before, home, acceleration, w + h * step)
            down = barrier_problem(allocator, before, home, acceleration, w - h * step)
            assert abs(up - down) / (2 * h) < 1e-4


@pytest.mark.parametrize("n", [3, 4, 6])
def test_at_rest_it_ends_near_the_global_optimum_of_the_paper(n):
    mu = 0.15 * 64 / n**3 * 4 if n > 4 else 0.3
    allocator = SafeAllocator(n, mu, min_angle_deg=20.0)
    for _ in range(1500):
        answer = allocator.allocate([0.0, 0.0, 2.2])
    assert answer.status.ok
    assert answer.kkt_residual <= 1e-6
    assert 0.0 <= answer.optimality_gap <= 0.02 * answer.objective
    assert answer.objective == pytest.approx(
        allocator.part.objective(answer.tensions, answer.directions), rel=1e-9
    )


def test_it_agrees_with_slsqp_on_the_hard_problem():
    optimize = pytest.importorskip("scipy.optimize")
    rng = np.random.default_rng(3)
    i, j = np.triu_indices(4, 1)
    for _ in range(4):
        mu = 10 ** rng.uniform(-1.5, 0.3)
        allocator = SafeAllocator(4, mu, spread=1e-5, barrier=1e-6, max_iterations=100, dt=0.02)
        force = np.array([0.0, 0.0, 2.2]) * rng.uniform(0.5, 2.0) + 0.3 * rng.standard_normal(3)
        for _ in range(1500):
            answer = allocator.allocate(force)

        def parts(x):
            w = x.reshape(4, 3)
            T = np.linalg.norm(w, axis=1)
            return w, T, w / T[:, None]

        def cost(x, mu=mu):
            _, T, alpha = parts(x)
            return 0.5 * T @ T + mu * np.sum((alpha @ alpha.T)[i, j] ** 2)

        def limits(x):
            _, T, alpha = parts(x)
            pairs = math.cos(math.radians(30.0)) - (alpha @ alpha.T)[i, j]
            return np.concatenate(
                [T - 0.05, 5.0 - T, -alpha[:, 2] - math.cos(math.radians(75)), pairs]
            )

        found = optimize.minimize(
            cost,
            (answer.tensions[:, None] * answer.directions).ravel(),
            method="SLSQP",
            constraints=[
                {"type": "ineq", "fun": limits},
                {"type": "eq", "fun": lambda x, f=force: parts(x)[0].sum(axis=0) + f},
            ],
            options={"maxiter": 500, "ftol": 1e-12},
        )
        assert found.success
        assert answer.objective == pytest.approx(found.fun, rel=5e-3)
        assert answer.objective >= found.fun - 1e-8


def test_the_order_of_the_cables_does_not_matter():
    rng = np.random.default_rng(1)
    first = SafeAllocator(Team.uniform(12, load_mass=0.7), min_angle_deg=20.0)
    start = ring(12, math.radians(60.0))
    first.reset(directions=start)
    shuffle = rng.permutation(12)
    second = SafeAllocator(Team.uniform(12, load_mass=0.7), min_angle_deg=20.0)
    second.reset(directions=start[shuffle])
    for k in range(50):
        force = [math.sin(0.05 * k), 0.3, 6.9]
        a, b = first.allocate(force), second.allocate(force)
    np.testing.assert_allclose(a.tensions[shuffle], b.tensions, atol=1e-4)
    np.testing.assert_allclose(a.directions[shuffle], b.directions, atol=1e-4)
