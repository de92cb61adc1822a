"""Plans for the whole team: exact, balanced, certified, the same for the same seed."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from windows import window

from colift.errors import MissionError, PlanError, SettingError
from colift.mission.load import load_mission
from colift.plan import planner
from colift.plan.distances import along, distance
from colift.plan.problem import assemble
from colift.plan.scene import load_scene
from colift.team.obstacles import CYLINDER
from terminal import colift


def test_a_plan_holds_newtons_equations_of_load_drones_and_cables(found):
    """Against accelerations from forces: with the cables' angular accelerations, which the benchmark's model drops."""
    rows, limits = found.sample(400), found.limits
    g = np.array([0.0, 0.0, limits.gravity])
    pull = rows["forces"][:, :, 0].sum(axis=1) / limits.load_mass - g
    assert np.abs(pull - rows["load"][:, 2]).max() < 1e-9
    cables = rows["drones"][:, :, 0] - rows["load"][:, None, 0]
    np.testing.assert_allclose(np.linalg.norm(cables, axis=2), 0.5, atol=1e-12)
    # The multiplier of each cable from the constraint |d|^2 = L^2, twice differentiated, as the plant solves it.
    U, m = rows["thrusts"], limits.drone_mass
    d = cables
    d1 = rows["drones"][:, :, 1] - rows["load"][:, None, 1]
    for k in range(0, len(d), 37):
        n = d.shape[1]
        A = d[k] @ d[k].T / limits.load_mass + np.diag((d[k] ** 2).sum(axis=1)) / m
        b = (d[k] * U[k]).sum(axis=1) / m + (d1[k] ** 2).sum(axis=1)
        lam = np.linalg.solve(A, b)
        load = d[k].T @ lam / limits.load_mass - g
        drones = (U[k] - lam[:, None] * d[k]) / m - g
        assert n == 3
        assert np.abs(load - rows["load"][k, 2]).max() < 1e-6
        assert np.abs(drones - rows["drones"][k, :, 2]).max() < 1e-6


def test_derivatives_of_a_plan_are_those_of_its_values(found):
    rows = found.sample(4000)
    dt = rows["time"][1]
    for name, axis in (("forces", 2), ("drones", 2), ("load", 1)):
        values = np.moveaxis(rows[name], axis, 0)
        for k in range(2):
            by_difference = np.gradient(values[k], dt, axis=0)[2:-2]
            scale = np.abs(values[k + 1]).max()
            assert np.abs(by_difference - values[k + 1][2:-2]).max() < 1e-3 * scale


def test_a_plan_begins_and_ends_at_rest(found):
    rows = found.sample(100)
    rounding = (
        2.0**-52 * (found.intervals / found.duration) ** 4 * 840.0 * 10.0
    )  # of a fourth derivative
    for end in (0, -1):
        assert np.abs(rows["load"][end, 1:]).max() < rounding
        assert np.abs(rows["drones"][end, :, 1:]).max() < rounding
    np.testing.assert_allclose(
        rows["load"][[0, -1], 0], [found.scene.start, found.scene.goal], atol=1e-12
    )


@pytest.mark.parametrize("far", [0.0, 0.03, 0.12])
def test_a_short_hop_begins_and_ends_where_the_scene_says(far):
    scene = replace(window(), goal=np.array([-0.5 + far, 0.0, 0.0]), obstacles=np.zeros((0, 8)))
    hop = planner.plan(scene, attempts=1)
    assert "obstacle" not in hop.excess
    np.testing.assert_allclose(
        hop.sample(20)["load"][[0, -1], 0], [scene.start, scene.goal], atol=1e-12
    )


def test_what_is_no_number_is_not_certified(found):
    broken = found.pull_points.copy()
    broken[10] = np.nan
    worst = planner.excess(found.scene, found.limits, found.load_points, broken, found.duration)
    assert np.isinf(worst).all()


def test_the_certificate_sees_what_dense_distances_see(found):
    assert max(found.excess.values()) <= 0.0
    moved = found.scene.obstacles.copy()
    moved[0, 2] -= 0.1
    for obstacles in (found.scene.obstacles, moved):
        scene = replace(found.scene, obstacles=obstacles)
        worst = planner.excess(
            scene, found.limits, found.load_points, found.pull_points, found.duration
        )
        at = found.sample(planner.DENSE * found.intervals)
        drones = at["drones"][:, :, 0].reshape(-1, 3)
        gap = min(distance(o, *p)[0] for o in obstacles for p in drones) - found.limits.radius
        assert worst[0] >= -gap - 1e-9
        assert (worst[0] > 0.0) == (obstacles is moved)


def test_the_same_seed_gives_the_same_plan(found):
    again = planner.plan(window(), seed=1, attempts=4, seconds=np.inf)
    assert np.array_equal(again.load_points, found.load_points)
    assert again.duration == found.duration


def test_gradients_are_those_of_the_cost():
    scene, limits = window(), planner.Limits()
    pulls, _ = planner.rest(scene, limits)
    grid = planner.Grid(3, 10)
    attempt = planner.Attempt(scene, limits, pulls)
    rng = np.random.default_rng(1)
    planner.first_guess(attempt, grid, rng, 1)
    for points, fixed in ((attempt.x, 6), (attempt.z, 4)):
        inner = points[fixed:-fixed]
        inner += rng.normal(0.0, 0.05, inner.shape)
    grad, col = np.zeros(grid.unknowns + 1), np.zeros(grid.unknowns + 1)

    def cost(x, z, T, fill=0):
        problem = attempt.problem(planner.MARGINS)
        return assemble(x, z, T, fill, *problem, grad, col, attempt.worst)

    T, h = 1.0, 1e-6
    cost(attempt.x, attempt.z, T, 1)
    wanted = grad.copy()
    by_T = (cost(attempt.x, attempt.z, T + h) - cost(attempt.x, attempt.z, T - h)) / (2 * h)
    assert wanted[-1] == pytest.approx(by_T, rel=1e-5)
    for which in (0, 1):
        for p, o in enumerate(grid.index[which]):
            if o < 0:
                continue
            both = []
            for sign in (h, -h):
                points = [attempt.x.copy(), attempt.z.copy()]
                points[which][p, 1] += sign
                both.append(cost(*points, T))
            assert wanted[o + 1] == pytest.approx((both[0] - both[1]) / (2 * h), rel=1e-4, abs=1e-2)


def test_it_says_why_there_is_no_plan():
    blocked = window(gap=0.05)
    blocked.obstacles[0, 1] = -0.5
    with pytest.raises(PlanError, match=r"at its start .* limit of obstacle by"):
        planner.plan(blocked)


@pytest.mark.parametrize("kind", [0.0, CYLINDER])
def test_distances_are_convex_and_their_gradients_true(kind):
    rng = np.random.default_rng(0)
    o = np.array([kind, 0.1, -0.2, 0.3, 0.4, 0.4, 0.5, 0.05])
    for _ in range(200):
        p, v = rng.normal(size=3), rng.normal(size=3)
        _, *grad = distance(o, *p)
        h = 1e-6
        slope = (distance(o, *(p + h * v))[0] - distance(o, *(p - h * v))[0]) / (2 * h)
        assert np.dot(grad, v) == pytest.approx(slope, abs=1e-4)
        t = along(o, *p, *v, 100.0)
        on = [distance(o, *(p + s * v))[0] for s in np.linspace(0, 1, 201)]
        assert distance(o, *(p + t * v))[0] <= min(on) + 0.01 * np.linalg.norm(v)


SCENE = {
    "environment": {"obstacles": [{"type": "box", "center": [0.5, 0.4, 0], "size": [0.4, 0.4, 3]}]},
    "robots": [{
        "l": [0.5, 0.5], "start": [0.0] * 6 + [0.0, 0.54, -0.8417, 0, 0, 0, 0.0, -0.54, -0.8417, 0, 0, 0] + [0.0] * 14,
        "goal": [1.0] + [0.0] * 31,
    }],
}  # fmt: skip


def test_scenes_are_read_and_their_mistakes_named(tmp_path):
    file = tmp_path / "scene.yaml"
    file.write_text(json.dumps(SCENE))  # JSON is YAML
    scene = load_scene(file)
    assert scene.obstacles.shape == (1, 8)
    assert (scene.directions[:, 2] > 0.8).all()
    bad = json.loads(json.dumps(SCENE))
    bad["environment"]["obstacles"] += [
        {"type": "cone"},
        {"type": "sphere", "center": [0, 0, 0], "radius": -1},
    ]
    bad["robots"][0]["goal"] = [0.0]
    file.write_text(json.dumps(bad))
    with pytest.raises(MissionError) as refused:
        load_scene(file)
    text = str(refused.value)
    for part in (
        str(file),
        "obstacles[1].type",
        "obstacles[2].radius",
        "greater than 0",
        "robots[0].goal",
        "32 finite",
    ):
        assert part in text


def test_ends_of_the_load_alone_ask_for_a_cone(tmp_path):
    file = tmp_path / "scene.yaml"
    robot = {"l": [0.5] * 4, "start": [0.0, 0.0, 1.0], "goal": [2.0, 0.0, 1.0]}
    file.write_text(json.dumps({"environment": {}, "robots": [robot]}))
    scene = load_scene(file)
    assert scene.directions is None
    assert (scene.lengths.size, *scene.goal) == (4, 2.0, 0.0, 1.0)
    file.write_text(json.dumps({"robots": [{**robot, "goal": [2.0]}]}))
    with pytest.raises(MissionError, match=r"robots\[0\]\.start: must be 58 finite"):
        load_scene(file)


def test_limits_are_set_by_name_and_refused_by_name():
    assert planner.Limits.of({"room": 0.03, "most": 1.25}) == planner.Limits(room=0.03, most=1.25)
    with pytest.raises(SettingError) as refused:
        planner.Limits.of({"room": -1, "speed": "fast", "rooms": 1.0, "rate": float("nan")})
    for text in ("room: must be a number from 0 to 10", "'fast'", "rooms: is no limit", "rate:"):
        assert text in str(refused.value)


def test_the_shipped_window_is_the_scene_of_the_examples():
    docs = Path(__file__).parents[2] / "docs"
    scene = load_scene(docs / "examples" / "through-a-window.yaml")
    mission = load_mission("through-a-window")
    np.testing.assert_allclose(mission.world.rows(), scene.obstacles, atol=1e-12)
    np.testing.assert_allclose(mission.reference.load_points[0], scene.start)
    np.testing.assert_allclose(mission.reference.load_points[-1], scene.goal)


def test_the_command_writes_a_plan(tmp_path):
    file = tmp_path / "scene.yaml"
    file.write_text(json.dumps(SCENE))
    said = colift(
        "plan", str(file), "--json", "--attempts", "6", "--npz", str(tmp_path / "plan.npz")
    )
    told = json.loads(said.stdout)
    with np.load(tmp_path / "plan.npz") as saved:
        assert saved["duration"] == told["duration"]
        assert saved["forces"].shape[1:] == (2, 3, 3)
