"""The safe allocator: limits hold in every answer, the force gives way in the stated order."""

from __future__ import annotations

import math

import numpy as np
import pytest

from colift.control.allocation.base import Status
from colift.control.allocation.limits.feasibility import spread_formation
from colift.control.allocation.limits.reach import out_of_reach
from colift.control.allocation.safe import SafeAllocator
from colift.team import Team
from colift.team.geometry import pairwise_angles, ring

G = 9.81
ANGLE = {1: 30.0, 2: 30.0, 3: 30.0, 4: 30.0, 6: 30.0, 8: 30.0, 12: 25.0, 16: 25.0, 64: 11.0}


def team_of(n: int) -> Team:
    return Team.uniform(n, load_mass=0.225 * max(1.0, n / 4))


def first(n: int):
    """Directions that :func:`make` starts from."""
    cone = math.radians(35.0 if n <= 4 else 70.0)
    return spread_formation(n, cone, math.radians(ANGLE[n] + 1.0))


def make(n: int, **settings) -> SafeAllocator:
    allocator = SafeAllocator(team_of(n), min_angle_deg=ANGLE[n], **settings)
    allocator.reset(directions=first(n))
    return allocator


def assert_limits(allocator: SafeAllocator, answer, before) -> None:
    part = allocator.part
    assert np.isfinite(answer.tensions).all()
    assert (answer.tensions >= part.tension_floors(allocator.team) - 1e-12).all()
    assert (answer.tensions <= part.tension_caps(allocator.team) + 1e-12).all()
    polar = np.arccos(np.clip(-answer.directions[:, 2], -1.0, 1.0))
    assert polar.max() <= math.radians(part.max_cone_deg) + 1e-6
    if allocator.n > 1:
        assert pairwise_angles(answer.directions).min() >= math.radians(part.min_angle_deg) - 1e-5
    chord = np.linalg.norm(answer.directions - before, axis=1).max()
    assert chord <= 2.0 * math.sin(0.5 * part.turn_rate(allocator.team) * allocator.dt) + 1e-9


def forces(kind: str, weight: float, cycles: int):
    rng = np.random.default_rng(5)
    level = np.zeros(3)
    for k in range(cycles):
        t = 0.01 * k
        if kind == "smooth":
            level = np.array([2.0 * math.sin(1.9 * t), 2.0 * math.sin(1.4 * t), math.sin(t)])
        elif kind == "noise":
            level = 0.3 * rng.standard_normal(3)
        elif k % 40 == 0:
            level = rng.uniform(-3.0, 3.0, 3)
        yield weight / G * (level + [0.0, 0.0, G])


@pytest.mark.parametrize("n", ANGLE)
@pytest.mark.parametrize("kind", ["smooth", "noise", "steps"])
def test_every_limit_holds_in_every_cycle_and_the_force_is_balanced_or_said_to_be_reduced(n, kind):
    allocator = make(n)
    weight = allocator.team.load_mass * G
    before = first(n)
    reduced = 0
    for force in forces(kind, weight, 400):
        answer = allocator.allocate(force)
        assert_limits(allocator, answer, before)
        before = answer.directions
        reduced += answer.status is Status.FORCE_REDUCED
        if answer.status is not Status.FORCE_REDUCED:
            assert answer.force_residual <= 1e-8
    if n >= 3 and kind != "steps":
        assert reduced == 0


@pytest.mark.parametrize("n", [3, 4, 8])
def test_an_unreachable_force_gives_up_its_horizontal_part_and_keeps_the_vertical(n):
    allocator = make(n)
    weight = allocator.team.load_mass * G
    before = first(n)
    for _ in range(150):
        answer = allocator.allocate([20.0 * weight, 0.0, weight])
        assert_limits(allocator, answer, before)
        before = answer.directions
    assert answer.status is Status.FORCE_REDUCED
    held = -answer.tensions @ answer.directions
    assert held[2] == pytest.approx(weight, abs=1e-6)
    assert 0.5 * weight < held[0] < 20.0 * weight
    assert abs(held[1]) < 0.1 * weight


def test_a_load_that_is_too_heavy_gets_all_the_cables_can_give():
    allocator = make(4)
    for _ in range(300):
        answer = allocator.allocate([0.0, 0.0, 50.0])
    assert answer.status is Status.FORCE_REDUCED
    # Four cables 30 degrees apart lie on a cone with sin(cone) = sin(15 deg) / sin(45 deg).
    cone = math.asin(math.sin(math.radians(15.0)) / math.sin(math.radians(45.0)))
    assert -answer.tensions @ answer.directions[:, 2] == pytest.approx(
        20.0 * math.cos(cone), rel=2e-3
    )


def test_a_heavy_load_does_not_draw_the_cables_together():
    for scaling, least in (("absolute", 30.0), ("weight", 35.0)):
        allocator = SafeAllocator(4, mu_scaling=scaling)
        for _ in range(500):
            answer = allocator.allocate([0.0, 0.0, 8.0])
        assert answer.status.ok
        assert np.degrees(pairwise_angles(answer.directions).min()) >= least - 1e-6


def test_thrust_and_tilt_limits_hold_for_the_drones():
    allocator = SafeAllocator(4, max_thrust=7.0, max_tilt_deg=25.0)
    rng = np.random.default_rng(2)
    for k in range(500):
        if k % 25 == 0:
            acceleration = rng.uniform(-1.5, 1.5, 3)
        force = 0.225 * (acceleration + [0.0, 0.0, G])
        answer = allocator.allocate(force, acceleration)
        thrust = 0.5 * (acceleration + [0.0, 0.0, G]) - answer.tensions[:, None] * answer.directions
        norms = np.linalg.norm(thrust, axis=1)
        assert norms.max() <= 7.0 + 1e-9
        assert np.degrees(np.arccos(thrust[:, 2] / norms)).max() <= 25.0 + 1e-6


def test_a_cable_of_more_weight_carries_less():
    even, uneven = SafeAllocator(4), SafeAllocator(4, weights=[3.0, 1.0, 1.0, 1.0])
    for _ in range(300):
        a, b = even.allocate([0.0, 0.0, 2.2]), uneven.allocate([0.0, 0.0, 2.2])
    assert b.status.ok
    assert b.tensions[0] < 0.7 * a.tensions[0]
    assert b.tensions[0] < b.tensions[1:].min()
    assert math.isnan(b.optimality_gap)


@pytest.mark.parametrize("weight", [1e-3, 7.0, 1000.0, [0.3, 0.3, 0.3, 0.3]])
def test_weights_that_are_all_the_same_change_nothing(weight):
    even, same = SafeAllocator(4), SafeAllocator(4, weights=weight)
    for force in forces("steps", 0.225 * G, 200):
        a, b = even.allocate(force), same.allocate(force)
        np.testing.assert_array_equal(a.tensions, b.tensions)
        np.testing.assert_array_equal(a.directions, b.directions)
        assert a.objective == b.objective
        assert b.objective == pytest.approx(same.part.objective(b.tensions, b.directions), rel=1e-9)


@pytest.mark.parametrize("n", [4, 6])
@pytest.mark.parametrize("ratio", [10.0, 100.0, 1000.0])
@pytest.mark.parametrize("heavy", [1, 3])
def test_weights_never_make_a_reachable_force_give_way(n, ratio, heavy):
    weights = [ratio] * heavy + [1.0] * (n - heavy)
    allocator = SafeAllocator(team_of(n), min_angle_deg=ANGLE[n], weights=weights)
    weight, rng = allocator.team.load_mass * G, np.random.default_rng(n)
    part, missed = allocator.part, 0
    team = allocator.team
    reach = (
        part.tension_floors(team),
        part.tension_caps(team),
        part.turn_rate(allocator.team) * allocator.dt,
    )
    directions = first(n)
    allocator.reset(directions=directions)
    for k in range(500):
        sway = [2.0 * math.sin(0.019 * k), 2.0 * math.sin(0.014 * k), 0.0]
        force = weight / G * (sway + 0.3 * rng.standard_normal(3) + [0.0, 0.0, G])
        before = directions
        answer = allocator.allocate(force)
        directions = answer.directions
        if answer.status is Status.FORCE_REDUCED:
            missed += 1
            cone = math.radians(part.max_cone_deg)
            assert out_of_reach(force[None], before[None], *reach, cone)[0]
    assert missed <= 5
    assert answer.tensions[:heavy].mean() < 0.5 * answer.tensions[heavy:].mean()


@pytest.mark.parametrize("barrier", [1e-3, 1e-5, 1e-7])
@pytest.mark.parametrize("n", [4, 8])
def test_recovering_is_said_only_while_a_limit_is_broken(n, barrier):
    allocator = make(n, barrier=barrier)
    rng = np.random.default_rng(n)
    for level in forces("steps", allocator.team.load_mass * G, 400):
        force = level + 0.3 * allocator.team.load_mass * rng.standard_normal(3)
        assert allocator.allocate(force).status is not Status.RECOVERING
    allocator.reset(directions=np.tile([0.3, 0.1, -1.0], (n, 1)))
    said = []
    for _ in range(100):
        answer = allocator.allocate([0.0, 0.0, allocator.team.load_mass * G])
        broken = pairwise_angles(answer.directions).min() < math.radians(ANGLE[n])
        assert (answer.status is Status.RECOVERING) == broken
        said.append(broken)
    assert said[0]
    assert not said[-1]


def test_settings_change_between_calls_without_a_jump():
    allocator = SafeAllocator(4)
    for _ in range(50):
        answer = allocator.allocate([0.1, 0.0, 2.2])
    for angle in (40.0, 25.0, 50.0):
        allocator.update(min_angle_deg=angle)
        for _ in range(60):
            before = answer.directions
            answer = allocator.allocate([0.1, 0.0, 2.2])
            chord = np.linalg.norm(answer.directions - before, axis=1).max()
            assert chord <= allocator.part.turn_rate(allocator.team) * allocator.dt + 1e-9
            assert answer.force_residual <= 1e-8
        assert np.degrees(pairwise_angles(answer.directions).min()) >= angle - 1e-6


@pytest.mark.parametrize("dt", [1e-3, 0.01, 0.1])
def test_noise_leaves_the_angles_wide_at_any_rate(dt):
    allocator = SafeAllocator(4, dt=dt)
    rng = np.random.default_rng(0)
    for _ in range(3000):
        answer = allocator.allocate(0.225 * (0.3 * rng.standard_normal(3) + [0.0, 0.0, G]))
        assert np.degrees(pairwise_angles(answer.directions).min()) > 40.0
        assert answer.status.ok


STARTS = {
    "coincident": lambda n, _: np.tile([0.3, 0.1, -1.0], (n, 1)),
    "bunched": lambda n, rng: [0.5, 0.2, -1.0] + 0.05 * rng.standard_normal((n, 3)),
    "anywhere": lambda n, rng: rng.standard_normal((n, 3)),
    "one-below": lambda n, _: np.vstack([[[0.0, 0.0, 1.0]], ring(n, 0.6)[1:]]),
}


@pytest.mark.parametrize("n", [1, 2, 3, 4, 6, 8, 12, 16])
@pytest.mark.parametrize("start", STARTS)
def test_any_start_leads_back_within_the_limits_and_no_angle_shrinks(n, start):
    rng = np.random.default_rng(n)
    allocator = SafeAllocator(team_of(n), min_angle_deg=ANGLE[n])
    given = STARTS[start](n, rng)
    allocator.reset(directions=given)
    least = math.radians(ANGLE[n])
    directions = given / np.linalg.norm(given, axis=1, keepdims=True)
    for _ in range(120):
        answer = allocator.allocate([0.0, 0.0, allocator.team.load_mass * G])
        if n > 1:
            old = np.minimum(pairwise_angles(directions), least)
            assert (pairwise_angles(answer.directions) >= old - 1e-3).all()
        directions = answer.directions
        if answer.status.ok:
            break
    assert answer.status.ok
    assert_limits(allocator, answer, directions)


def test_a_team_that_loses_a_drone_keeps_the_other_cables_limits():
    part = SafeAllocator(3, tension_max=[3.0, 4.0, 5.0], weights=[1.0, 2.0, 3.0]).part
    left = part.of([0, 2])
    assert left.tension_max == [3.0, 5.0]
    assert left.weights == [1.0, 3.0]
    assert left.tension_min == part.tension_min


@pytest.mark.slow
def test_128_cables_work():
    allocator = SafeAllocator(Team.uniform(128, load_mass=7.0), min_angle_deg=8.0)
    for k in range(30):
        answer = allocator.allocate([math.sin(0.1 * k), 0.0, 7.0 * G])
    assert answer.status.ok
    assert answer.force_residual <= 1e-8
    assert np.degrees(pairwise_angles(answer.directions).min()) >= 8.0 - 1e-6
