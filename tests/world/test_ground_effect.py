"""Thrust near the ground: the formula's numbers, its limit, and where it is left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from air_rig import Air

from colift.errors import MissionError
from colift.mission import load_mission
from colift.team import Ground, Team
from colift.world.disturbance.ground_effect import GroundEffect


def lifted(height, *, ground=0.0, attitude=(1.0, 0.0, 0.0, 0.0)):
    """Extra force on a drone of 10 N of thrust whose rotors, of 0.2 m radius, are 0.05 m above its centre."""
    team = replace(Team.uniform(1), ground=Ground(ground))
    air = Air(GroundEffect(rotor_radius=0.2, rotor_height=0.05), team=team)
    air.positions[0] = [3.0, -2.0, height - 0.05]
    air.attitudes[0] = attitude
    air.thrusts[0] = 10.0
    return air.act()[1]


@pytest.mark.parametrize(
    ("radii", "share"), [(0.5, 4.0 / 3.0), (1.0, 16.0 / 15.0), (2.0, 64.0 / 63.0), (20.0, 1.00016)]
)
def test_thrust_is_that_of_cheeseman_and_bennett(radii, share):
    np.testing.assert_allclose(lifted(0.2 * radii)[0], [0.0, 0.0, 10.0 * (share - 1.0)], atol=1e-4)


def test_it_is_held_below_half_a_radius_and_counts_from_the_ground():
    np.testing.assert_array_equal(lifted(0.06), lifted(0.1))
    np.testing.assert_allclose(lifted(5.2, ground=5.0), lifted(0.2))


def test_a_tilted_drone_is_pushed_along_its_thrust_and_one_upside_down_is_not():
    c, s = np.cos(0.2), np.sin(0.2)
    x, y, z = lifted(1.0, attitude=(c, 0.0, s, 0.0))[0]
    assert x / z == pytest.approx(np.tan(0.4))
    assert y == 0.0
    np.testing.assert_array_equal(lifted(1.0, attitude=(0.0, 1.0, 0.0, 0.0)), 0.0)


def test_it_needs_a_ground():
    air = {"disturbance": [{"kind": "ground-effect"}], "world.ground": "none"}
    with pytest.raises(MissionError, match=r"disturbance\.0\.kind.*needs a ground"):
        load_mission("hover", air)
