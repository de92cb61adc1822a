"""Wind, gusts, turbulence and drag against analytic truths."""

from __future__ import annotations

import numpy as np
import pytest
from air_rig import Air

import colift
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.world.disturbance.drag import Drag
from colift.world.disturbance.dryden import Dryden
from colift.world.disturbance.gust import Gust
from colift.world.disturbance.wind import Wind

RHO = 1.225
CALM = {"load_area": 0.0, "drone_area": 0.0, "cable_diameter": 0.0}


# ---------------------------------------------------------------- wind and gusts


def test_wind_has_its_speed_and_heading_after_the_ramp():
    air = Air(Wind(speed=10.0, heading_deg=30.0, updraft=-1.0, ramp=2.0))
    np.testing.assert_array_equal(air.act(0)[0], 0.0)
    wanted = [10.0 * np.cos(np.pi / 6), 5.0, -1.0]
    np.testing.assert_allclose(air.act(1000)[0], np.divide(wanted, 2.0), rtol=1e-12)
    np.testing.assert_allclose(air.act(2000, wind=(1.0, 0.0, 0.0))[0] - [1.0, 0.0, 0.0], wanted)
    np.testing.assert_allclose(Air(Wind(ramp=0.0)).act(0)[0], [5.0, 0.0, 0.0])


def test_gust_is_one_minus_cosine():
    air = Air(Gust(peak=(4.0, 0.0, -2.0), at=1.0, duration=0.8))
    steps = np.arange(0, 3000, 10)
    winds = np.array([air.act(int(k))[0] for k in steps])
    since = steps * 0.001 - 1.0
    shape = np.where((since >= 0) & (since < 0.8), 0.5 - 0.5 * np.cos(2 * np.pi * since / 0.8), 0)
    np.testing.assert_allclose(winds, shape[:, None] * [4.0, 0.0, -2.0], atol=1e-12)
    assert winds[:, 0].max() == pytest.approx(4.0)


def test_repeated_gusts_come_once_in_each_interval():
    air = Air(Gust(peak=(4.0, 0.0, 0.0), at=1.0, duration=0.5, every=2.0))
    winds = np.array([air.act(k)[0][0] for k in range(0, 41000, 5)])
    assert (winds[: 1000 // 5] == 0.0).all()
    each = winds[1000 // 5 :].reshape(20, -1)
    peaks, begins = each.max(axis=1), np.argmax(each > 0.0, axis=1)
    assert (peaks > 0.0).all()
    assert peaks.max() <= 4.0
    assert np.ptp(peaks) > 1.0
    assert np.ptp(begins) * 0.005 > 0.5
    assert (np.count_nonzero(each, axis=1) * 0.005 <= 0.505).all()
    other = Air(air.part, key=8)
    assert max(other.act(k)[0][0] for k in range(1000, 3000, 5)) != pytest.approx(peaks[0])


# ---------------------------------------------------------------- turbulence

HEIGHT, SPEED = 30.0, 10.0


def dryden_scales(h):
    """MIL-F-8785C, low altitude, from its text: h in feet."""
    base = 0.177 + 0.000823 * h
    return h / base**1.2 * 0.3048, h * 0.3048, 0.1 * SPEED / base**0.4, 0.1 * SPEED


@pytest.fixture(scope="module", params=[0.1, 1.0], ids=["fine", "coarse"])
def turbulence(request):
    """Long flights at an airspeed of 10 m/s in steps of 0.1 s, and of about a time constant.

    The air blows past, so that these are steps of 1 ms at an airspeed 100 or 1000 times as high.
    """
    dt = request.param
    air = Air(Dryden(speed=SPEED))
    air.load[0, 2] = HEIGHT
    mean = np.array([SPEED * dt / air.dt, 0.0, 0.0])
    return dt, np.array([air.act(k, wind=mean)[0] - mean for k in range(150_000)])


def test_turbulence_has_the_standard_deviations_of_the_standard(turbulence):
    dt, gusts = turbulence
    L_u, _, sigma_u, sigma_w = dryden_scales(HEIGHT / 0.3048)
    periods = len(gusts) * dt * SPEED / L_u
    tolerance = 4.0 / np.sqrt(periods)
    np.testing.assert_allclose(gusts.std(axis=0), [sigma_u, sigma_u, sigma_w], rtol=tolerance)
    assert np.abs(gusts.mean(axis=0)).max() < 6.0 * sigma_u / np.sqrt(periods)
    correlation = np.corrcoef(gusts.T) - np.eye(3)
    assert np.abs(correlation).max() < 6.0 / np.sqrt(periods)


def test_turbulence_has_the_correlation_of_the_standard(turbulence):
    """Longitudinal exp(-s / L), across (1 - s / 2 L) exp(-s / L): the transforms of Dryden's spectra."""
    dt, gusts = turbulence
    L_u, L_w, *_ = dryden_scales(HEIGHT / 0.3048)
    tolerance = 6.0 / np.sqrt(len(gusts) * dt * SPEED / L_u)
    for lag in (1, 2, 5, 10, 40):
        s = lag * dt * SPEED
        across = [(1.0 - 0.5 * s / length) * np.exp(-s / length) for length in (L_u, L_w)]
        wanted = [np.exp(-s / L_u), *across]
        found = (gusts[lag:] * gusts[:-lag]).mean(axis=0) / gusts.var(axis=0)
        np.testing.assert_allclose(found, wanted, atol=tolerance)


@pytest.mark.parametrize("turbulence", [0.1], indirect=True, ids=["fine"])
def test_turbulence_has_the_spectrum_of_the_standard(turbulence):
    dt, gusts = turbulence
    L_u, L_w, sigma_u, sigma_w = dryden_scales(HEIGHT / 0.3048)
    pieces = gusts.reshape(-1, 2500, 3) * np.hanning(2500)[:, None]
    power = np.mean(np.abs(np.fft.rfft(pieces, axis=1)) ** 2, axis=0)
    power *= dt / (np.sum(np.hanning(2500) ** 2) * np.pi)  # one-sided, per rad/s
    omega = 2.0 * np.pi * np.fft.rfftfreq(2500, dt)
    x_u, x_w = (length * omega / SPEED for length in (L_u, L_w))
    wanted = np.column_stack([
        sigma_u**2 * 2.0 * L_u / (np.pi * SPEED) / (1.0 + x_u**2),
        sigma_u**2 * L_u / (np.pi * SPEED) * (1.0 + 3.0 * x_u**2) / (1.0 + x_u**2) ** 2,
        sigma_w**2 * L_w / (np.pi * SPEED) * (1.0 + 3.0 * x_w**2) / (1.0 + x_w**2) ** 2,
    ])  # fmt: skip
    for low, high in ((0.1, 0.2), (0.2, 0.5), (0.5, 1.0), (1.0, 3.0)):
        band = (omega >= low) & (omega < high)
        ratio = power[band].sum(axis=0) / wanted[band].sum(axis=0)
        np.testing.assert_allclose(ratio, 1.0, atol=6.0 / np.sqrt(60 * np.count_nonzero(band)))


def test_turbulence_begins_stationary_and_turns_with_its_heading():
    first = np.array([Air(Dryden(), key=key).act()[0] for key in range(4000)])
    again = np.array([Air(Dryden(heading_deg=90.0), key=key).act()[0] for key in range(4000)])
    np.testing.assert_allclose(again[:, 1], first[:, 0], atol=1e-12)
    np.testing.assert_allclose(again[:, 0], -first[:, 1], atol=1e-12)
    base = (0.177 + 0.00823) ** 0.4
    np.testing.assert_allclose(first.std(axis=0), [0.5 / base, 0.5 / base, 0.5], rtol=0.05)


def test_turbulence_is_the_same_in_one_stretch_or_many():
    table = {"name": "t", "reference": {"kind": "hover"}, "timing": {"duration": 0.2}, "seed": 5}
    table["disturbance"] = [{"kind": "drag"}, {"kind": "dryden"}, {"kind": "wind", "ramp": 0.0}]
    whole = Flight(load_mission(table)).run()
    flight = Flight(load_mission(table))
    for _ in range(20):
        flight.advance(0.01)
    flight.advance(0.001)
    np.testing.assert_array_equal(whole["wind"], flight.recording()["wind"])
    np.testing.assert_array_equal(whole["external_forces"], flight.recording()["external_forces"])
    assert np.ptp(whole["wind"], axis=0).min() > 1e-3
    other = Flight(load_mission(table, {"seed": 6})).run()
    assert np.abs(whole["wind"] - other["wind"]).max() > 0.01


# ---------------------------------------------------------------- drag


def test_drag_follows_the_square_of_the_relative_wind():
    air = Air(Drag(drone_area=0.02, load_area=0.01, cable_diameter=0.0))
    air.velocities[0] = [1.0, 0.0, 0.0]
    forces = air.act(wind=(4.0, 4.0, 0.0))[1]
    np.testing.assert_allclose(forces[0], 0.5 * RHO * 0.02 * 5.0 * np.array([3.0, 4.0, 0.0]))
    np.testing.assert_allclose(forces[1], 0.5 * RHO * 0.01 * 32**0.5 * np.array([4.0, 4.0, 0.0]))


def test_linear_drag_and_rotor_drag():
    part = Drag(**CALM, drone_linear=0.3, load_linear=0.2, rotor_drag=0.05)
    air = Air(part)
    air.thrusts[:] = 6.0
    air.attitudes[0] = [np.cos(0.2), 0.0, np.sin(0.2), 0.0]  # 0.4 rad about y
    forces = air.act(wind=(2.0, 1.0, 0.0))[1]
    axis = np.array([np.sin(0.4), 0.0, np.cos(0.4)])
    wind = np.array([2.0, 1.0, 0.0])
    wanted = 0.3 * wind + 0.05 * 6.0 * (wind - (wind @ axis) * axis)
    np.testing.assert_allclose(forces, [wanted, 0.2 * wind])


def test_a_falling_load_reaches_its_terminal_velocity():
    """All cables cut: v = v_t tanh(g t / v_t) with v_t = sqrt(2 m g / (rho C_d A))."""
    table = {"name": "t", "reference": {"kind": "hover"}, "timing": {"duration": 3.0}}
    table["disturbance"] = [{"kind": "drag", "load_area": 0.02}]
    table["fault"] = [{"kind": "load-released", "at": 0.0}]
    table["start"] = {"cone_deg": 60.0}
    table["world"] = {"ground": "none"}
    r = colift.run(table).recording
    terminal = np.sqrt(2.0 * 0.225 * 9.81 / (RHO * 0.02))
    np.testing.assert_allclose(
        -r["load"][:, 1, 2], terminal * np.tanh(9.81 * r.time / terminal), atol=0.02
    )
    assert -r["load"][-1, 1, 2] > 0.95 * terminal


def test_cable_drag_by_quadrature():
    """Cross-flow drag along a moving cable, and its shares by the lever rule, by a fine sum."""
    rng = np.random.default_rng(3)
    air = Air(Drag(load_area=0.0, drone_area=0.0, cable_diameter=0.004, cable_coefficient=1.1))
    air.positions[0] = [0.4, -0.3, 0.8]
    air.stretch()
    air.velocities[:], air.load[1] = rng.normal(size=(1, 3)), rng.normal(size=3)
    wind = np.array([9.0, 2.0, -1.0])
    forces = air.act(wind=wind)[1]
    alpha, length = air.directions[0], np.linalg.norm(air.positions[0])
    s = (np.arange(2000) + 0.5) / 2000
    past = wind - np.outer(1 - s, air.velocities[0]) - np.outer(s, air.load[1])
    past -= np.outer(past @ alpha, alpha)
    density = 0.5 * RHO * 1.1 * 0.004 * np.linalg.norm(past, axis=1)[:, None] * past
    at_load = length * np.mean(s[:, None] * density, axis=0)
    at_drone = length * np.mean((1 - s)[:, None] * density, axis=0)
    np.testing.assert_allclose(forces, [at_drone, at_load], rtol=1e-5, atol=1e-9)
    assert np.abs(forces @ alpha).max() < 1e-12
    air.attached[:] = 0.0
    np.testing.assert_array_equal(air.act(wind=wind)[1], 0.0)


def test_drag_takes_energy_from_whatever_moves_in_still_air():
    rng = np.random.default_rng(1)
    air = Air(Drag(drone_linear=0.1, rotor_drag=0.03), n=3)
    for _ in range(50):
        air.positions[:] = rng.normal(size=(3, 3)) + [0.0, 0.0, 2.0]
        air.stretch()
        air.velocities[:], air.load[1] = rng.normal(size=(3, 3)), rng.normal(size=3)
        air.thrusts[:] = rng.uniform(0.0, 8.0, 3)
        forces = air.act()[1]
        assert np.sum(forces[:3] * air.velocities) + forces[3] @ air.load[1] < 0.0


def test_all_winds_come_before_what_they_drive():
    """The order in the mission does not matter between wind and drag."""
    table = {"name": "t", "reference": {"kind": "hover"}, "timing": {"duration": 0.05}}
    parts = [{"kind": "drag"}, {"kind": "wind", "ramp": 0.0}]
    runs = [colift.run({**table, "disturbance": order}).recording for order in (parts, parts[::-1])]
    np.testing.assert_array_equal(runs[0]["external_forces"], runs[1]["external_forces"])
    assert runs[0]["external_forces"][0, :, 0].min() > 0.05
