"""The shipped missions that show the world do what their pages say."""

from __future__ import annotations

import pytest

import colift

SEEDS = range(4)


def rotors_that_drag(name, rotor_drag):
    """The disturbances of a shipped mission, its rotors' drag another."""
    table = colift.load_mission(name).resolved()["disturbance"]
    return [
        {**each, **({"rotor_drag": rotor_drag} if each["kind"] == "drag" else {})} for each in table
    ]


@pytest.mark.parametrize(
    ("name", "rotor_drag", "error"),
    [("windy-spiral", 0.0, 0.05), ("windy-spiral", 0.02, 0.08), ("noisy-spiral", 0.0, 0.03)],
)
def test_spirals_are_flown_in_the_world(name, rotor_drag, error):
    """No position controller here knows of the rotors' drag, so it costs its share."""
    for seed in SEEDS:
        disturbance = rotors_that_drag(name, rotor_drag)
        metrics = colift.run(name, seed=seed, overrides={"disturbance": disturbance}).metrics
        assert metrics["tracking_max_m"] < error
        assert metrics["min_angle_deg"] > 30.0
        assert metrics["slack_time_s"] == 0.0
        assert metrics["lost_drones"] == 0.0


@pytest.mark.parametrize(("rotor_drag", "error"), [(0.0, 0.1), (0.02, 0.3)])
def test_an_unannounced_cut_is_found_and_flown_on(rotor_drag, error):
    for seed in SEEDS:
        disturbance = rotors_that_drag("cut-in-flight", rotor_drag)
        run = colift.run("cut-in-flight", seed=seed, overrides={"disturbance": disturbance})
        assert run.recording.outcome == "completed"
        assert run.metrics["lost_drones"] == 1.0
        assert 0.0 < run.metrics["detection_delay_s"] < 0.16
        assert run.metrics["tracking_max_m"] < error
        assert run.metrics["min_angle_deg"] > 30.0


def test_without_detection_the_same_cut_is_never_found():
    run = colift.run("cut-in-flight", overrides={"detection.kind": "none"})
    assert run.metrics["lost_drones"] == 0.0
    assert run.metrics["detection_delay_s"] == float("inf")


@pytest.mark.parametrize(("lag", "flies"), [(0.004, True), (0.005, False)])
def test_the_papers_gains_want_fast_motors(lag, flies):
    motors = {"kind": "motors", "noise": 0.0, "max_rate": 1e6, "time_constant": lag}
    changes = {f"actuation.{name}": value for name, value in motors.items()}
    error = colift.run("paper-spiral", overrides=changes).metrics["tracking_max_m"]
    assert (error < 0.0015) if flies else (error > 1.0)
