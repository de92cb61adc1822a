"""Missions whose team cannot hold its load are refused before they fly, with the reason and the numbers."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest

from colift.control.allocation.limits.hover import RESERVE
from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.mission.warnings import warnings_of
from colift.record import metrics
from terminal import colift

WEAK = {
    "name": "weak-motors",
    "load": {"mass": 1.0},
    "drones": {"count": 4, "mass": 0.5, "cable_length": 1.0},
    "timing": {"duration": 6.0, "load_control": 0.01, "allocation": 0.01},
    "reference": {"kind": "hover", "position": [0.0, 0.0, 2.0]},
    "allocation": {
        "kind": "safe", "min_angle_deg": 30.0, "mu": 0.15, "mu_scaling": "weight", "max_rate": 0.5,
        "tension_min": 0.05, "tension_max": 5.0, "max_thrust": 100.0,
    },
    "position_control": {
        "kind": "feed-forward", "k_p": [5.0] * 3, "k_d": [3.0] * 3, "k_i": [1.5] * 3,
        "frequency": 3.0, "thrust_filter": 0.1,
    },
    "attitude_control": {
        "kind": "manifold", "rho": [24.0] * 3, "k_d": [0.8, 0.72, 1.44], "beta": [0.01] * 3,
    },
    "actuation": {"kind": "motors", "max_thrust": 1.87},
}  # fmt: skip
"""The four drones lift a little more than everything weighs, were the cables vertical; the allocator does not know how little."""


@pytest.mark.parametrize("thrust", [1.84, 1.87, 1.885])
def test_motors_just_too_weak_are_refused_with_needed_and_given_thrust(thrust):
    with pytest.raises(MissionError) as refused:
        load_mission(WEAK, {"actuation.max_thrust": thrust})
    (problem,) = refused.value.problems
    assert problem.path == "actuation.max_thrust"
    assert problem.value == f"{thrust:g}"
    assert "needs 7.547 N" in problem.message
    assert f"motors give {4 * thrust:.4g} N" in problem.message
    assert "34.5 degrees from the vertical" in problem.message


def test_motors_that_hold_but_leave_nothing_to_control_with_are_refused():
    """1.95 N a motor: hover needs 7.55 of 7.8 N."""
    with pytest.raises(MissionError) as refused:
        load_mission(WEAK, {"actuation.max_thrust": 1.95})
    (problem,) = refused.value.problems
    assert problem.path == "actuation.max_thrust"
    assert "leave 3.2 % of their thrust to control with" in problem.message
    assert "needs 7.547 N and its motors give 7.8 N" in problem.message
    assert "5 % are kept in reserve (7.41 N are left for hover)" in problem.message
    load_mission(WEAK, {"actuation.max_thrust": 1.95}, must_fly=False)


def test_the_weakest_drone_for_what_it_has_is_named():
    """Drone 2 needs the same as the others of less."""
    with pytest.raises(MissionError, match=r"drone 2 needs 7\.\d+ N and its motors give 7\.8 N"):
        load_mission(WEAK, {"actuation.max_thrust": [2.2, 2.3, 1.95, 2.1]})
    load_mission(WEAK, {"actuation.max_thrust": [2.2, 2.3, 2.0, 2.1]})


def test_the_border_is_where_hover_in_the_formation_flown_leaves_the_reserve():
    flight = Flight(load_mission(WEAK, {"actuation.max_thrust": 2.2}))
    r = flight.run()
    tilt = np.arccos(-r["desired_directions"][-1, :, 2])
    tension = 9.81 / 4.0 / np.cos(tilt)
    needed = np.hypot(0.5 * 9.81 + tension * np.cos(tilt), tension * np.sin(tilt)).max()
    border = needed / 4.0 / (1.0 - RESERVE)
    load_mission(WEAK, {"actuation.max_thrust": 1.003 * border})
    with pytest.raises(MissionError, match="reserve"):
        load_mission(WEAK, {"actuation.max_thrust": 0.997 * border})


def test_what_is_refused_would_sink_and_what_is_not_holds():
    weak = load_mission(WEAK, {"actuation.max_thrust": 1.87}, must_fly=False)
    assert Flight(weak).run()["load"][-1, 0, 2] < 1.0
    strong = Flight(load_mission(WEAK, {"actuation.max_thrust": 2.0, "timing.duration": 12.0}))
    assert strong.run()["load"][-1, 0, 2] == pytest.approx(2.0, abs=0.02)


@pytest.mark.parametrize("kind", ["ring", "min-norm"])
def test_motors_are_judged_with_any_allocator(kind):
    with pytest.raises(MissionError, match=r"motors are too weak.*35 degrees"):
        load_mission(WEAK, {"allocation.kind": kind})


def test_a_load_beyond_the_cables_names_what_binds():
    heavy = {"load.mass": 1.95}  # together the cables may pull 20 N, the load weighs 19.1 N
    with pytest.raises(MissionError, match=r"tension_max = 5 N \(the default\), .*min_angle_deg"):
        load_mission("hover", heavy)
    load_mission("hover", {"load.mass": 1.88})
    assert load_mission("hover", heavy, must_fly=False).load.mass == 1.95


def test_the_commands_refuse_and_judge(tmp_path):
    tomli_w = pytest.importorskip("tomli_w")
    file = tmp_path / "weak.toml"
    file.write_text(tomli_w.dumps(WEAK))
    flown = colift("run", str(file), "--out", str(tmp_path / "out"))
    assert flown.returncode == 2  # as for any mistake in a mission
    assert "motors are too weak" in flown.stderr
    assert "5 % are kept in reserve" in flown.stderr
    assert not (tmp_path / "out").exists()
    judged = colift("feasibility", str(file), "--json")
    assert judged.returncode == 1
    found = json.loads(judged.stdout)
    assert found["feasible"] is False
    assert "motors are too weak" in found["conflicts"][0]
    assert found["thrusts_N"] == pytest.approx([7.547] * 4, abs=0.002)
    assert found["thrust_limits_N"] == [7.48] * 4
    assert found["binding"][0]["path"] == "actuation.max_thrust"
    assert found["binding"][0]["default"] is False
    # The best formation, 30 degrees apart, would hold it by two hundredths.
    cone = math.asin(math.sin(math.radians(15.0)) / math.sin(math.pi / 4.0))
    own = 0.5 * 9.81
    pull = math.sqrt(7.48**2 - (own * math.sin(cone)) ** 2) - own * math.cos(cone)
    assert found["heaviest_N"] == pytest.approx(4.0 * pull * math.cos(cone), rel=3e-3)


@pytest.mark.parametrize(("thrust", "codes"), [(1.98, (2, 1)), (1.993, (0, 0))])
def test_commands_agree_on_the_reserve(tmp_path, thrust, codes):
    tomli_w = pytest.importorskip("tomli_w")
    file, out = tmp_path / "weak.toml", tmp_path / "out"
    given = {"actuation": {"kind": "motors", "max_thrust": thrust}}
    file.write_text(tomli_w.dumps(WEAK | given))
    flown = colift("run", str(file), "--set", "timing.duration=0.5", "--out", str(out))
    judged = colift("feasibility", str(file))
    assert (flown.returncode, judged.returncode) == codes
    for told in (flown.stderr, judged.stdout):
        assert ("kept in reserve" in " ".join(told.split())) is (codes[0] != 0)


def test_wind_is_said_to_be_left_out():
    shown = colift("feasibility", "windy-spiral")
    assert shown.returncode == 0
    assert "disturbance.0 (wind)" in " ".join(shown.stdout.split())


BLOWN = {
    "name": "blown",
    "load": {"mass": 0.5},
    "drones": {"count": 1, "mass": 1.4, "max_thrust": 32.0, "arm": 0.2, "cable_length": 5.0},
    "reference": {"kind": "hover"},
    "disturbance": [
        {"kind": "wind", "speed": 6.0}, {"kind": "dryden", "speed": 6.0},
        {"kind": "drag", "load_area": 0.1},
    ],
}  # fmt: skip


def test_gusts_that_swing_the_load_of_one_drone_are_refused_unless_that_is_allowed():
    with pytest.raises(MissionError) as refused:
        load_mission(BLOWN)
    (problem,) = refused.value.problems
    assert problem.path == "disturbance"
    found = re.search(r"gusts swing the load below one drone by about ([0-9.]+) m", problem.message)
    assert found
    # Steady wind leans it, too, but that is made up for.
    load_mission({**BLOWN, "disturbance": [BLOWN["disturbance"][0], BLOWN["disturbance"][2]]})
    mission = load_mission({**BLOWN, "criteria": {"tracking_max_m": {"max": 5.0}}})
    error = np.linalg.norm(metrics.tracking_error(Flight(mission).run()), axis=1)
    assert error[len(error) // 2 :].max() == pytest.approx(float(found[1]), rel=0.5)


def test_wind_that_leans_the_load_further_than_a_cable_may_is_refused_and_nearly_so_far_warned_of():
    three = {**BLOWN, "drones": {**BLOWN["drones"], "count": 3}}
    with pytest.raises(MissionError) as refused:
        load_mission({**three, "load": {"mass": 0.1}})
    (problem,) = refused.value.problems
    lean, most = map(float, re.findall(r"([0-9.]+) degrees, more than the ([0-9.]+)", problem.message)[0])  # fmt: skip
    assert lean > most == 75.0
    (warning,) = warnings_of(load_mission({**three, "load": {"mass": 0.13}}))
    assert warning.path == "disturbance"
    assert 70.0 < float(re.findall(r"leans by ([0-9.]+) degrees", warning.message)[0]) < most
    assert warnings_of(load_mission({**three, "load": {"mass": 0.17}})) == []
    narrow = {**three, "load": {"mass": 0.17}, "allocation": {"max_cone_deg": 60.0}}
    with pytest.raises(MissionError, match=r"more than the 60 .*max_cone_deg"):
        load_mission(narrow)
