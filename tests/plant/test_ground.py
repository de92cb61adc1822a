"""Contact with the ground: what it must keep on every plant, against closed forms, and against MuJoCo."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from plant_rig import DOWN, Rig, rotation

from colift import part
from colift.team import Ground, Team
from colift.world.plant._contact import RATE, damping_ratio, feet
from colift.world.plant.mujoco import Mujoco

SETTINGS = {"bead-cables": {"drag_coefficient": 0.0, "beads": 2}}
G = 9.81


@pytest.fixture(params=part.names("plant"))
def plant(request):
    found = part.find("plant", request.param)
    if message := found.missing():
        pytest.skip(message)
    return found(**SETTINGS.get(request.param, {}))


@pytest.fixture(params=[kind for kind in part.names("plant") if kind != "mujoco"])
def own(request):
    """The plants whose contact is ours."""
    return part.find("plant", request.param)(**SETTINGS.get(request.param, {}))


def on_ground(team=None, **ground):
    return replace(team or Team.uniform(1), ground=Ground(**ground))


def apart(team, plant, height=0.0):
    """Load and drones over the ground at this height, cut from each other, drones 1 m and more aside."""
    rig = Rig(team, np.tile(DOWN, (team.n, 1)), plant)
    rig.attached[:] = 0.0
    rig.load[0] = [0.0, 0.0, height]
    rig.drones[:, :3] = [[2.0 + i, 0.0, height] for i in range(team.n)]
    if rig.beads.size:  # cut at the load's end, beads lie beside their drone
        rig.beads[:, :, :3] = rig.drones[:, None, :3] + [0.0, 0.01, 0.0]
    rig.beads[:, :, 3:] = 0.0
    let_go(rig)
    return rig


def let_go(rig):
    """Put the anchors below bodies that were moved by hand."""
    if rig.part.anchored:
        rig.memory[-2 * (rig.n + 1) :] = [*rig.load[0, :2], *rig.drones[:, :2].ravel()]


def contact_energy(rig):
    """Of the springs that press and of those that hold, J."""
    w, height = RATE, rig.team.ground.height
    anchors = rig.memory[-2 * (rig.n + 1) :].reshape(-1, 2)
    places = np.vstack([rig.load[0, :2], rig.drones[:, :2]])
    masses = np.append(rig.team.load_mass, rig.team.masses)
    total = 0.5 * w**2 * masses @ np.sum((places - anchors) ** 2, axis=1)
    total += 0.5 * rig.team.load_mass * w**2 * max(0.0, height - rig.load[0, 2]) ** 2
    if rig.beads.size:
        masses, x, _ = rig.points()
        beads = slice(1 + rig.n, None)
        total += 0.5 * w**2 * masses[beads] @ np.maximum(0.0, height - x[beads, 2]) ** 2
    for i, r in enumerate(feet(rig.team)):
        ux, uy, _ = rotation(rig.drones[i, 6:10])[2]
        for rise in (ux, -ux, uy, -uy):
            d = max(0.0, height - rig.drones[i, 2] - r * rise)
            total += 0.125 * rig.team.masses[i] * w**2 * d**2
    return total


def energy(rig):
    turning = 0.5 * np.sum(rig.team.inertias * rig.drones[:, 10:13] ** 2)
    return rig.energy() + turning + contact_energy(rig)


def test_a_body_falls_touches_with_its_speed_and_rests(plant):
    rig = apart(on_ground(), plant, height=0.2)
    fastest = np.zeros(2)
    for _ in range(1500):
        rig.touch_speeds[:] = 0.0
        rig.step()
        fastest = np.maximum(fastest, rig.touch_speeds)
    np.testing.assert_allclose(fastest, np.sqrt(2.0 * G * 0.2), atol=0.01)
    sag = (
        0.0 if isinstance(plant, Mujoco) else G / RATE**2
    )  # its constraint holds weight without a stretch
    np.testing.assert_allclose(rig.load[0, 2], -sag, atol=2e-5)
    np.testing.assert_allclose(rig.drones[:, 2], -G / RATE**2, atol=2e-4)
    assert np.abs(rig.load[1]).max() < 1e-6
    assert np.abs(rig.drones[:, 3:6]).max() < 1e-5
    weights = G * np.append(rig.team.masses, rig.team.load_mass)
    np.testing.assert_allclose(
        rig.ground_forces[:, 2], weights, rtol=2e-2 if rig.beads.size else 1e-3
    )
    np.testing.assert_allclose(rig.ground_forces[:, :2], 0.0, atol=1e-3)


@pytest.mark.parametrize("speed", [0.5, 1.0, 3.0])
@pytest.mark.parametrize("mu", [0.3, 0.8])
def test_what_slides_comes_to_rest_where_friction_says(own, speed, mu):
    rig = apart(on_ground(friction=mu), own, height=-G / RATE**2)
    rig.load[1, 0] = speed
    rig.drones[0, 4] = speed
    start = rig.load[0, 0], rig.drones[0, 1]
    rig.step(count=3000)
    wanted = speed**2 / (2.0 * mu * G)
    assert rig.load[0, 0] - start[0] == pytest.approx(wanted, rel=0.01)
    if not rig.beads.size:  # a rope drags on the drone
        assert rig.drones[0, 1] - start[1] == pytest.approx(wanted, rel=0.01)


def test_a_push_below_friction_moves_nothing(own):
    rig = apart(on_ground(friction=0.5), own, height=-G / RATE**2)
    rig.external[:, 0] = 0.45 * G * np.append(rig.team.masses, rig.team.load_mass)
    rig.step(count=200)
    before = rig.load[0].copy(), rig.drones[0, :3].copy()
    rig.step(count=5000)
    assert np.linalg.norm(rig.load[0] - before[0]) < 1e-7
    assert np.linalg.norm(rig.drones[0, :3] - before[1]) < 1e-7
    assert rig.load[0, 0] < 1e-4


@pytest.mark.parametrize("e", [0.2, 0.5, 0.9])
def test_restitution_is_the_share_of_speed_that_comes_back(e):
    plant = part.find("plant", "slack-cables")()
    rig = apart(on_ground(Team.uniform(1, gravity=1e-9), restitution=e), plant, height=0.01)
    rig.load[1, 2] = -1.0
    rig.step(count=100)
    assert rig.load[1, 2] == pytest.approx(e, abs=0.02)
    assert damping_ratio(0.0) == 1.0


@pytest.mark.parametrize("seed", range(20))
def test_energy_never_rises(own, seed):
    """Thrown onto the ground with any attitude and spin."""
    rng = np.random.default_rng(seed)
    team = on_ground(
        Team.uniform(3), friction=rng.uniform(0.0, 1.5), restitution=rng.uniform(0, 0.9)
    )
    rig = apart(team, own)
    rig.load[:] = [[0.0, 0.0, rng.uniform(0.01, 0.5)], rng.normal(size=3) * 2.0]
    rig.drones[:, 2] = rng.uniform(0.3, 0.8, 3)
    rig.drones[:, 3:6] = 2.0 * rng.normal(size=(3, 3))
    turned = rng.normal(size=(3, 4))
    rig.drones[:, 6:10] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
    rig.drones[:, 10:13] = 3.0 * rng.normal(size=(3, 3))
    if rig.beads.size:
        rig.beads[:, :, :3] = rig.drones[:, None, :3] + [0.0, 0.01, 0.0]
    let_go(rig)
    first = before = energy(rig)
    rise = 0.0
    for _ in range(1500):
        rig.step()
        after = energy(rig)
        rise = max(rise, after - before)
        before = after
    assert rise < 1e-5 * first
