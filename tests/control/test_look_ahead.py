"""What is planned of a thrust vector, told to attitude and motors ahead of time."""

from __future__ import annotations

import numpy as np

from colift.control.position_control._aim import AHEAD, AIM_ALONG, aim_along, look_ahead

DT = 1e-3


def thrust(t):
    """Leans by up to 60 degrees while its size falls to a third and rises again."""
    lean, way = 0.5 + 0.5 * np.sin(12.0 * t), 3.0 * t
    axis = np.array([np.sin(lean) * np.cos(way), np.sin(lean) * np.sin(way), np.cos(lean)])
    return (1.0 + 0.6 * np.sin(9.0 * t)) * axis


def test_planned_angular_acceleration_is_the_change_of_the_planned_rate():
    """Also where the thrust changes its size, and where the body turns about its axis."""
    aimed, ahead = np.zeros(AIM_ALONG), np.zeros(AHEAD)
    thrusts, attitudes, rates, turning = (np.zeros(shape) for shape in (1, (1, 4), (1, 3), (1, 3)))
    told, wanted, sizes = [], [], []
    times = np.arange(0.0, 1.5, DT)
    for k, t in enumerate(times):
        p = thrust(t)
        size = np.linalg.norm(p)
        aim_along(0, k == 0, DT, 0.9, p, p[None], size, aimed, 0, thrusts, attitudes, rates)
        more = look_ahead(0, k == 0, DT, 0.1, 0.0, 1.0, p, ahead, 0, attitudes, rates, turning)
        told.append(rates[0].copy())
        wanted.append(turning[0].copy())
        sizes.append(size + more)
    by_difference = np.diff(told, axis=0)[10:, :2] / DT
    # Rates are those of the middle of the last period, so their differences those of its end; what is told is of the middle of the next one.
    later = 0.5 * (by_difference[1:] + by_difference[:-1])
    asked = np.array(wanted)[10:, :2]
    scale = np.abs(by_difference).max()
    assert scale > 70.0
    # Axes and speeds are those of the beginning: within half a period bodies turn by hundredths.
    assert np.abs(asked[: len(later)] - later).max() < 0.02 * scale
    means = [np.linalg.norm(thrust(t + 0.5 * DT)) for t in times]
    np.testing.assert_allclose(sizes[10:], means[10:], rtol=1e-4)
