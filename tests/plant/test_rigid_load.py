"""A rigid load on every plant: an oracle, conserved quantities, the integrator's order, the ground, MuJoCo.

The oracle knows nothing of the plants' formulas: bodies in world coordinates, one holonomic constraint a cable between
points of two bodies, Lagrange multipliers from one dense linear system.
"""

from __future__ import annotations

import importlib.util
from dataclasses import replace

import numpy as np
import pytest
from plant_rig import Rig, random_team, rotation

from colift.team import Body, Ground, Team
from colift.team.geometry import ring
from colift.team.load import box_inertia, usual_attachments
from colift.world.plant._params import DRONE, LOAD
from colift.world.plant._rigid import derivative
from colift.world.plant.bead_cables import BeadCables
from colift.world.plant.elastic_cables import ElasticCables
from colift.world.plant.mujoco import Mujoco
from colift.world.plant.rigid_cables import RigidCables
from colift.world.plant.slack_cables import SlackCables

SIZE = np.array([0.6, 0.4, 0.2])


def crooked(rng, n):
    """A body of which nothing is symmetric."""
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    inertia = turn @ np.diag([0.02, 0.03, 0.04]) @ turn.T
    return Body(
        0.5 * (inertia + inertia.T), rng.normal(size=(n, 3)) * 0.3, rng.normal(size=3) * 0.05
    )


def tumbling(seed, n, part=None, *, gravity=9.81, rates=1.0):
    """A random team on taut cables around a crooked load, which turns with its drones as one body."""
    rng = np.random.default_rng(seed)
    team = replace(random_team(rng, n, gravity=gravity), body=crooked(rng, n))
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rig = Rig(team, directions, part)
    spin = rates * rng.normal(size=3)  # world
    rig.state[10:13] = rotation(rig.state[6:10]).T @ spin
    rig.drones[:, 3:6] = np.cross(spin, rig.drones[:, :3] - rig.state[:3])
    rig.straighten()
    return rig, rng


def oracle(rig, thrusts, external):
    """Accelerations of load and drones (n + 1, 3), of the load's rates (3,), and tensions (n,)."""
    team, n, s = rig.team, rig.n, rig.observe()
    R, omega = rotation(rig.state[6:10]), rig.state[10:13]
    inertia = R @ team.body.inertia @ R.T
    spin = R @ omega
    size = 3 * n + 6  # drones, load's place, load's turning in the world
    mass = np.zeros((size, size))
    force = np.zeros(size)
    for i in range(n):
        mass[3 * i : 3 * i + 3, 3 * i : 3 * i + 3] = team.masses[i] * np.eye(3)
        force[3 * i : 3 * i + 3] = thrusts[i] * rotation(s["attitudes"][i])[:, 2] + external[i]
        force[3 * i + 2] -= team.masses[i] * team.gravity
    mass[3 * n : 3 * n + 3, 3 * n : 3 * n + 3] = team.load_mass * np.eye(3)
    mass[3 * n + 3 :, 3 * n + 3 :] = inertia
    force[3 * n : 3 * n + 3] = external[n] - [0.0, 0.0, team.load_mass * team.gravity]
    force[3 * n + 3 :] = -np.cross(spin, inertia @ spin)
    jacobian, rows = np.zeros((n, size)), np.zeros(n)
    for i in range(n):
        arm = R @ team.levers[i]
        span = rig.state[:3] + arm - rig.drones[i, :3]
        speed = rig.state[3:6] + np.cross(spin, arm) - rig.drones[i, 3:6]
        jacobian[i, 3 * i : 3 * i + 3] = -span
        jacobian[i, 3 * n : 3 * n + 3] = span
        jacobian[i, 3 * n + 3 :] = np.cross(arm, span)
        rows[i] = -speed @ speed - span @ np.cross(spin, np.cross(spin, arm))
    system = np.block([[mass, jacobian.T], [jacobian, np.zeros((n, n))]])
    answer = np.linalg.solve(system, np.append(force, rows))
    moved = answer[:size]
    turned = R.T @ moved[3 * n + 3 :]
    return moved[: 3 * n + 3].reshape(n + 1, 3), turned, answer[size:] * team.cable_lengths


@pytest.mark.parametrize("n", [1, 2, 3, 6])
def test_accelerations_and_tensions_agree_with_maximal_coordinates(n):
    for seed in range(5):
        rig, rng = tumbling(10 * n + seed, n)
        rig.drones[:, 10:13] = rng.normal(size=(n, 3))
        thrusts, external = rng.uniform(0.0, 20.0, n), rng.normal(size=(n + 1, 3))
        wanted, turned, tensions = oracle(rig, thrusts, external)
        slope, T = np.zeros_like(rig.state), np.zeros(n)
        derivative(
            n, rig.state, thrusts, rig.torques, external, np.zeros(3), rig.attached, np.zeros(2 * n + 16), 0.0,
            rig.params, np.zeros(n), T, np.zeros(3 * n), np.zeros(n), rig.ground_forces, slope,
        )  # fmt: skip
        close = {"rtol": 0, "atol": 1e-9 * max(1.0, np.abs(wanted).max(), np.abs(turned).max())}
        np.testing.assert_allclose(T, tensions, **close)
        np.testing.assert_allclose(slope[3:6], wanted[n], **close)
        np.testing.assert_allclose(slope[10:13], turned, **close)
        np.testing.assert_allclose(slope[LOAD:].reshape(n, DRONE)[:, 3:6], wanted[:n], **close)


PLANTS = [
    RigidCables(),
    SlackCables(),
    ElasticCables(damping_ratio=0.0, stiffness=2000.0),
    BeadCables(damping_ratio=0.0, stiffness=2000.0, beads=3, drag_coefficient=0.0),
]


@pytest.mark.parametrize("plant", PLANTS, ids=lambda plant: type(plant).__name__)
def test_energy_and_momenta_are_conserved(plant):
    rig, _ = tumbling(3, 3, plant, gravity=0.0)
    if hasattr(plant, "stiffness"):
        rig.drones[:, :3] *= 1.02  # stretched: the cables pull and swing back

    def kept():
        energy, turning = rig.turning()
        return rig.energy() + energy, rig.momentum(), rig.angular_momentum() + turning

    energy, momentum, angular = kept()
    rig.step(dt=0.00025, count=4000)
    later = kept()
    if isinstance(plant, SlackCables):  # a catch takes energy away
        assert rig.slack_times.max() > 0.0
        assert 0.9 * energy < later[0] < energy
    elif isinstance(plant, BeadCables):  # the integrator damps the fastest waves of the beads
        assert 0.5 * energy < later[0] < energy
    else:  # what springs that go slack and taut cost the integrator's order is small
        assert later[0] == pytest.approx(energy, rel=1e-9 if plant is PLANTS[0] else 1e-4)
    np.testing.assert_allclose(later[1], momentum, rtol=0, atol=1e-9)
    np.testing.assert_allclose(later[2], angular, rtol=0, atol=1e-7 * np.abs(angular).max() + 1e-9)


@pytest.mark.parametrize(
    "plant",
    [*PLANTS, pytest.param(Mujoco(), marks=pytest.mark.skipif(
        importlib.util.find_spec("mujoco") is None, reason="needs mujoco"
    ))],
    ids=lambda plant: type(plant).__name__,
)  # fmt: skip
def test_a_moment_on_the_load_changes_the_angular_momentum_of_all_at_its_rate(plant):
    rig, _ = tumbling(3, 3, plant, gravity=0.0)
    rig.moment[:] = 0.05, -0.02, 0.03  # world, however the load turns

    def angular():
        return rig.angular_momentum() + rig.turning()[1]

    before, momentum = angular(), rig.momentum()
    rig.step(dt=0.0005, count=800)
    np.testing.assert_allclose(angular() - before, 0.4 * rig.moment, rtol=0, atol=2e-6)
    np.testing.assert_allclose(rig.momentum(), momentum, rtol=0, atol=1e-6)


def test_a_rod_pushes_along_itself_and_turns_no_drone():
    """A drone that is pressed onto a rod upright above the load: both go down together, the load by the rod alone."""
    m, m_L, F = 0.5, 0.8, 6.0
    body = Body(box_inertia(m_L, SIZE), np.array([[0.0, 0.0, 0.1]]), size=SIZE)
    team = replace(Team.uniform(1, mass=m, load_mass=m_L, gravity=0.0), body=body)
    rig = Rig(team, np.array([[0.0, 0.0, -1.0]]), RigidCables())
    rig.external[0] = 0.0, 0.0, -F
    rig.torques[0] = 0.0, 0.0, 1e-3  # on a ball joint it spins by itself
    rig.step(count=200)
    assert rig.tensions[0] == pytest.approx(-F * m_L / (m + m_L), rel=1e-9)
    assert rig.load[1, 2] == pytest.approx(-0.2 * F / (m + m_L), rel=1e-9)
    assert rig.slack_times[0] == pytest.approx(0.2)
    assert rig.drones[0, 12] == pytest.approx(0.2 * 1e-3 / team.inertias[0, 2], rel=1e-9)
    assert not rig.state[10:13].any()


@pytest.mark.parametrize("plant", PLANTS[:2], ids=lambda plant: type(plant).__name__)
def test_cables_keep_their_lengths_and_what_is_observed_is_the_load_s_middle(plant):
    rig, _ = tumbling(5, 4, plant, gravity=0.0, rates=3.0)
    rig.step(count=2000)
    s = rig.observe()
    R = rotation(s["load_attitude"])
    assert s["load_attitude"] @ s["load_attitude"] == pytest.approx(1.0, abs=1e-12)
    middle = rig.state[:3] - R @ rig.team.body.centre
    np.testing.assert_allclose(s["load"][0], middle, atol=1e-12)
    ends = middle + rig.team.body.attachments @ R.T
    np.testing.assert_allclose(s["ends"][:, 0], ends, atol=1e-12)
    spans = np.linalg.norm(ends - s["positions"], axis=1)
    np.testing.assert_allclose(spans, rig.team.cable_lengths, atol=1e-9)
    along = np.sum((s["ends"][:, 1] - s["velocities"]) * s["directions"], axis=1)
    np.testing.assert_allclose(along, 0.0, atol=1e-9)
    np.testing.assert_allclose(s["load_rates"], rig.state[10:13])


def test_integrator_is_of_fourth_order():
    def after(dt):
        rig, _ = tumbling(8, 3, rates=2.0)
        rig.thrusts[:] = 5.0
        rig.step(dt=dt, count=round(0.4 / dt))
        return rig.state.copy()

    best = after(0.4 / 1024)
    coarse, fine = (np.abs(after(0.4 / steps) - best).max() for steps in (32, 64))
    assert 3.6 < np.log2(coarse / fine) < 4.6


def test_a_point_that_is_rigid_moves_as_a_point():
    rng = np.random.default_rng(2)
    team = random_team(rng, 3)
    ball = replace(team, body=Body(np.eye(3), np.zeros((3, 3)) + [[0, 0, 1e-30]], size=np.zeros(3)))
    flown = []
    for each in (team, ball):
        rig = Rig(each, ring(3, 0.6))
        rig.thrusts[:] = [3.0, 4.0, 5.0]
        flown.append(rig.step(count=300).state.copy())
    np.testing.assert_allclose(*flown, atol=1e-9)


def box(n=4, **more):
    body = Body(box_inertia(0.5, SIZE), usual_attachments(n, SIZE), size=SIZE)
    return Team(**{**Team.uniform(n, load_mass=0.5).__dict__, "body": body, **more})


@pytest.mark.parametrize(
    "plant",
    [RigidCables(), SlackCables(), ElasticCables(), Mujoco()],
    ids=lambda p: type(p).__name__,
)
def test_a_box_that_is_dropped_lies_flat_in_the_end(plant):
    if plant.missing():
        pytest.skip(plant.missing())
    rig = Rig(box(ground=Ground(friction=0.6)), ring(4, 0.6), plant)
    rig.attached[:] = 0.0
    rig.state[:3] = [0.0, 0.0, 0.5]
    rig.state[6:10] = [np.cos(0.2), np.sin(0.2) * 0.6, np.sin(0.2) * 0.8, 0.0]
    rig.drones[:, 2] += 50.0
    rig.step(count=2500)
    up = rotation(rig.state[6:10])[2, 2]
    assert up > np.cos(np.radians(1.0))
    assert rig.state[2] == pytest.approx(0.1, abs=2e-3)
    assert np.abs(rig.state[[3, 4, 5, 10, 11, 12]]).max() < 1e-2
    assert rig.ground_forces[4, 2] == pytest.approx(0.5 * 9.81, rel=0.02)
    assert rig.touch_speeds[4] > 1.0


@pytest.mark.skipif(not importlib.util.find_spec("mujoco"), reason="needs the package mujoco")
def test_mujoco_moves_a_box_on_four_cables_alike():
    ours, theirs = (Rig(box(), ring(4, 0.6), part) for part in (RigidCables(), Mujoco()))
    for rig in (ours, theirs):
        rig.thrusts[:] = [6.3, 6.1, 6.2, 6.4]
        rig.torques[:, 2] = [0.001, 0.0, 0.002, 0.0]
        rig.step(count=500)
    np.testing.assert_allclose(theirs.state[:3], ours.state[:3], atol=2e-3)
    turn = rotation(theirs.state[6:10]).T @ rotation(ours.state[6:10])
    assert np.degrees(np.arccos(min(1.0, (np.trace(turn) - 1.0) / 2.0))) < 0.5
    assert np.abs(ours.state[:3] - [0, 0, 0]).max() > 0.02
    np.testing.assert_allclose(theirs.tensions, ours.tensions, atol=0.05)
