"""What chance does is a function of time: it does not change with the physics step."""

from __future__ import annotations

import numpy as np
import pytest
from air_rig import Air
from numpy.testing import assert_array_equal

from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.team import Team
from colift.world.actuation.motors import Motors
from colift.world.disturbance.dryden import Dryden
from colift.world.disturbance.gust import Gust
from colift.world.link.radio import Radio
from colift.world.sensing.noisy import Noisy

STEPS = (0.0005, 0.001, 0.002)
TIMES = 0.01 * np.arange(101)


@pytest.mark.parametrize(
    "part",
    [Dryden(speed=8.0), Gust(peak=(4.0, 1.0, 0.0), at=0.1, duration=0.05, every=0.15)],
    ids=["dryden", "gust"],
)
def test_wind(part):
    histories = []
    for dt in STEPS:
        air, every = Air(part, dt=dt), round(0.01 / dt)
        air.load[0, 2] = 30.0
        winds = np.array([air.act(k)[0] for k in range(round(1.0 / dt) + 1)])
        histories.append(winds[::every])
    assert np.ptp(histories[0], axis=0)[0] > 0.02
    for other in histories[1:]:
        np.testing.assert_allclose(other, histories[0], rtol=0.0, atol=1e-10)


def test_motors():
    """Within rounding: thrust less command is the noise alone."""
    part, histories = Motors(noise=0.05), []
    for dt in STEPS:
        team = Team.uniform(2)
        memory, rows = part.memory(team), []
        for k in range(round(1.0 / dt) + 1):
            acting, _ = part.call(team, memory, step=k, key=5, dt=dt, thrusts=np.full(2, 6.0))
            rows.append([*acting.applied_thrusts, *acting.applied_torques.ravel()])
        histories.append(np.array(rows)[:: round(0.01 / dt)])
    assert histories[0][:, 0].std() > 0.05
    for other in histories[1:]:
        np.testing.assert_allclose(other, histories[0], rtol=0.0, atol=1e-13)


def test_sensors():
    """Bias, noise and losses are those of the sample's number."""
    timing = {
        "attitude_period": 0.002,
        "rates_period": 0.004,
        "rates_dropout": 0.3,
        "specific_force_period": 0.01,
    }
    part = Noisy(
        **timing, load_period=0.01, tracking_period=0.01, tracking_dropout=0.2, position_bias=0.01,
        load_view=0.02, push_view=0.1,
    )  # fmt: skip
    steady = "load_views"
    n, histories, ages, views = 2, [], [], []
    for dt in STEPS:
        team, rows, old = Team.uniform(n), [], []
        memory, measured = part.memory(team), {}
        upright = np.tile([1.0, 0.0, 0.0, 0.0], (n, 1))
        for k in range(round(1.0 / dt) + 1):
            read, _ = part.call(team, memory, step=k, key=11, dt=dt, attitudes=upright, **measured)
            measured = read._asdict()
            old.append(measured["measured_ages"].copy())
            samples = (
                m.ravel()
                for name, m in measured.items()
                if not name.endswith("_ages") and name != steady
            )
            rows.append(np.concatenate([*samples]))
        views.append(measured[steady])
        histories.append(np.array(rows)[:: round(0.01 / dt)])
        ages.append(np.array(old)[:: round(0.01 / dt)])
    # Delays of 7 and 1 ms are no multiples of 2 ms: they are rounded to 8 and 2 ms, before the next row.
    for other in histories[1:]:
        assert_array_equal(other, histories[0])
    for other in views[1:]:
        assert_array_equal(other, views[0])
    assert (views[0] != 0.0).all()
    for other in ages[1:]:  # counted up step by step
        np.testing.assert_allclose(other, ages[0], rtol=0.0, atol=1e-13)
    assert (np.diff(histories[0], axis=0) != 0.0).any(axis=0).all()


def test_radio():
    part, histories = Radio(period=0.01, delay=0.002, jitter=0.004, loss=0.3), []
    for dt in STEPS:
        team, rows, tensions = Team.uniform(2), [], np.zeros(2)
        memory = part.memory(team)
        for k in range(round(1.0 / dt) + 1):
            part.call(
                team, memory, step=k, key=3, dt=dt, desired_tensions=np.full(2, k * dt),
                received_tensions=tensions,
            )  # fmt: skip
            rows.append(tensions.copy())
        histories.append(np.array(rows)[:: round(0.01 / dt)])
    lost = np.diff(histories[0], axis=0) == 0.0
    assert 0.2 < lost.mean() < 0.4
    for other in histories[1:]:
        np.testing.assert_allclose(other, histories[0], atol=1e-12)


def mission(step, **changes):
    table = {
        "name": "t", "reference": {"kind": "hover"}, "seed": 3,
        "timing": {
            "duration": 1.0, "step": step, "recording": 0.01, "load_control": 0.002,
            "allocation": 0.002, "position_control": 0.002, "attitude_control": 0.002,
        },
        "sensing": {
            "kind": "noisy", "load_delay": 0.008, "tracking_delay": 0.008, "attitude_period": 0.002,
            "rates_period": 0.002, "rates_delay": 0.002, "load_period": 0.01, "tracking_period": 0.01,
        },
        "link": {"kind": "radio", "jitter": 0.0, "delay": 0.004, "loss": 0.1},
        "actuation": {"kind": "motors", "noise": 0.03}, "plant": {"kind": "rigid-cables"},
        "disturbance": [
            {"kind": "wind", "speed": 6.0, "ramp": 0.0}, {"kind": "dryden", "speed": 6.0},
            {"kind": "gust", "every": 0.4, "duration": 0.3, "at": 0.0}, {"kind": "drag"},
        ],
    }  # fmt: skip
    return load_mission(table, changes)


TOLD = {"lag": 0.02, "delay": 0.02, "period": 0.01}
COPING = {
    "estimation": {"kind": "predictor", "lag": 0.02, "delay_from": "told"},
    "load_control": {"kind": "adaptive", **TOLD},
    "allocation": {"kind": "safe", "max_rate": 0.5},
    "position_control": {"kind": "disturbance-observer", **TOLD},
    "attitude_control": {"kind": "delay-aware", **TOLD},
}
"""Controllers that cope with the motors and delays of this flight, so that no cable pushes and no motor saturates."""


def test_a_whole_flight():
    """The errors of the sensors are the same; the rest differs as the integrator does, in proportion to the step.

    The airspeed, at which turbulence blows past, is the flight's, so the wind differs a little with it.
    """
    flights = {step: Flight(mission(step, **COPING)).run() for step in STEPS}
    other_seed = Flight(mission(0.001, seed=4, **COPING)).run()
    for name, share in (("wind", 2e-4), ("load", 0.1), ("applied_thrusts", 0.3)):
        fine = flights[STEPS[0]][name]
        by_chance = np.abs(other_seed[name] - fine).max()
        apart = [flights[step][name] - fine for step in STEPS[1:]]
        assert max(np.abs(each).max() for each in apart) < share * by_chance, name
        # The first tenth of a second is the first command's.
        by_step = [np.abs(each[10:]).max() for each in apart]
        in_proportion = (STEPS[2] - STEPS[0]) / (STEPS[1] - STEPS[0])
        assert by_step[1] / by_step[0] == pytest.approx(in_proportion, rel=0.15), name
    # Sampled every 10 ms, 8 ms late: a row sees the sample of the row before.
    errors = [f["measured_load"][1:] - f["load"][:-1] for f in flights.values()]
    for other in errors[1:]:
        np.testing.assert_allclose(other, errors[0], atol=1e-12)
    assert errors[0][:, 0].std() > 5e-4
