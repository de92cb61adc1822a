"""Elastic cables and beads: statics, oscillation and damping against closed forms, convergence, refusals."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from plant_rig import DOWN, Rig, random_rig, slack_rig
from scipy.optimize import brentq

import colift
from colift.errors import MissionError
from colift.team import Team
from colift.world.plant.bead_cables import AIR, BeadCables
from colift.world.plant.elastic_cables import ElasticCables
from colift.world.plant.rigid_cables import RigidCables

WHIRL = np.array([[0.0, 1.5, 0.0]])


# ---------------------------------------------------------------- closed forms


@pytest.mark.parametrize("part", [ElasticCables(stiffness=500.0), BeadCables(stiffness=500.0)])
def test_static_stretch_is_force_times_length_over_stiffness(part):
    """A load on a held drone, started without stretch, comes to rest F L / EA lower."""
    part = part.model_copy(update={"damping_ratio": 0.5})
    length, mass = 1.7, 1e6
    team = Team.uniform(1, load_mass=0.4, mass=mass, cable_length=length)
    rig = Rig(team, DOWN, part)
    rig.drones[0, 2] = length
    rig.straighten()
    rig.external[0, 2] = mass * 9.81
    rig.step(count=3000)
    below = rig.points()[0][1:].copy()  # the drone's mass, then the beads'
    below[0] = 0.0
    k = rig.beads.shape[1]
    hanging = rig.params[0] + np.append(
        0.0, np.cumsum(below[1:])
    )  # under each segment, from the load up
    stretch = np.sum(hanging) * 9.81 * (length / (k + 1)) / 500.0
    span = rig.drones[0, 2] - rig.load[0, 2]
    assert span - length == pytest.approx(stretch, rel=1e-5)
    assert stretch == pytest.approx(0.4 * 9.81 * length / 500.0, rel=3e-3)
    np.testing.assert_allclose(rig.tensions, rig.params[0] * 9.81, rtol=1e-5)


@pytest.mark.parametrize("damping_ratio", [0.0, 0.03, 0.2])
@pytest.mark.parametrize("beads", [0, 3])
def test_drone_and_load_bounce_with_the_stated_rate_and_damping(beads, damping_ratio):
    """Without gravity, pre-tensioned by external forces: x'' + 2 zeta w x' + w^2 x = 0, w^2 = k / mu."""
    settings = {"stiffness": 800.0, "damping_ratio": damping_ratio}
    light = {"beads": beads, "density": 1e-5, "drag_coefficient": 0.0}
    part = BeadCables(**settings, **light) if beads else ElasticCables(**settings)
    team = Team.uniform(1, load_mass=0.3, mass=0.7, gravity=0.0)
    rig = Rig(team, DOWN, part)
    pull, amplitude = 40.0, 0.01
    rig.external[:, 2] = [pull, -pull]
    rig.drones[0, 2] = 1.0 + pull / 800.0 + amplitude
    rig.straighten()
    rate = np.sqrt(800.0 / (0.3 * 0.7))
    damped = rate * np.sqrt(1.0 - damping_ratio**2)
    dt = 2.0 * np.pi / damped / 100
    for turn in (1, 2):
        rig.step(dt, 100)
        left = rig.drones[0, 2] - rig.load[0, 2] - 1.0 - pull / 800.0
        wanted = amplitude * np.exp(-damping_ratio * rate * 100 * turn * dt)
        assert left == pytest.approx(wanted, rel=2e-3, abs=1e-3 * amplitude)


def test_a_hanging_chain_is_a_catenary_as_beads_multiply():
    """Both ends held 0.8 m apart: nodes on a cosh, with an error that falls as the square of a segment."""
    a = brentq(lambda a: 2.0 * a * np.sinh(0.4 / a) - 1.0, 0.1, 10.0)
    sag = a * (np.cosh(0.4 / a) - 1.0)
    errors = []
    for beads in (3, 7, 15):
        part = BeadCables(beads=beads, density=0.05, stiffness=5e4)
        team = Team.uniform(1, load_mass=1e6, mass=1e6)
        rig = Rig(team, np.array([[1.0, 0.0, 0.0]]), part)
        rig.drones[0, :3] = [-0.8, 0.0, 0.0]
        x = np.linspace(-0.5, 0.5, beads + 2)[1:-1]
        x = a * np.arcsinh(x / a)  # even along the arc
        rig.beads[0, :, 0], rig.beads[0, :, 2] = x - 0.4, a * (np.cosh(x / a) - np.cosh(0.4 / a))
        rig.external[:, 2] = 1e6 * 9.81
        for _ in range(400):  # relax
            rig.step(0.01)
            rig.beads[:, :, 3:] *= 0.8
        assert np.abs(rig.beads[0, :, 3:]).max() < 1e-4
        errors.append(rig.load[0, 2] - rig.beads[0, :, 2].min() - sag)
    assert abs(errors[-1]) < 0.005 * sag
    rates = np.array(errors[:-1]) / errors[1:]
    np.testing.assert_allclose(rates, 4.0, atol=0.8)


def test_the_air_pushes_the_cable_by_its_normal_drag():
    """A straight cable across the wind, all at rest and free: rho c_d d L v^2 / 2 on the whole."""
    part = BeadCables(air_velocity=(8.0, 0.0, 3.0), diameter=0.004, stiffness=1e3)
    team = Team.uniform(1, gravity=0.0)
    rig = Rig(team, DOWN, part)
    rig.step(1e-4)
    force = 0.5 * AIR * 1.1 * 0.004 * 1.0 * 8.0 * np.array([8.0, 0.0, 0.0])  # not along the cable
    np.testing.assert_allclose(rig.momentum(), 1e-4 * force, rtol=5e-3, atol=1e-9)


def test_a_cut_leaves_the_cable_with_its_drone():
    part = BeadCables(drag_coefficient=0.0)
    rig = Rig(Team.uniform(1), DOWN, part)
    rig.thrusts[:] = 9.81 * (0.5 + 6.5e-4)
    rig.attached[:] = 0.0
    rig.step(count=500)
    assert rig.tensions[0] == 0.0
    assert rig.load[1, 2] == pytest.approx(-0.5 * 9.81)
    assert np.abs(rig.drones[0, 3:6]).max() < 0.1
    hang = np.linalg.norm(rig.beads[0, :, :3] - rig.drones[0, :3], axis=1)
    assert hang.max() < 0.76


# ---------------------------------------------------------------- invariants and convergence


@pytest.mark.parametrize("part", [ElasticCables, BeadCables])
def test_energy_without_damping_is_conserved_through_slack_and_catch(part):
    settings = {"drag_coefficient": 0.0} if part is BeadCables else {}
    for seed in range(3):
        rig, _ = slack_rig(600 + seed, 2, part(damping_ratio=0.0, stiffness=2e3, **settings))
        before, scale = rig.energy(), rig.kinetic_energy()
        slack = rig.slack_times.copy()
        rig.step(1e-5, 100_000)
        assert rig.energy() == pytest.approx(before, abs=2e-5 * scale)
        assert np.all(rig.slack_times > slack)
        assert np.any(rig.slack_times < 1.0)


def test_elastic_integrator_is_of_fourth_order_while_taut():
    def flown(dt):
        rig, rng = random_rig(700, 2, ElasticCables(stiffness=300.0, damping_ratio=0.3), spin=0.5)
        rig.external[:2] = -10.0 * rig.observe()["directions"]
        rig.drones[:, :3] += -0.05 * rig.observe()["directions"]
        rig.torques[:] = 0.02 * rng.normal(size=(2, 3))
        for _ in range(round(0.1 / dt)):
            rig.step(dt)
            assert rig.tensions.min() > 0.0
        return rig.state.copy()

    answers = [flown(0.1 / count) for count in (40, 80, 160, 320)]
    changes = [np.linalg.norm(b - a) for a, b in pairwise(answers)]
    orders = np.log2(np.array(changes[:-1]) / changes[1:])
    assert np.all(np.abs(orders - 4.0) < 0.3), orders


def swinging(part):
    """A load that swings under a drone of three times its weight, for 1 s."""
    rig = Rig(Team.uniform(1, load_mass=0.2, mass=0.6), DOWN, part, spin=WHIRL)
    rig.thrusts[:] = 0.8 * 9.81
    rig.step(count=1000)
    return np.concatenate([rig.load[0], rig.drones[0, :3]])


def test_elastic_cables_become_rigid_as_stiffness_grows():
    rigid = swinging(RigidCables())
    errors = [
        np.abs(swinging(ElasticCables(stiffness=EA)) - rigid).max() for EA in (1e3, 1e4, 1e5, 1e6)
    ]
    rates = np.array(errors[:-1]) / errors[1:]
    assert np.all((rates > 5.0) & (rates < 20.0)), errors  # as 1 / EA
    assert errors[-1] < 1e-5


def test_beads_converge_as_they_multiply_and_become_massless():
    heavy = {"density": 0.02, "stiffness": 1e4, "drag_coefficient": 0.0, "damping_ratio": 0.1}
    answers = [swinging(BeadCables(beads=k, **heavy)) for k in (1, 3, 7, 15)]
    changes = [np.abs(b - a).max() for a, b in pairwise(answers)]
    assert np.all(np.array(changes[:-1]) / changes[1:] > 2.5), changes
    elastic = swinging(ElasticCables(stiffness=1e4, damping_ratio=0.1))
    errors = [
        np.abs(swinging(BeadCables(**(heavy | {"density": rho}))) - elastic).max()
        for rho in (4e-3, 4e-4, 4e-5)
    ]
    rates = np.array(errors[:-1]) / errors[1:]
    assert np.all((rates > 7.0) & (rates < 13.0)), errors  # as the density


@pytest.mark.parametrize(("load", "EA"), [(0.225, 4e4), (0.0225, 4e3), (22.5, 4e6)])
def test_elastic_cables_are_as_thick_as_the_load_that_is_told_asks_for(load, EA):
    mission = colift.load_mission(
        "hover",
        {
            "plant.kind": "elastic-cables", "drones.vehicle": "heavy-lift-25kg", "load.mass": load,
            "drones.cable_length": 5.0, "truth.load_mass_factor": 1.5,
        },
    )  # fmt: skip
    assert mission.plant.stiffness == pytest.approx(EA, rel=1e-15)
    assert mission.resolved()["derived"]["plant.stiffness"] == mission.plant.stiffness
    given = colift.load_mission(
        "hover", {"plant.kind": "elastic-cables", "plant.stiffness": 123.0, "load.mass": 1.0}
    )
    assert given.plant.stiffness == 123.0


# ---------------------------------------------------------------- refusals


@pytest.mark.parametrize(
    "settings",
    [
        {"plant.kind": "elastic-cables", "plant.stiffness": 1e9, "drones.cable_length": 0.005},
        {"plant.kind": "bead-cables", "plant.beads": 64, "plant.stiffness": 1e6},
        {"plant.kind": "bead-cables", "plant.density": 1e-8},
    ],
)
def test_cables_too_stiff_for_any_sane_step_are_refused_with_what_would_do(settings):
    with pytest.raises(MissionError, match=r"plant\.stiffness.*at most") as caught:
        colift.load_mission("hover", settings)
    allowed = float(str(caught.value).rpartition("at most ")[2].split(" N")[0])
    assert colift.load_mission("hover", {**settings, "plant.stiffness": 0.95 * allowed})
    with pytest.raises(MissionError, match=r"plant\.stiffness"):
        colift.load_mission("hover", {**settings, "plant.stiffness": 1.1 * allowed})


@pytest.mark.parametrize(
    "change",
    [
        {"events": [{"at": 1.0, "field": "load.mass", "value": 1e-9}]},
        {"truth.load_mass_factor": 0.02, "load.mass": 1e-5, "allocation.kind": "ring"},
    ],
)
def test_the_masses_of_the_truth_and_of_events_count(change):
    settings = {"plant.kind": "elastic-cables", "plant.stiffness": 1e6}
    with pytest.raises(MissionError, match=r"plant\.stiffness.*at most"):
        colift.load_mission("hover", {**settings, **change})


def test_a_flight_that_needs_many_substeps_does_not_diverge():
    flown = colift.run(
        "hover", overrides={"plant.kind": "elastic-cables", "plant.stiffness": 1e8},
        timing__duration=0.1, timing__step=0.001,
    )  # fmt: skip
    assert flown.recording.outcome == "completed"
    assert np.isfinite(flown.recording["tensions"]).all()
