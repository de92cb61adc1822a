"""The rotors' wake: momentum theory at the disc and far below, geometry, and what it adds to drag."""

from __future__ import annotations

import numpy as np
import pytest
from air_rig import Air

from colift.world.disturbance.downwash import Downwash, speed_at

RHO, RADIUS, THRUST = 1.225, 0.1, 6.0
DISC = 2.0 * RADIUS  # one disc as large as four rotors
INDUCED = np.sqrt(THRUST / (2.0 * RHO * np.pi * DISC**2))
CORE = 6.0 * np.sqrt(2.0) * DISC


def below(part, depth, off=0.0):
    """A drone high above a load at this depth and distance off its axis; forces on both."""
    air = Air(part)
    air.thrusts[:] = THRUST
    air.positions[0] = [off, 0.0, depth]
    air.stretch()
    return air.act()[1]


@pytest.mark.parametrize("depth", [8.0 * DISC, CORE, 2.0 * CORE, 5.0 * CORE])
def test_the_far_wake_carries_the_momentum_of_the_thrust(depth):
    """rho times the integral of V^2 over a section is the thrust (momentum theory: f = 2 rho A v_i^2)."""
    r = np.linspace(0.0, 6.0 * DISC * max(1.0, depth / CORE), 20_000)
    speed = np.array([speed_at(depth, x, INDUCED, DISC) for x in r])
    flux = RHO * 2.0 * np.pi * np.trapezoid(speed**2 * r, r)
    growth = 0.5 * (1.0 + depth / np.hypot(depth, DISC))  # the last of the pressure becomes speed
    assert flux == pytest.approx(THRUST * growth**2, rel=1e-3)
    assert growth > 0.99


def test_speed_on_the_axis():
    assert speed_at(1e-9, 0.0, INDUCED, DISC) == pytest.approx(INDUCED)
    assert speed_at(7.0 * DISC, 0.0, INDUCED, DISC) == pytest.approx(2.0 * INDUCED, rel=0.01)
    far = [speed_at(k * CORE, 0.0, INDUCED, DISC) for k in (4.0, 8.0)]
    assert far[1] / far[0] == pytest.approx(0.5, rel=1e-3)
    assert speed_at(-0.1, 0.0, INDUCED, DISC) == 0.0


def test_the_load_below_is_pushed_down_by_its_drag():
    force = below(Downwash(load_area=0.01, cable_diameter=0.0), 1.0)[1]
    speed = speed_at(1.0, 0.0, INDUCED, DISC)
    np.testing.assert_allclose(force, [0.0, 0.0, -0.5 * RHO * 0.01 * speed**2], atol=1e-12)
    away = below(Downwash(load_area=0.01, cable_diameter=0.0), 1.0, off=0.6)[1]
    assert 0.0 < -away[2] < 1e-3 * -force[2]


def test_a_lower_drone_is_pushed_an_upper_one_is_not():
    air = Air(Downwash(drone_area=0.02, cable_diameter=0.0, load_area=0.0), n=2)
    air.positions[:] = [[0.0, 0.0, 3.0], [0.0, 0.05, 2.0]]
    air.thrusts[:] = [THRUST, 0.0]
    forces = air.act()[1]
    speed = speed_at(1.0, 0.05, INDUCED, DISC)
    np.testing.assert_allclose(forces[1], [0.0, 0.0, -0.5 * RHO * 0.02 * speed**2], atol=1e-12)
    np.testing.assert_array_equal(forces[[0, 2]], 0.0)


def test_a_cable_across_the_wake_by_quadrature():
    """A slanted cable, its drag across the line, shared by the lever rule."""
    air = Air(Downwash(drone_area=0.0, load_area=0.0, cable_diameter=0.004, cable_coefficient=1.0))
    air.positions[0], air.thrusts[0] = [-0.5, 0.0, 0.8], THRUST
    air.stretch()
    forces = air.act()[1]
    alpha, length = air.directions[0], np.linalg.norm(air.positions[0])
    s = (np.arange(4000) + 0.5) / 4000
    points = air.positions[0] + np.outer(s * length, alpha)
    speed = [
        speed_at(0.8 - p[2], abs(p[0] + 0.5), INDUCED, DISC) for p in points
    ]  # fmt: skip
    down = np.array([0.0, 0.0, -1.0])
    across = down - (down @ alpha) * alpha
    density = 0.5 * RHO * 0.004 * np.outer(np.square(speed), np.linalg.norm(across) * across)
    wanted = [length * np.mean((w[:, None]) * density, axis=0) for w in (1 - s, s)]
    np.testing.assert_allclose(forces, wanted, rtol=0.05, atol=1e-5)
    assert np.abs(forces @ alpha).max() < 1e-12
    air.attached[:] = 0.0
    np.testing.assert_array_equal(air.act()[1], 0.0)


def test_wind_carries_the_wake_away():
    air = Air(Downwash(load_area=0.01, cable_diameter=0.0))
    air.positions[0], air.thrusts[0] = [0.0, 0.0, 1.0], THRUST
    calm = air.act()[1][1]
    wind = np.array([8.0, 0.0, 0.0])
    assert np.abs(air.act(wind=wind)[1][1]).max() < 1e-3 * np.abs(calm).max()
    air.positions[0] = [-8.0 / (2.0 * INDUCED), 0.0, 1.0]  # upwind by as much as it drifts
    assert np.abs(air.act(wind=wind)[1][1]).max() > 0.3 * np.abs(calm).max()


def test_no_thrust_no_wake():
    air = Air(Downwash(), n=3)
    air.positions[:] = [[0.0, 0.0, 1.0], [0.0, 0.1, 2.0], [0.1, 0.0, 3.0]]
    air.stretch()
    np.testing.assert_array_equal(air.act(wind=(3.0, 0.0, 0.0))[1], 0.0)
