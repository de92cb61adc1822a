"""Named places in the vectors of kernels."""

from __future__ import annotations

import numpy as np
import pytest

from colift import part
from colift.kernel.layout import Layout
from colift.kernel.math.columns import column

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


def test_a_name_stands_once():
    for wrong in ({"g": 1}, {"rows": 1}, {"width": 1}):
        with pytest.raises(ValueError, match="duplicate"):
            Layout(team={"g": 1}, drone=wrong)


def test_an_open_size_hides_what_stands_behind_it_until_it_is_filled_in():
    memory = Layout(team={"started": 1}, drone={"bias": 3, "queue": None, "last": 1})
    assert memory.at._asdict() == {"started": 0, "rows": 1, "bias": 0, "queue": 3}
    with pytest.raises(AttributeError, match="width"):
        memory.zeros(2)
    whole = memory.filled(queue=5)
    assert (whole.at.queue, whole.at.last, whole.at.width) == (3, 8, 9)
    assert whole.size(2) == 19
    for wrong in ({}, {"queue": 5, "last": 1}):
        with pytest.raises(TypeError, match=r"last|queue"):
            memory.filled(**wrong)


def test_columns_share_the_vector_out():
    table = Layout(team={"g": 2}, drone={"T": 1, "alpha": 3})
    vector = np.arange(float(table.size(3)))
    T = column(vector, table.at.rows, 3, table.spans.T)
    alpha = column(vector, table.at.rows, 3, table.spans.alpha)
    np.testing.assert_array_equal(np.concatenate([vector[:2], T, alpha]), vector)
    assert T.size == 3


def test_what_stands_behind_the_rows_is_not_carried_over():
    old, fresh = np.ones(LAYOUT.size(3) + 2), np.zeros(LAYOUT.size(2) + 2)
    kept = LAYOUT.carry_over(old, fresh, np.array([2, 0]))
    np.testing.assert_array_equal(kept, [1.0] * LAYOUT.size(2) + [0.0] * 2)


def test_sensors_of_other_delays_keep_what_is_on_its_way():
    part_of = part.find("sensing", "noisy")(load_delay=0.05, rates_delay=0.02)
    layout, team = part_of.layout(), part.Team.uniform(3)
    old = part_of.memory(team)
    layout.view(old, "load_samples")[:] = 1.0
    layout.view(old, "rates_samples")[2] = 2.0
    kept = part_of.carry_over(old, part_of.memory(part.Team.uniform(2)), np.array([0, 2]))
    assert (layout.view(kept, "load_samples") == 1.0).all()
    np.testing.assert_array_equal(layout.view(kept, "rates_samples")[:, 0], [0.0, 2.0])


EVERY = [(layer, name) for layer in part.LAYERS for name in part.names(layer)]


@pytest.mark.parametrize(("layer", "name"), EVERY, ids="/".join)
def test_the_memory_of_a_part_is_as_long_as_its_layout(layer, name):
    found = part.find(layer, name)
    if found.missing():
        pytest.skip(found.missing())
    layout = found().layout()
    if layout.size(1):
        for n in (1, 4):
            assert found().memory(part.Team.uniform(n)).size == layout.size(n)
