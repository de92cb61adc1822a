"""The proof that a force is out of reach: against closed forms, random forces and another solver."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colift.control.allocation.limits.feasibility import spread_formation
from colift.control.allocation.limits.reach import out_of_reach
from colift.study import safety

TURN, CONE = 0.06, np.radians(75.0)
DOWN = np.array([0.0, 0.0, -1.0])


def spread(n: int) -> np.ndarray:
    return spread_formation(n, np.radians(40.0), np.radians(31.0) if n < 8 else np.radians(20.0))


@pytest.mark.parametrize("direction", [[1, 0, 0], [0, 1, 0], [0.6, 0, 0.8], [0, 0, -1]])
def test_one_cable_reaches_its_largest_tension_and_its_rim(direction: list[float]) -> None:
    low, high = np.array([0.5]), np.array([2.0])
    last = DOWN[None, None, :]
    side = np.array([direction[0], direction[1], 0.0])
    tilt = np.sin(TURN) * side / max(np.linalg.norm(side), 1e-9)
    rim = tilt + np.sqrt(1 - tilt @ tilt) * DOWN
    for force, expected in (
        (-1.999 * rim, False),
        (-2.001 * rim, True),
        (-0.501 * rim, False),
        (-0.498 * np.array([0, 0, -1.0]) * np.cos(TURN), True),
        (1.0 * DOWN, True),
    ):
        assert out_of_reach(force[None], last, low, high, TURN, CONE)[0] == expected


@settings(max_examples=200, deadline=None)
@given(n=st.integers(1, 16), seed=st.integers(0, 2**32 - 1))
def test_a_force_that_cables_within_the_limits_give_is_never_proved_unreachable(
    n: int, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    last = spread(n) if n > 1 else DOWN[None]
    axis = np.cross(last, rng.standard_normal((n, 3)))
    axis /= np.linalg.norm(axis, axis=1)[:, None]
    angle = TURN * rng.choice([0.0, 0.5, 1.0], (n, 1))
    alpha = np.cos(angle) * last + np.sin(angle) * np.cross(axis, last)
    low, high = np.full(n, 0.05), np.full(n, 5.0)
    tension = rng.choice([0.05, 1.0, 5.0], n)
    force = -(tension @ alpha)
    assert not out_of_reach(force[None], last[None], low, high, TURN, CONE)[0]


def test_beyond_the_sum_of_all_tensions_everything_is_proved_unreachable() -> None:
    rng = np.random.default_rng(0)
    forces = rng.standard_normal((500, 3))
    forces *= 20.1 / np.linalg.norm(forces, axis=1)[:, None]
    last = np.broadcast_to(spread(4), (500, 4, 3))
    assert out_of_reach(forces, last, np.full(4, 0.05), np.full(4, 5.0), TURN, CONE).all()


def test_the_cone_stops_a_cable_that_its_turn_would_allow() -> None:
    edge = np.array([np.sin(CONE), 0.0, -np.cos(CONE)])
    beyond = np.array([np.sin(CONE + 0.5 * TURN), 0.0, -np.cos(CONE + 0.5 * TURN)])
    low, high = np.array([0.9]), np.array([1.1])
    for force, expected in ((-edge, False), (-beyond, True)):
        assert out_of_reach(force[None], edge[None, None], low, high, TURN, CONE)[0] == expected
    assert not out_of_reach(-beyond[None], edge[None, None], low, high, TURN, CONE + TURN)[0]


@pytest.mark.parametrize("n", [2, 3, 4])
@pytest.mark.parametrize("family", ["noise", "steps", "adversary"])
def test_force_is_given_up_only_where_no_allocator_could_give_it(n: int, family: str) -> None:
    found = safety.attack(n, family, 20_000, safety.problem(n)[1])
    assert found.holds
    assert found.avoidable_share <= (1e-3 if family == "adversary" else 5e-4)
