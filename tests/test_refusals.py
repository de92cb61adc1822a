"""Whatever is refused is refused by an error of ours, which names the field, what was found and what is allowed."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import colift
from colift.control.allocation.base import Allocator
from colift.control.allocation.ring import Ring
from colift.control.allocation.safe import Safe
from colift.errors import (
    ColiftError,
    MissionError,
    Problem,
    SettingError,
    UnknownNameError,
)  # fmt: skip
from colift.flight.flight import Flight
from colift.part import find, make
from colift.team import Team

NAN, INF = float("nan"), float("inf")
GOOD = {
    "load_mass": 0.2,
    "masses": np.full(3, 0.5),
    "inertias": np.full((3, 3), 0.01),
    "cable_lengths": np.ones(3),
}


def team(**changed):
    return Team(**{**GOOD, **changed})


def flight(path, value):
    mission = colift.load_mission(
        "hover", {"actuation": {"kind": "motors"}, "timing.duration": 0.1}
    )
    return Flight(mission).change(path, value)


def allocate(*arguments, **keywords):
    return colift.SafeAllocator(3).allocate(*arguments, **keywords)


TABLE = [
    (lambda: team(load_mass=0.0), "load_mass: .*greater than 0 .*0.0"),
    (lambda: team(load_mass=NAN), "load_mass: .*finite.*nan"),
    (lambda: team(load_mass="heavy"), "load_mass: must be a number .*heavy"),
    (lambda: team(masses=[0.5, -0.5, 0.5]), r"masses: .*greater than 0.*-0.5"),
    (lambda: team(masses=[0.5, NAN, 0.5]), "masses: .*finite.*nan"),
    (lambda: team(masses=[]), "masses: .*at least 1"),
    (lambda: team(masses=np.full((3, 1), 0.5)), r"masses: must have shape \(3,\) .*\(3, 1\)"),
    (lambda: team(inertias=np.full(3, 0.01)), r"inertias: must have shape \(3, 3\) .*\(3,\)"),
    (lambda: team(inertias=np.zeros((3, 3))), "inertias: .*greater than 0"),
    (lambda: team(cable_lengths=[1.0, 1.0]), r"cable_lengths: must have shape \(3,\) .*\(2,\)"),
    (lambda: team(cable_lengths=[1.0, INF, 1.0]), "cable_lengths: .*finite.*inf"),
    (lambda: team(gravity=-1.0), "gravity: .*at least 0.*-1"),
    (lambda: team().of([3]), r"drones: must be some of 0 to 2 .*\[3\]"),
    (lambda: team().of([]), "drones: "),
    (lambda: Team.uniform(0), "n: must be at least 1 .*0"),
    (lambda: Team.uniform(2.5), "n: must be a whole number .*2.5"),
    (lambda: Team.uniform(4, mass=-1.0), "mass: .*greater than 0.*-1"),
    (lambda: Team.uniform(4, inertia=(1.0, 2.0)), r"inertia: must have shape \(3,\)"),
    (lambda: Safe(mu=-1.0), "mu: must be greater than or equal to 0 .*-1"),
    (lambda: Safe(min_angle_deg=200), "min_angle_deg: must be less than 150 .*200"),
    (lambda: Safe(min_angel_deg=20), "min_angel_deg: .*did you mean 'min_angle_deg'"),
    (lambda: Safe(tension_max=[1.0, NAN]), "tension_max.*finite.*nan"),
    (lambda: Safe(mu="much"), "mu: must be a valid number.*much"),
    (lambda: Safe(mu_scaling="mass"), "mu_scaling: must be .*absolute.*weight.*mass"),
    (lambda: Safe(tension_min=2.0, tension_max=2.0), "tension_min = 2.0 conflicts with tension_max"),
    (lambda: setattr(Safe(), "mu", NAN), "mu: .*finite.*nan"),
    (lambda: setattr(Safe(), "muu", 1.0), "muu: unknown key; did you mean 'mu'"),
    (lambda: Allocator("safe", 4), "part: .*allocator.*safe"),
    (lambda: Allocator(Ring(), 4, dt=0.0), "dt: .*greater than 0.*0"),
    (lambda: Allocator(Ring(), 4, dt="10 ms"), "dt: must be a number.*10 ms"),
    (lambda: Allocator(Ring(), 4, cone_deg=180.0), "cone_deg: .*less than 180"),
    (lambda: Allocator(Safe(weights=[1.0, 2.0]), 3), "weights: 2 values; .* 3 drones"),
    (lambda: colift.SafeAllocator(n=-1), "n: must be at least 1"),
    (lambda: colift.SafeAllocator(n="four"), "n: must be a whole number.*four"),
    (lambda: colift.SafeAllocator(min_angel_deg=20), "did you mean 'min_angle_deg'"),
    (lambda: colift.SafeAllocator(8, min_angle_deg=60.0), "min_angle_deg.*max_cone_deg"),
    (lambda: colift.SafeAllocator(4, tension_max=[1.0]), "tension_max: 1 values; .* 4 drones"),
    (lambda: colift.SqpAllocator(4, tolerence=1.0), "did you mean 'tolerance'"),
    (lambda: colift.SqpAllocator(4, mu=-1.0), "mu: .*greater than or equal to 0"),
    (lambda: colift.SafeAllocator(4).update(tension_max=[2.0]), "tension_max: 1 values; .* 4 drones"),
    (lambda: colift.SafeAllocator(4).update(max_rat=2.0), "did you mean 'max_rate'"),
    (lambda: colift.SafeAllocator(4).reset([[1.0, 2.0]]), r"directions: must have shape \(4, 3\)"),
    (lambda: colift.SafeAllocator(4).reset("ring"), r"directions: must be numbers of shape \(4, 3\)"),
    (lambda: allocate([0.0, "up", 1.0]), r"force: must be numbers of shape \(3,\)"),
    (lambda: allocate(None), r"force: must have shape \(3,\)"),
    (lambda: allocate([[0.0], [1.0, 2.0]]), r"force: must be numbers of shape \(3,\)"),
    (lambda: allocate([0, 0, 1], [0, 0]), r"acceleration: must have shape \(3,\)"),
    (lambda: allocate([0, 0, 1], dt="soon"), "dt: must be a number.*soon"),
    (lambda: allocate([0, 0, 1], dt=[0.1, 0.2]), "dt: must be a single number"),
    (lambda: make("allocation", {"kind": "safe", "mu": -1}), "allocation.mu: .*greater.*-1"),
    (lambda: make("allocation", {"kind": "saef"}), "did you mean 'safe'"),
    (lambda: find("alocation", "safe"), "no layer named 'alocation'; did you mean 'allocation'"),
    (lambda: flight("allocation.mu", -1.0), "allocation.mu: .*greater than or equal to 0.*-1"),
    (lambda: flight("allocation.muu", 1.0), "allocation.muu: unknown key; did you mean 'mu'"),
    (lambda: flight("allocation.tension_max", [1.0]), "allocation.tension_max: 1 values"),
    (lambda: flight("actuation.max_thrust", [4.0] * 3), "actuation.max_thrust: 3 values"),
    (lambda: flight("allocation.kind", "none"), "no allocation part named 'none'"),
    (lambda: flight("reference", {"kind": "hover", "at": 1}), "reference.at: unknown key"),
    (lambda: flight("load.mass", -0.1), "load.mass: .*greater than 0.*-0.1"),
    (lambda: flight("load.mass", NAN), "load.mass: .*finite.*nan"),
    (lambda: flight("load.mass", None), "load.mass: .*finite"),
    (lambda: flight("load.size", 1.0), "load.size: there is no such setting"),
    (lambda: flight("plant.kind", 1.0), "plant"),
    (lambda: colift.load_mission("hovr"), "no mission named 'hovr'; did you mean 'hover'"),
    (lambda: colift.load_mission(5), "mission: must be a name.*5"),
    (lambda: colift.load_mission("absent.toml"), "absent.toml.*cannot be read"),
    (lambda: colift.load_mission({"name": "x", ("a", "b"): 1}), "plain data"),
    (lambda: colift.load_mission("hover", {"load.mass": NAN}), "load.mass.*finite"),
    (lambda: colift.run("hover", laod__mass=0.2), "laod: unknown key; did you mean 'load'"),
    (lambda: colift.run("hover", load__mas=0.2), "load.mas: unknown key; did you mean 'mass'"),
    (lambda: colift.run("hover", min_angel_deg=20), "did you mean 'min_angle_deg'"),
    (lambda: colift.run("hover", allocator="sfae"), "allocation.kind: .*did you mean 'safe'"),
    (lambda: colift.run("hover", seed=-1), "seed: .*greater than or equal to 0.*-1"),
    (lambda: colift.run("hover", overrides={"drones.mass": [0.5]}), "drones.mass.*drones.count = 4"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "message"), TABLE)
def test_a_bad_call_is_refused_by_name(call, message):
    with pytest.raises(ColiftError, match=f"(?s){message}"):
        call()


def test_a_refused_setting_is_a_value_error_as_well():
    """Programs that caught what pydantic raised go on working."""
    with pytest.raises(ValueError, match="mu"):
        Safe(mu=-1.0)
    with pytest.raises(LookupError, match="hovr"):
        colift.load_mission("hovr")


@pytest.mark.parametrize(
    "error",
    [
        SettingError.of("mu", -1, "must be at least 0"),
        MissionError("mission.toml", [Problem("load.mass", "0", "must be greater than 0")]),
        UnknownNameError("mission", "hovr", ["hover", "spiral"]),
    ],
)
def test_errors_survive_the_way_between_processes(error):
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)
