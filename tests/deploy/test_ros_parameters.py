"""Settings as ROS parameters, without ROS."""

from __future__ import annotations

import sys

import numpy as np
import pytest

from colift.deploy.ros.layers import Layers
from colift.deploy.ros.parameters import Parameters, settings_of
from colift.mission import load_mission
from colift.part import answering, find


@pytest.fixture
def mission():
    return load_mission("hover")


def test_ranges_are_those_of_the_schema(mission):
    found = {each.name: each for each in settings_of("allocation", mission.allocation)}
    angle = found["allocation.min_angle_deg"]
    assert angle.value == 30.0
    assert "degrees" in angle.meaning
    iterations = next(each for name, each in found.items() if each.whole)
    assert iterations.low >= 0
    pid = {each.name: each for each in settings_of("x", mission.position_control)}
    assert pid["x.direction_filter"].low == 0.0
    assert pid["x.direction_filter"].high == 10.0
    assert pid["x.integral_limit"].low == np.nextafter(0.0, 1.0)
    assert pid["x.integral_limit"].high == sys.float_info.max
    assert pid["x.k_p"].value == [40.0, 40.0, 40.0]
    assert pid["x.k_p"].low is None  # a range is of one number; words say the rest
    assert pid["x.k_p"].words.startswith("3 numbers")


@pytest.mark.parametrize(
    "layer", ["allocation", "load_control", "position_control", "observation", "attitude_control"]
)
def test_every_part_s_settings_can_be_parameters_and_be_set_to_what_they_are(layer, mission):
    for kind in answering(layer):
        part = find(layer, kind)()
        parameters = Parameters({layer: part}, mission.team)
        for each in parameters.settings():
            assert isinstance(each.value, bool | int | float | str | list | None)
            assert parameters.change({each.name: each.value}, None) == ""
        assert parameters.parts[layer] is part


def test_changes_reach_the_kernel_all_or_none(mission):
    layers = Layers(mission)
    parameters = Parameters(
        {"allocation": mission.allocation, "position_control": mission.position_control},
        mission.team,
    )
    before = layers.flight.wires.position_control.params.copy()
    changes = {"allocation.mu": 0.3, "position_control.k_p": [20.0, 20.0, 20.0]}
    assert parameters.change(changes, layers.flight) == ""
    assert layers.flight.parts["allocation"].mu == 0.3
    assert (layers.flight.wires.position_control.params != before).any()
    now = layers.flight.wires.position_control.params.copy()
    why = parameters.change(
        {"position_control.k_p": [1.0, 1.0, 1.0], "allocation.mu": -1.0}, layers.flight
    )
    assert "allocation.mu" in why
    assert (layers.flight.wires.position_control.params == now).all()
    assert parameters.parts["position_control"].k_p == (20.0, 20.0, 20.0)
    assert "k_p" in parameters.change({"position_control.k_p": [1.0]}, layers.flight)
