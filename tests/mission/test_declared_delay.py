"""One delay for the whole mission, and settings that say otherwise."""

from __future__ import annotations

import pytest

from colift.errors import MissionError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.part import LAYERS, find, names

TRUE = {
    f"sensing.{sensor}_delay"
    for sensor in ("load", "tracking", "attitude", "rates", "specific_force")
}
TOLD = {f"{layer}.delay" for layer in ("estimation", "load_control", "observation", "position_control", "attitude_control")}  # fmt: skip
ALL = {*TRUE, *TOLD, "estimation.attitude_delay"}


def delays(mission):
    """Every setting of a delay by its path."""
    return {
        f"{layer}.{name}": getattr(getattr(mission, layer), name)
        for layer in LAYERS
        for name in type(getattr(mission, layer)).model_fields
        if name.endswith("delay") and layer != "link"
    }


def test_it_is_the_default_of_all_settings():
    assert {*delays(load_mission("real-world"))} == ALL
    found = delays(load_mission("real-world", {"timing.delay": 0.035}))
    assert found == dict.fromkeys(ALL, 0.035)


def test_without_one_each_setting_has_its_own_default():
    found = load_mission("noisy-spiral")
    assert found.timing.delay is None
    assert found.sensing == find("sensing", "noisy")()


@pytest.mark.parametrize("path", sorted(ALL))
def test_a_setting_of_its_own_goes_before_it(path):
    """So the controllers may be told another delay than there is."""
    found = delays(load_mission("real-world", {path: 0.011}))
    assert found == {**dict.fromkeys(ALL, 0.02), path: 0.011}
    found = delays(load_mission("real-world", {"timing.delay": 0.03, path: 0.02}))
    assert found == {**dict.fromkeys(ALL, 0.03), path: 0.02}


def test_a_resolved_mission_says_all_and_follows_another_delay():
    resolved = load_mission("real-world", {"estimation.delay": 0.011}).resolved()
    assert resolved["attitude_control"]["delay"] == 0.02
    assert load_mission(resolved).resolved() == resolved
    found = delays(load_mission(resolved, {"timing.delay": 0.03}))
    assert found == {**dict.fromkeys(ALL, 0.03), "estimation.delay": 0.011}


def test_a_part_put_in_place_in_flight_takes_it_too():
    events = [{"at": 0.0, "field": "attitude_control", "value": {"kind": "delay-aware"}}]
    flight = Flight(load_mission("hover", {"timing.delay": 0.004, "events": events}))
    flight.advance(0.01)
    assert flight.parts["attitude_control"].delay == 0.004
    flight.change("load_control", {"kind": "adaptive", "delay": 0.006})
    assert flight.parts["load_control"].delay == 0.006


def test_it_is_bounded_like_any_setting():
    with pytest.raises(MissionError, match=r"timing\.delay"):
        load_mission("hover", {"timing.delay": 0.6})


@pytest.mark.parametrize("layer", LAYERS)
def test_parts_take_it_for_settings_that_they_have(layer):
    for name in names(layer):
        part = find(layer, name)
        if not part.missing():
            assert {*part.delays_declared} <= {*part.model_fields}
