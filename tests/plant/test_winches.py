"""Cables that winches pay out and take in: the length is kept, and what a winch works is tension times rate."""

from __future__ import annotations

import numpy as np
import pytest
from plant_rig import DOWN, Rig

from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.kernel.math.winch import paid_out, turning
from colift.mission import load_mission
from colift.team import Team
from colift.world.plant.elastic_cables import ElasticCables
from colift.world.plant.mujoco import Mujoco
from colift.world.plant.rigid_cables import RigidCables
from colift.world.plant.slack_cables import SlackCables

needs_mujoco = pytest.mark.skipif(bool(Mujoco.missing()), reason="needs MuJoCo")
PLANTS = {
    "rods": (RigidCables(), 1e-6),
    "slack": (SlackCables(), 1e-6),
    "elastic": (ElasticCables(stiffness=1e5, damping_ratio=0.0), 2e-3),
    "mujoco": (Mujoco(), 5e-3),
}
BOTH = [pytest.param(name, marks=needs_mujoco if name == "mujoco" else ()) for name in PLANTS]


def kinetic(rig):
    masses = rig.team.masses
    squares = np.sum(rig.drones[:, 3:6] ** 2, axis=1)
    return 0.5 * (masses @ squares + rig.team.load_mass * np.sum(rig.load[1] ** 2))


@pytest.mark.parametrize("name", BOTH)
def test_a_winch_works_tension_times_rate_and_keeps_angular_momentum(name):
    """A drone and a load turn about each other without gravity while cable is taken in; in MuJoCo, which is slow, for a moment."""
    part, tolerance = PLANTS[name]
    change, duration, turn = (-0.05, 0.1, 8.0) if name == "mujoco" else (-0.4, 0.5, 2.0)
    team, reduced, end = Team.uniform(1, load_mass=0.3, mass=0.6, gravity=0.0), 0.2, 1.0 + change
    rig = Rig(team, DOWN, part, spin=np.array([[0.0, turn, 0.0]]))
    if name == "elastic":  # as long as the pull of the spin makes it
        rig.drones[0, :3] *= 1.0 + reduced * turn**2 / 1e5
    rig.step(count=20)
    rig.winches[0] = 0.0, change, rig.time, duration
    before, work, last = kinetic(rig), 0.0, 0.0
    for _ in range(round(duration / 0.001) + 1):
        _, rate, _ = paid_out(rig.winches, 0, rig.time)
        rig.step()
        work -= 0.5 * 0.001 * (last + rig.tensions[0] * rate)
        last = rig.tensions[0] * rate
    apart, moving = rig.load[0] - rig.drones[0, :3], rig.load[1] - rig.drones[0, 3:6]
    assert np.linalg.norm(apart) == pytest.approx(end, abs=1e-9 if tolerance < 1e-5 else 5e-4)
    assert np.cross(apart, moving)[1] == pytest.approx(turn, rel=10 * tolerance)
    gained = 0.5 * reduced * turn**2 * (1.0 / end**2 - 1.0)
    assert work == pytest.approx(gained, rel=10 * tolerance)
    assert kinetic(rig) - before == pytest.approx(work, rel=10 * tolerance)


def test_a_drone_stands_still_while_its_winch_lets_the_load_down():
    """The way of the load and that of the cable are alike and as long: ``winch-delivery``, from when it is above the place."""
    shorter = {"reference.points": [[5.0, 0.0, 5.0], [5.0, 0.0, 1.0]], "timing.duration": 13.0}
    shorter["events"] = [{"at": 1.0, "field": "drones.cable_length", "value": 5.0, "rate": 0.875}]
    flown = Flight(load_mission("winch-delivery", shorter)).run()
    assert np.abs(flown["positions"][:, 0] - [5.0, 0.0, 6.0]).max() < 0.01
    assert flown["load"][-1, 0] == pytest.approx([5.0, 0.0, 1.0], abs=0.005)
    apart = np.linalg.norm(flown["positions"][:, 0] - flown["load"][:, 0], axis=1)
    assert apart == pytest.approx(1.0 + flown["reeled"][:, 0, 0], abs=1e-4)


def test_a_slack_cable_that_is_taken_in_comes_taut():
    rig = Rig(Team.uniform(1, load_mass=0.3, mass=0.6, gravity=0.0), DOWN, SlackCables())
    rig.drones[0, 2] -= 0.1
    rig.winches[0] = 0.0, -0.3, 0.0, 1.0
    length, apart = 1.0, 0.9
    while length > 0.9:
        rig.step()
        length = 1.0 + paid_out(rig.winches, 0, rig.time)[0]
        apart = np.linalg.norm(rig.load[0] - rig.drones[0, :3])
        assert apart == pytest.approx(min(length, 0.9), abs=1e-9)
    rig.step()
    assert rig.catch_impulses[0] == pytest.approx(
        0.2 * -paid_out(rig.winches, 0, rig.time)[1], rel=0.05
    )
    assert 0.6 * rig.drones[0, 5] + 0.3 * rig.load[1, 2] == pytest.approx(0.0, abs=1e-12)


def test_what_is_paid_out_has_the_derivatives_that_it_tells():
    winches = np.array([[0.2, -0.7, 1.0, 0.8]])
    t, h = np.linspace(1.05, 1.75, 11), 1e-5
    _, rate, bend = np.array([paid_out(winches, 0, s) for s in t]).T
    more, less = (np.array([paid_out(winches, 0, s + d) for s in t]).T for d in (h, -h))
    np.testing.assert_allclose((more[0] - less[0]) / (2 * h), rate, atol=1e-7)
    np.testing.assert_allclose((more[1] - less[1]) / (2 * h), bend, atol=1e-6)
    assert paid_out(winches, 0, 0.5) == (0.2, 0.0, 0.0)
    assert paid_out(winches, 0, 3.0) == (pytest.approx(-0.5), 0.0, 0.0)
    assert not turning(1, winches, 0.5, 0.4)
    assert turning(1, winches, 0.95, 0.1)
    assert not turning(1, winches, 1.8, 0.1)


def winding(value, at=2.0, **more):
    return {"at": at, "field": "drones.cable_length", "value": value, **more}


@pytest.mark.parametrize(
    ("events", "overrides", "words"),
    [
        ([winding(1.5)], {"plant.kind": "bead-cables"}, "mass would have to come from a drum"),
        ([winding([1.5, 1.0])], {}, "must be one value or a list of drones.count = 4"),
        ([winding(-1.0)], {}, "greater than 0|must be above 0"),
        ([winding(1.5), winding(1.2, at=2.5)], {}, "before the winch of drone 0 has stopped, at 7.469 s"),
        ([winding(0.2)], {"truth.cable_length_factor": 0.7}, "leaves nothing of the cable of drone 0"),
    ],
)  # fmt: skip
def test_refused_before_the_flight(events, overrides, words):
    with pytest.raises(MissionError, match=words):
        load_mission("hover", {"events": events, **overrides})


def test_limits_are_judged_at_the_lengths_that_cables_get():
    """Drones that keep their distance on 2 m cables cannot on 0.3 m."""
    overrides = {"drones.vehicle": "x500", "drones.cable_length": 2.0, "load.mass": 0.5}
    load_mission("hover", overrides)
    with pytest.raises(MissionError, match=r"events.0.value"):
        load_mission("hover", {**overrides, "events": [winding(0.3)]})
