"""Distances in metres: of drones from each other, and from the others' cables."""

from __future__ import annotations

import math

import numpy as np
import pytest

from colift.control.allocation.base import Status
from colift.control.allocation.limits import cycle, distance, newton
from colift.control.allocation.limits.feasibility import (
    cannot_hold,
    feasibility,
    formations,
    limits_of,
)
from colift.control.allocation.limits.heaviest import extreme
from colift.control.allocation.safe import Safe, SafeAllocator
from colift.errors import SettingError
from colift.team import Team
from colift.team.geometry import pairwise_angles, ring

G = 9.81
BITS = {"angle": 64, "drones": 128, "cable": 256}


def team_of(lengths, **numbers) -> Team:
    n = len(lengths)
    body = {"mass": 0.5, "inertia": (0.021, 0.0187, 0.0397), **numbers}
    load = 0.225 * max(1.0, n / 4)
    return Team.of_bodies(
        [body] * n, load_mass=load, cable_lengths=np.asarray(lengths, dtype=float)
    )


def unequal(n: int, seed: int, shortest: float = 0.5, longest: float = 3.0) -> Team:
    return team_of(np.random.default_rng([seed, n]).uniform(shortest, longest, n))


def hostile(team: Team, cycles: int, seed: int):
    """Forces that jump between extremes, with noise on top."""
    rng = np.random.default_rng([7, seed])
    level = np.zeros(3)
    for _ in range(cycles):
        if rng.random() < 0.04:
            level = rng.choice([-1.0, 0.0, 1.0], 3) * [4.0, 4.0, 5.0] * rng.choice([1.0, 3.0])
        yield team.load_mass * (level + 0.5 * rng.standard_normal(3) + [0.0, 0.0, G])


def settled(team: Team, part: Safe, cycles: int = 600) -> SafeAllocator:
    """In hover, within all limits."""
    allocator = SafeAllocator.unchecked(team, part)
    allocator.reset()
    for _ in range(cycles):
        answer = allocator.allocate([0.0, 0.0, team.load_mass * G])
        if answer.status is not Status.RECOVERING:
            break
    assert answer.status is not Status.RECOVERING
    return allocator


@pytest.mark.parametrize("n", [2, 3, 4, 6])
@pytest.mark.parametrize("length", [0.4, 1.0, 2.5])
def test_spheres_on_equal_cables_are_an_angle(n: int, length: float) -> None:
    """Chord of two points on a sphere: d = 2 L sin(angle / 2)."""
    angle = 36.0
    team = team_of([length] * n)
    apart = 2.0 * length * math.sin(math.radians(0.5 * angle))
    metres = SafeAllocator(team, min_angle_deg=5.0, min_distance=apart, downwash=1.0)
    degrees = SafeAllocator(team, min_angle_deg=angle)
    degrees.reset(ring(n, 0.6))
    metres.reset(ring(n, 0.6))
    causes = set()
    for force in hostile(team, 600, n):
        a, b = metres.allocate(force), degrees.allocate(force)
        assert a.status == b.status
        np.testing.assert_allclose(a.directions, b.directions, atol=1e-6)
        np.testing.assert_allclose(a.tensions, b.tensions, atol=1e-6)
        causes.add((a.active_limits & ~63, b.active_limits & ~63))
    assert causes <= {(0, 0), (BITS["drones"], BITS["angle"])}
    assert len(causes) == 2


@pytest.mark.parametrize("n", [2, 3, 5, 8])
def test_a_round_ellipsoid_is_the_sphere(n: int) -> None:
    """Rows of the ellipsoid against the angles of the same limit: two derivations of one set."""
    team = unequal(n, 3, 0.7, 1.1)
    allocators = []
    for stretch in (1.0, 1.0 + 1e-12):
        part = Safe(min_angle_deg=5.0, min_distance=0.5, downwash=stretch, spread=1e-4)
        assert part.ellipsoids(team) == (stretch > 1.0)
        allocators.append(settled(team, part))
    angles, _ = allocators[0].part.pair_angles(team)
    pairs = np.triu_indices(n, k=1)
    for force in hostile(team, 300, n):
        for allocator in allocators:
            directions = allocator.allocate(force).directions
            assert (pairwise_angles(directions) >= angles[pairs] - 1e-9).all()
            assert distance.distances(team.cable_lengths, directions)[0].min() >= 0.5 - 1e-9


def test_caps_are_the_distances_that_they_stand_for() -> None:
    """At the angle of the table, the distance by brute force over the cable's points is the one asked for."""
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(400):
        lengths = rng.uniform(0.3, 3.0, 2)
        apart, clear = rng.uniform(0.0, 1.0), rng.uniform(0.0, 0.3)
        sizes, clearances = np.full(2, apart), np.full(2, clear)
        angles, causes = distance.angles_of(lengths, sizes, clearances, math.radians(3.0))
        angle, cause = angles[0, 1], causes[0, 1]
        assert angle == angles[1, 0]
        if angle > math.radians(179.0):
            continue
        seen.add(cause)
        for turn, inside in ((angle - 1e-3, False), (angle + 1e-3, True)):
            one, other = np.array([0.0, 0.0, 1.0]), np.array([math.sin(turn), 0.0, math.cos(turn)])
            drones = np.linalg.norm(lengths[0] * one - lengths[1] * other)
            along = np.linspace(0.0, 1.0, 4001)[:, None]
            cable = min(
                np.linalg.norm(lengths[0] * one - along * lengths[1] * other, axis=1).min(),
                np.linalg.norm(lengths[1] * other - along * lengths[0] * one, axis=1).min(),
            )
            kept = drones > apart - 1e-6 and cable > clear - 1e-6 and turn > math.radians(3.0)
            assert kept == inside or cause == distance.ANGLE
    assert seen == {distance.ANGLE, distance.DRONES, distance.CABLE}


def test_distances_are_those_of_points_and_segments() -> None:
    rng = np.random.default_rng(1)
    lengths, ends = rng.uniform(0.3, 2.0, 4), rng.uniform(-0.5, 0.5, (3, 4, 3))
    directions = rng.standard_normal((3, 4, 3))
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    drones, cables = distance.distances(lengths, directions, 2.0, ends)
    at = ends - lengths[:, None] * directions
    share = np.linspace(0.0, 1.0, 20001)[:, None]
    for k in range(3):
        for i in range(4):
            for j in range(4):
                if i != j:
                    away = (at[k, i] - at[k, j]) / [1.0, 1.0, 2.0]
                    assert drones[k, i, j] == pytest.approx(np.linalg.norm(away))
                    points = at[k, j] + share * (ends[k, j] - at[k, j])
                    near = np.linalg.norm(points - at[k, i], axis=1).min()
                    assert cables[k, i, j] == pytest.approx(near, abs=1e-7)
    np.testing.assert_allclose(
        distance.distances(lengths, directions, 2.0)[0],
        distance.distances(lengths, directions, 2.0, np.ones((3, 4, 3)))[0],
    )


def test_gradient_and_hessian_of_the_ellipsoids_are_those_of_finite_differences() -> None:
    """Of the barrier ``-kappa log g`` of one pair, by turns of both directions along a great circle."""
    rng = np.random.default_rng(2)
    n, flat = 2, 0.3
    for _ in range(20):
        lengths = rng.uniform(0.4, 2.0, 2)
        alpha = rng.standard_normal((2, 3))
        alpha /= np.linalg.norm(alpha, axis=1, keepdims=True)
        root = math.sqrt(lengths[1] / lengths[0])

        def value(a, root=root):
            v = (root * a[1] - a[0] / root) * [1.0, 1.0, math.sqrt(flat)]
            return 0.5 * v @ v - 1e-3

        rows, K = np.zeros(newton.ROW * n), np.zeros(4 * n * n)
        basis = np.zeros((2, 2, 3))
        for i in range(n):
            basis[i] = np.linalg.svd(alpha[i][None])[2][1:]
            rows[newton.ROW * i : newton.ROW * i + 6] = basis[i].ravel()
        g = np.array([value(alpha)])
        kappa = 0.7
        one = np.ones(1)
        work = newton.Work(
            data=one, T=np.ones(n), alpha=alpha.ravel(), w=one, dw=one, w_new=one, g=g, g_new=one,
            z=np.array([kappa / g[0]]), pairs=np.array([1.0, 0.0]), kappa_pair=np.array([kappa]),
            cos_max=np.array([1e-3]), cause=one, root=np.array([root]), flat=flat, first=one,
            strong=one, last=one, begin=one, eta=one,
            rows=rows, K=K, Y=one, S=one, lam=one, M=one,
        )  # fmt: skip
        again, ambient = np.zeros(1), np.zeros(3 * n)
        distance.margins(n, 0, 1, 0, work, again)
        assert again[0] == pytest.approx(g[0], rel=1e-12)
        distance.assemble(n, 0, 1, 0, newton.ROW, newton.block_of, work)
        distance.add_gradient(0, 1, 0, work, ambient)

        def barrier(x, alpha=alpha, basis=basis, value=value, kappa=kappa):
            moved = np.empty((2, 3))
            for i in range(2):
                step = x[2 * i : 2 * i + 2] @ basis[i]
                size = np.linalg.norm(step)
                moved[i] = math.cos(size) * alpha[i] + np.sinc(size / math.pi) * step
            return -kappa * math.log(value(moved))

        h = 1e-4
        unit = h * np.eye(4)
        slope = [(barrier(e) - barrier(-e)) / (2 * h) for e in unit]
        curve = [
            [
                (barrier(a + b) - barrier(a - b) - barrier(b - a) + barrier(-a - b)) / (4 * h * h)
                for a in unit
            ]
            for b in unit
        ]
        table = rows.reshape(n, newton.ROW)
        np.testing.assert_allclose(table[:, 6:8].ravel(), slope, rtol=1e-5, atol=1e-5)
        np.testing.assert_allclose(table[:, 8:10].ravel(), slope, rtol=1e-5, atol=1e-5)
        tangent = np.einsum("ikx,ix->ik", basis, ambient.reshape(2, 3))
        np.testing.assert_allclose(tangent.ravel(), slope, rtol=1e-5, atol=1e-5)
        scale = np.abs(curve).max()
        for i in range(n):
            c = table[i, 10:13]
            found = np.array([[c[0], c[1]], [c[1], c[2]]])
            expected = np.array(curve)[2 * i : 2 * i + 2, 2 * i : 2 * i + 2]
            np.testing.assert_allclose(found, expected, atol=1e-5 * scale)
        found = K.reshape(2 * n, 2 * n)[2:, :2]
        np.testing.assert_allclose(found, np.array(curve)[2:, :2], atol=1e-5 * scale)


SETTINGS = {"min_angle_deg": 12.0, "min_distance": 0.5, "cable_distance": 0.2}


@pytest.mark.parametrize("n", [2, 3, 4, 5, 6, 7, 8])
@pytest.mark.parametrize("stretch", [1.0, 2.0, 3.0])
@pytest.mark.parametrize("seed", [0, 1])
def test_no_hostile_force_breaks_a_distance(n: int, stretch: float, seed: int) -> None:
    """Cables of 0.5 to 3 lengths; a start within the limits."""
    team = unequal(n, seed, 0.5, (1.5, 3.0)[seed])
    part = Safe(**SETTINGS, downwash=stretch, spread=(1e-2, 1e-5)[seed])
    allocator = settled(team, part)
    angles = allocator.part.pair_angles(team)[0][np.triu_indices(n, k=1)]
    found, bits, statuses = [], 0, set()
    for force in hostile(team, 700, seed):
        answer = allocator.allocate(force)
        found.append(answer.directions)
        bits |= answer.active_limits
        statuses.add(answer.status)
        assert answer.status is Status.FORCE_REDUCED or answer.force_residual <= 1e-8
    assert Status.RECOVERING not in statuses
    directions = np.array(found)
    assert np.isfinite(directions).all()
    drones, cables = part.distances(team, directions)
    assert drones.min() >= 0.5 - 1e-12
    assert cables.min() >= 0.2 - 1e-12
    assert (pairwise_angles(directions) >= angles - 1e-9).all()
    turned = np.linalg.norm(np.diff(directions, axis=0), axis=-1).max()
    assert turned <= part.turn_rate(allocator.team) * allocator.dt
    if seed == 1:  # without a barrier that keeps off, drones come as near as they may
        for kind, found, least in (("drones", drones, 0.5), ("cable", cables, 0.2)):
            assert not bits & BITS[kind] or found.min() < least + 0.02
        assert n < 3 or bits & sum(BITS.values())


def test_the_limit_of_two_stacked_drones_is_at_work() -> None:
    """A short and a long cable, the force along them: 62 cm above each other is too near, and the angle allows it."""
    team = team_of([0.6, 1.22, 1.0, 1.0])
    angles_only = settled(team, Safe(min_angle_deg=10.0, spread=1e-5, mu=0.0))
    both = settled(team, Safe(min_angle_deg=10.0, spread=1e-5, mu=0.0, min_distance=0.6))
    for force in hostile(team, 2000, 5):
        near, kept = angles_only.allocate(force), both.allocate(force)
        near_now = both.part.distances(team, near.directions)[0].min()
        assert both.part.distances(team, kept.directions)[0].min() >= 0.6 - 1e-12
        if near_now < 0.5 and kept.active_limits & BITS["drones"]:
            return
    pytest.fail("angles alone never came that near")


STARTS = {
    "coincident": lambda n, _: np.tile([0.3, 0.1, -1.0], (n, 1)),
    "bunched": lambda n, rng: [0.5, 0.2, -1.0] + 0.05 * rng.standard_normal((n, 3)),
    "anywhere": lambda n, rng: rng.standard_normal((n, 3)),
    "one-below": lambda n, _: np.vstack([[[0.0, 0.0, 1.0]], ring(n, 0.6)[1:]]),
}


@pytest.mark.parametrize("n", [2, 3, 4, 5, 6, 7, 8])
@pytest.mark.parametrize("start", STARTS)
@pytest.mark.parametrize("seed", [0, 1])
def test_any_start_leads_back_and_nothing_broken_gets_worse(n, start, seed) -> None:
    team = unequal(n, seed, 0.8, (1.6, 2.4)[seed])
    part = Safe(min_angle_deg=12.0, min_distance=0.45, cable_distance=0.15)
    allocator = SafeAllocator.unchecked(team, part)
    before = np.asarray(STARTS[start](n, np.random.default_rng([n, seed])), dtype=float)
    before /= np.linalg.norm(before, axis=1, keepdims=True)
    allocator.reset(directions=before)
    pairs = np.triu_indices(n, k=1)
    least = part.pair_angles(team)[0][pairs]
    said = False
    for _ in range(250):
        answer = allocator.allocate([0.0, 0.0, team.load_mass * G])
        for now, was, asked in (
            (
                part.distances(team, answer.directions)[0][pairs],
                part.distances(team, before)[0][pairs],
                0.45,
            ),
            (pairwise_angles(answer.directions), pairwise_angles(before), least),
        ):
            assert (now >= np.minimum(was, asked) - 1e-3).all()
        before = answer.directions
        kept = part.keeps_pairs(team, before) and part._keeps_cone(before)
        if not kept:
            assert answer.status is Status.RECOVERING
            drones, cables = part.distances(team, before)
            if drones[pairs].min() < 0.45 - 1e-9:
                assert answer.active_limits & BITS["drones"]
                said = True
            if min(cables[pairs].min(), cables.T[pairs].min()) < 0.15 - 1e-9:
                assert answer.active_limits & (BITS["cable"] | BITS["drones"])
        elif answer.status.ok:
            break
    assert answer.status.ok
    assert said or start in ("anywhere", "one-below")


def test_a_drone_that_joins_too_near_is_led_away() -> None:
    team = team_of([1.0, 1.0, 1.0, 0.5])
    allocator = SafeAllocator(team, min_angle_deg=15.0, min_distance=0.7, cable_distance=0.3)
    for _ in range(100):
        allocator.allocate([0.0, 0.0, 2.2])
    allocator.lose(3)
    for _ in range(100):
        answer = allocator.allocate([0.0, 0.0, 2.2])
    assert answer.status.ok
    allocator.join(3, answer.directions[0] + [0.05, 0.0, 0.0])
    counted = 0
    for _ in range(100):
        answer = allocator.allocate([0.0, 0.0, 2.2])
        if answer.status is not Status.RECOVERING:
            break
        counted += 1
    assert counted > 2
    assert answer.status.ok
    assert allocator.part.keeps_pairs(team, answer.directions)


def test_distances_of_zero_change_no_bit() -> None:
    team = unequal(6, 0)
    plain, off = SafeAllocator(team), SafeAllocator(team, min_distance=0.0, cable_distance=0.0)
    far = SafeAllocator(team, min_distance=1e-3, cable_distance=1e-3)  # the angle keeps more
    for force in hostile(team, 300, 0):
        answers = [each.allocate(force) for each in (plain, off, far)]
        for answer in answers[1:]:
            np.testing.assert_array_equal(answers[0].directions, answer.directions)
            np.testing.assert_array_equal(answers[0].tensions, answer.tensions)
            assert answers[0].active_limits == answer.active_limits


def test_distances_follow_from_the_drones_radii_where_these_are_known() -> None:
    unknown, known = team_of([1.0] * 4), team_of([1.0] * 4, radius=0.1)
    part = Safe()
    assert not part.drone_distances(unknown).any()
    assert not part.cable_distances(unknown).any()
    np.testing.assert_allclose(part.drone_distances(known), 0.24)
    np.testing.assert_allclose(part.cable_distances(known), 0.12)
    assert part.filled(known).min_distance == pytest.approx(0.24)
    assert part.filled(unknown).min_distance == 0.0
    assert not Safe(min_distance=0.0).drone_distances(known).any()
    # Unlike drones: each pair keeps its own.
    mixed = Team.of_bodies(
        [{"mass": 0.5, "inertia": (0.02, 0.02, 0.04), "radius": r} for r in (0.1, 0.4, 0.1)],
        load_mass=0.3,
        cable_lengths=np.array([1.0, 1.0, 1.0]),
    )
    angles, causes = Safe(min_angle_deg=5.0, downwash=1.0).pair_angles(mixed)
    assert 2.0 * math.sin(0.5 * angles[0, 1]) == pytest.approx(1.2 * 0.5)
    assert 2.0 * math.sin(0.5 * angles[0, 2]) == pytest.approx(1.2 * 0.2)
    assert causes[0, 1] == distance.DRONES
    losing = Safe(min_distance=[0.1, 0.2, 0.3]).of([0, 2])
    assert losing.min_distance == [0.1, 0.3]


def test_a_setting_changes_in_flight_without_a_jump() -> None:
    allocator = SafeAllocator(team_of([1.0, 0.7, 1.0, 0.7]), min_angle_deg=20.0)
    for apart in (0.3, 0.6, 0.0, 0.5):
        allocator.update(min_distance=apart, cable_distance=0.5 * apart)
        answer = allocator.allocate([0.1, 0.0, 2.2])
        for _ in range(80):
            before = answer.directions
            answer = allocator.allocate([0.1, 0.0, 2.2])
            turned = np.linalg.norm(answer.directions - before, axis=1).max()
            assert turned <= allocator.part.turn_rate(allocator.team) * allocator.dt + 1e-9
        assert answer.status.ok
        assert allocator.part.distances(allocator.team, answer.directions)[0].min() >= apart


@pytest.mark.parametrize(
    ("lengths", "settings", "words"),
    [
        ([1.0] * 4, {"min_distance": 1.7}, "min_distance = 1.7 m conflicts with max_cone_deg = 75"),
        ([1.0, 1.0], {"min_distance": 1.95}, "at most 150.0 degrees"),
        ([1.0, 0.2], {"cable_distance": 0.25}, "cable_distance = 0.25 m .*0.2 m from drone 1"),
        ([0.5] * 8, {"min_distance": 0.5}, "min_distance = 0.5 m .* 60.0 degrees or more, and 8"),
    ],
)
def test_distances_that_cannot_be_kept_are_refused_by_name(lengths, settings, words) -> None:
    with pytest.raises(SettingError, match=words):
        SafeAllocator(team_of(lengths), **settings)


def test_distances_that_follow_from_radii_and_cannot_be_kept_name_the_radius() -> None:
    with pytest.raises(SettingError, match=r"drones.radius: min_distance = 1.8 m, which follows"):
        SafeAllocator(team_of([1.0] * 4, radius=0.75))


def test_a_start_that_no_recovery_leads_back_is_told_in_metres() -> None:
    team = team_of([0.5] * 6)
    part = Safe(min_angle_deg=20.0, min_distance=0.45, downwash=6.0, max_cone_deg=60.0)
    assert "min_distance = 0.45 m where" in part.cannot_start(team, ring(6, 0.5))


def test_memory_is_enough_for_every_row() -> None:
    """All pairs near, with both rows: what lies behind the rows, the matrix, is left alone by them."""
    n = 8
    team = team_of([1.0] * n)
    part = Safe(min_angle_deg=20.0, min_distance=0.45, downwash=1.5, spread=1.0)
    allocator = settled(team, part)
    rows = n * (n - 1)
    assert allocator._memory.size == part.memory(team).size >= rows * (3 + 6) + 4 * n * n
    assert allocator._params.size == cycle.PARAMS.size(n) + n * n
    for force in hostile(team, 100, 0):
        assert allocator.allocate(force).status in (
            Status.CONVERGED, Status.FORCE_REDUCED, Status.ITERATION_LIMIT,
        )  # fmt: skip


@pytest.mark.parametrize(
    "settings",
    [
        {"min_distance": 0.8, "downwash": 1.0},
        {"min_distance": 0.6},
        {"cable_distance": 0.3},
        {"min_distance": 0.5, "cable_distance": 0.25},
    ],
)
@pytest.mark.parametrize("lengths", [[1.0] * 4, [0.6, 1.2, 0.6, 1.2], [0.6, 1.0, 1.4, 0.8, 1.2]])
def test_what_is_feasible_keeps_the_distances_and_names_what_they_cost(lengths, settings) -> None:
    team = team_of(lengths)
    plain = Safe(min_angle_deg=15.0)
    part = plain.model_copy(update=settings)
    limits = limits_of(team, part)
    starts = formations(team.n, limits)
    assert len(starts)
    best = extreme(limits, starts)
    drones, cables = part.distances(team, best.directions)
    assert drones.min() >= part.drone_distances(team)[0] - 1e-9
    assert cables.min() >= part.cable_distances(team)[0] - 1e-9
    assert part.keeps_pairs(team, best.directions)
    free, found = feasibility(team, plain), feasibility(team, part)
    assert found.ok
    assert found.heaviest >= best.weight * (1.0 - 1e-9)
    assert found.heaviest < free.heaviest
    named = {b.path.removeprefix("allocation.") for b in found.binding}
    assert named & {*settings}
    # The allocator itself, asked for far more, gives no more than that, and nearly that.
    allocator = settled(team, part)
    for _ in range(300):
        answer = allocator.allocate([0.0, 0.0, 1.5 * free.heaviest])
    held = -float(answer.tensions @ answer.directions[:, 2])
    assert 0.85 * found.heaviest < held <= 1.02 * found.heaviest
    assert cannot_hold(team, part, np.full(team.n, np.inf), answer.directions) == []
