"""The same mission on every plant, and MuJoCo, which is not ours, against ours over 20 s: bounds as documented."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import colift
from colift.mission import load_mission
from colift.part import find, names

BOUNDS = {
    "slack-cables": (1e-9, 1e-9, 1e-9),
    "mujoco": (1e-6, 1e-6, 1e-4),
    "elastic-cables": (1e-4, 5e-4, 0.05),
    "bead-cables": (5e-4, 3e-3, 0.05),
}
"""Largest differences from rigid cables on the paper's spiral: load (m), directions (1), tensions (N) after 0.1 s."""


@cache
def flight(kind, duration):
    if message := find("plant", kind).missing():
        pytest.skip(message)
    settings = {"plant.kind": kind, "timing.duration": duration, "timing.recording": 0.01}
    return colift.run("paper-spiral", overrides=settings)


def differences(first, second):
    a, b = first.recording, second.recording
    settled = a.time >= 0.1
    return (
        np.linalg.norm(a["load"][:, 0] - b["load"][:, 0], axis=1).max(),
        np.linalg.norm(a["directions"] - b["directions"], axis=2).max(),
        np.abs(a["tensions"] - b["tensions"])[settled].max(),
    )


def test_every_plant_has_its_bounds():
    assert {"rigid-cables", "external", *BOUNDS} == set(names("plant"))


@pytest.mark.parametrize("kind", BOUNDS)
def test_the_same_mission_is_the_same_flight_within_the_stated_bounds(kind):
    flown = flight(kind, 5.0)
    found = differences(flown, flight("rigid-cables", 5.0))
    assert np.all(np.array(found) < BOUNDS[kind]), found
    assert flown.metrics["slack_time_s"] == 0.0


def test_mujoco_agrees_with_rigid_and_elastic_cables_over_20_s():
    mujoco = flight("mujoco", 20.0)
    for kind, bounds in (
        ("rigid-cables", BOUNDS["mujoco"]),
        ("elastic-cables", BOUNDS["elastic-cables"]),
    ):
        found = differences(mujoco, flight(kind, 20.0))
        assert np.all(np.array(found) < bounds), (kind, found)
    # Not the same by standing still: the load flies two turns of the spiral.
    assert np.ptp(mujoco.recording["load"][:, 0], axis=0).min() > 1.9


def test_mujoco_comes_nearer_to_rigid_cables_as_its_limit_hardens():
    settings = {"timing.duration": 1.0, "timing.recording": 0.01, "plant.kind": "mujoco"}
    errors = []
    for constant in (0.04, 0.02, 0.01):
        soft = {"plant.time_constant": constant, "plant.impedance": 0.9}
        flown = colift.run("paper-spiral", overrides=settings | soft)
        errors.append(differences(flown, flight("rigid-cables", 1.0))[0])
    rates = np.array(errors[:-1]) / errors[1:]
    assert np.all(rates > 2.0), errors


def test_mujocos_cables_are_as_stiff_as_the_rope_that_the_team_needs():
    paper = load_mission("paper-spiral", {"plant.kind": "mujoco"})
    assert paper.plant.decay(paper.team) == 0.002
    heavy = load_mission("heavy-lift", {"plant.kind": "mujoco"})
    elastic = load_mission("heavy-lift", {"plant.kind": "elastic-cables"})
    (stiffness, *_), team = elastic.plant.tautness(elastic.team), heavy.team
    mass = team.masses[0] * team.load_mass / (team.masses[0] + team.load_mass)
    spring = mass / heavy.plant.decay(team) ** 2
    assert spring == pytest.approx(stiffness / team.cable_lengths[0], rel=1e-12)
    given = load_mission("heavy-lift", {"plant.kind": "mujoco", "plant.time_constant": 0.003})
    assert given.plant.decay(team) == 0.003
