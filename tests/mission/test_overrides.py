"""Of several values for one thing the later wins, whether whole tables or single fields are given."""

from __future__ import annotations

import json
import sqlite3
from contextlib import closing
from itertools import permutations

import pytest

import colift
import terminal
from colift.mission.load import layered, load_mission, parse_overrides
from colift.part import LAYERS, LISTS, find, names
from colift.study import compare, stress, sweep

HOVER = load_mission("hover").resolved()
REQUIRED = {("reference", "waypoints"): {"points": [[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]]}}
MOTORS = {"actuation.kind": "motors", "sensing.kind": "noisy", "link.kind": "radio"}


def able(layer):
    """Two kinds of a layer that can be used here."""
    found = [kind for kind in names(layer) if not find(layer, kind).missing()]
    return found[0], found[-1]


def a_setting(layer, kind):
    """A field of a part with a valid value that is not its default."""
    part = find(layer, kind)
    base = part.model_validate(REQUIRED.get((layer, kind), {}))
    for name, field in part.model_fields.items():
        value = getattr(base, name)
        for other in (0.5, 0.011, 2.0, 0.25):
            if type(value) is float and value != other and field.is_required() is False:
                try:
                    part.model_validate({**REQUIRED.get((layer, kind), {}), name: other})
                except ValueError:
                    continue
                return name, other
    return None


@pytest.mark.parametrize("layer", LAYERS)
def test_a_kind_wins_over_a_table_before_it_and_a_table_over_a_kind_before_it(layer):
    first, second = able(layer)
    if first == second:
        pytest.skip("the layer has one part")
    path = f"{layer}.kind"
    for one, other in ((first, second), (second, first)):
        table = {"kind": one, **REQUIRED.get((layer, one), {})}
        whole = {layer: table}
        given = REQUIRED.get((layer, other), {})
        alone = {path: other, **{f"{layer}.{name}": value for name, value in given.items()}}
        assert load_mission("hover", {**whole, **alone}).kinds[layer] == other
        assert load_mission("hover", {**alone, **whole}).kinds[layer] == one


@pytest.mark.parametrize("layer", LAYERS)
def test_a_field_wins_over_a_table_before_it_and_a_table_over_a_field_before_it(layer):
    for kind in dict.fromkeys(able(layer)):
        found = a_setting(layer, kind)
        if found is None:
            continue
        name, value = found
        whole = {layer: {"kind": kind, **REQUIRED.get((layer, kind), {})}}
        alone = {f"{layer}.{name}": value}
        before = getattr(getattr(load_mission("hover", whole), layer), name)
        assert before != value
        assert getattr(getattr(load_mission("hover", {**whole, **alone}), layer), name) == value
        assert getattr(getattr(load_mission("hover", {**alone, **whole}), layer), name) == before


@pytest.mark.parametrize("section", ["load", "drones", "truth", "timing", "world"])
def test_so_do_the_tables_that_name_no_part(section):
    name, value = {
        "load": ("mass", 0.3), "drones": ("mass", 0.7), "truth": ("load_mass_factor", 1.5),
        "timing": ("duration", 3.0), "world": ("gravity", 1.62),
    }[section]  # fmt: skip
    whole, alone = {section: {name: 1.0}}, {f"{section}.{name}": value}
    for order, wins in (({**whole, **alone}, value), ({**alone, **whole}, 1.0)):
        assert getattr(getattr(load_mission("hover", order), section), name) == wins


@pytest.mark.parametrize("name", LISTS)
def test_and_the_lists(name):
    kind, field = {"disturbance": ("wind", "speed"), "fault": ("cable-cut", "at")}[name]
    whole = {name: [{"kind": kind, field: 1.0}]}
    alone = {f"{name}.0.{field}": 2.0}
    source = {**HOVER, name: [{"kind": kind, field: 3.0}]}
    for order, wins in (({**whole, **alone}, 2.0), ({**alone, **whole}, 1.0)):
        (part,) = getattr(load_mission(source, order), name)
        assert getattr(part, field) == wins
    assert getattr(load_mission(source, {**alone, name: []}), name) == []


def test_a_setting_given_by_its_path_is_never_dropped():
    """Which of the two was meant first cannot be seen, and a setting must not vanish in silence."""
    wanted = {"allocation.kind": "ring", "allocation.cone_deg": 40.0}
    for order in permutations(wanted.items()):
        assert load_mission("hover", dict(order)).allocation.cone_deg == 40.0
    with pytest.raises(colift.errors.MissionError, match="cone_deg: unknown key"):
        load_mission("hover", {"allocation.cone_deg": 40.0, "allocation.kind": "sqp"})
    # Those of a table go with its part.
    table = {"allocation": {"kind": "ring", "cone_deg": 40.0}}
    assert load_mission("hover", {**table, "allocation.kind": "sqp"}).kinds["allocation"] == "sqp"
    lost = {"allocation.mu": 0.3, "allocation": {"kind": "safe"}, "allocation.kind": "sqp"}
    assert load_mission("hover", lost).allocation.mu == 0.15


def test_what_is_given_is_left_alone():
    table = {"kind": "noisy", "load_delay": 0.02}
    given = {"sensing": table, "sensing.kind": "ideal", "sensing.kind ": "?"}
    with pytest.raises(colift.errors.MissionError):
        load_mission("hover", given)
    assert table == {"kind": "noisy", "load_delay": 0.02}
    assert list(given.values()) == [table, "ideal", "?"]


def test_what_is_given_again_comes_last():
    texts = ["actuation.kind=motors", 'actuation={kind="ideal"}', "actuation.kind=motors"]
    assert list(parse_overrides(texts)) == ["actuation", "actuation.kind"]
    assert load_mission("hover", parse_overrides(texts)).kinds["actuation"] == "motors"
    assert layered({"a": 1, "b": 2}, {"a": 3}) == {"b": 2, "a": 3}
    assert list(layered({"a": 1, "b": 2}, {"a": 3})) == ["b", "a"]


def test_run_takes_settings_and_overrides_in_this_order():
    short = {"timing.duration": 0.02}
    told = {"actuation": {"kind": "ideal"}, "actuation.kind": "motors", **short}
    assert colift.run("hover", overrides=told).mission.kinds["actuation"] == "motors"
    flown = colift.run("hover", mu=0.3, overrides={**short, "allocation.mu": 0.6})
    assert flown.mission.allocation.mu == 0.6
    flown = colift.run("hover", allocator="ring", overrides={**short, "allocation.kind": "sqp"})
    assert flown.mission.kinds["allocation"] == "sqp"


@pytest.mark.parametrize(("path", "kind"), MOTORS.items())
def test_every_study_flies_what_was_set(path, kind):
    layer = path.removesuffix(".kind")
    changes = {path: kind}
    studies = {
        "stress": stress.cases("real-world", ["calm", "noise", "radio"], [], [], [0, 1], changes),
        "compare": compare.cases(["sqp", "ring"], ["hover"], [0, 1], changes),
        "sweep": sweep.cases("hover", [sweep.parse_over("load.mass=0.2,0.3")], [0, 1], changes),
        "swept": sweep.cases("hover", [sweep.parse_over(f"{path}=ideal,{kind}")], [0], {}),
    }
    for name, found in studies.items():
        flown = [case.load().kinds[layer] for case in found]
        assert flown == (["ideal", kind] if name == "swept" else [kind] * len(found)), name


def test_so_does_every_command(tmp_path):
    sets = ["--set", "timing.duration=0.05", "--set", 'actuation={kind="ideal"}']
    sets += ["--set", "actuation.kind=motors", "--json"]
    commands = {
        "run": ["run", "hover", "--no-report", "--out", str(tmp_path / "run"), *sets],
        "stress": [
            "stress",
            "--conditions",
            "calm",
            "--seeds",
            "1",
            "--workers",
            "1",
            "--out",
            str(tmp_path / "stress"),
            *sets,
        ],
    }
    for name, words in commands.items():
        done = terminal.colift(*words)
        assert json.loads(done.stdout), name
    assert 'kind = "motors"' in (tmp_path / "run" / "mission.toml").read_text()
    with closing(sqlite3.connect(tmp_path / "stress" / "campaign.sqlite")) as database:
        ((mission,),) = database.execute("SELECT mission FROM runs").fetchall()
    assert json.loads(mission)["actuation"]["kind"] == "motors"
