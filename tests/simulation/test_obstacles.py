"""Obstacles in missions: how far away they are, what touches them, and what is refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

import colift
from colift.errors import MissionError
from colift.mission.scenes import obstacle_of
from colift.plan.distances import along, distance
from colift.record.metrics import compute
from colift.record.recording import Recording
from colift.show.report.figures import path
from colift.team.obstacles import (
    Bodies,
    clearances,
    corners,
    distances,
    first_touch,
    least_clearance,
)

BOX = {"kind": "box", "centre": [1.0, 0.0, 1.0], "size": [0.4, 0.6, 0.8]}
POLE = {"kind": "cylinder", "centre": [0.0, 3.0, 1.0], "radius": 0.2, "height": 2.0}
BALL = {"kind": "sphere", "centre": [0.0, 0.0, 4.0], "radius": 0.5}
HOVER = {"drones.radius": 0.2, "timing.duration": 1.0}


def rows_of(*obstacles):
    return colift.load_mission(
        "hover", {"world.obstacles": list(obstacles), "reference.position": [9.0, 9.0, 9.0]}
    ).world.rows()


ROWS = rows_of(BOX, POLE, BALL)


@pytest.mark.parametrize(
    ("point", "expected"),
    [
        ([1.7, 0.0, 1.0], [0.5, np.hypot(1.7, 3.0) - 0.2, np.sqrt(1.7**2 + 9.0) - 0.5]),
        ([1.5, 0.7, 1.8], [0.5 * np.sqrt(0.3**2 + 0.4**2 + 0.4**2) * 2, None, None]),
        ([1.05, 0.0, 1.0], [-0.15, None, None]),
        ([0.0, 3.0, 2.5], [None, 0.5, None]),
        ([0.0, 3.1, 1.0], [None, -0.1, None]),
        ([0.3, 3.4, 2.3], [None, np.hypot(0.3, 0.3), None]),
        ([0.0, 0.1, 4.0], [None, None, -0.4]),
    ],
)
def test_distances_are_those_of_geometry(point, expected):
    found = distances(ROWS, np.array(point))
    for one, other in zip(found, expected, strict=True):
        assert other is None or one == pytest.approx(other, abs=1e-12)


def test_the_planner_and_the_metric_measure_alike():
    rng = np.random.default_rng(0)
    points, spans = rng.uniform(-2.0, 5.0, (300, 3)), rng.normal(0.0, 1.0, (300, 3))
    bodies = Bodies(
        np.zeros(1), points[:, None], (points + spans)[:, None], np.ones((300, 1)), points[:, None]
    )
    found = clearances(ROWS, bodies)
    for k, (p, v) in enumerate(zip(points, spans, strict=True)):
        for m, row in enumerate(ROWS):
            d, *_ = distance(row, *p)
            assert found[k, 0, m] == pytest.approx(d, abs=1e-12)
            t = along(row, *p, *v, np.inf)
            d, *_ = distance(row, *(p + t * v))
            # Of the planner's search of 14 steps so much of the cable is left.
            assert d - found[k, 2, m] < (2.0 / 3.0) ** 14 * np.linalg.norm(v)
            assert found[k, 2, m] <= d + 1e-6


def test_the_first_touch_names_who_and_which():
    x = np.zeros((50, 2, 3))
    x[:, 0, 0], x[:, 1] = np.linspace(0.0, 0.75, 50), [-5.0, 0.0, 1.0]
    x[:, 0, 2] = 1.0
    far = np.full((50, 1, 3), -9.0)
    bodies = Bodies(np.array([0.1, np.nan]), x, x, np.ones((50, 2)), far)
    touch = first_touch(ROWS, bodies)
    assert touch.text == "drone {0} touched obstacle 0"
    assert x[touch.row, 0, 0] > 0.7 >= x[touch.row - 1, 0, 0]
    assert first_touch(ROWS, bodies._replace(radii=np.zeros(2))) is None
    ends = x.copy()
    ends[30:, 0] = [1.6, 0.0, 1.0]  # through the box
    touch = first_touch(ROWS, bodies._replace(radii=np.zeros(2), ends=ends))
    assert (touch.row, touch.text) == (30, "the cable of drone {0} touched obstacle 0")
    cut = bodies._replace(radii=np.zeros(2), ends=ends, attached=np.zeros((50, 2)))
    assert first_touch(ROWS, cut) is None
    load = bodies._replace(radii=np.zeros(2), load=far.copy())
    load.load[30:] = [0.0, 3.0, 1.0]
    assert first_touch(ROWS, load)[:2] == (30, "the load touched obstacle 1")


def test_corners_turn_with_the_load():
    half = np.sqrt(0.5)
    found = corners(
        np.array([2.0, 4.0, 6.0]), np.ones((1, 1, 3)), np.array([[half, 0.0, 0.0, half]])
    )
    spread = np.ptp(found[0], axis=0)
    np.testing.assert_allclose(spread, [4.0, 2.0, 6.0], atol=1e-12)
    np.testing.assert_allclose(found[0, 8], 1.0)


def test_rows_go_back_to_tables():
    for table, row in zip((BOX, POLE, BALL), ROWS, strict=True):
        back = obstacle_of(row.tolist())
        assert back.keys() == table.keys()
        assert all(back[name] == pytest.approx(table[name]) for name in table)


def test_a_scene_brings_its_obstacles_into_any_mission(tmp_path):
    (tmp_path / "of.toml").write_text(
        'name = "m"\n[reference]\nkind = "hover"\nposition = [9, 9, 9]\n[world]\nscene = "gate.yaml"\n'
        '[[world.obstacles]]\nkind = "sphere"\ncentre = [0, 0, 4]\nradius = 0.5\n'
    )
    scene = {"environment": {"obstacles": [
        {"type": "box", "center": BOX["centre"], "size": BOX["size"]},
        {"type": "cylinder", "center": POLE["centre"], "radius": 0.2, "height": 2.0},
    ]}}  # fmt: skip
    (tmp_path / "gate.yaml").write_text(json.dumps(scene))  # JSON is YAML
    mission = colift.load_mission(tmp_path / "of.toml")
    np.testing.assert_allclose(mission.world.rows(), ROWS, atol=1e-15)
    kept = mission.resolved()
    assert "scene" not in kept["world"]
    np.testing.assert_allclose(colift.load_mission(kept).world.rows(), ROWS, atol=1e-15)
    scene["environment"]["obstacles"][1]["radius"] = -1
    (tmp_path / "gate.yaml").write_text(json.dumps(scene))
    with pytest.raises(MissionError, match=r"world\.scene: environment\.obstacles\[1\]\.radius"):
        colift.load_mission(tmp_path / "of.toml")
    with pytest.raises(MissionError, match=r"world\.scene: .*cannot be read.*none\.yaml"):
        colift.load_mission("hover", {"world.scene": "none.yaml"})


def test_the_report_outlines_obstacles_that_are_near():
    hub = {"kind": "sphere", "centre": [0.0, 0.0, 1.6], "radius": 0.1}
    asked = {**HOVER, "reference.position": [0.0, 0.0, 1.0], "world.obstacles": [BOX, POLE, hub]}
    figure = path(colift.run("hover", overrides=asked).recording)
    (lines,) = [line for line in figure.axes[0].lines if line.get_label() == "obstacles"]
    x, _, z = lines.get_data_3d()
    assert np.nanmax(np.abs(x)) == pytest.approx(0.1)  # of the three only the hub is inside
    assert (np.nanmin(z), np.nanmax(z)) == pytest.approx((1.5, 1.7))


def test_a_flight_tells_its_least_clearance_and_one_without_obstacles_none(tmp_path):
    wall = {"kind": "box", "centre": [0.0, 0.0, 0.0], "size": [4.0, 4.0, 1.0]}
    run = colift.run("hover", overrides={**HOVER, "world.obstacles": [wall]})
    low = run.recording["load"][:, 0, 2].min()
    assert run.metrics["min_clearance_m"] == pytest.approx(low - 0.5, abs=1e-9)
    assert run.verdict.ok
    run.recording.save(tmp_path / "one.h5")
    stored = Recording.load(tmp_path / "one.h5")
    assert compute(stored)["min_clearance_m"] == run.metrics["min_clearance_m"]
    assert np.isnan(colift.run("hover", overrides=HOVER).metrics["min_clearance_m"])
    assert np.isnan(least_clearance(np.zeros((0, 8)), None))


def test_who_touches_an_obstacle_is_lost():
    moving = {
        "reference": {
            "kind": "waypoints",
            "points": [[0.0, 0.0, 1.5], [4.0, 0.0, 1.5]],
            "hold": 0.1,
        }
    }
    gate = {"kind": "cylinder", "centre": [2.0, 0.0, 1.5], "radius": 0.05, "height": 9.0}
    run = colift.run(
        "hover",
        overrides={
            **HOVER,
            **moving,
            "timing.duration": 6.0,
            "world.obstacles": [BALL | {"centre": [0.0, 0.0, 9.0]}, gate],
        },
    )
    assert "touched obstacle 1 at t =" in run.recording.outcome
    assert run.verdict.level == "lost"


@pytest.mark.parametrize(
    ("obstacle", "who"),
    [
        ({"kind": "sphere", "centre": [0.0, 0.0, 1.5], "radius": 0.1}, "the load"),
        ({"kind": "box", "centre": [0.0, 0.0, 2.3], "size": [9.0, 9.0, 0.2]}, "drone 0"),
        (
            {"kind": "box", "centre": [0.0, 0.0, 1.8], "size": [9.0, 9.0, 0.02]},
            "the cable of drone 0",
        ),
    ],
)
def test_a_start_in_an_obstacle_is_refused(obstacle, who):
    asked = {**HOVER, "reference.position": [0.0, 0.0, 1.5], "world.obstacles": [POLE, obstacle]}
    with pytest.raises(MissionError, match=rf"world\.obstacles\.1: .*{who} touches it"):
        colift.load_mission("hover", asked)


@pytest.mark.parametrize(
    ("obstacle", "why"),
    [
        ({"kind": "box", "centre": [0, 0, 0], "radius": 1.0}, "a box has size"),
        (
            {"kind": "cylinder", "centre": [0, 0, 0], "radius": 1.0},
            "a cylinder has height and radius",
        ),
        ({"kind": "sphere", "centre": [0, 0, 0], "radius": -1.0}, "world.obstacles.0.radius"),
        ({"kind": "cone", "centre": [0, 0, 0]}, "world.obstacles.0.kind"),
        ({"kind": "sphere", "radius": 1.0}, "world.obstacles.0.centre"),
    ],
)
def test_what_is_no_obstacle_is_refused(obstacle, why):
    with pytest.raises(MissionError, match=why):
        colift.load_mission("hover", {"world.obstacles": [obstacle]})
