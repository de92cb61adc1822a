"""Drones by their numbers: the vehicles, what overrides them, what follows from them, and how wrong ones are refused."""

from __future__ import annotations

import math
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import colift
from colift import catalogue
from colift.control.allocation.limits.feasibility import binding_limits
from colift.control.allocation.safe import Safe
from colift.errors import MissionError, SettingError, VehicleError
from colift.mission import load_mission
from colift.mission.warnings import notes_of, warnings_of
from colift.record.recorded import RecordedMission
from colift.team import Team, Vehicle
from colift.team.vehicles import NUMBERS, complete, estimated_inertia
from colift.world.actuation.ideal import Ideal
from colift.world.actuation.motors import PARAMS as MOTORS_PARAMS
from colift.world.actuation.motors import Motors
from colift.world.disturbance.drag import PARAMS, Drag

NAMES = catalogue.own_vehicle_names()
REAL = [name for name in NAMES if name != "paper"]
"""The paper's drone has an inertia that no drone of its size has."""
GRAVITY = 9.81
MOTORS = {"actuation": {"kind": "motors"}}


def mission(drones=None, **changes):
    """A hover with these drones and a load of a tenth of their mass; whatever else is changed by its path."""
    table = {
        "name": "test", "reference": {"kind": "hover"}, "drones": drones or {}, **MOTORS,
        "load": {"mass": 0.1},
    }  # fmt: skip
    return load_mission(table, changes, must_fly=changes.pop("must_fly", True))


def problems(drones, **changes):
    with pytest.raises(MissionError) as caught:
        mission(drones, **changes)
    return caught.value.problems


def test_the_promised_vehicles_are_there():
    promised = {"crazyflie-2.1", "x500", "s500", "hexacopter-3kg", "heavy-lift-25kg", "paper"}
    assert promised <= set(NAMES) == set(catalogue.vehicle_names())


@pytest.mark.parametrize("name", NAMES)
def test_each_number_of_a_vehicle_has_its_source(name):
    vehicle = Vehicle.named(name)
    given = {field for field in NUMBERS if getattr(vehicle, field) is not None} - {"rotors"}
    assert set(vehicle.sources) == given
    assert all(len(source) > 8 for source in vehicle.sources.values())
    assert len(vehicle.description) > 20


@pytest.mark.parametrize("name", NAMES)
def test_a_vehicle_hovers_by_its_numbers(name):
    vehicle = Vehicle.named(name)
    assert vehicle.max_thrust >= 1.3 * vehicle.mass * GRAVITY
    assert 0.005 <= vehicle.motor_lag <= 0.1
    assert vehicle.rotors in (4, 6, 8)
    # A rotor's torque over its thrust is a small part of its radius, for all sizes about the same.
    if vehicle.rotor_radius is not None:
        assert 0.08 < vehicle.torque_ratio / vehicle.rotor_radius < 0.3
        apart = 2.0 * vehicle.arm * math.sin(math.pi / vehicle.rotors)
        assert 2.0 * vehicle.rotor_radius <= apart  # side by side, not one above the other


@pytest.mark.parametrize("name", REAL)
def test_a_vehicles_inertia_is_that_of_a_body_within_its_arms(name):
    numbers = complete({}, Vehicle.named(name)).numbers
    J, m, arm = np.array(numbers["inertia"]), numbers["mass"], numbers["arm"]
    assert np.all(0.5 * J.sum() * (1.0 + 1e-9) >= J)  # triangle inequality
    assert np.all(np.sqrt(J / m) < arm)
    assert J[2] > max(J[:2])  # flat


@pytest.mark.parametrize("name", [n for n in REAL if Vehicle.named(n).inertia is not None])
def test_the_estimate_is_within_a_factor_of_two_of_every_known_inertia(name):
    vehicle = Vehicle.named(name)
    ratio = np.array(vehicle.inertia) / estimated_inertia(vehicle.mass, vehicle.arm)
    print(name, ratio.round(2))
    assert np.all((ratio > 0.5) & (ratio < 2.0))


def test_other_published_drones_are_near_the_estimate_too():
    published = {  # mass (with rotors), arm, inertia: rotors_simulator, PX4's iris, Lee et al. 2010
        "hummingbird": (0.716 + 4 * 0.009, 0.17, (0.007, 0.007, 0.012)),
        "pelican": (1.0 + 4 * 0.005, 0.21, (0.01, 0.01, 0.02)),
        "iris": (1.5 + 4 * 0.005, 0.2555, (0.029125, 0.029125, 0.055225)),
        "lee": (4.34, 0.315, (0.082, 0.0845, 0.1377)),
    }
    for name, (mass, arm, inertia) in published.items():
        ratio = np.array(inertia) / estimated_inertia(mass, arm)
        print(name, ratio.round(2))
        assert np.all((ratio > 0.5) & (ratio < 2.0)), name


def test_the_estimate_is_that_of_a_disc():
    # Points on rings of a disc of even thickness, summed.
    mass, arm = 2.0, 0.3
    r = (np.arange(400) + 0.5) / 400 * arm
    phi = 2.0 * np.pi * np.arange(60) / 60
    weight = np.repeat(r / (r.sum() * 60), 60) * mass
    x, y = (r[:, None] * np.cos(phi)).ravel(), (r[:, None] * np.sin(phi)).ravel()
    summed = [weight @ y**2, weight @ x**2, weight @ (x**2 + y**2)]
    np.testing.assert_allclose(estimated_inertia(mass, arm), summed, rtol=1e-4)


def test_the_papers_drone_is_the_default():
    paper, default = Team.uniform(3, vehicle="paper"), Team.uniform(3)
    np.testing.assert_array_equal(paper.masses, default.masses)
    np.testing.assert_array_equal(paper.inertias, default.inertias)
    assert np.all(paper.max_thrusts == 12.0)
    assert np.isinf(default.max_thrusts).all()
    told, left = Motors().filled(paper), Motors().filled(default)
    np.testing.assert_allclose(
        [told.model_dump()[name] for name in Motors.from_team],
        [left.model_dump()[name] for name in Motors.from_team], rtol=1e-12,
    )  # fmt: skip


def test_what_is_not_told_is_usual_and_shown_as_derived():
    plain = mission()
    assert plain.drones.vehicle is None
    assert set(plain.resolved()["drones"]) == {
        "count", "mass", "inertia", "cable_length", "cable_density",
    }  # fmt: skip
    motors, safe = plain.actuation, plain.allocation
    assert (motors.max_thrust, motors.time_constant, motors.arm_length) == (3.0, 0.02, 0.2)
    assert (motors.torque_ratio, motors.max_rate, motors.noise) == (0.016, 100.0, 0.01)
    share = 0.1 * GRAVITY / 4
    limits = (0.5 * share, 0.95 * 12.0 - 0.5 * GRAVITY, 11.4)
    assert (safe.tension_min, safe.tension_max, safe.max_thrust) == pytest.approx(limits)
    assert (safe.mu, safe.mu_scaling) == (pytest.approx(0.5 * share**2 * 4), "weight")
    resolved = plain.resolved()
    assert resolved["actuation"] == {
        "kind": "motors", "min_thrust": 0.0, "centre_offset": [0.0, 0.0],
    }  # fmt: skip
    assert resolved["derived"]["actuation.max_thrust"] == 3.0
    assert resolved["derived"]["drones.max_thrust"] == 12.0
    assert resolved["derived"]["allocation.tension_min"] == pytest.approx(0.5 * share)
    again = load_mission(resolved)
    assert again.resolved() == resolved
    heavier = load_mission(resolved, {"drones.mass": 1.0}).resolved()["derived"]
    assert heavier["drones.max_thrust"] == 24.0
    assert heavier["drones.arm"] == pytest.approx(0.2 * 2.0 ** (1.0 / 3.0))
    (note,) = notes_of(plain)
    assert note.path == "drones.max_thrust"
    assert "12 N are assumed" in note.message
    assert notes_of(mission({"max_thrust": 12.0})) == []


def test_numbers_that_the_motors_say_are_the_drones_too():
    given = {"max_thrust": 2.5, "time_constant": 0.03, "arm_length": 0.15}
    own = {"mass": 0.5, "inertia": [0.02, 0.02, 0.04]}
    found = mission(own, actuation={"kind": "motors", **given})
    assert np.all(found.team.max_thrusts == 10.0)
    assert np.all(found.team.motor_lags == 0.03)
    assert found.allocation.max_thrust == pytest.approx(9.5)
    assert found.attitude_control.lag == 0.03
    assert notes_of(found) == []
    ideal = mission(actuation={"kind": "ideal"})
    assert np.isinf(ideal.team.max_thrusts).all()
    assert (ideal.allocation.mu, ideal.allocation.mu_scaling) == (0.15, "absolute")


@pytest.mark.parametrize("name", NAMES)
def test_a_vehicle_feeds_motors_allocator_and_drag(name):
    vehicle = Vehicle.named(name)
    load = 0.2 * vehicle.mass
    drones = {"vehicle": name, "cable_length": 5.0}  # so long that the largest keep apart
    found = mission(drones, **{"load.mass": load, "disturbance": [{"kind": "drag"}]})
    team, motors, safe = found.team, found.actuation, found.allocation
    assert np.all(team.masses == vehicle.mass)
    assert 4.0 * motors.max_thrust == pytest.approx(vehicle.max_thrust)
    assert motors.time_constant == motors.motor_lag() == vehicle.motor_lag
    assert motors.arm_length == vehicle.arm
    assert motors.torque_ratio == vehicle.torque_ratio
    assert motors.max_rate * 0.03 == pytest.approx(motors.max_thrust)
    assert motors.noise * 300.0 == pytest.approx(motors.max_thrust)
    assert safe.max_thrust == pytest.approx(0.95 * vehicle.max_thrust)
    assert safe.tension_max == pytest.approx(0.95 * vehicle.max_thrust - vehicle.mass * GRAVITY)
    assert safe.tension_min == pytest.approx(0.5 * load * GRAVITY / 4)
    assert found.disturbance[0].rotor_drag == (vehicle.rotor_drag or 0.0)
    # The motors' largest torque with the thrust of hover is what the vehicle's rotors have about their weaker axis.
    n = vehicle.rotors
    places = 2.0 * np.pi * np.arange(n) / n + (math.pi / n if n == 4 else 0.0)
    y = vehicle.arm * np.sin(places)
    spare = min(1.0 - vehicle.mass * GRAVITY / vehicle.max_thrust, 0.4) * vehicle.max_thrust / n
    reach = []
    for turn in np.linspace(0.0, 2.0 * math.pi / n, 2 if n == 4 else 61):
        y = vehicle.arm * np.sin(places + (0.0 if n == 4 else turn))
        reach.append(
            float(np.sum(spare * y / np.abs(y).max() * y))
        )  # thrusts in proportion to their lever
    params = motors.params(team)
    lever = params[MOTORS_PARAMS.at.rows + MOTORS_PARAMS.at.lever]
    assert 4.0 * lever * spare * n / 4.0 == pytest.approx(min(reach), rel=1e-3)


def test_what_is_set_wins_over_the_vehicle():
    given = {
        "actuation.max_thrust": 7.0, "actuation.time_constant": 0.05, "allocation.tension_max": 9.0,
    }  # fmt: skip
    found = mission({"vehicle": "x500"}, **given)
    assert found.actuation.max_thrust == 7.0
    assert found.actuation.time_constant == 0.05
    assert found.actuation.arm_length == Vehicle.named("x500").arm
    assert found.allocation.tension_max == 9.0
    kept = found.resolved()
    assert kept["actuation"]["max_thrust"] == 7.0
    assert "arm_length" not in kept["actuation"]
    assert load_mission(kept) == found


def test_numbers_override_those_of_the_vehicle_and_only_them():
    x500 = Vehicle.named("x500")
    drones = mission({"vehicle": "x500", "mass": 2.5, "max_thrust": 50.0}).drones
    assert (drones.mass, drones.max_thrust) == (2.5, 50.0)
    assert (drones.inertia, drones.arm, drones.motor_lag) == (
        x500.inertia,
        x500.arm,
        x500.motor_lag,
    )


def test_a_mission_shows_its_resolved_numbers_and_is_a_mission_again():
    for drones in (
        {"vehicle": "x500", "mass": 2.5},
        {"vehicle": ["x500", "s500", "hexacopter-3kg"], "count": 3},
        {"mass": 1.2, "arm": 0.2, "max_thrust": [30.0, 31.0, 32.0, 33.0]},
    ):
        found = mission(drones)
        resolved = found.resolved()
        assert resolved["drones"]["max_thrust"] == found.drones.max_thrust
        again = load_mission(resolved)
        assert again.resolved() == resolved
        for name in ("masses", "inertias", "max_thrusts", "motor_lags", "arms", "radii"):
            np.testing.assert_array_equal(getattr(again.team, name), getattr(found.team, name))
        np.testing.assert_array_equal(
            again.actuation.params(again.team), found.actuation.params(found.team)
        )


def test_unequal_drones():
    found = mission({"vehicle": ["x500", "heavy-lift-25kg"], "count": 2, "cable_length": 3.0})
    light, heavy = Vehicle.named("x500"), Vehicle.named("heavy-lift-25kg")
    team = found.team
    np.testing.assert_array_equal(team.masses, [light.mass, heavy.mass])
    np.testing.assert_allclose(team.inertias[1], estimated_inertia(heavy.mass, heavy.arm))
    np.testing.assert_array_equal(team.rotors, [4, 6])
    assert np.isnan(team.rotor_drags).all()  # only one of the two tells it
    assert found.actuation.max_thrust == [light.max_thrust / 4, heavy.max_thrust / 4]
    assert found.actuation.time_constant == [light.motor_lag, heavy.motor_lag]
    assert found.actuation.of([1]).time_constant == [heavy.motor_lag]
    np.testing.assert_allclose(
        team.disc_areas, [4 * np.pi * light.rotor_radius**2, 6 * np.pi * heavy.rotor_radius**2]
    )
    one = team.of([1])
    assert (one.n, one.max_thrusts[0], one.arms[0]) == (1, heavy.max_thrust, heavy.arm)
    each = mission({"vehicle": "x500", "count": 2, "max_thrust": [34.0, 40.0]})
    np.testing.assert_array_equal(each.team.max_thrusts, [34.0, 40.0])
    np.testing.assert_allclose(each.allocation.max_thrust, [32.3, 38.0])


def test_radius_follows_from_arm_and_rotor():
    assert mission({"arm": 0.2, "rotor_radius": 0.1}).drones.radius == pytest.approx(0.3)
    assert mission({"arm": 0.2, "rotor_radius": 0.1, "radius": 0.4}).drones.radius == 0.4


def test_an_estimated_inertia_is_said_and_kept():
    found = mission({"mass": 2.0, "arm": 0.3, "max_thrust": 40.0})
    assert found.drones.inertia == pytest.approx((0.045, 0.045, 0.09))
    assert found.resolved()["drones"]["inertia_from"] == "estimate"
    (note,) = notes_of(found)
    assert note.path == "drones.inertia"
    assert "estimated from mass and arm" in note.message
    again = load_mission(found.resolved())
    assert [str(each) for each in notes_of(again)] == [str(note)]
    heavier = load_mission(found.resolved(), {"drones.mass": 2.4})
    assert heavier.drones.inertia == pytest.approx((0.054, 0.054, 0.108))
    known = load_mission(found.resolved(), {"drones.inertia": [0.04, 0.04, 0.07]})
    assert notes_of(known) == []
    assert notes_of(mission({"vehicle": "x500"})) == []
    inertia, thrust = sorted(notes_of(mission({"mass": 0.6})), key=lambda note: note.path)
    assert (inertia.path, thrust.path) == ("drones.inertia", "drones.max_thrust")
    assert "estimated from mass and arm" in inertia.message
    (thrust, inertia) = notes_of(mission({"mass": 0.5}))
    assert "that of the paper's drone" in inertia.message


def test_another_vehicle_drops_what_the_old_one_brought():
    resolved = mission({"vehicle": "x500", "mass": 2.5}).resolved()
    x500 = load_mission(resolved, {"actuation.noise": 0.02}).resolved()
    changed = load_mission(x500, {"drones.vehicle": "s500", "load.mass": 0.2})
    fresh = mission({"vehicle": "s500"}, **{"load.mass": 0.2})
    assert changed.drones == fresh.drones
    np.testing.assert_array_equal(
        changed.actuation.params(changed.team), fresh.actuation.params(fresh.team)
    )
    kept = load_mission(x500, {"drones.mass": 1.9, "drones.vehicle": "s500"})
    assert kept.drones.mass == 1.9
    was_default = load_mission(mission().resolved(), {"drones.vehicle": "x500"})
    assert was_default.actuation.max_thrust == Vehicle.named("x500").max_thrust / 4


@pytest.mark.parametrize(
    ("drones", "path", "message", "value"),
    [
        ({"vehicle": "x50"}, "drones.vehicle", "did you mean 'x500'", "x50"),
        ({"vehicle": ["x500"]}, "drones.vehicle", "drones.count = 4", "1 values"),
        ({"max_thrust": 4.0}, "drones.max_thrust", "must exceed 4.905 N: drone 0 weighs that", "4"),
        ({"vehicle": "x500", "mass": 4.0}, "drones.max_thrust", "must exceed 39.24 N", "34.2"),
        ({"max_thrust": [9.0, 9.0, 4.0, 9.0]}, "drones.max_thrust", "drone 2 weighs that", "4"),
        ({"max_thrust": -1.0}, "drones.max_thrust", "greater than 0", "-1"),
        ({"max_thrust": [9.0, 9.0]}, "drones.max_thrust", "drones.count = 4", "2 values"),
        ({"rotors": 5}, "drones.rotors", "4, 6 or 8", "5"),
        ({"motor_lag": 2.0}, "drones.motor_lag", "less than or equal to 1", "2"),
        ({"efficiency": 1.2}, "drones.efficiency", "less than or equal to 1", "1.2"),
        ({"arm": 0.3, "radius": 0.2}, "drones.radius", "must be at least arm = 0.3 m", "0.2"),
        ({"arm": 0.3, "radius": [0.4, 0.2, 0.4, 0.4]}, "drones.radius.1", "at least arm", "0.2"),
        ({"vehicle": "x500", "inertia": [0.1, 0.1, 0.3]}, "drones.inertia", "no body has", "0.3"),
        ({"vehicle": "none.toml"}, "drones.vehicle", "none.toml: cannot be read", "none.toml"),
    ],
)  # fmt: skip
def test_a_wrong_number_is_refused_by_field_value_and_range(drones, path, message, value):
    found = [each for each in problems(drones) if each.path == path]
    assert found, [str(each) for each in problems(drones)]
    assert message in found[0].message
    assert value in found[0].value


def test_a_file_of_ones_own_is_found_beside_the_mission(tmp_path):
    folder = tmp_path / "missions"
    folder.mkdir()
    (folder / "mine.toml").write_text("mass = 1.5\nmax_thrust = 33.0\narm = 0.25\n")
    file = folder / "flight.toml"
    file.write_text(
        'name = "t"\n[drones]\nvehicle = "mine.toml"\n[reference]\nkind = "hover"\n[actuation]\nkind = "motors"\n'
    )
    found = load_mission(file)
    assert (found.drones.mass, found.actuation.max_thrust) == (1.5, 8.25)
    resolved = found.resolved()  # which outlives the file
    assert "vehicle" not in resolved["drones"]
    (folder / "mine.toml").unlink()
    assert load_mission(resolved).drones.max_thrust == 33.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("mass = 1.5\nmax_thrust = -3.0\n", "max_thrust: must be greater than 0"),
        ("mass = 1.5\nthrust = 3.0\n", "thrust: unknown key; did you mean 'max_thrust'"),
        ("max_thrust = 3.0\n", "mass: is required"),
        ("mass = 1.5\narm = 0.3\nradius = 0.2\n", "radius: must be at least arm"),
        ("mass = \n", "is not valid TOML"),
    ],
)
def test_a_wrong_file_of_a_vehicle_is_named_with_its_field(tmp_path, text, message):
    file = tmp_path / "mine.toml"
    file.write_text(text)
    with pytest.raises(VehicleError) as caught:
        Vehicle.named(str(file))
    assert message in str(caught.value)
    assert "mine.toml" in str(caught.value)


def test_a_recording_opens_without_the_vehicle_that_flew():
    told = mission({"vehicle": "x500", "count": 3}).resolved()
    told["drones"]["vehicle"] = "nobody-knows-it"
    read = RecordedMission.read(told, drones=3, source="simulation")
    assert read.drones.vehicle is None
    assert read.team.max_thrusts.tolist() == [34.2] * 3
    assert read.team.inertias[2].tolist() == [0.0238, 0.0238, 0.044]


def test_another_package_brings_vehicles(monkeypatch, tmp_path):
    file = tmp_path / "elsewhere.toml"
    file.write_text("mass = 3.0\n")

    class Point:
        def __init__(self, found):
            self.load = lambda: found

    points = {"mine": Point({"mass": 1.2, "max_thrust": 30.0}), "filed": Point(file)}
    monkeypatch.setattr(catalogue, "plugged", lambda _: points)
    assert {"mine", "filed", "x500"} <= set(catalogue.vehicle_names())
    assert Vehicle.named("mine").max_thrust == 30.0
    assert Vehicle.named("filed").mass == 3.0
    assert Team.uniform(2, vehicle="mine").max_thrusts[1] == 30.0


def test_a_team_that_cannot_hold_its_load_is_refused_by_the_drones_number():
    for kind in ("motors", "ideal"):
        (found,) = problems(
            {"vehicle": "x500"},
            **{"load.mass": 5.6, "actuation.kind": kind, "allocation.max_thrust": 1e3,
               "allocation.tension_max": 1e3},
        )  # fmt: skip
        assert found.path == "drones.max_thrust"
        assert found.value == "34.2"
    unplanned = {"allocation.max_thrust": 34.2, "allocation.tension_max": 30.0}
    near = mission({"vehicle": "x500", "cable_length": 2.0}, **{"load.mass": 4.2, **unplanned})
    warned = [each for each in warnings_of(near) if "of thrust to spare" in each.message]
    assert [(each.path, each.value) for each in warned] == [("drones.max_thrust", "34.2")]


def test_what_binds_is_named_where_it_comes_from():
    team = Team.uniform(4, vehicle="x500", load_mass=2.0)
    (first, *_) = binding_limits(team, Safe(), Ideal())
    assert (first.path, first.value, first.default) == ("drones.max_thrust", 34.2, False)
    (first, *_) = binding_limits(Team.uniform(4), Safe(), Motors())
    assert (first.path, first.value, first.default) == ("allocation.tension_max", 5.0, True)


def test_limits_of_the_tension_may_not_cross():
    (found,) = problems({"vehicle": "x500"}, **{"allocation.tension_min": 12.0})
    assert found.path == "allocation.tension_min"
    assert "conflicts with tension_max = 12.2" in found.message


def test_teams_of_vehicles_in_python():
    team = Team.of_vehicles(["x500", Vehicle(mass=1.0)], load_mass=0.5, cable_lengths=[1.0, 2.0])
    assert team.max_thrusts.tolist() == [34.2, math.inf]
    assert np.isnan(team.arms[1])
    assert team.cable_lengths.tolist() == [1.0, 2.0]
    assert Team.uniform(2, arm=0.3, mass=2.0).inertias[0] == pytest.approx([0.045, 0.045, 0.09])
    assert replace(team, load_mass=2.0).max_thrusts[0] == 34.2
    for make, message in (
        (lambda: Team.uniform(2, vehicle="x50"), "vehicle: no vehicle named 'x50'"),
        (lambda: Team.uniform(2, rotors=5), "rotors: must be 4, 6 or 8"),
        (lambda: Team.uniform(2, arm=0.3, radius=0.1), "radius: must be at least arm = 0.3"),
        (lambda: Team.of_vehicles([], load_mass=1.0), "vehicles: must name at least 1"),
        (lambda: replace(team, arms=[-1.0, 1.0]), "arms: must be at least 0"),
        (lambda: replace(team, arms=[1.0]), r"arms: must have shape \(2,\)"),
    ):
        with pytest.raises(SettingError, match=message):
            make()


def test_drag_takes_the_rotors_of_each_drone():
    team = Team.of_vehicles(["x500", "crazyflie-2.1"], load_mass=0.1)

    def rotors(part, of):
        return part.params(of)[PARAMS.at.rows + PARAMS.at.rotor_drag :: PARAMS.at.width]

    np.testing.assert_array_equal(rotors(Drag(), team), team.rotor_drags)
    np.testing.assert_array_equal(rotors(Drag(rotor_drag=[0.1, 0.2]), team), [0.1, 0.2])
    assert np.all(rotors(Drag(), Team.uniform(2)) == 0.0)


def test_larger_bodies_have_more_drag():
    small, large = Drag().filled(Team.uniform(2)), Drag().filled(Team.uniform(2, mass=4.0))
    assert (small.drone_area, small.load_area, small.cable_diameter) == (0.012, 0.006, 0.0015)
    assert large.drone_area == pytest.approx(4.0 * small.drone_area)
    heavy = Drag().filled(Team.uniform(2, load_mass=8 * 0.225))
    assert heavy.load_area == pytest.approx(4.0 * small.load_area)
    assert heavy.cable_diameter == pytest.approx(math.sqrt(8.0) * small.cable_diameter)


def test_the_mission_that_the_page_begins_with():
    file = Path(__file__).parents[2] / "docs" / "examples" / "my-team.toml"
    text = file.read_text()
    assert len(text.splitlines()) == 4
    flown = colift.run(file)
    drones = flown.mission.drones
    assert drones.vehicle == tomllib.loads(text)["drones"]["vehicle"] == "x500"
    assert flown.mission.actuation.max_thrust == 8.55
    assert flown.verdict.level == "pass", flown.verdict.sentence
    # The recording knows the numbers, and what its thrust is compared with.
    assert flown.recording.mission.team.max_thrusts.tolist() == [34.2] * 3
    assert 0.7 < flown.metrics["peak_thrust_fraction"] < 1.0
