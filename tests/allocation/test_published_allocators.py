"""The allocators of other papers and of general solvers: what each is known to answer."""

from __future__ import annotations

import importlib.util
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest

import colift
from colift import part
from colift.control.allocation.base import Allocator, Status
from colift.control.allocation.common.oracle import (
    Limits,
    TensionProblem,
    beyond_saddles,
    outcome_of,
)
from colift.control.allocation.internal_force import InternalForce
from colift.control.allocation.min_norm import MinNorm
from colift.control.allocation.sqp import SqpAllocator
from colift.control.allocation.wahba_hoenig import half_spaces, least_forces, separating_normal
from colift.errors import MissingExtraError, MissionError
from colift.mission import load_mission
from colift.team import Team
from colift.team.geometry import pairwise_angles, ring, rotation_between

UP = np.array([0.0, 0.0, 1.0])
HOVER = 0.225 * 9.81 * UP
ORACLES = ("slsqp", "ipopt")


def needs(package):
    return pytest.mark.skipif(
        importlib.util.find_spec(package) is None, reason=f"optional: {package}"
    )


def allocator(kind, n, **settings):
    found = part.find("allocation", kind)
    if message := found.missing():
        pytest.skip(message)
    return Allocator(found(**settings), n)


def random_directions(rng, n):
    directions = rng.normal(size=(n, 3))
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


# ---------------------------------------------------------------- min-norm


@pytest.mark.parametrize("n", [1, 2, 3, 4, 7, 40])
@pytest.mark.parametrize("coincident", [False, True])
def test_min_norm_is_numpys_pseudo_inverse(n, coincident):
    rng = np.random.default_rng(n)
    for _ in range(10):
        directions, force = random_directions(rng, n), rng.normal(size=3)
        if coincident:
            directions[1:] = directions[0]
        expected = -np.linalg.pinv(directions.T) @ force
        scale = np.abs(expected).max()
        push, clamp = (Allocator(MinNorm(negative=name), n) for name in ("push", "clamp"))
        for each in (push, clamp):
            each.reset(directions=directions)
        answer = push.allocate(force)
        np.testing.assert_allclose(
            answer.tensions[:, None] * answer.directions,
            expected[:, None] * directions,
            atol=1e-12 * scale,
        )
        clamped = clamp.allocate(force)
        np.testing.assert_allclose(clamped.tensions, np.maximum(expected, 0.0), atol=1e-12 * scale)
        np.testing.assert_allclose(clamped.directions, directions, atol=1e-15)


@pytest.mark.parametrize(
    ("negative", "status", "balanced"),
    [("clamp", Status.CLAMPED, False), ("push", Status.PUSHING, True)],
)
def test_min_norm_says_that_a_cable_would_have_to_push(negative, status, balanced):
    tilt = np.radians([10.0, 40.0])
    one_sided = -np.column_stack([np.sin(tilt), np.zeros(2), np.cos(tilt)])
    each = Allocator(MinNorm(negative=negative), 2)
    each.reset(directions=one_sided)
    answer = each.allocate(HOVER)
    assert answer.status is status
    assert (answer.force_residual < 1e-12) == balanced
    assert np.isfinite(answer.optimality_gap) == balanced
    assert (answer.directions[1, 2] > 0.0) == balanced  # the pushing drone is below the load


def test_min_norm_keeps_its_formation_and_tells_that_two_cables_cannot_pull_across():
    each = Allocator(MinNorm(), 2)
    first = each.allocate(HOVER)
    assert first.status.ok
    across = each.allocate(HOVER + [0.0, 0.3, 0.0])
    assert across.status is Status.FORCE_REDUCED
    assert across.force_residual == pytest.approx(0.3)
    assert np.array_equal(across.directions, first.directions)
    assert each.allocate(HOVER).status.ok


def test_min_norm_of_the_formation_that_is_left_when_a_drone_leaves():
    settings, rng = MinNorm(), np.random.default_rng(0)
    each = Allocator(settings, 5)
    directions = ring(5, 0.6) + 0.1 * rng.normal(size=(5, 3))
    each.reset(directions=directions)
    each.allocate(HOVER)
    each.lose(2)
    kept = np.delete(directions / np.linalg.norm(directions, axis=1, keepdims=True), 2, axis=0)
    answer = each.allocate(HOVER)
    expected = np.maximum(-np.linalg.pinv(kept.T) @ HOVER, 0.0)
    np.testing.assert_allclose(answer.tensions, expected, atol=1e-12)
    np.testing.assert_allclose(answer.directions, kept, atol=1e-15)


# ---------------------------------------------------------------- internal-force


@pytest.mark.parametrize("n", [2, 3, 4, 7])
def test_internal_forces_add_up_to_nothing_and_cost_what_they_must(n):
    force = HOVER + [0.4, -0.2, 0.1]
    answer = Allocator(InternalForce(internal_force=0.3), n).allocate(force)
    pulls = -answer.tensions[:, None] * answer.directions  # on the load
    internal = pulls - force / n
    np.testing.assert_allclose(internal.sum(axis=0), 0.0, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(internal, axis=1), 0.3, rtol=1e-12)
    np.testing.assert_allclose(internal[:, 2], 0.0, atol=1e-14)
    assert answer.optimality_gap == pytest.approx(0.5 * n * 0.3**2)
    assert answer.status.ok


def test_two_robots_have_the_internal_force_of_the_paper():
    answer = Allocator(InternalForce(internal_force=0.7, heading_deg=30.0), 2).allocate(HOVER)
    beam = np.array([np.cos(np.pi / 6), 0.5, 0.0])
    pulls = -answer.tensions[:, None] * answer.directions
    np.testing.assert_allclose(
        pulls, [0.5 * HOVER + 0.7 * beam, 0.5 * HOVER - 0.7 * beam], atol=1e-15
    )


def test_without_internal_force_all_cables_are_parallel_and_the_norm_is_least():
    force = HOVER + [0.4, -0.2, 0.1]
    answer = Allocator(InternalForce(internal_force=0.0), 5).allocate(force)
    assert pairwise_angles(answer.directions).max() < 1e-7
    assert answer.optimality_gap == pytest.approx(0.0, abs=1e-15)


def test_the_spread_closes_the_gap_of_a_lost_drone_and_stays_balanced():
    settings = InternalForce(settling=0.05)
    left = Allocator(settings, 4)
    left.lose(1)
    first = left.allocate(HOVER)
    assert first.force_residual < 1e-15
    gaps = pairwise_angles(first.directions)
    assert gaps.max() - gaps.min() > np.radians(5.0)
    for _ in range(200):
        last = left.allocate(HOVER)
        assert last.force_residual < 1e-14
    assert np.ptp(pairwise_angles(last.directions)) < 1e-9


# ---------------------------------------------------------------- wahba-hoenig


@needs("daqp")
def test_the_plane_between_equal_cables_is_their_bisector():
    rng = np.random.default_rng(1)
    for near, far in rng.normal(size=(20, 2, 3)):
        near, far = near / np.linalg.norm(near), far / np.linalg.norm(far)
        normal = separating_normal(near, far, UP, 0.0)
        assert normal @ near == pytest.approx(-1.0)
        np.testing.assert_allclose(
            normal / np.linalg.norm(normal), (far - near) / np.linalg.norm(far - near), atol=1e-6
        )
    assert separating_normal(near, near, UP, 0.0) is None
    heavy = separating_normal(np.array([0.3, 0.1, 1.0]), np.array([-0.2, 0.5, 0.8]), UP, 1e6)
    assert abs(heavy @ UP) < 1e-3 * np.linalg.norm(heavy)


@pytest.mark.parametrize("n", [2, 3, 4, 6, 9])
def test_hover_settles_on_the_ring_that_just_fits_the_wedges(n):
    each = allocator("wahba-hoenig", n, settling=0.02)
    tilt = each.part.tilts(each.team)[0]
    for _ in range(100):
        answer = each.allocate(HOVER)
        assert answer.status.ok
    cone = np.arctan(np.tan(tilt) / np.sin(np.pi / n))
    np.testing.assert_allclose(np.arccos(-answer.directions[:, 2]), cone, atol=1e-5)
    neighbours = 2.0 * np.arcsin(np.sin(cone) * np.sin(np.pi / n))
    assert pairwise_angles(answer.directions).min() == pytest.approx(neighbours, abs=1e-5)
    # Two cables stand across their wedge and get all of it; on a wide ring they lean along it.
    assert (neighbours == pytest.approx(2.0 * tilt)) == (n == 2)
    assert answer.kkt_residual < 1e-9
    assert answer.active_limits == 64


@pytest.mark.parametrize("n", [2, 4, 7])
def test_every_answer_is_within_the_half_spaces_of_the_directions_before(n):
    team = Team.uniform(n)
    team.cable_lengths[:] = np.linspace(0.8, 1.3, n)
    found = part.find("allocation", "wahba-hoenig")
    if message := found.missing():
        pytest.skip(message)
    each = Allocator(found(), team)
    tilts, rng = each.part.tilts(team), np.random.default_rng(n)
    before, checked = ring(n, math.radians(35.0)), 0
    each.reset(directions=before)
    for _ in range(40):
        force = HOVER + 0.1 * rng.normal(size=3)
        answer = each.allocate(force)
        unit = force / np.linalg.norm(force)
        owners, normals = half_spaces(
            -team.cable_lengths[:, None] * before, unit, tilts, each.part.plane_weight
        )
        pulls = -answer.tensions[:, None] * answer.directions
        if answer.status.ok:
            checked += 1
            assert np.max(np.sum(normals * pulls[owners], axis=1)) < 1e-8
            # So each pair keeps a gap across its plane that grows with the height above the load.
            for first, second in zip(normals[::2], normals[1::2], strict=True):
                assert first @ second < -np.cos(2.2 * tilts.max())
        before = answer.directions
    assert checked > 30


@needs("daqp")
def test_least_forces_agree_with_another_solver():
    optimize = pytest.importorskip("scipy.optimize", reason="optional: the extra solvers")
    rng, n = np.random.default_rng(4), 4
    planes = half_spaces(-ring(n, 0.5), UP, np.full(n, 0.3), 1000.0)
    owners, normals = planes
    for _ in range(5):
        force, aim = UP + 0.1 * rng.normal(size=3), 0.2 * rng.normal(size=(n, 3))
        forces, multipliers, _ = least_forces(owners, normals, force, aim, np.zeros(len(owners)))
        other = optimize.minimize(
            lambda x, aim=aim: 0.5 * np.sum((x - aim.ravel()) ** 2),
            np.tile(force / n, n),
            jac=lambda x, aim=aim: x - aim.ravel(),
            method="SLSQP",
            constraints=[
                {"type": "eq", "fun": lambda x, f=force: x.reshape(n, 3).sum(axis=0) - f},
                {
                    "type": "ineq",
                    "fun": lambda x: -np.sum(normals * x.reshape(n, 3)[owners], axis=1),
                },
            ],
            options={"ftol": 1e-14, "maxiter": 500},
        )
        np.testing.assert_allclose(forces, other.x.reshape(n, 3), atol=1e-6)
        assert (multipliers > -1e-9).all()


def test_coincident_cables_start_anew_from_a_ring():
    each = allocator("wahba-hoenig", 4)
    each.reset(directions=np.tile([0.1, 0.0, -1.0], (4, 1)))
    first = each.allocate(HOVER)
    assert first.status is Status.RECOVERING
    assert first.force_residual < 1e-12
    assert np.degrees(pairwise_angles(first.directions).min()) > 20.0
    assert each.allocate(HOVER).status.ok


def test_a_desired_formation_draws_the_cables_to_it():
    each = allocator("wahba-hoenig", 4, settling=0.0, formation_weight=1e4, formation_cone_deg=40.0)
    for _ in range(5):
        answer = each.allocate(HOVER)
    cones = np.degrees(np.arccos(-answer.directions[:, 2]))
    np.testing.assert_allclose(cones, 40.0, atol=0.1)
    assert answer.active_limits == 0


def test_a_distance_beyond_the_cables_is_a_mistake_in_the_mission():
    with pytest.raises(MissionError, match=r"allocation\.distance.*1\.2 m.*found 1\.5"):
        load_mission("hover", {"allocation.kind": "wahba-hoenig", "allocation.distance": 1.5})


def test_rotations_take_one_vector_to_the_other_the_short_way():
    rng = np.random.default_rng(2)
    for a, b in rng.normal(size=(20, 2, 3)):
        a, b = a / np.linalg.norm(a), b / np.linalg.norm(b)
        for target in (b, a, -a, -a + 1e-7 * b):
            target = target / np.linalg.norm(target)
            R = rotation_between(a, target)
            np.testing.assert_allclose(R @ a, target, atol=1e-12)
            np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
            assert np.trace(R) == pytest.approx(1.0 + 2.0 * (a @ target), abs=1e-9)


# ---------------------------------------------------------------- general solvers


def bunched(n, apart, seed):
    """Directions (n, 3) about ``apart`` radians from one that leans a little."""
    rng = np.random.default_rng(seed)
    directions = np.array([0.1, 0.05, -1.0]) + apart * rng.normal(size=(n, 3))
    return directions / np.linalg.norm(directions, axis=1)[:, None]


@pytest.mark.parametrize("kind", ORACLES)
@pytest.mark.parametrize("apart", [0.0, 1e-9, 1e-6, 1e-3, 0.05])
@pytest.mark.parametrize(("n", "mu"), [(2, 0.15), (3, 0.4), (4, 0.15), (4, 1.35), (6, 0.75)])
def test_no_saddle_at_coincident_cables_passes_for_the_optimum(kind, n, mu, apart):
    """Cables that all hang along the force have no slope, but the cost falls when they part."""
    each = allocator(kind, n, mu=mu)
    each.reset(
        directions=np.tile([0.0, 0.0, -1.0], (n, 1)) if apart == 0.0 else bunched(n, apart, n)
    )
    answer = each.allocate(HOVER)
    best = SqpAllocator(n, mu=mu).allocate(HOVER).objective
    assert answer.force_residual < 1e-9
    assert (
        answer.status is Status.CONVERGED
    )  # elsewhere it may say that it is not, never this of a saddle
    assert answer.objective == pytest.approx(best, rel=1e-5)


@pytest.mark.parametrize("kind", ORACLES)
def test_coincident_cables_within_limits_part_too(kind):
    n = 4
    each = allocator(kind, n, mu=0.75, max_cone_deg=60.0, tension_max=5.0)
    each.reset(directions=np.tile([0.0, 0.0, -1.0], (n, 1)))
    answer = each.allocate(HOVER)
    again = allocator(kind, n, mu=0.75, max_cone_deg=60.0, tension_max=5.0).allocate(HOVER)
    assert answer.status is again.status is Status.CONVERGED
    assert answer.objective == pytest.approx(again.objective, rel=1e-5)


def test_a_saddle_from_which_nothing_leads_on_is_not_converged():
    n = 4
    asked = TensionProblem(n, 0.75 / 2.207**2, UP)
    z = np.concatenate([np.full(n, 1.0 / n), np.tile(-UP, n)])
    assert asked.violation(z) == 0.0
    assert asked.stationarity(z) < 1e-12
    stuck, further = beyond_saddles(asked, z, 1e-6, lambda _: (z, 3))
    np.testing.assert_array_equal(stuck, z)
    assert further == 3
    assert outcome_of(asked, z, 1e-6, 1).status is Status.ITERATION_LIMIT


@pytest.mark.parametrize("limits", [Limits(), Limits(0.02, 2.0, math.cos(0.5), -math.cos(1.0))])
def test_curvature_of_the_lagrangian_is_that_of_differences(limits):
    n, rng = 4, np.random.default_rng(4)
    force = np.array([0.1, -0.2, 1.0]) / np.linalg.norm([0.1, -0.2, 1.0])
    asked = TensionProblem(n, 0.3, force, limits)
    T, alpha = rng.uniform(0.2, 0.5, n), ring(n, 0.6)
    if limits.pairs:  # two cables as near as they may be
        alpha[1] = np.cos(0.5) * alpha[0] + np.sin(0.5) * np.cross(
            alpha[0], alpha[2]
        ) / np.linalg.norm(np.cross(alpha[0], alpha[2]))
    z = np.concatenate([T, alpha.ravel()])
    rows = [
        *asked.equalities_jacobian(z),
        *asked.inequalities_jacobian(z)[asked.inequalities(z) < 1e-6],
    ]
    assert len(rows) > 3 + n or not limits.pairs
    multipliers = rng.normal(size=len(rows))
    work = asked.inequalities(z) < 1e-6

    def slope(z):
        rows = np.vstack([asked.equalities_jacobian(z), asked.inequalities_jacobian(z)[work]])
        return asked.gradient(z) - rows.T @ multipliers

    h = 1e-6
    numeric = [(slope(z + h * e) - slope(z - h * e)) / (2.0 * h) for e in np.eye(4 * n)]
    np.testing.assert_allclose(asked._lagrangian_hessian(z, multipliers), numeric, atol=1e-8)


@pytest.mark.parametrize("kind", ORACLES)
@pytest.mark.parametrize("n", [2, 3, 4, 6])
def test_general_solvers_agree_with_the_paper_s_allocator(kind, n):
    each, ours = allocator(kind, n, mu=0.15), SqpAllocator(n, mu=0.15)
    for k in range(8):
        force = HOVER + 0.2 * np.array([np.cos(0.3 * k), np.sin(0.3 * k), 0.2 * k])
        answer = each.allocate(force)
        assert answer.status.ok
        assert answer.objective == pytest.approx(ours.allocate(force).objective, rel=1e-8)
        assert answer.optimality_gap == pytest.approx(0.0, abs=1e-7)
        assert answer.objective == pytest.approx(
            each.part.objective(answer.tensions, answer.directions), rel=1e-12
        )
        assert answer.iterations > 0


@pytest.mark.parametrize("kind", ORACLES)
def test_general_solvers_hold_the_limits_that_are_asked_for(kind):
    limits = {"min_angle_deg": 50.0, "max_cone_deg": 40.0, "tension_min": 0.5, "tension_max": 0.9}
    each, free = allocator(kind, 4, **limits), SqpAllocator(4)
    force = HOVER + [0.25, 0.0, 0.0]
    answer = each.allocate(force)
    assert answer.status.ok
    assert np.degrees(pairwise_angles(answer.directions).min()) > 50.0 - 1e-4
    assert np.degrees(np.arccos(-answer.directions[:, 2])).max() < 40.0 + 1e-4
    assert answer.tensions.min() > 0.5 - 1e-6
    assert answer.tensions.max() < 0.9 + 1e-6
    assert answer.objective > free.allocate(force).objective + 1e-3  # they cost something


def test_general_solvers_agree_within_limits():
    values = [
        allocator(kind, 4, min_angle_deg=50.0, max_cone_deg=40.0).allocate(HOVER).objective
        for kind in ORACLES
    ]
    assert values[0] == pytest.approx(values[1], rel=1e-7)


@pytest.mark.parametrize("kind", ORACLES)
def test_limits_that_cannot_hold_keep_the_directions_and_balance_the_force(kind):
    each = allocator(kind, 4, min_angle_deg=80.0, max_cone_deg=20.0)
    start = ring(4, math.radians(35.0))
    each.reset(directions=start)
    answer = each.allocate(HOVER)
    assert answer.status is Status.NUMERICAL_FAILURE
    assert answer.force_residual < 1e-12
    assert np.sum(answer.directions * start, axis=1).min() > 0.95


def test_a_solver_that_raises_does_not_stop_the_flight(monkeypatch):
    optimize = pytest.importorskip("scipy.optimize", reason="optional: the extra solvers")

    def broken(*_, **__):
        raise ValueError("a solver's own trouble")

    monkeypatch.setattr(optimize, "minimize", broken)
    run = colift.run("hover", allocator="slsqp", timing__duration=0.1)
    assert run.recording.outcome == "completed"
    assert set(run.recording["allocator_status"]) == {float(Status.NUMERICAL_FAILURE)}
    assert run.recording["allocator_force_residual"].max() < 1e-12


def test_derivatives_of_the_problem_are_those_of_its_values():
    n = 4
    limits = Limits(0.1, 2.0, np.cos(np.radians(40.0)), -np.cos(np.radians(50.0)))
    problem = TensionProblem(n, 0.3, UP, limits)
    rng = np.random.default_rng(0)
    z, h = rng.normal(size=4 * n), 1e-6
    pairs = [
        (lambda z: np.atleast_1d(problem.objective(z)), lambda z: problem.gradient(z)[None]),
        (problem.equalities, problem.equalities_jacobian),
        (problem.inequalities, problem.inequalities_jacobian),
    ]
    # The penalty's derivative is that for unit directions kept unit by the norms' constraints.
    z[n:] = random_directions(rng, n).ravel()
    for value, slope in pairs:
        steps = np.eye(4 * n) * h
        numeric = np.array([(value(z + d) - value(z - d)) / (2.0 * h) for d in steps]).T
        tangent = np.eye(4 * n)
        for i in range(n):
            rows = slice(n + 3 * i, n + 3 * i + 3)
            tangent[rows, rows] -= np.outer(z[rows], z[rows])
        np.testing.assert_allclose(numeric @ tangent, slope(z) @ tangent, atol=1e-8)


# ---------------------------------------------------------------- all of them in flight


@pytest.mark.parametrize("kind", ["min-norm", "internal-force", "wahba-hoenig"])
def test_a_drone_may_leave(kind):
    if message := part.find("allocation", kind).missing():
        pytest.skip(message)
    run = colift.run(
        "hover",
        allocator=kind,
        overrides={
            "drones.count": 5,
            "timing.duration": 2.0,
            "events": [{"at": 0.5, "field": "drones.lose", "value": 1}],
        },
    )
    r = run.recording
    assert r.outcome == "completed"
    after = r.time > 0.5
    assert np.isfinite(r["desired_tensions"][after][:, [0, 2, 3, 4]]).all()
    # Losing a fifth of the pull at once, the load drops a little and comes back.
    error = np.linalg.norm(r["load"][:, 0] - r["reference"][:, 0], axis=1)
    assert error[r.time > 1.8].max() < 0.05


@pytest.mark.parametrize(
    ("kind", "package"), [("wahba-hoenig", "daqp"), ("slsqp", "scipy"), ("ipopt", "casadi")]
)
def test_a_missing_package_is_named(monkeypatch, kind, package):
    monkeypatch.setattr(importlib.util, "find_spec", lambda *_: None)
    with pytest.raises(MissionError, match=rf"allocation\.kind.*pip install '{package}"):
        load_mission("hover", {"allocation.kind": kind})
    with pytest.raises(MissingExtraError, match=rf"pip install '{package}"):
        Allocator(part.find("allocation", kind)(), 4)


def test_every_extra_that_a_part_names_brings_its_package():
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    found = [part.find("allocation", name) for name in part.names("allocation")]
    needed = [each.needs for each in found if each.needs]
    assert len(needed) >= 3
    for package, extra in needed:
        assert any(line.startswith(package) for line in project["optional-dependencies"][extra])
