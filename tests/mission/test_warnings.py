"""What is likely to go wrong is told before the flight, by both fields, and nothing else is."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import colift
import terminal
from colift.control.tuning import loop_growth
from colift.flight.flight import Flight
from colift.mission import load_mission, mission_names
from colift.mission.warnings import warnings_of

HOVER = {"name": "t", "reference": {"kind": "hover"}, "timing": {"duration": 2.0}}


def warned(changes, source=HOVER):
    """What parts warn of; what loops do is in tests/control/test_margins.py."""
    found = warnings_of(load_mission(source, changes))
    loops = ("loop is unstable near", "loop has a modulus margin")
    return [str(each) for each in found if not any(loop in each.message for loop in loops)]


@pytest.mark.parametrize("name", mission_names())
def test_shipped_missions_warn_of_nothing_but_what_two_cables_cannot_hold(name):
    found = [str(each) for each in warnings_of(load_mission(name))]
    assert len(found) == (name == "two-drones-bar")
    assert all("there the load swings freely" in each for each in found)


def test_wind_without_drag_acts_on_nothing():
    wind = {"disturbance": [{"kind": "gust"}, {"kind": "wind", "speed": 8.0}]}
    found = warned(wind)
    assert [text.split(":")[0] for text in found] == ["disturbance.0.kind", "disturbance.1.kind"]
    assert "drag" in found[0]
    assert warned({"disturbance": [*wind["disturbance"], {"kind": "drag"}]}) == []


@pytest.mark.parametrize(
    ("section", "kind"),
    [
        ("attitude_control", "delay-aware"),
        ("position_control", "disturbance-observer"),
        ("load_control", "adaptive"),
        ("estimation", "predictor"),
    ],
)
def test_a_lag_that_nobody_told_the_controllers(section, kind):
    periods = {
        f"timing.{layer}": 0.01
        for layer in ("attitude_control", "position_control", "load_control")
    }
    changes = {
        **periods, f"{section}.kind": kind, f"{section}.lag": 0.0, "actuation.kind": "motors",
    }  # fmt: skip
    (text,) = (each for each in warned(changes) if each.startswith(f"{section}.lag"))
    assert text.startswith(
        f"{section}.lag: is 0 s, but actuation of kind motors has a lag of 0.02 s"
    )
    told = warned({**changes, f"{section}.lag": 0.02})
    assert not any(each.startswith(section) for each in told if "lag: is" in each)
    ideal = warned({**changes, "actuation.kind": "ideal", f"{section}.lag": 0.02})
    assert f"{section}.lag" in [each.split(":")[0] for each in ideal]


@pytest.mark.parametrize(
    ("section", "kind", "sensor"),
    [
        ("attitude_control", "delay-aware", "rates"),
        ("position_control", "disturbance-observer", "tracking"),
        ("load_control", "adaptive", "load"),
        ("estimation", "predictor", "tracking"),
    ],
)
def test_a_delay_shorter_than_the_sensors(section, kind, sensor):
    periods = {
        f"timing.{layer}": 0.01
        for layer in ("attitude_control", "position_control", "load_control")
    }
    changes = {**periods, f"{section}.kind": kind, "sensing.kind": "noisy",
               f"sensing.{sensor}_delay": 0.03, f"{section}.delay": 0.02}  # fmt: skip
    text = next(each for each in warned(changes) if each.startswith(f"{section}.delay"))
    assert f"is 0.02 s, but sensing.{sensor}_delay is 0.03 s" in text
    longer = warned({**changes, f"{section}.delay": 0.03})
    assert not any(each.startswith(f"{section}.delay") for each in longer)


def test_sampling_bears_gains_up_to_two():
    """``J (Omega' - Omega) = -K dt Omega``: -1 per period at K dt / J = 2."""
    for ratio, growth in ((0.5, 0.5), (1.9, 0.9), (2.1, 1.1), (3.0, 2.0)):
        found = loop_growth(ratio, 1e-9, 1.0, period=1.0)
        assert found == pytest.approx(max(growth, 1.0), abs=1e-6)


@pytest.mark.parametrize(("delay", "lag"), [(0.0, 0.0), (0.012, 0.0), (0.0, 0.02), (0.017, 0.013)])
def test_the_growth_of_the_loop_is_that_of_a_simulation(delay, lag):
    """The same loop in steps of 0.1 ms: the biggest stable gain agrees."""
    dt, fine, J, slope = 0.005, 1e-4, 0.02, 10.0

    def grows(K):
        per, back = round(dt / fine), round(delay / fine)
        theta, Omega, torque, wanted = [1.0] * (back + 1), [0.0] * (back + 1), 0.0, 0.0
        keep = math.exp(-fine / lag) if lag else 0.0
        peaks = []
        for step in range(20_000):
            if step % per == 0:
                wanted = -K * (Omega[-1 - back] + 0.5 * slope * theta[-1 - back])
            torque = keep * torque + (1.0 - keep) * wanted
            Omega.append(Omega[-1] + fine * torque / J)
            theta.append(theta[-1] + fine * Omega[-1])
            peaks.append(abs(Omega[-1]))
            if peaks[-1] > 1e6:
                return True
        return max(peaks[-4000:]) > max(peaks[4000:8000])

    low, high = 0.0, 16.0
    for _ in range(12):
        middle = 0.5 * (low + high)
        unstable = loop_growth(middle, slope, J, period=dt, delay=delay, lag=lag) > 1.0
        low, high = (low, middle) if unstable else (middle, high)
    assert not grows(0.93 * low)
    assert grows(1.07 * high)


def test_gains_near_what_sampling_bears_are_warned_of_and_those_above_diverge():
    J = 0.02
    changes = {"load_control.kind": "pid", "drones.inertia": [J, J, J], "attitude_control.beta": [1e-6] * 3,
               "attitude_control.rho": [2.0] * 3, "timing.attitude_control": 0.01}  # fmt: skip

    def gain(ratio):
        return {**changes, "attitude_control.k_d": [ratio * J / 0.01] * 3}

    assert warned(gain(1.2)) == []
    (near,) = warned(gain(1.7))
    assert near.startswith(
        "attitude_control.k_d: K_d dt / J is 1.7 (axis x of drone 0, inertia 0.02"
    )
    assert "timing.attitude_control = 0.01 s" in near
    assert "1.4 times the gain would diverge" in near
    (above,) = warned(gain(2.2))
    assert "diverges; above 2" in above
    # And so it does, while what is not warned of flies.
    assert Flight(load_mission(HOVER, gain(1.2))).run().outcome == "completed"
    shaken = Flight(load_mission(HOVER, gain(2.2))).run()
    assert np.nanmax(np.abs(shaken["rates"])) > 100.0


def test_true_inertia_delay_and_lag_count():
    changes = {"attitude_control.rho": [24.0] * 3, "attitude_control.k_d": [0.8, 0.72, 1.44],
               "attitude_control.beta": [0.01] * 3}  # fmt: skip
    assert warned(changes) == []
    (light,) = warned({**changes, "truth.inertia_factor": 0.015})
    assert "truth.inertia_factor" in light
    late = {"sensing.kind": "noisy", "sensing.rates_delay": 0.05, "sensing.attitude_delay": 0.05}
    (delayed,) = warned({**changes, **late})
    assert "50 ms of delay (sensing)" in delayed
    slow = {"actuation.kind": "motors", "actuation.time_constant": 0.15}
    assert any("150 ms of motor lag (actuation)" in each for each in warned({**changes, **slow}))


def test_thin_thrust_and_what_is_really_carried():
    motors = {"actuation.kind": "motors", "attitude_control.k_d": [0.8] * 3, "attitude_control.rho": [24.0] * 3,
              "attitude_control.beta": [0.01] * 3}  # fmt: skip
    assert warned({**motors, "actuation.max_thrust": 1.6}) == []
    (thin,) = warned({**motors, "actuation.max_thrust": 1.45})
    assert thin.startswith("actuation.max_thrust: leaves 5.")
    assert "needs 5.462 N of its 5.8 N" in thin
    strong = {**motors, "actuation.max_thrust": 1.6}
    (heavy,) = warned({**strong, "truth.load_mass_factor": 4.0})
    assert heavy.startswith(
        "allocation.kind: with what the drones really weigh and carry (truth, events) the motors"
    )
    assert "motors give 6.4 N" in heavy
    (cables,) = warned({"truth.load_mass_factor": 10.0})
    assert "load's weight of 22.07 N is heavier than the 18.6" in cables
    event = {"events": [{"at": 1.0, "field": "load.mass", "value": 0.9}]}
    assert warned({**strong, **event}) == [heavy]
    assert warned({**strong, "truth.load_mass_factor": 1.5}) == []


def test_warnings_go_with_the_flight(tmp_path):
    windy = {"disturbance": [{"kind": "wind"}], "timing.duration": 0.2}
    run = colift.run(HOVER, overrides=windy)
    (text,) = run.recording.provenance["warnings"]
    assert "drag" in text
    saved = colift.Recording.load(run.recording.save(tmp_path / "r.h5"))
    assert saved.provenance["warnings"] == [text]
    shown = terminal.colift(
        "run", "windy-spiral", "--set", "timing.duration=0.2", "--set",
        'disturbance=[{kind="wind"}]', "--json", "--out", str(tmp_path / "out"),
    )  # fmt: skip
    assert json.loads(shown.stdout)["warnings"] == [text.replace("disturbance.1", "disturbance.0")]
    assert "warning: disturbance.0.kind" in shown.stderr
    assert "Warned before the flight" in (tmp_path / "out" / "report.html").read_text()
