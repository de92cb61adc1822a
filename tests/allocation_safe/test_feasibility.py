"""Formations, widest angles, hover margins and the errors that name two limits."""

from __future__ import annotations

import math

import numpy as np
import pytest

from colift.allocation._feasibility import (
    feasibility,
    most_cables,
    spread_formation,
    widest_angle,
)
from colift.allocation.safe import Safe, SafeAllocator
from colift.geometry import pairwise_angles
from colift.team import Team

WIDEST = {  # degrees, best found, for cones of 45, 60 and 75 degrees
    2: (90.0, 120.0, 150.0),
    3: (75.5, 97.2, 113.6),
    4: (60.0, 75.5, 86.2),
    5: (49.1, 61.2, 75.0),
    6: (45.0, 60.0, 69.2),
    7: (41.4, 51.3, 58.4),
    8: (35.7, 45.0, 53.9),
    12: (28.2, 36.8, 43.5),
    16: (23.7, 31.0, 37.5),
}


@pytest.mark.parametrize("n", WIDEST)
def test_widest_angles(n):
    found = [math.degrees(widest_angle(n, math.radians(cone))) for cone in (45.0, 60.0, 75.0)]
    np.testing.assert_allclose(found, WIDEST[n], atol=0.15)


@pytest.mark.parametrize("n", [1, 2, 5, 7, 9, 16, 24])
def test_a_spread_formation_keeps_its_promises(n):
    cone = math.radians(70.0)
    least = 0.9 * widest_angle(n, cone) if n > 1 else 1.0
    directions = spread_formation(n, cone, least)
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0, atol=1e-12)
    assert (-directions[:, 2] >= math.cos(cone) - 1e-9).all()
    if n > 1:
        assert pairwise_angles(directions).min() >= least


def test_a_formation_that_does_not_exist_names_both_limits():
    with pytest.raises(ValueError, match="min_angle 60 deg conflicts with cone 45 deg"):
        spread_formation(8, math.radians(45.0), math.radians(60.0))


@pytest.mark.parametrize(
    ("settings", "names"),
    [
        ({"n": 8, "min_angle_deg": 60.0, "max_cone_deg": 45.0}, "min_angle_deg.*max_cone_deg"),
        ({"tension_min": 5.0, "tension_max": 4.0}, "tension_min.*tension_max"),
        ({"n": 2, "tension_max": 0.9}, "tension_max.*weight"),
        ({"tension_min": 3.0}, "tension_min.*weight"),
        ({"max_thrust": 5.0}, "max_thrust.*drones.mass"),
        ({"weights": [1.0, 2.0]}, "2 values"),
    ],
)
def test_limits_that_conflict_are_named(settings, names):
    with pytest.raises(ValueError, match=names):
        SafeAllocator(**settings)


def test_hover_margins_are_those_of_the_geometry():
    found = feasibility(Team.uniform(4), Safe())
    assert found.ok
    cone = math.asin(math.sin(math.radians(15.0)) / math.sin(math.radians(45.0)))
    assert found.heaviest == pytest.approx(20.0 * math.cos(cone), rel=2e-3)
    assert found.lightest == pytest.approx(0.2 * math.cos(math.radians(75.0)), rel=2e-2)
    assert found.margin == pytest.approx(found.heaviest / (0.225 * 9.81))
    assert found.tensions @ found.directions == pytest.approx([0.0, 0.0, -0.225 * 9.81], abs=1e-8)


def test_a_load_beyond_the_margin_is_a_conflict():
    found = feasibility(Team.uniform(4, load_mass=1.95), Safe())
    assert not found.ok
    assert found.margin < 1.0
    assert "weight" in found.conflicts[0]


@pytest.mark.parametrize(("angle", "cone", "least"), [(30, 60, 16), (30, 45, 10), (59, 60, 6)])
def test_the_number_of_cables_that_an_angle_allows(angle, cone, least):
    found, bound = most_cables(math.radians(angle), math.radians(cone))
    assert least <= found <= bound
    assert math.degrees(widest_angle(found + 1, math.radians(cone))) < angle
    directions = spread_formation(found, math.radians(cone), math.radians(angle))
    assert np.degrees(pairwise_angles(directions).min()) >= angle
