"""Physics that every plant must keep, over everything that discovery finds, each to its own stated accuracy."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from plant_rig import DOWN, E3, Rig, random_rig, slack_rig

import colift
from colift import part
from colift.team import Team
from colift.team.geometry import ring, zero_yaw_quaternion
from colift.world.plant.rigid_cables import RigidCables

KINDS = [kind for kind in part.names("plant") if kind != "external"]  # which moves nothing
SETTINGS = {
    "bead-cables": {"drag_coefficient": 0.0, "beads": 2}, "elastic-cables": {"stiffness": 4e4},
}  # fmt: skip
"""Without air, which takes momentum; and a rope that is the same for every load: accuracies are stated for it."""


@pytest.fixture(params=KINDS)
def plant(request):
    found = part.find("plant", request.param)
    if message := found.missing():
        pytest.skip(message)
    return found(**SETTINGS.get(request.param, {}))


@cache
def kinds():
    return {part.find("plant", kind): kind for kind in KINDS}


def kind_of(plant):
    return kinds()[type(plant)]


def accuracy(plant, **by_kind):
    """The entry of this plant's kind, dashes as underscores, else that of the rigid one."""
    return by_kind.get(kind_of(plant).replace("-", "_"), by_kind["rigid_cables"])


def test_all_five_are_here():
    assert set(KINDS) >= {
        "rigid-cables", "slack-cables", "elastic-cables", "bead-cables", "mujoco",
    }  # fmt: skip


def test_free_fall_is_without_tension(plant):
    rig = Rig(Team.uniform(3, gravity=0.0), ring(3, 0.6), plant)  # not stretched by a weight
    rig.params = plant.params(Team.uniform(3))
    rig.step(count=200)
    assert np.abs(rig.tensions).max() < 1e-9
    np.testing.assert_allclose(rig.load[1], -0.2 * 9.81 * E3, rtol=0, atol=1e-9)
    np.testing.assert_allclose(rig.load[0], -0.02 * 9.81 * E3, rtol=0, atol=1e-9)
    np.testing.assert_allclose(rig.drones[:, 5], -0.2 * 9.81, rtol=0, atol=1e-9)


def test_forces_and_weight_account_for_every_change_of_momentum(plant):
    for seed in range(3):
        rig, rng = random_rig(200 + seed, 3, plant)
        rig.external[:] = rng.normal(size=(4, 3))
        before, weight = rig.momentum(), rig.points()[0].sum() * 9.81
        rig.step(count=200)
        wanted = before + 0.2 * (rig.external.sum(axis=0) - weight * E3)
        np.testing.assert_allclose(rig.momentum(), wanted, rtol=0, atol=1e-8 * weight)


def test_angular_momentum_is_kept_without_forces(plant):
    for seed in range(3):
        rig, _ = random_rig(300 + seed, 3, plant, gravity=0.0)
        before = rig.angular_momentum()
        rig.step(count=500)
        relative = np.abs(rig.angular_momentum() - before).max() / np.abs(before).max()
        assert relative < accuracy(plant, rigid_cables=1e-8, mujoco=1e-5)


def test_energy_is_never_gained_when_cables_are_caught(plant):
    """From slack cables and fast bodies; the rigid plant has no slack and keeps its energy."""
    for seed in range(4):
        rig, _ = slack_rig(400 + seed, 3, plant, gravity=9.81 if seed % 2 else 0.0)
        if kind_of(plant) == "rigid-cables":
            rig, _ = random_rig(400 + seed, 3, plant)
        first, scale = rig.energy(), rig.kinetic_energy()
        before = energy = first
        for _ in range(100):
            rig.step(count=10)
            energy = rig.energy()
            assert energy < before + 1e-6 * scale
            # What MuJoCo's soft limit stores and hands back is not in our sum: compare with the start.
            before = first if kind_of(plant) == "mujoco" else energy
        lost = first - energy
        assert (lost > 1e-3 * scale) == (kind_of(plant) != "rigid-cables")


def static_rig(plant, n=4, cone=0.6):
    """In balance: thrusts of m g e3 - T alpha."""
    team = Team.uniform(n)
    directions = ring(n, cone)
    T = team.load_mass * team.gravity / (n * np.cos(cone))
    thrust = -T * directions + team.masses[:, None] * team.gravity * E3
    sizes = np.linalg.norm(thrust, axis=1)
    attitudes = zero_yaw_quaternion(thrust / sizes[:, None])
    rig = Rig(team, directions, plant, attitudes=attitudes)
    rig.thrusts[:] = sizes
    return rig, T


def test_a_flight_in_balance_stays_there(plant):
    rig, T = static_rig(plant)
    allowed = accuracy(plant, rigid_cables=1e-9, elastic_cables=1e-6, bead_cables=2e-3, mujoco=1e-6)
    rig.step()
    np.testing.assert_allclose(rig.tensions, T, rtol=allowed)
    rig.step(count=200)  # the cables' own weight, which nobody holds, lets the beads sink
    np.testing.assert_allclose(rig.load[0], 0.0, atol=0.2 * allowed * 9.81)


def test_pendulum_period(plant):
    """A drone of great mass in exact hover: the load swings as a pendulum on a fixed point."""
    mass, amplitude, dt = 1e4, 0.2, 0.002
    team = Team.uniform(1, load_mass=0.2, mass=mass)
    rig = Rig(team, np.array([[np.sin(amplitude), 0.0, -np.cos(amplitude)]]), plant)
    rig.thrusts[:] = mass * 9.81
    series = 1.0 + amplitude**2 / 16.0 + 11.0 * amplitude**4 / 3072.0
    period = 2.0 * np.pi * np.sqrt(1.0 / 9.81) * series
    crossings, before, time = [], amplitude, 0.0
    while len(crossings) < 3:
        rig.step(dt)
        time += dt
        x, _, z = rig.observe()["directions"][0]
        angle = np.arctan2(x, -z)
        if before * angle < 0.0:
            crossings.append(time - dt * angle / (angle - before))
        before = angle
    allowed = accuracy(plant, rigid_cables=5e-5, elastic_cables=1e-4, bead_cables=2e-3)
    assert crossings[2] - crossings[0] == pytest.approx(period, rel=allowed)


def test_a_manoeuvre_is_that_of_the_rigid_plant(plant):
    """Thrusts, torques, external forces and spinning bodies, from the same state for 0.3 s.

    Elastic cables are made stiff: they do not start with the stretch of this motion and bounce.
    """
    if hasattr(plant, "stiffness"):
        plant = plant.model_copy(update={"stiffness": 4e6})
    for seed in range(4):
        ends = []
        for flown in (plant, RigidCables()):
            rig, rng = random_rig(500 + seed, 3, flown, spin=0.3)
            rig.external[:3] = -8.0 * rig.observe()["directions"]  # keeps the cables taut
            rig.thrusts[:] = rng.uniform(1.0, 3.0, 3)
            rig.torques[:] = 0.02 * rng.normal(size=(3, 3))
            lowest = np.inf
            for _ in range(300):
                rig.step()
                lowest = min(lowest, rig.tensions.min())
            ends.append(rig.observe())
        assert lowest > 0.1
        allowed = accuracy(
            plant, rigid_cables=1e-9, elastic_cables=1e-3, bead_cables=1e-2, mujoco=2e-4
        )
        for name in ("load", "positions"):
            mine, theirs = ends[0][name], ends[1][name]
            if name == "load":
                mine, theirs = mine[0], theirs[0]
            np.testing.assert_allclose(mine, theirs, rtol=0, atol=allowed)
        for name in ("attitudes", "rates"):  # cables do not reach them
            np.testing.assert_allclose(ends[0][name], ends[1][name], rtol=0, atol=1e-6)


def test_a_cut_cable_frees_the_drone_and_all_of_them_the_load(plant):
    rig, T = static_rig(plant)
    rig.step(count=10)
    rig.attached[1] = 0.0
    before = rig.observe()
    rig.step(count=100)
    after = rig.observe()
    assert rig.tensions[1] == 0.0
    assert rig.tensions[[0, 2, 3]].min() > 0.0
    assert rig.slack_times[1] == 0.0
    pulled = T * before["directions"][1]  # what balanced its thrust and weight is gone
    flown = before["positions"][1] - 0.5 * 0.1**2 * pulled / 0.5
    np.testing.assert_allclose(after["positions"][1], flown, rtol=0, atol=1e-4)
    rig.attached[:] = 0.0
    start = rig.load.copy()
    rig.step(count=200)
    assert np.all(rig.tensions == 0.0)
    wanted = start[0] + 0.2 * start[1] - 0.5 * 0.2**2 * 9.81 * E3
    np.testing.assert_allclose(rig.load[0], wanted, rtol=0, atol=1e-9)


@pytest.mark.parametrize("mission", ["four-to-three", "three-to-four"])
def test_drones_leave_and_join_in_flight(plant, mission):
    event = {"at": 0.5, "field": f"drones.{'lose' if mission == 'four-to-three' else 'join'}"}
    event["value"] = 0 if mission == "four-to-three" else 3
    flown = colift.run(
        mission,
        overrides={
            "plant.kind": kind_of(plant),
            **{f"plant.{key}": value for key, value in SETTINGS.get(kind_of(plant), {}).items()},
            "events": [event],
            "timing.duration": 1.0,
        },
    )
    r = flown.recording
    assert r.outcome == "completed"
    assert flown.metrics["tracking_max_m"] < 0.03
    change = np.searchsorted(r.time, 0.5)
    for row, flying in ((change - 1, 4 - (event["value"] == 3)), (-1, 3 + (event["value"] == 3))):
        spans = np.linalg.norm(r["load"][row, 0] - r["positions"][row], axis=1)
        assert np.count_nonzero(np.isfinite(spans)) == flying
        np.testing.assert_allclose(spans[np.isfinite(spans)], 1.0, atol=1e-3)
    others = r["positions"][change - 1 : change + 1, 1:3]
    assert np.abs(np.diff(others, axis=0)).max() < 0.005  # nobody jumps


def test_a_heavy_cross_wind_on_the_load_leans_the_pendulum(plant):
    """External force on the last row is on the load: equilibrium angle atan(F / m g), damped by hand."""
    team = Team.uniform(1, mass=1e4)
    rig = Rig(team, DOWN, plant)
    rig.thrusts[:] = 1e4 * 9.81
    for _ in range(3000):
        rig.external[1] = np.array([0.5, 0.0, 0.0]) - 0.8 * rig.load[1]
        rig.step(0.002)
    x, _, z = rig.observe()["directions"][0]
    wanted = 0.5 / (0.225 * 9.81)
    assert x / -z == pytest.approx(wanted, rel=accuracy(plant, rigid_cables=1e-4, bead_cables=3e-3))
