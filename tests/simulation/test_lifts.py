"""Take-off, pick-up, set-down and landing, in closed loop: the supervisor of kind ``lift``."""

from __future__ import annotations

import numpy as np
import pytest

import colift
from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.kernel.phase import Phase
from colift.mission import load_mission
from colift.mission.warnings import warnings_of

ALL = [
    Phase.STAND, Phase.CLIMB, Phase.HOOK, Phase.TENSION, Phase.RISE, Phase.FLY, Phase.LOWER, Phase.TOUCH,
    Phase.UNLOAD, Phase.SLACKEN, Phase.LAND, Phase.DONE,
]  # fmt: skip
RELEASED = [Phase.RELEASE if phase == Phase.LAND else phase for phase in ALL]
NOISY = {"timing.delay": 0.02, "sensing.kind": "noisy", "estimation.kind": "predictor"}
SHORT = {"reference.position": [0.0, 0.0, 0.4], "supervision.fly": 0.5, "timing.duration": 45.0}


def fly(name="take-off-and-land", **changes):
    return colift.run(name, overrides={key.replace("__", "."): v for key, v in changes.items()})


def phases(run):
    """The phases in the order in which they came."""
    found = run.recording["phase"][:, 0].astype(int)
    return [Phase(found[k]) for k in (0, *(np.flatnonzero(np.diff(found)) + 1))]


def check(run, order=ALL, *, peak=1.0, down=1.5, dragged=5e-3, placed=0.01, mass=0.08):
    """The targets of a lift in calm air."""
    found = run.metrics
    assert phases(run) == order
    assert run.verdict.ok, run.verdict.sentence
    assert found["lift_peak"] <= peak
    assert found["touch_peak"] <= down
    assert found["touch_speed_mps"] <= 0.15
    assert found["drone_touch_speed_mps"] <= 0.15
    assert abs(found["touch_height_m"]) <= 5e-3
    assert found["dragged_m"] <= dragged
    assert found["placement_m"] <= placed
    assert found["weighed_mass_kg"] == pytest.approx(run.mission.true_team.load_mass, rel=mass)
    assert found["slack_time_s"] <= 0.1
    assert found["lost_drones"] == 0.0
    assert found["setbacks"] == 0.0
    return run


def test_a_team_takes_off_lifts_its_load_sets_it_down_and_lands():
    run = check(fly())
    assert run.compiled
    r = run.recording
    # It stands at the end as it stood at first: drones beside the load, all at rest, motors idle.
    assert r["load"][-1, 0, 2] == pytest.approx(0.0, abs=1e-3)
    assert np.abs(r["positions"][-1, :, 2]).max() < 1e-3
    assert np.abs(r["velocities"][-1]).max() < 1e-3
    assert (r["standing"][-1] == 1.0).all()
    assert (r["applied_thrusts"][-1] < 0.2 * 0.5 * 9.81).all()
    distances = np.linalg.norm(r["positions"][-1] - r["load"][-1, 0], axis=1)
    assert (distances < run.mission.team.cable_lengths).all()
    # While it flies, the supervisor leaves everything to the others.
    flying = r["phase"][:, 0] == Phase.FLY
    assert (r["lift_share"][flying] == 1.0).all()
    assert not r["standing"][flying].any()
    assert (np.diff(r["clock"][flying, 0]) > 0.0).all()
    assert (r["clock"][~flying, 1] == 0.0).all()
    assert [m.text for m in r.moments if m.kind == "phase"][:3] == [
        "On the ground", "Drones climb", "Cables are drawn taut",
    ]  # fmt: skip


def test_spans_and_reference_have_the_derivatives_that_are_told():
    """Over the whole flight, but for the step in which the touch-down is told."""
    flight = Flight(load_mission("take-off-and-land", {**SHORT, "timing.recording": 0.001}))
    r = flight.run()
    dt = 0.001
    told = np.flatnonzero(r["phase"][:, 0] == Phase.UNLOAD)[0]
    calm = np.abs(np.arange(len(r.time)) - told) > 3
    for values, tolerance in ((r["spans"], 0.02), (r["reference"].transpose(0, 2, 1), 0.02)):
        for order in range(values.shape[2] - 1):
            change = np.gradient(values[:, :, order], dt, axis=0)
            off = np.abs(change - values[:, :, order + 1]).max(axis=1)
            changes = np.flatnonzero(np.diff(r["phase"][:, 0]))
            inner = calm & (np.abs(np.arange(len(r.time))[:, None] - changes).min(axis=1) > 3)
            scale = max(np.abs(values[:, :, order + 1]).max(), 0.1)
            assert np.median(off[inner]) <= 1e-3 * scale
            assert np.quantile(off[inner], 0.999) <= tolerance * scale


def test_a_released_load_stays_where_it_was_put_and_the_drones_land_farther_off():
    run = check(fly("pick-up-and-place"), RELEASED)
    r = run.recording
    assert r["load"][-1, 0, :2] == pytest.approx([2.0, 0.5], abs=0.01)
    assert not r["attached"][-1].any()
    let_go = np.flatnonzero(r["attached"][:, 0] == 0.0)[0]
    assert r["phase"][let_go, 0] == Phase.RELEASE
    assert r["ground_forces"][let_go, -1, 2] > 0.0
    distances = np.linalg.norm(r["positions"][-1] - r["load"][-1, 0], axis=1)
    assert (distances > 1.1 * run.mission.team.cable_lengths).all()
    assert not any(moment.kind == "fault" for moment in r.moments)


def test_a_load_is_picked_up_again_where_it_was_set_down():
    points = [[0.0, 0.0, 0.4], [0.5, 0.0, 0.4], [1.0, 0.5, 0.4]]
    reference = {"kind": "waypoints", "points": points, "travel": 3.0, "hold": 1.0}
    places = [[0.5, 0.0], [0.8, 0.4]]
    run = fly(reference=reference, supervision__fly=4.5, supervision__set_down=places, timing__duration=80.0)  # fmt: skip
    check(run, [*ALL[:-2], *ALL[2:]])
    r = run.recording
    flying = r["phase"][:, 0] == Phase.FLY
    assert r["clock"][flying, 0].max() == pytest.approx(9.0, abs=0.01)
    for place, last in zip(places, np.flatnonzero(np.diff(r["phase"][:, 0]) == Phase.HOOK - Phase.SLACKEN), strict=False):  # fmt: skip
        assert r["load"][last, 0, :2] == pytest.approx(place, abs=0.01)
    assert r["load"][-1, 0, :2] == pytest.approx(places[-1], abs=0.01)


@pytest.mark.parametrize("n", [3, 4, 6])
def test_a_box_is_fetched_as_a_point_is_and_keeps_its_attitude(n):
    run = fly("box-pick-up-and-place", drones__count=n)
    r = run.recording
    assert run.verdict.level != "fail", run.verdict.reasons
    assert r["load"][0, 0, 2] == pytest.approx(0.1)  # on its lower face
    assert r["positions"][0, :, 2] == pytest.approx(0.0)
    assert r["load"][-1, 0] == pytest.approx([2.0, 0.5, 0.1], abs=0.01)
    assert r["phase"][-1, 0] == Phase.DONE
    assert run.metrics["attitude_max_deg"] < 2.0
    assert not r["attached"][-1].any()


@pytest.mark.parametrize("name", ["crazyflie-trio", "heavy-lift"])
def test_smallest_and_largest_drones(name):
    check(fly(name))


@pytest.mark.slow
def test_slow_drones_on_a_stiff_rope_go_on_towards_the_load_until_they_are_level():
    """Leaning against a cable that is gone they drift outwards for as long as their attitude needs."""
    heavy = fly(
        "pick-up-and-place",
        drones__vehicle="heavy-lift-25kg",
        drones__cable_length=5.0,
        load__mass=15.0,
        plant__kind="elastic-cables",
        reference__points=[[0.0, 0.0, 2.5], [5.0, 0.0, 3.0]],
        supervision__set_down=[5.0, 2.5],
        timing__duration=110.0,
    )
    check(heavy, RELEASED, down=1.25)


@pytest.mark.parametrize("count", [2, 8])
def test_few_drones_and_many(count):
    check(fly(drones__count=count, load__mass=0.225 if count < 8 else 0.6))


def test_one_drone_alone():
    """Its cable bears all of the weight."""
    bound = {"max": 1.1}
    check(fly(drones__count=1, criteria__lift_peak=bound), peak=1.1)


@pytest.mark.parametrize("factor", [0.5, 1.5])
def test_a_load_of_another_mass_than_told_is_weighed(factor):
    check(fly(truth__load_mass_factor=factor, **SHORT))


@pytest.mark.parametrize("factor", [0.95, 1.05])
def test_cables_of_another_length_than_told_are_measured(factor):
    r = check(fly(truth__cable_length_factor=factor, **SHORT)).recording
    flying = r["phase"][:, 0] == Phase.FLY
    assert r["spans"][flying, :, 0] == pytest.approx(factor - 1.0, abs=0.01)


def test_drones_of_other_masses_than_told_are_made_up_for():
    check(fly(truth__drone_mass_factor=[1.1, 1.0, 0.95, 1.05], **SHORT))


def test_late_and_noisy_sensors_and_a_push_of_a_twentieth_of_the_weight():
    push = [{"kind": "push", "force": [0.11, 0.0, 0.0], "duration": 1e3}]
    run = fly(**NOISY, **SHORT, disturbance=push)
    check(run, dragged=8e-3)


GUSTS = [
    {"kind": "gust", "peak": [5.0, 0.0, 1.5], "at": 0.0, "duration": 2.0, "every": 3.0},
    {"kind": "gust", "peak": [0.0, 5.0, -1.5], "at": 0.0, "duration": 1.0, "every": 2.0},
    {"kind": "drag", "drone_area": 0.0, "load_area": 0.0, "cable_diameter": 0.0, "drone_linear": 0.049, "load_linear": 0.022},
]  # fmt: skip


@pytest.mark.parametrize("seed", [1, 2])
def test_gusts_of_a_twentieth_of_the_weight_are_neither_tension_nor_a_cut_cable(seed):
    bounds = {f"criteria__{name}": {"max": 2.0} for name in ("lift_peak", "touch_peak")}
    run = fly(disturbance=GUSTS, seed=seed, **SHORT, **bounds)
    check(run, peak=2.0, down=2.0, dragged=0.03, mass=0.15)
    r, L = run.recording, 1.0
    raised = np.flatnonzero((r["phase"][:, 0] == Phase.TENSION) & (r["load"][:, 0, 2] < 1e-3))
    distances = np.linalg.norm(r["positions"] - r["load"][:, None, 0], axis=2)
    assert (
        distances[raised].min() > 0.99 * L
    )  # all cables were at their ends before they were told to pull


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["elastic-cables", "bead-cables"])
def test_cables_that_stretch(plant):
    check(fly(plant__kind=plant, **SHORT))


@pytest.mark.slow
def test_on_the_plant_of_others():
    """Its cables are springs with critical damping, whose force is there at once: what counts is the speed of a catch."""
    pytest.importorskip("mujoco")
    coarse = {"timing.step": 2e-3, "timing.recording": 0.01}  # it divides its steps itself
    run = check(fly(plant__kind="mujoco", **{**SHORT, **coarse, "timing.duration": 36.0}))
    assert run.metrics["max_catch_impulse_Ns"] < 0.5 * 0.03  # a drone caught at 3 cm/s


@pytest.mark.parametrize("changes", [
    {"truth__load_mass_factor": 4.0}, {"truth__cable_length_factor": 1.2},
])  # fmt: skip
def test_a_load_that_cannot_be_lifted_is_given_up_and_the_drones_land(changes):
    """Too heavy; or on cables so long that none pulls where it should."""
    run = fly(**changes)
    order = phases(run)
    assert Phase.RISE not in order
    assert order[-3:] == [Phase.SLACKEN, Phase.LAND, Phase.DONE]
    assert run.recording["load"][:, 0, 2].max() < 5e-3
    assert run.metrics["drone_touch_speed_mps"] <= 0.15
    assert np.isnan(run.metrics["weighed_mass_kg"])
    assert run.metrics["setbacks"] == 1.0
    assert run.verdict.level == "fail"
    assert "lifted_m" in run.verdict.reasons[0]


def test_a_flight_that_begins_in_the_air_ends_on_the_ground():
    changes = {"start.on_ground": False, "supervision.kind": "lift", **SHORT}
    run = colift.run("take-off-and-land", overrides=changes)
    assert phases(run) == [Phase.FLY, *ALL[6:]]
    assert run.metrics["touch_speed_mps"] <= 0.15
    assert run.metrics["placement_m"] <= 0.01


def test_a_short_way_aside_is_no_jolt():
    changes = {"start.on_ground": False, "supervision.kind": "lift", **SHORT}
    run = colift.run("take-off-and-land", overrides={**changes, "supervision.set_down": [0.1, 0.0]})
    assert run.metrics["placement_m"] <= 0.01
    assert run.metrics["slack_time_s"] <= 0.1


def test_lengths_found_in_flight_and_wound_meanwhile_are_counted_once():
    """Cables measured in the air are hooked again, and taken in while the load is being lifted."""
    wound = [{"at": 20.0, "field": "drones.cable_length", "value": 0.7, "rate": 0.4}]
    changes = {
        "start.on_ground": False, "supervision.kind": "lift", "truth.cable_length_factor": 1.05,
        "supervision.set_down": [[0.0, 0.0], [0.0, 0.0]], "events": wound,
    }  # fmt: skip
    run = colift.run("take-off-and-land", overrides={**SHORT, **changes, "timing.duration": 24.6})
    r = run.recording
    again = (r["phase"][:, 0] == Phase.FLY) & (r.time > 1.0)
    assert phases(run) == [Phase.FLY, *ALL[6:10], *ALL[2:6]]
    assert run.metrics["setbacks"] == 0.0
    np.testing.assert_allclose(r["found_lengths"][again], 0.05, atol=1e-3)
    np.testing.assert_allclose(r["spans"][again, :, 0], 0.0, atol=2e-3)
    np.testing.assert_allclose(r["reeled"][again, :, 0], -0.3, atol=1e-9)


def test_a_reference_that_begins_on_the_ground_is_flown_above_it():
    points = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.5], [0.5, 0.0, 0.0]]
    reference = {"kind": "waypoints", "points": points, "travel": 3.0, "hold": 0.5}
    run = check(fly(reference=reference, supervision__fly=7.5))
    flying = run.recording["phase"][:, 0] == Phase.FLY
    assert run.recording["load"][flying, 0, 2].min() > 0.1


def test_without_a_supervisor_nothing_is_led():
    r = fly("hover", timing__duration=0.2).recording
    assert (r["lift_share"] == 1.0).all()
    assert not r["standing"].any()
    assert not r["spans"].any()
    assert not r["unhooked"].any()
    assert not r["phase"].any()


# ---------------------------------------------------------------- what is refused and warned of


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"position_control.kind": "pid"}, 'needs position_control.kind = "formation"'),
        ({"observation.kind": "none"}, 'needs observation.kind = "momentum"'),
        ({"world.ground": "none", "start.on_ground": False}, "needs a ground"),
    ],
)
def test_what_does_not_go_with_it_is_refused(changes, said):
    with pytest.raises(MissionError, match=said):
        load_mission("take-off-and-land", changes)


def test_a_team_on_the_ground_is_led_unless_the_mission_says_otherwise():
    table = {"name": "t", "start": {"on_ground": True}, "reference": {"kind": "hover"}}
    assert load_mission(table).kinds["supervision"] == "lift"
    assert load_mission(table, {"supervision.kind": "none"}).kinds["supervision"] == "none"
    assert load_mission(table, {"load_control.kind": "pid"}).kinds["supervision"] == "none"
    assert load_mission(table, {"start.on_ground": False}).kinds["supervision"] == "none"


def test_a_reference_that_is_not_at_rest_when_it_ends_is_warned_of():
    spiral = {"reference": {"kind": "spiral"}, "supervision.fly": 7.0}
    (warning,) = warnings_of(load_mission("take-off-and-land", spiral))
    assert warning.path == "supervision.fly"
    assert "moves at" in warning.message
    assert warnings_of(load_mission("take-off-and-land")) == []
