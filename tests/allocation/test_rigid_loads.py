"""Wrenches shared among the cables of a rigid load: the plan, the pseudo-inverse, the safe allocator."""

from __future__ import annotations

import importlib
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import minimize

from colift.control.allocation.base import Allocator, Status
from colift.control.allocation.limits import metres
from colift.control.allocation.safe_wrench import SafeWrench, outward
from colift.control.allocation.wrench_min_norm import WrenchMinNorm
from colift.team import Body, Team
from colift.team.geometry import matrix_of
from colift.team.load import box_inertia, usual_attachments
from colift.team.plan import least_lean, plan, unheld, wrench_map

SIZE = np.array([0.6, 0.4, 0.2])
MASS = 0.5
WEIGHT = MASS * 9.81


def team_of(n, *, size=SIZE, **further):
    body = Body(box_inertia(MASS, size), usual_attachments(n, size), size=size)
    team = Team.uniform(n, load_mass=MASS, mass=0.5, **further)
    return replace(team, body=body)


def turn(x, y, z):
    angle = math.sqrt(x * x + y * y + z * z)
    scale = math.sin(0.5 * angle) / angle if angle > 0.0 else 0.5
    return np.array([math.cos(0.5 * angle), scale * x, scale * y, scale * z])


def allocator_of(part, team):
    allocator = Allocator(part, team)
    directions, tensions = part.formation(team)
    allocator.reset(directions, tensions)
    return allocator


def missing(team, answer, force, moment, attitude=(1.0, 0.0, 0.0, 0.0)):
    """What the answer leaves of the wrench (6,), N and N m."""
    ends = team.levers @ matrix_of(np.asarray(attitude)).T
    pulls = answer.tensions[:, None] * answer.directions
    return np.concatenate([pulls.sum(axis=0) + force, np.cross(ends, pulls).sum(axis=0) + moment])


def clearances(part, team, attitude, directions):
    """Least distance of two drones, in the norm of their ellipsoids, m."""
    drones = team.levers @ matrix_of(attitude).T - team.cable_lengths[:, None] * directions
    i, j = np.triu_indices(team.n, k=1)
    return np.linalg.norm((drones[i] - drones[j]) / [1.0, 1.0, part.downwash], axis=1).min()


@pytest.mark.parametrize("n", [2, 3, 4, 5, 8, 16])
def test_a_plan_holds_the_load_with_drones_apart_and_outward(n):
    team = team_of(n)
    attitude = turn(0.0, 0.1, 0.7)
    directions, tensions = plan(team, attitude, distance=0.35)
    ends = team.levers @ matrix_of(attitude).T
    wrench = wrench_map(ends) @ (tensions[:, None] * directions).ravel()
    if n > 2:  # two cables cannot hold a tilted load
        assert_allclose(wrench, [0.0, 0.0, -WEIGHT, 0.0, 0.0, 0.0], atol=1e-9)
    assert tensions.min() > 0.1 * WEIGHT / n
    drones = ends - team.cable_lengths[:, None] * directions
    i, j = np.triu_indices(n, k=1)
    assert np.linalg.norm((drones[i] - drones[j]) / [1.0, 1.0, 2.0], axis=1).min() > 0.35
    stiffness = tensions / team.cable_lengths * np.sum(ends[:, :2] * drones[:, :2], axis=1)
    assert stiffness.sum() > 0.0


def test_a_plan_shares_the_weight_about_the_centre_of_mass():
    body = replace(team_of(4).body, centre=np.array([0.1, 0.05, 0.0]))
    directions, tensions = plan(replace(team_of(4), body=body))
    pulls = tensions[:, None] * directions
    assert_allclose(np.cross(body.arms, pulls).sum(axis=0), 0.0, atol=1e-9)
    assert tensions[0] > 1.5 * tensions[2]


@pytest.mark.parametrize("n", [3, 6])
def test_the_pseudo_inverse_gives_the_nearest_forces_to_its_plan(n):
    team, attitude = team_of(n), turn(0.1, -0.05, 0.4)
    force, moment = np.array([0.4, -0.3, WEIGHT]), np.array([0.05, -0.02, 0.03])
    answer = Allocator(WrenchMinNorm(), team).allocate(
        force, moment=moment, attitude=attitude, wanted_attitude=attitude
    )
    assert answer.status is Status.CONVERGED
    assert_allclose(missing(team, answer, force, moment, attitude), 0.0, atol=1e-12)
    # What it adds to the plan, turned with heading and force, has no part that makes no wrench.
    directions, tensions = plan(team)
    size = np.linalg.norm(force)
    heading = 2.0 * math.atan2(attitude[3], attitude[0])
    axis = np.cross([0.0, 0.0, 1.0], force / size)
    lean = turn(*(axis / np.linalg.norm(axis) * math.acos(force[2] / size)))
    planned = tensions[:, None] * directions @ (matrix_of(lean) @ matrix_of(turn(0, 0, heading))).T
    step = answer.tensions[:, None] * answer.directions - planned * size / WEIGHT
    balance = wrench_map(team.levers @ matrix_of(attitude).T)
    in_range = np.linalg.pinv(balance) @ (balance @ step.ravel())
    assert_allclose(step.ravel(), in_range, atol=1e-9)


@pytest.mark.parametrize(
    ("n", "force", "moment"),
    [
        (3, [0.1, 0.03, WEIGHT], [0.005, 0.01, -0.004]),
        (4, [0.09, 0.03, 1.02 * WEIGHT], [0.02, 0.03, -0.006]),
    ],
)
def test_the_answer_costs_no_more_than_that_of_slsqp(n, force, moment):
    """With turns, tensions and cones at their limits; from the answer of the cycle before."""
    team = team_of(n)
    part = SafeWrench(max_rate=2.0, max_cone_deg=40.0, barrier=1e-8, tolerance=1e-6)
    force, moment = np.array(force), np.array(moment)
    allocator = allocator_of(part, team)
    before = allocator.allocate([0.0, 0.0, WEIGHT])
    answer = allocator.allocate(force, moment=moment)
    assert answer.status is Status.CONVERGED
    assert answer.optimality_gap > 0.0  # a limit is at work
    floor, most = part.tension_floors(team), part.tension_caps(team)
    directions, tensions = part.formation(team)
    size = np.linalg.norm(force)
    axis = np.cross([0.0, 0.0, 1.0], force / size)
    lean = turn(*(axis / np.linalg.norm(axis) * math.acos(force[2] / size)))
    home = tensions[:, None] * directions @ matrix_of(lean).T * size / WEIGHT

    def limits(z):
        w = z.reshape(n, 3)
        t = np.linalg.norm(w, axis=1)
        along = np.sum(w * before.directions, axis=1)
        cone = -w[:, 2] - math.cos(math.radians(40.0)) * t
        turned = along * math.tan(0.02) - np.sqrt(np.maximum(t * t - along * along, 1e-18))
        return np.concatenate([along - floor, most - t, cone, 10.0 * turned])

    balance = wrench_map(team.levers)
    wanted = -np.concatenate([force, moment])
    found = minimize(
        lambda z: 0.5 * np.sum((z - home.ravel()) ** 2),
        (before.tensions[:, None] * before.directions).ravel(),
        jac=lambda z: z - home.ravel(),
        method="SLSQP",
        constraints=[
            {"type": "eq", "fun": lambda z: balance @ z - wanted, "jac": lambda _: balance},
            {"type": "ineq", "fun": limits},
        ],
        options={"ftol": 1e-12, "maxiter": 300},
    )
    assert np.abs(balance @ found.x - wanted).max() < 1e-8
    assert limits(found.x).min() > -1e-8
    assert answer.objective <= found.fun * (1.0 + 1e-4)
    assert answer.objective >= found.fun * (1.0 - 1e-3)


@pytest.mark.parametrize("n", [2, 3, 4, 8])
@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_no_answer_breaks_a_limit(n, noise):
    team = team_of(n, max_thrust=12.0)
    part = SafeWrench(
        max_rate=3.0, min_distance=0.5, cable_distance=0.2, max_tilt_deg=35.0, max_cone_deg=55.0
    )
    allocator = allocator_of(part, team)
    rng = np.random.default_rng(n)
    previous = allocator.allocate([0.0, 0.0, WEIGHT])
    outs, boxed = outward(team), np.any(outward(team) != 0.0, axis=1)
    floors, caps = part.tension_floors(team), part.tension_caps(team)
    seen = set()
    for k in range(300):
        t = 0.01 * k
        begin = min(t, 1.0)
        roll = 0.0 if n == 2 else 0.15
        attitude = turn(
            roll * begin * math.sin(2.1 * t),
            0.15 * begin * math.sin(1.7 * t),
            0.8 * math.sin(0.9 * t),
        )
        acceleration = begin * np.array(
            [2.0 * math.sin(1.3 * t), 2.0 * math.sin(1.9 * t), 1.0 * math.sin(t)]
        )
        acceleration += noise * rng.normal(size=3)
        moment = 0.07 * noise * rng.normal(size=3)
        measured = attitude + 0.003 * noise * rng.normal(size=4)
        answer = allocator.allocate(
            MASS * (acceleration + [0.0, 0.0, 9.81]), acceleration,
            moment=moment, attitude=measured, wanted_attitude=attitude,
        )  # fmt: skip
        seen.add(answer.status)
        assert np.all(answer.tensions >= floors - 1e-9)
        assert np.all(answer.tensions <= caps + 1e-9)
        assert np.all(-answer.directions[:, 2] >= math.cos(math.radians(55.0)) - 1e-9)
        turned = np.linalg.norm(answer.directions - previous.directions, axis=1)
        assert turned.max() <= 2.0 * math.sin(0.015) + 1e-9
        own = team.masses[:, None] * (acceleration + [0.0, 0.0, 9.81])
        thrust = own - answer.tensions[:, None] * answer.directions
        sizes = np.linalg.norm(thrust, axis=1)
        assert sizes.max() <= 0.95 * 12.0 + 0.1  # ends of the load accelerate a little more
        assert np.all(thrust[:, 2] >= math.cos(math.radians(36.0)) * sizes)
        out = -np.sum(outs @ matrix_of(attitude).T * answer.directions, axis=1)[boxed]
        assert np.all(out >= math.sin(math.radians(5.0)) - 1e-9)
        assert clearances(part, team, attitude, answer.directions) >= 0.5 - 1e-9
        previous = answer
    assert Status.RECOVERING not in seen
    assert Status.CONVERGED in seen
    if noise == 0.0 and n > 2:
        assert seen == {Status.CONVERGED}


def test_who_is_too_near_is_parted_at_no_others_cost(monkeypatch):
    """After 201 s of the table's smooth wrenches sixteen drones stand at their distance all around, and the load's turn brings two of them 0.01 mm too near."""
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "docs" / "figures")
    script = importlib.import_module("rigid_allocation")
    team, part = script.team_of(16), script.judge_of(16)
    asked = script.asked("smooth", 20_160, team, part.turn_rate(team))
    answers = script.run(part, team, asked)
    broken = script.violations(part, team, asked, answers.pulls)
    assert max(broken.values()) <= 0.0, broken
    assert set(answers.state[:, 0]) == {Status.CONVERGED}


def test_a_wrench_gives_way_in_order_yaw_first_the_weight_last():
    team = team_of(4)
    part = SafeWrench(max_rate=2.0)
    lost = {}
    for name, force, moment in (
        ("yaw", [0.0, 0.0, WEIGHT], [0.0, 0.0, 0.5]),
        ("level", [1.5, 0.0, WEIGHT], [0.0, 0.0, 0.5]),
        ("all", [1.5, 0.0, WEIGHT], [0.3, 0.3, 0.5]),
    ):
        allocator = allocator_of(part, team)
        answer = allocator.allocate(force, moment=moment)
        assert answer.status is Status.FORCE_REDUCED
        lost[name] = np.abs(missing(team, answer, np.array(force), np.array(moment)))
    assert lost["yaw"][5] > 0.1
    assert_allclose(lost["yaw"][:5], 0.0, atol=2e-4)
    assert lost["level"][0] > 0.5
    assert lost["level"][5] > 0.1
    assert_allclose(lost["level"][1:5], 0.0, atol=2e-3)
    assert lost["all"][2] < 2e-3
    assert np.all(lost["all"][[3, 4]] < 2e-3)  # what tensions alone can do is done


@pytest.mark.parametrize("n", [2, 4])
def test_what_is_no_number_repeats_the_last_answer(n):
    team = team_of(n)
    allocator = allocator_of(SafeWrench(), team)
    good = allocator.allocate([0.1, 0.0, WEIGHT], moment=[0.0, 0.01, 0.0])
    nan, inf = math.nan, math.inf
    for force, moment, attitude in (
        ([nan, 0.0, 1.0], [0.0] * 3, [1.0, 0.0, 0.0, 0.0]),
        ([0.0, inf, 1.0], [0.0] * 3, [1.0, 0.0, 0.0, 0.0]),
        ([0.0, 0.0, 1.0], [0.0, nan, 0.0], [1.0, 0.0, 0.0, 0.0]),
        ([0.0, 0.0, 1.0], [0.0] * 3, [nan, 0.0, 0.0, 0.0]),
        ([0.0, 0.0, 1.0], [0.0] * 3, [0.0, 0.0, 0.0, 0.0]),
    ):
        answer = allocator.allocate(force, moment=moment, attitude=attitude)
        assert answer.status is Status.INVALID_FORCE
        assert np.array_equal(answer.tensions, good.tensions)
        assert np.array_equal(answer.directions, good.directions)
    for force, moment in (
        ([0.0, 0.0, 0.0], [0.0] * 3),
        ([0.0, 0.0, -WEIGHT], [0.0] * 3),
        ([1e9, -1e9, 1e9], [1e9, 1e9, -1e9]),
        ([1e-300, 0.0, 0.0], [5e-324, 0.0, 0.0]),
    ):
        for _ in range(20):
            answer = allocator.allocate(force, moment=moment, attitude=[1.0, 0.0, 0.0, 0.0])
            assert np.isfinite(answer.tensions).all()
            assert np.all(answer.tensions >= 0.05 - 1e-9)
            assert_allclose(np.linalg.norm(answer.directions, axis=1), 1.0, atol=1e-12)
    assert any(allocator.allocate([0.0, 0.0, WEIGHT]).status.ok for _ in range(300))


def test_two_cables_make_every_moment_but_that_about_their_line():
    team = team_of(2)
    allocator = allocator_of(SafeWrench(max_rate=20.0), team)
    force, moment = np.array([0.1, 0.05, WEIGHT]), np.array([0.4, 0.05, 0.03])
    answer = allocator.allocate(force, moment=moment)
    assert answer.status is Status.CONVERGED
    miss = missing(team, answer, force, moment)
    assert_allclose(miss[[0, 1, 2, 4, 5]], 0.0, atol=1e-9)
    assert abs(miss[3]) > 0.1


def test_drones_that_start_too_close_are_led_apart():
    team = team_of(4)
    part = SafeWrench(min_distance=0.5, max_rate=2.0)
    inward = -team.levers * [0.9, 0.9, 0.0]
    directions = -np.column_stack(
        [inward[:, :2], np.sqrt(1.0 - np.sum(inward[:, :2] ** 2, axis=1))]
    )
    allocator = Allocator(part, team)
    allocator.reset(directions)
    level = np.array([1.0, 0.0, 0.0, 0.0])
    nearest = clearances(part, team, level, directions)
    assert nearest < 0.2
    statuses = []
    for _ in range(300):
        answer = allocator.allocate([0.0, 0.0, WEIGHT])
        now = clearances(part, team, level, answer.directions)
        assert now >= min(nearest, 0.5) - 1e-6
        nearest = now
        statuses.append(answer.status)
    assert statuses[0] is Status.RECOVERING
    assert statuses[-1] is Status.CONVERGED
    assert nearest >= 0.5


def test_rotors_keep_off_the_cables_of_others():
    """With one long cable, whose drone flies above the short ones' where the plan says so."""
    base = team_of(4, radius=0.12)
    team = replace(base, cable_lengths=np.array([1.0, 0.5, 1.0, 0.5]))
    part = SafeWrench(max_rate=4.0)
    allocator = allocator_of(part, team)
    asked = part.cable_distances(team)
    tilt = turn(0.0, 0.0, 0.0)
    for k in range(400):
        force = WEIGHT * np.array(
            [0.35 * math.sin(0.02 * k), 0.35 * math.cos(0.03 * k) - 0.35, 1.0]
        )
        answer = allocator.allocate(force, wanted_attitude=tilt)
        drones = team.levers - team.cable_lengths[:, None] * answer.directions
        for i in range(4):
            for j in range(4):
                if i != j:
                    cable = drones[j] - team.levers[j]
                    s = np.clip((drones[i] - team.levers[j]) @ cable / (cable @ cable), 0.0, 1.0)
                    gap = np.linalg.norm(drones[i] - team.levers[j] - s * cable)
                    assert gap >= asked[i] - 1e-9


def test_what_drones_that_are_left_cannot_hold_is_told():
    part, four, six = SafeWrench(), team_of(4), team_of(6)
    thrusts = np.full(6, 9.0)
    assert part.cannot_hold(four, thrusts[:4], plan(four)[0]) == []
    assert part.cannot_hold(six.of([0, 1, 2, 3, 5]), thrusts[:5], plan(six)[0]) == []
    # Of the cables on four corners three hold the load only where the lost corner sinks.
    three = four.of([0, 1, 3])
    assert unheld(three, (1.0, 0.0, 0.0, 0.0), *plan(three)) > 1e-3
    angle, attitude = least_lean(three)
    assert 0.0 < angle <= math.radians(20.0)
    assert unheld(three, attitude, *plan(three, attitude)) < 1e-6
    corner = four.levers[2]
    assert (matrix_of(attitude) @ corner)[2] < corner[2]
    (problem,) = part.cannot_hold(three, thrusts[:3], plan(four)[0])
    assert "only leaning, not level" in problem  # and nobody leans it yet
    two = four.of([0, 1])
    (problem,) = part.cannot_hold(two, thrusts[:2], plan(four)[0])
    assert "neither level nor leaning" in problem
    (problem,) = part.cannot_hold(four, np.full(4, 6.0), plan(four)[0])
    assert "would need" in problem


def test_limits_that_cross_are_told():
    team = team_of(4)
    (problem,) = SafeWrench(tension_min=3.0, tension_max=3.1).check(team)
    assert problem[0] == "tension_min"
    (problem,) = SafeWrench(max_thrust=5.0).conflicts(team)
    assert "needs a quarter more" in problem[1]
    assert SafeWrench(min_distance=[0.3] * 3).check(team)


def test_a_slew_limit_spreads_a_jump_of_the_level_force_over_cycles():
    team = team_of(4)
    part = SafeWrench(slew=0.6, max_rate=2.0)
    allocator = allocator_of(part, team)
    allocator.allocate([0.0, 0.0, WEIGHT])
    most = 0.6 * WEIGHT * 2.0 * 0.01
    for k in range(1, 4):
        answer = allocator.allocate([2.5 * most, 0.0, WEIGHT])
        given = -(answer.tensions @ answer.directions)
        assert_allclose(given, [min(k, 2.5) * most, 0.0, WEIGHT], atol=1e-9)
        assert answer.status is (Status.FORCE_REDUCED if k < 3 else Status.CONVERGED)


@pytest.mark.parametrize("kind", [metres.ROTOR, metres.ROTOR_BACK, metres.CABLES])
def test_a_distance_is_the_least_of_all_points_and_its_normal_the_slope(kind, monkeypatch):
    rng = np.random.default_rng(kind)
    steps = np.linspace(0.0, 1.0, 101)

    plain = getattr(metres.apart, "py_func", metres.apart)  # too little to compile it for
    monkeypatch.setattr(metres, "closest", getattr(metres.closest, "py_func", metres.closest))

    def distance(e, p, q):
        return plain(kind, 0.25, *e.tolist(), *p.tolist(), *q.tolist())

    for _ in range(30):
        e, p, q = rng.normal(size=(3, 3))
        size, *normal, s, t = distance(e, p, q)
        first = steps[:, None] * p if kind != metres.ROTOR else p[None]
        second = steps[:, None] * q if kind != metres.ROTOR_BACK else q[None]
        grid = np.linalg.norm(e + first[:, None] - second[None], axis=2).min()
        assert grid - 0.02 <= size <= grid + 1e-12
        d = 1e-6 * rng.normal(size=3)
        assert_allclose(distance(e, p + d, q)[0] - size, s * np.dot(normal, d), atol=1e-10)
        assert_allclose(distance(e, p, q + d)[0] - size, -t * np.dot(normal, d), atol=1e-10)
