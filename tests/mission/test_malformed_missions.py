"""Missions with mistakes: each gives one readable error that names the place and what is allowed."""

from __future__ import annotations

import numpy as np
import pytest

import colift
from colift.control.allocation.limits.feasibility import widest_formation
from colift.errors import ColiftError, MissionError, UnknownNameError
from colift.mission.load import load_mission, parse_override
from colift.team.geometry import ring

NAN, INF = float("nan"), float("inf")


def base():
    return {"name": "test", "reference": {"kind": "hover"}}


SECTIONS = ("name", "description", "seed", "world", "load", "drones", "start", "timing", "events")
LAYERS = (
    "reference",
    "load_control",
    "allocation",
    "position_control",
    "attitude_control",
    "plant",
)
WAYPOINTS = {"kind": "waypoints"}
POINTS = "reference.points"
EVENT = {"at": 1.0, "field": "load.mass", "value": 0.3}

# (changes by dotted path, what the message must contain)
TABLE = [
    # name, description, seed
    ({"name": 3}, ["name: must be text", "found 3"]),
    ({"name": ""}, ["name", "at least 1 character"]),
    ({"name": "x" * 201}, ["name", "at most 200 characters"]),
    ({"name": ["a"]}, ["name: must be text"]),
    ({"description": 1.5}, ["description: must be text"]),
    ({"seed": -1}, ["seed", "greater than or equal to 0", "found -1"]),
    ({"seed": 1.5}, ["seed: must be a whole number"]),
    ({"seed": "7"}, ["seed: must be a whole number", "found '7'"]),
    ({"seed": True}, ["seed: must be a whole number", "found True"]),
    ({"seed": 2**63}, ["seed: must be less than 9223372036854775808"]),
    # unknown keys at every level
    ({"nmae": "x"}, ["nmae: unknown key", "did you mean 'name'?"]),
    ({"alloction": {"kind": "sqp"}}, ["alloction: unknown key", "did you mean 'allocation'?"]),
    ({"zzz": 1}, ["zzz: unknown key", *SECTIONS, *LAYERS]),
    ({"kinds": {"plant": "x"}}, ["kinds: unknown key"]),
    ({"load.mas": 0.3}, ["load.mas: unknown key", "did you mean 'mass'?"]),
    ({"world.wind": 3.0}, ["world.wind: unknown key", "valid: gravity"]),
    ({"drones.number": 3}, ["drones.number: unknown key", "count, mass, inertia, cable_length"]),
    ({"start.cone": 35.0}, ["start.cone: unknown key", "did you mean 'cone_deg'?"]),
    ({"timing.dt": 0.001}, ["timing.dt: unknown key", "duration, step"]),
    ({"reference.centre": [0, 0, 1]}, ["reference.centre: unknown key", "position, attitude_deg, kind"]),
    ({"load_control.kp": [1, 1, 1]}, ["load_control.kp", "did you mean 'k_p'?"]),
    ({"position_control.kp": 1}, ["position_control.kp: unknown key"]),
    ({"attitude_control.roh": 1}, ["attitude_control.roh", "did you mean 'rho'?"]),
    ({"allocation.nu": 0.3}, ["allocation.nu: unknown key", "did you mean 'mu'?"]),
    ({"plant.drag": 0.3}, ["plant.drag: unknown key"]),
    ({"events": [{**EVENT, "until": 2.0}]}, ["events.0.until: unknown key", "at, field, value"]),
    # parts
    ({"reference.kind": "sprial"}, ["reference.kind", "did you mean 'spiral'?", "found 'sprial'"]),
    ({"allocation.kind": "sqpp"}, ["allocation.kind: must be one of", "did you mean 'sqp'?"]),
    ({"load_control.kind": "pd"}, ["load_control.kind: must be one of", "did you mean 'pid'?"]),
    ({"position_control.kind": "x"}, ["position_control.kind: must be one of", "pid"]),
    ({"attitude_control.kind": "manifld"}, ["attitude_control.kind", "did you mean 'manifold'?"]),
    ({"plant.kind": "rigid_cables"}, ["plant.kind", "did you mean 'rigid-cables'?"]),
    ({"allocation.kind": "base"}, ["allocation.kind: must be one of"]),
    ({"allocation.kind": "_fixed"}, ["allocation.kind: must be one of"]),
    ({"allocation.kind": ""}, ["allocation.kind: must be one of"]),
    ({"reference.kind": 3}, ["reference.kind: must be one of", "found 3"]),
    ({"reference.kind": ["hover"]}, ["reference.kind: must be one of", "found ['hover']"]),
    ({"reference.kind": True}, ["reference.kind: must be one of", "found True"]),
    ({"reference.kind": {}}, ["reference.kind: must be one of", "found {}"]),
    ({"reference": {}}, ["reference.kind: is required", "figure-eight, guided, hover, plan, spiral, waypoints"]),
    ({"reference": "spiral"}, ["reference: must be a table", "found 'spiral'"]),
    ({"plant": 3}, ["plant: must be a table"]),
    ({"allocation": [{"kind": "sqp"}]}, ["allocation: must be a table"]),
    ({"reference.kind": "[bold]hover[/bold]"}, ["[bold]hover[/bold]"]),
    # world and load
    ({"world": 9.81}, ["world: must be a table"]),
    ({"world.gravity": -1.0}, ["world.gravity: must be greater than or equal to 0"]),
    ({"world.gravity": 1000.0}, ["world.gravity: must be less than or equal to 100"]),
    ({"world.gravity": [0, 0, -9.81]}, ["world.gravity: must be a number"]),
    ({"load": None}, ["load: must be a table"]),
    ({"load": []}, ["load: must be a table"]),
    ({"load.mass": 0.0}, ["load.mass: must be greater than 0", "found 0"]),
    ({"load.mass": -0.2}, ["load.mass: must be greater than 0", "found -0.2"]),
    ({"load.mass": 1e6}, ["load.mass: must be less than or equal to 100000"]),
    ({"load.mass": NAN}, ["load.mass: must be a finite number"]),
    ({"load.mass": INF}, ["load.mass: must be a finite number"]),
    ({"load.mass": 10**400}, ["load.mass: must be a finite number"]),
    ({"load.mass": "0.2"}, ["load.mass: must be a number", "found '0.2'"]),
    ({"load.mass": True}, ["load.mass: must be a number", "found True"]),
    ({"load.mass": {}}, ["load.mass: must be a number"]),
    ({"load.mass": [0.2]}, ["load.mass: must be a number"]),
    # drones
    ({"drones": 4}, ["drones: must be a table"]),
    ({"drones.count": 0}, ["drones.count: must be greater than or equal to 1"]),
    ({"drones.count": -4}, ["drones.count: must be greater than or equal to 1"]),
    ({"drones.count": 1025}, ["drones.count: must be less than or equal to 1024"]),
    ({"drones.count": 10**18}, ["drones.count: must be less than or equal to 1024"]),
    ({"drones.count": 4.0}, ["drones.count: must be a whole number"]),
    ({"drones.count": "4"}, ["drones.count: must be a whole number"]),
    ({"drones.mass": 0.0}, ["drones.mass: must be greater than 0"]),
    ({"drones.mass": "heavy"}, ["drones.mass: must be a number", "found 'heavy'"]),
    ({"drones.mass": True}, ["drones.mass: must be a number"]),
    ({"drones.mass": []}, ["drones.mass"]),
    ({"drones.mass": [0.5, 0.5]}, ["drones.mass", "drones.count = 4", "2 values"]),
    ({"drones.mass": [0.5, -0.5, 0.5, 0.5]}, ["drones.mass.1: must be greater than 0"]),
    ({"drones.mass": [0.5, "a", 0.5, 0.5]}, ["drones.mass.1: must be a number"]),
    ({"drones.mass": [0.5, NAN, 0.5, 0.5]}, ["drones.mass.1: must be a finite number"]),
    ({"drones.cable_length": -1.0}, ["drones.cable_length: must be greater than 0"]),
    ({"drones.cable_length": [1.0] * 5}, ["drones.cable_length", "drones.count = 4", "5 values"]),
    ({"drones.inertia": 0.02}, ["drones.inertia: must be a list"]),
    ({"drones.inertia": [0.02, 0.02]}, ["drones.inertia: must have at least 3 values"]),
    ({"drones.inertia": [0.02] * 4}, ["drones.inertia: must have at most 3 values"]),
    ({"drones.inertia": [0.02, 0.02, -0.02]}, ["drones.inertia.2: must be greater than 0"]),
    ({"drones.inertia": [0.01, 0.01, 0.03]}, ["drones.inertia: no body has these", "0.03"]),
    ({"drones.inertia": [[0.02] * 3] * 3}, ["drones.inertia", "drones.count = 4", "3 values"]),
    ({"drones.inertia": [[0.02] * 3] * 3 + [[0.02, 0.02]]}, ["drones.inertia.3: must have at least 3"]),
    ({"drones.inertia": [[0.02] * 3] * 3 + [[1.0, 0.1, 0.1]]}, ["drones.inertia: no body has these"]),
    # start
    ({"start.cone_deg": 0.0}, ["start.cone_deg: must be greater than 0"]),
    ({"start.cone_deg": 180.0}, ["start.cone_deg: must be less than 180"]),
    ({"start.heading_deg": INF}, ["start.heading_deg: must be a finite number"]),
    ({"start.directions": [[0, 0, -1]] * 3}, ["start.directions", "drones.count = 4", "3 directions"]),
    ({"start.directions": [[0, 0, -1]] * 3 + [[0, 0, 0]]}, ["start.directions.3", "is zero"]),
    ({"start.directions": [[0, 0, -1]] * 3 + [[0, 0]]}, ["start.directions.3: must have at least 3"]),
    ({"start.directions": [[0, 0, -1]] * 3 + [[0, 0, "d"]]}, ["start.directions.3.2: must be a number"]),
    ({"start.directions": 1}, ["start.directions: must be a list"]),
    ({"start.directions": [[0, 0, -1e200]] * 4}, ["start.directions.0.2: must be greater than or equal"]),
    ({"start.load_offset": [0.0, 0.0]}, ["start.load_offset: must have at least 3 values"]),
    ({"start.load_offset": [0.0, 0.0, NAN]}, ["start.load_offset.2: must be a finite number"]),
    ({"start.load_offset": 0.1}, ["start.load_offset: must be a list"]),
    # timing
    ({"timing.duration": 0.0}, ["timing.duration: must be greater than 0"]),
    ({"timing.duration": -5.0}, ["timing.duration: must be greater than 0"]),
    ({"timing.duration": 2e6}, ["timing.duration: must be less than or equal to 1000000"]),
    ({"timing.duration": "20 s"}, ["timing.duration: must be a number", "'20 s'"]),
    ({"timing.duration": 1e-9}, ["timing.recording: must not exceed timing.duration"]),
    ({"timing.step": 0.0}, ["timing.step: must be greater than or equal to 0.00001"]),
    ({"timing.step": 0.1}, ["timing.step: must be less than or equal to 0.01"]),
    ({"timing.step": 0.0007}, ["timing.load_control: must be a whole multiple of timing.step"]),
    ({"timing.load_control": 0.0015}, ["timing.load_control", "whole multiple", "nearest 0.002"]),
    ({"timing.allocation": 0.0101}, ["timing.allocation", "whole multiple", "nearest 0.01"]),
    ({"timing.position_control": 0.0001}, ["timing.position_control", "whole", "nearest 0.001"]),
    ({"timing.attitude_control": -0.01}, ["timing.attitude_control: must be greater than 0"]),
    ({"timing.recording": 30.0}, ["timing.recording: must not exceed timing.duration = 20 s"]),
    ({"timing.recording": 1e308}, ["timing.recording: must be less than or equal to 1000000"]),
    ({"timing.step": 1e-5, "timing.duration": 1e6}, ["timing.recording: must record at most 4 GB"]),
    ({"timing.duration": 1e6, "drones.count": 1024}, ["timing.recording: must record at most 4 GB"]),
    # references
    ({"reference.position": [0.0, 1.0]}, ["reference.position: must have at least 3 values"]),
    ({"reference.position": [0.0, 1.0, NAN]}, ["reference.position.2: must be a finite number"]),
    ({"reference.position": "here"}, ["reference.position: must be a list"]),
    ({"reference": {"kind": "spiral", "period": 0.0}}, ["reference.period: must be greater than 0"]),
    ({"reference": {"kind": "spiral", "ramp": 0.0}}, ["reference.ramp: must be greater than 0"]),
    ({"reference": {"kind": "spiral", "radius": -1}}, ["reference.radius: must be greater than or"]),
    ({"reference": {"kind": "spiral", "climb_rate": "1"}}, ["reference.climb_rate: must be a number"]),
    ({"reference": {"kind": "figure-eight", "width": 1e9}}, ["reference.width: must be less than or"]),
    ({"reference": {**WAYPOINTS, "points": []}}, [f"{POINTS}: must have at least 1 value"]),
    ({"reference": {**WAYPOINTS, "points": [[0, 0]]}}, [f"{POINTS}.0: must have at least 3"]),
    ({"reference": {**WAYPOINTS, "points": [1, 2, 3]}}, [f"{POINTS}.0: must be a list"]),
    ({"reference": {**WAYPOINTS, "points": [[0, 0, 1]] * 1001}}, [f"{POINTS}: must have at most 1000"]),
    ({"reference": {**WAYPOINTS, "travel": 0.0}}, ["reference.travel: must be greater than 0"]),
    ({"reference": {**WAYPOINTS, "hold": -1.0}}, ["reference.hold: must be greater than or equal to 0"]),
    # controllers and allocator
    ({"load_control.k_p": 8.0}, ["load_control.k_p: must be a list"]),
    ({"load_control.k_p": [8.0, 8.0]}, ["load_control.k_p: must have at least 3 values"]),
    ({"load_control.k_p": [8.0, -8.0, 8.0]}, ["load_control.k_p.1: must be greater than or equal"]),
    ({"load_control.sign": "printed"}, ["load_control.sign", "'corrected' or 'as-printed'"]),
    ({"load_control.integral_limit": 0.0}, ["load_control.integral_limit: must be greater than 0"]),
    ({"position_control.k_i": [1, 2, INF]}, ["position_control.k_i.2: must be a finite number"]),
    ({"position_control.thrust_filter": 1.0}, ["position_control.thrust_filter", "equal to 0.1"]),
    ({"position_control.direction_rates": 1}, ["direction_rates: must be true or false"]),
    ({"attitude_control.rho": [0, 1, 1]}, ["attitude_control.rho.0: must be greater than 0"]),
    ({"allocation.mu": -0.1}, ["allocation.mu: must be greater than or equal to 0"]),
    ({"allocation.mu": "0.3"}, ["allocation.mu: must be a number"]),
    ({"allocation.max_iterations": 0}, ["allocation.max_iterations: must be greater than or"]),
    ({"allocation.max_iterations": 2.5}, ["allocation.max_iterations: must be a whole number"]),
    ({"position_control.direction_rates": "yes"}, ["position_control.direction_rates: must be true or false"]),
    ({"allocation": {"kind": "ring", "mu": 0.3}}, ["allocation.mu: unknown key", "cone_deg"]),
    ({"allocation": {"kind": "ring", "cone_deg": 90}}, ["allocation.cone_deg: must be less than 90"]),
    # events
    ({"events": 3}, ["events: must be a list"]),
    ({"events": {"at": 1.0}}, ["events: must be a list"]),
    ({"events": [3]}, ["events.0: must be a table"]),
    ({"events": [{}]}, ["events.0.at: is required", "events.0.field: is required"]),
    ({"events": [EVENT, {**EVENT, "at": -1.0}]}, ["events.1.at: must be greater than or equal to 0"]),
    ({"events": [{**EVENT, "at": 21.0}]}, ["events.0.at", "timing.duration = 20 s", "found 21"]),
    ({"events": [{**EVENT, "at": "noon"}]}, ["events.0.at: must be a number"]),
    ({"events": [{**EVENT, "field": "load.colour"}]}, ["events.0.field", "load\\.mass"]),
    ({"events": [{**EVENT, "field": 3}]}, ["events.0.field: must be text"]),
    ({"events": [{**EVENT, "value": 0.0}]}, ["events.0", "load.mass must be greater than 0"]),
    ({"events": [{**EVENT, "value": NAN}]}, ["events.0", "load.mass must be a finite number"]),
    ({"events": [{**EVENT, "value": "0.3"}]}, ["events.0", "load.mass must be a number"]),
    ({"events": [{**EVENT, "value": [0.3]}]}, ["events.0", "load.mass must be a number"]),
    ({"events": [{**EVENT, "field": "allocation.mu", "value": -1}]}, ["events.0", "allocation.mu"]),
    ({"events": [{**EVENT, "field": "allocation.nu"}]}, ["events.0", "did you mean 'mu'?"]),
]  # fmt: skip


def changed(changes):
    table = base()
    for path, value in changes.items():
        *parents, leaf = path.split(".")
        node = table
        for key in parents:
            node = node.setdefault(key, {})
        node[leaf] = value
    return table


def identify(value):
    return (
        ",".join(f"{k}={str(v)[:30]}" for k, v in value.items()) if isinstance(value, dict) else ""
    )


def test_the_unchanged_mission_is_valid():
    assert load_mission(base()).drones.count == 4
    assert len(TABLE) >= 100


@pytest.mark.parametrize(("changes", "expected"), TABLE, ids=identify)
def test_a_mistake_gives_its_place_and_what_is_allowed(changes, expected):
    with pytest.raises(MissionError) as caught:
        load_mission(changed(changes))
    text = str(caught.value)
    for part in expected:
        assert part in text
    for internal in (
        "constrained",
        "tuple[",
        "list[",
        "pydantic",
        "Input",
        "Field required",
        "dictionary",
    ):
        assert internal not in text
    paths = [problem.path for problem in caught.value.problems]
    assert len(paths) == len(set(paths))  # one problem a place


@pytest.mark.parametrize(
    "changes", [c for c, _ in TABLE if len(c) == 1 and "events" not in c], ids=identify
)
def test_one_mistake_is_one_problem(changes):
    with pytest.raises(MissionError) as caught:
        load_mission(changed(changes))
    sections = {problem.path.split(".")[0] for problem in caught.value.problems}
    assert len(sections) == 1
    # One wrong step is wrong for all periods; two items of a list may be wrong alike.
    if not sections & {"timing", "start"} and "points" not in str(changes):
        assert len(caught.value.problems) == 1


def test_five_mistakes_in_five_sections_are_all_reported():
    mission = changed(
        {
            "load.mass": -1.0,
            "drones.inertia": [0.01, 0.01, 0.03],
            "timing.recording": 0.0015,
            "allocation.kind": "sqpp",
            "start.directions": [[0, 0, 0]] * 4,
        }
    )
    with pytest.raises(MissionError) as caught:
        load_mission(mission)
    places = {problem.path for problem in caught.value.problems}
    assert {"load.mass", "drones.inertia", "timing.recording", "allocation.kind"} <= places
    assert {f"start.directions.{i}" for i in range(4)} <= places
    assert str(caught.value).startswith("mission: 8 problems\n")
    assert str(caught.value).count("\n") == 8


def test_a_broken_section_causes_no_false_alarm_elsewhere():
    """Checks between sections leave out those that are broken themselves."""
    mission = changed({"drones.count": -8, "start.directions": [[0, 0, -1]] * 8})
    with pytest.raises(MissionError) as caught:
        load_mission(mission)
    assert [problem.path for problem in caught.value.problems] == ["drones.count"]
    mission = changed({"timing.duration": "30", "events": [{**EVENT, "at": 25.0}]})
    with pytest.raises(MissionError) as caught:
        load_mission(mission)
    assert [problem.path for problem in caught.value.problems] == ["timing.duration"]


def test_missing_name_and_reference():
    with pytest.raises(MissionError) as caught:
        load_mission({})
    assert {p.path for p in caught.value.problems} == {"name", "reference.kind"}


# ---------------------------------------------------------------- sources


@pytest.mark.parametrize(
    "text",
    [
        "name = ",
        "name = 'a'\nname = 'b'",
        "[reference\nkind='hover'",
        "{}",
        "[load]\nmass = 0,2",
        "[load]\nmass = 1\n[load]\nmass = 2",
        "a = " + "[" * 5000,
        "seed = " + "9" * 5000,
        "\x00",
    ],
)
def test_not_toml(tmp_path, text):
    path = tmp_path / "broken.toml"
    path.write_text(text)
    with pytest.raises(MissionError, match=r"broken\.toml: 1 problem\n  file: is not valid TOML"):
        load_mission(path)


def test_not_text(tmp_path):
    path = tmp_path / "binary.toml"
    path.write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(MissionError, match="cannot be read"):
        load_mission(str(path))


@pytest.mark.parametrize("name", ["nowhere.toml", "a\0b.toml", "x" * 5000 + ".toml"])
def test_missing_file(tmp_path, name):
    with pytest.raises(MissionError, match="file: cannot be read"):
        load_mission(str(tmp_path / name))


def test_a_folder_is_no_mission(tmp_path):
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(MissionError, match="cannot be read"):
        load_mission(tmp_path / "folder.toml")


@pytest.mark.parametrize("name", ["", "paper-spiral-2", "hover/../hover", "a\0b", "x" * 5000, "/"])
def test_unknown_name(name):
    with pytest.raises(UnknownNameError) as caught:
        load_mission(name)
    for valid in ("hover", "paper-spiral", "figure-eight"):
        assert valid in str(caught.value)


def test_misspelt_name_is_corrected():
    with pytest.raises(UnknownNameError, match="did you mean 'paper-spiral'"):
        load_mission("paper-sprial")


def test_toml_dates_and_undecodable_text_are_no_crash(tmp_path):
    path = tmp_path / "dated.toml"
    path.write_text("name = 'x'\nseed = 2026-01-01\n[reference]\nkind = 07:30:00\n")
    with pytest.raises(MissionError) as caught:
        load_mission(path)
    assert {p.path for p in caught.value.problems} == {"seed", "reference.kind"}
    assert load_mission({**base(), "description": "\udcff"}).description == "?"


# ---------------------------------------------------------------- overrides


@pytest.mark.parametrize("text", ["", "mu", "=3", " = 3", "allocation.mu"])
def test_override_without_key_or_value(text):
    with pytest.raises(MissionError, match="must have the form key=value"):
        parse_override(text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("allocation.mu=0.3", ("allocation.mu", 0.3)),
        (" seed = 3 ", ("seed", 3)),
        ("reference.kind=hover", ("reference.kind", "hover")),
        ('name="a=b"', ("name", "a=b")),
        ("name=a=b", ("name", "a=b")),
        ("start.load_offset=[0, 0, 1.5]", ("start.load_offset", [0, 0, 1.5])),
        ("allocation.transport=false", ("allocation.transport", False)),
        ("load.mass=inf", ("load.mass", INF)),
        ("name=", ("name", "")),
        ("name=[bold]", ("name", "[bold]")),
        ("seed=1\nname='x'", ("seed", "1\nname='x'")),
    ],
)
def test_override_values_are_toml_and_else_text(text, expected):
    assert parse_override(text) == expected


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        ({"name.first": "x"}, ["name: is not a table"]),
        ({"load.mass.kg": 1.0}, ["load.mass: is not a table"]),
        ({"events.1.at": 1.0}, ["events.1: is not there: the list has 1, from 0"]),
        ({"events.at": 1.0}, ["events.at: events is a list of 1"]),
        ({"": 1}, ["unknown key"]),
        ({"load.": 1}, ["unknown key"]),
        ({"allocation.nu": 1}, ["allocation.nu: unknown key", "did you mean 'mu'?"]),
        ({"laod.mass": 1.0}, ["laod: unknown key", "did you mean 'load'?"]),
        ({"load.mass": "big"}, ["load.mass: must be a number"]),
        ({"load": 3}, ["load: must be a table"]),
        ({"name.first": "x", "seed": -1}, ["name: is not a table", "seed: must be"]),
    ],
)
def test_bad_overrides(overrides, expected):
    mission = {**base(), "events": [EVENT], "load": {"mass": 0.2}}
    with pytest.raises(MissionError) as caught:
        load_mission(mission, overrides)
    for part in expected:
        assert part in str(caught.value)


def test_overrides_replace_and_leave_the_source_alone():
    source = {**base(), "load": {"mass": 0.2}}
    mission = load_mission(source, {"load.mass": 0.3, "timing.duration": 5})
    assert (mission.load.mass, mission.timing.duration) == (0.3, 5.0)
    assert source == {**base(), "load": {"mass": 0.2}}


def test_another_kind_drops_the_settings_of_the_old_one():
    for section in ({"kind": "sqp", "mu": 0.4}, {"mu": 0.4}):  # safe is the default kind
        mission = load_mission({**base(), "allocation": section}, {"allocation.kind": "ring"})
        assert mission.kinds["allocation"] == "ring"
    same = load_mission({**base(), "allocation": {"mu": 0.4}}, {"allocation.kind": "safe"})
    assert same.allocation.mu == 0.4


def test_settings_for_another_kind_are_kept_in_any_order():
    for order in (
        ["allocation.kind", "allocation.cone_deg"],
        ["allocation.cone_deg", "allocation.kind"],
    ):
        values = {"allocation.kind": "ring", "allocation.cone_deg": 40.0}
        mission = load_mission(base(), {key: values[key] for key in order})
        assert mission.allocation.cone_deg == 40.0
    with pytest.raises(MissionError, match=r"allocation\.mu: unknown key"):
        load_mission(base(), {"allocation.mu": 0.3, "allocation.kind": "ring"})


def test_numpy_values_are_plain_data():
    mission = load_mission(
        base(),
        {
            "load.mass": np.float32(0.5),
            "drones.count": np.int64(3),
            "reference.position": np.ones(3),
        },
    )
    assert (mission.load.mass, mission.drones.count) == (0.5, 3)
    assert mission.reference.position == (1.0, 1.0, 1.0)
    assert type(mission.drones.count) is int


@pytest.mark.parametrize(
    "arguments",
    [
        {"allocator": "sqpp"},
        {"mu": -1.0},
        {"nu": 0.3},
        {"allocator": "ring", "mu": 0.3},
        {"seed": -1},
        {"seed": 1.5},
        {"timing__duration": 0.0},
        {"timing__dt": 1.0},
        {"overrides": {"load.mass": -1.0}},
    ],
)
def test_run_reports_bad_keywords_before_flying(arguments):
    with pytest.raises(MissionError):
        colift.run("hover", progress=lambda _: pytest.fail("flown"), **arguments)


def test_every_error_is_a_colift_error():
    assert issubclass(MissionError, ColiftError)
    assert issubclass(UnknownNameError, ColiftError)


EIGHT = {
    "drones.count": 8, "load.mass": 0.45, "allocation.kind": "safe", "allocation.min_angle_deg": 53.5
}  # fmt: skip
"""Eight cables in a cone of 75 degrees are at most 53.9 degrees apart."""


def test_a_start_that_cannot_be_led_back_within_the_limits_is_told_before_the_flight():
    with pytest.raises(MissionError) as error:
        load_mission(base(), EIGHT | {"start.cone_deg": 20.0})
    message = str(error.value)
    for name in ("start.cone_deg", "8 cables", "min_angle_deg = 53.5", "max_cone_deg = 75", "53.9"):
        assert name in message
    wide = widest_formation(8, np.radians(75.0))[0]
    load_mission(base(), EIGHT | {"start.directions": wide.tolist()})
    ringed = ring(8, np.radians(20.0)).tolist()
    with pytest.raises(MissionError, match=r"start\.directions: breaks a limit"):
        load_mission(base(), EIGHT | {"start.directions": ringed})


def test_a_start_that_is_led_back_is_no_mistake():
    load_mission(base(), EIGHT | {"allocation.min_angle_deg": 40.0, "start.cone_deg": 5.0})
