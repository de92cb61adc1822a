"""Named places in the vectors of kernels."""

from __future__ import annotations

import numpy as np
import pytest

from colift import part
from colift.kernel.layout import Layout

LAYOUT = Layout(team={"g": 1, "k_p": 3}, drone={"m": 1, "J": 3})


def test_places_follow_from_the_table():
    P = LAYOUT.at
    assert (P.g, P.k_p, P.rows, P.m, P.J, P.width) == (0, 1, 4, 0, 1, 4)
    assert [LAYOUT.size(n) for n in (0, 1, 5)] == [4, 8, 24]


def test_what_is_packed_is_found_by_name():
    J = np.arange(6.0).reshape(2, 3)
    packed = LAYOUT.pack(2, g=9.81, k_p=(1.0, 2.0, 3.0), m=[0.5, 0.7], J=J)
    np.testing.assert_array_equal(packed, [9.81, 1, 2, 3, 0.5, 0, 1, 2, 0.7, 3, 4, 5])
    np.testing.assert_array_equal(LAYOUT.view(packed, "k_p"), [1, 2, 3])
    np.testing.assert_array_equal(LAYOUT.view(packed, "m"), [[0.5], [0.7]])
    LAYOUT.view(packed, "J")[1] = 7.0  # a view, not a copy
    np.testing.assert_array_equal(packed[-3:], 7.0)
    alike = LAYOUT.pack(3, g=1.0, k_p=2.0, m=0.5, J=(1.0, 2.0, 3.0))
    np.testing.assert_array_equal(LAYOUT.view(alike, "J"), np.tile([1.0, 2.0, 3.0], (3, 1)))


def test_a_value_that_is_missing_or_unknown_is_named():
    with pytest.raises(TypeError, match="J, mass"):
        LAYOUT.pack(1, g=1.0, k_p=0.0, m=0.5, mass=0.5)


def test_who_stays_keeps_its_row():
    old = LAYOUT.pack(3, g=1.0, k_p=2.0, m=[0.1, 0.2, 0.3], J=4.0)
    kept = LAYOUT.carry_over(old, LAYOUT.zeros(3), np.array([2, -1, 0]))
    np.testing.assert_array_equal(LAYOUT.view(kept, "m")[:, 0], [0.3, 0.0, 0.1])
    np.testing.assert_array_equal(LAYOUT.view(kept, "k_p"), 2.0)
    team = Layout(team={"integral": 3})
    assert (team.carry_over(np.ones(3), np.zeros(3), np.array([0])) == 1.0).all()


EVERY = [(layer, name) for layer in part.LAYERS for name in part.names(layer)]


@pytest.mark.parametrize(("layer", "name"), EVERY, ids="/".join)
def test_the_memory_of_a_part_is_as_long_as_its_layout(layer, name):
    found = part.find(layer, name)
    if found.missing():
        pytest.skip(found.missing())
    if found.remembers.size(1):
        for n in (1, 4):
            team = part.Team.uniform(n)
            assert found().memory(team).size == found.remembers.size(n)
