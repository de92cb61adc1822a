"""Plans that drones and load make in turn: agreed on, in balance, through a doorway."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from colift.errors import PlanError
from colift.plan.by_turns import ENOUGH, plan_by_turns
from colift.plan.planner import Limits
from colift.plan.scene import load_scene
from colift.team.obstacles import distances
from terminal import colift

DOORWAY = Path(__file__).parents[2] / "docs" / "examples" / "doorway.yaml"
BODIES = {"drone_mass": 0.85, "load_mass": 0.35, "most": 1.439, "radius": 0.275, "load_radius": 0.2}


@pytest.fixture(scope="module")
def agreed():
    return plan_by_turns(load_scene(DOORWAY), Limits.of(BODIES))


def test_all_agree_and_what_they_agree_on_holds_newtons_equations(agreed):
    assert agreed.done
    assert agreed.history[-1] <= ENOUGH < agreed.history[0]
    dt, g = agreed.times[1], np.array([0.0, 0.0, 9.81])
    away = agreed.drones - agreed.load
    lengths = np.linalg.norm(away, axis=2)
    assert np.abs(lengths - 1.55).max() < 2e-3
    pulls = agreed.pulls.T[..., None] * away / lengths[..., None]
    bend = (agreed.load[2:] - 2.0 * agreed.load[1:-1] + agreed.load[:-2]) / dt**2
    weight = 0.35 * 9.81
    missing = 0.35 * (bend + g) - pulls.sum(axis=0)[1:-1]
    assert np.abs(missing).max() < 5e-3 * weight
    for drone, pull in zip(agreed.drones, pulls, strict=True):
        bend = (drone[2:] - 2.0 * drone[1:-1] + drone[:-2]) / dt**2
        thrust = np.linalg.norm(0.85 * (bend + g) + pull[1:-1], axis=1)
        assert thrust.max() < 12.0 * 1.005


def test_drones_go_through_the_door_one_behind_the_other(agreed):
    scene = agreed.scene
    assert distances(scene.obstacles, agreed.drones).min() > 0.275 - 2e-3
    assert distances(scene.obstacles, agreed.load).min() > 0.2 - 2e-3
    i, j = np.triu_indices(3, k=1)
    apart = np.linalg.norm(agreed.drones[i] - agreed.drones[j], axis=2)
    assert apart.min() > 0.55 - 2e-3
    half = len(agreed.times) // 2
    assert np.ptp(agreed.drones[:, half, 1]) < 0.3 < 1.5 < np.ptp(agreed.drones[:, 0, 1])
    np.testing.assert_allclose(agreed.load[0], scene.start)
    np.testing.assert_allclose(agreed.load[-1], scene.goal)


def test_the_command_says_whether_they_agreed(tmp_path):
    words = [f"--set={name}={value}" for name, value in BODIES.items()]
    done = colift("plan-by-turns", str(DOORWAY), "--rounds", "3", "--json", *words, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert (found["done"], found["rounds"], len(found["history"])) == (False, 3, 3)
    wrong = colift("plan-by-turns", str(DOORWAY), "--set", "wings=2", folder=tmp_path)
    assert "wings" in wrong.stderr
    assert wrong.returncode != 0


def test_too_few_points_are_refused():
    with pytest.raises(PlanError, match="needs 7 points"):
        plan_by_turns(load_scene(DOORWAY), Limits.of(BODIES), points=5)
