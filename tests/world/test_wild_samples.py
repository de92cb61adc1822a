"""Samples of a load that are wild, late, lost or biased, and what becomes of a rigid load whose attitude they say."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record import metrics
from colift.record.recording import Recording
from colift.team.load import from_to

LAYERS = ("load_control", "allocation", "position_control", "attitude_control")
FLOWN = {
    "sensing.kind": "noisy", "timing.delay": 0.02, "timing.duration": 12.0, "reference.period": 6.4, "seed": 8,
    **{f"timing.{name}": 0.01 for name in LAYERS},
}  # fmt: skip


def flown(**changes: Any) -> Recording:
    given = {name.replace("__", "."): value for name, value in changes.items()}
    return Flight(load_mission("box-figure-eight", {**FLOWN, **given})).run()


def turned(recording: Recording, name: str) -> np.ndarray:
    """By how much what is measured or estimated of the load's attitude is off, degrees."""
    pairs = zip(recording["load_attitude"], recording[f"{name}_load_attitude"], strict=True)
    return np.degrees(
        2.0 * np.array([math.asin(min(np.linalg.norm(from_to(*pair)[1:]), 1.0)) for pair in pairs])
    )


def test_so_many_samples_are_wild_as_are_asked_for_and_by_so_much() -> None:
    recording = flown(
        sensing__load_wild=0.1, reference={"kind": "hover"}, **{"timing.recording": 0.005}
    )
    off = turned(recording, "measured")
    wild = off > 10.0
    assert 0.05 < wild.mean() < 0.15
    assert 30.0 < np.median(off[wild]) < 150.0
    place = np.linalg.norm((recording["measured_load"] - recording["load"])[:, 0], axis=1)
    assert np.median(place[wild]) > 0.2
    assert np.median(place[~wild]) < 0.01


def test_wild_samples_are_left_out_and_the_box_flies_as_without_them() -> None:
    calm, wild = flown(), flown(sensing__load_wild=0.05)
    assert turned(wild, "measured").max() > 60.0
    assert turned(wild, "estimated").max() < 7.0  # one that is hardly wild is believed
    values = [metrics.compute(each) for each in (calm, wild)]
    assert values[1]["attitude_rms_deg"] < 1.3 * values[0]["attitude_rms_deg"]
    assert values[1]["tracking_rms_m"] < 1.3 * values[0]["tracking_rms_m"]
    believed = flown(sensing__load_wild=0.05, estimation__wild_deg=180.0)
    assert turned(believed, "estimated").max() > 60.0


def test_an_attitude_that_jumps_and_stays_there_is_believed_in_the_end() -> None:
    """Half of all samples are lost, and the load is never taken to stand where it was."""
    recording = flown(sensing__load_dropout=0.8, estimation__wild_deg=0.5)
    assert recording.outcome == "completed"
    assert turned(recording, "estimated").max() < 8.0


@pytest.mark.parametrize("bias", [(0.02, 0.0, 0.0), (0.0, 0.02, 0.01)])
def test_a_bias_of_the_attitude_turns_the_load_by_itself_and_no_more(
    bias: tuple[float, ...],
) -> None:
    recording = flown(
        sensing__load_attitude_bias=bias, reference={"kind": "hover"}, **{"timing.duration": 25.0}
    )
    error = metrics.attitude_error(recording)[recording.time > 20.0].mean(axis=0)
    np.testing.assert_allclose(error, -np.array(bias), atol=math.radians(0.4))
