"""The object that calls an allocator by hand: validation, settings, repeatability."""

from __future__ import annotations

import numpy as np
import pytest

from colift.control.allocation.base import Allocator, Status
from colift.control.allocation.ring import Ring
from colift.control.allocation.sqp import Sqp, SqpAllocator
from colift.errors import SettingError
from colift.team import Team
from colift.team.geometry import ring

HOVER = [0.0, 0.0, 2.2]


def state(allocator: Allocator) -> tuple[bytes, ...]:
    return (
        allocator._tensions.tobytes(),
        allocator._directions.tobytes(),
        allocator._params.tobytes(),
        allocator._memory.tobytes(),
        repr(allocator.part).encode(),
    )


@pytest.fixture
def flown() -> SqpAllocator:
    allocator = SqpAllocator(n=4)
    allocator.allocate([0.1, 0.2, 2.2])
    return allocator


@pytest.mark.parametrize(
    "settings",
    [
        {"mu": -0.1},
        {"mu": float("nan")},
        {"mu": float("inf")},
        {"tolerance": 0.0},
        {"max_iterations": 0},
        {"alpha": 1.0},
        {"mu": 0.3, "tolerance": -1.0},
        {"mu": "much"},
    ],
)
def test_a_refused_setting_changes_nothing(flown, settings):
    before = state(flown)
    with pytest.raises(SettingError, match=list(settings)[-1]):
        flown.update(**settings)
    assert state(flown) == before


def test_a_refused_mu_changes_nothing(flown):
    before = state(flown)
    with pytest.raises(SettingError):
        flown.mu = -1.0
    assert state(flown) == before
    assert flown.mu == 0.15


def test_mu_may_change_between_two_calls_and_keeps_the_warm_start(flown):
    last = flown.allocate([0.1, 0.2, 2.2]).directions
    flown.mu = 0.3
    changed = flown.allocate([0.1, 0.2, 2.2])
    fresh = SqpAllocator(n=4, mu=0.3).allocate([0.1, 0.2, 2.2])
    assert changed.status.ok
    assert changed.objective == pytest.approx(fresh.objective, abs=1e-9)
    assert flown.mu == 0.3
    assert 0.01 < np.abs(changed.directions - last).max() < 0.3


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            {"directions": np.ones((3, 3))},
            r"directions: must have shape \(4, 3\) \(found shape \(3, 3\)\)",
        ),
        (
            {"directions": np.ones(3)},
            r"directions: must have shape \(4, 3\) \(found shape \(3,\)\)",
        ),
        ({"tensions": np.ones(3)}, r"tensions: must have shape \(4,\) \(found shape \(3,\)\)"),
        ({"tensions": 1.0}, r"tensions: must have shape \(4,\) \(found shape \(\)\)"),
        ({"directions": np.zeros((4, 3))}, "not zero"),
        ({"directions": np.full((4, 3), np.nan)}, "finite"),
        ({"tensions": [1.0, 1.0, -1e-9, 1.0]}, "at least 0"),
        ({"tensions": [1.0, 1.0, np.nan, 1.0]}, "finite"),
        ({"directions": ring(4, 0.3), "tensions": np.ones(5)}, r"tensions: .* \(5,\)"),
    ],
)
def test_a_refused_start_names_the_fault_and_changes_nothing(flown, arguments, message):
    before = state(flown)
    with pytest.raises(SettingError, match=message):
        flown.reset(**arguments)
    assert state(flown) == before


@pytest.mark.parametrize("force", [2.2, [2.2], [0.0, 2.2], [[0.0, 0.0, 2.2]], np.zeros((3, 1))])
def test_a_force_without_three_components_is_refused_and_changes_nothing(flown, force):
    before = state(flown)
    with pytest.raises(SettingError, match=r"force: must have shape \(3,\)"):
        flown.allocate(force)
    with pytest.raises(SettingError, match=r"acceleration: must have shape \(3,\)"):
        flown.allocate(HOVER, force)
    assert state(flown) == before


def test_an_acceleration_left_out_is_zero_not_the_last_one(flown):
    flown.allocate(HOVER, [1.0, 2.0, 3.0])
    flown.allocate(HOVER)
    assert (flown._reference == 0.0).all()


def test_reset_starts_again_bit_by_bit():
    allocator = SqpAllocator(n=5)
    first = allocator.allocate([0.3, 0.1, 2.0])
    allocator.allocate([1.0, 1.0, 1.0])
    allocator.reset()
    again = allocator.allocate([0.3, 0.1, 2.0])
    assert np.array_equal(first.tensions, again.tensions)
    assert np.array_equal(first.directions, again.directions)
    assert first.iterations == again.iterations


def test_an_answer_is_not_overwritten_by_the_next(flown):
    first = flown.allocate(HOVER)
    kept = first.tensions.copy(), first.directions.copy(), first.objective
    flown.allocate([1.0, 0.0, 3.0])
    assert np.array_equal(first.tensions, kept[0])
    assert np.array_equal(first.directions, kept[1])
    assert first.objective == kept[2]


@pytest.mark.parametrize("n", [4, np.int64(4), Team.uniform(4)])
def test_the_number_of_drones_may_be_any_integer_or_a_team(n):
    assert SqpAllocator(n).n == 4
    assert Allocator(Ring(), n).n == 4


@pytest.mark.parametrize("n", [0, -1])
def test_fewer_than_one_drone_is_refused(n):
    with pytest.raises(SettingError, match="at least 1"):
        SqpAllocator(n)


@pytest.mark.parametrize("force", [[0.0, 0.0, 0.0], [0.0, np.nan, 2.2]])
def test_an_answer_that_was_not_optimised_claims_no_optimality(flown, force):
    answer = flown.allocate(force)
    assert answer.status in (Status.ZERO_FORCE, Status.INVALID_FORCE)
    assert not answer.status.ok
    assert np.isnan([answer.kkt_residual, answer.objective, answer.optimality_gap]).all()


def test_the_reported_objective_is_the_papers(flown):
    answer = flown.allocate([0.3, -0.5, 2.5])
    pairs = sum(
        (answer.directions[i] @ answer.directions[j]) ** 2 for i in range(4) for j in range(i)
    )
    expected = 0.5 * answer.tensions @ answer.tensions + 0.15 * pairs
    assert answer.objective == pytest.approx(expected, rel=1e-13)
    assert Sqp().objective(answer.tensions, answer.directions) == pytest.approx(expected, rel=1e-13)
