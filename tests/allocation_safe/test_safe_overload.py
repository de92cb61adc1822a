"""Overload, force given up without need, and the price of the turning rate's barrier: what the figures measure, in small."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from colift.control.allocation.base import Status
from colift.control.allocation.safe import SafeAllocator
from colift.study import safety
from colift.team.geometry import pairwise_angles

FIGURES = Path(__file__).parents[2] / "docs" / "figures"
SETTLED = 100
"""Cycles of 10 ms after which an overloaded team gives all it can, to 1 %."""
DIRECTIONS = {
    "level": (1.0, 0.0, 0.0),
    "nearly level": (1.0, 0.0, 0.05),
    "aside": (-0.6, 0.8, 0.0),
    "rising": (0.3, 0.8, 0.5),
    "up": (0.0, 0.0, 1.0),
}


def hovering(n: int) -> tuple[SafeAllocator, np.ndarray]:
    team, safe = safety.problem(n)
    allocator = SafeAllocator.unchecked(team, safe)
    cone = np.radians(safety.CONES.get(n, 70.0))
    allocator.reset(safety.spread_formation(n, cone, np.radians(safe.min_angle_deg + 1.0)))
    hover = np.array([0.0, 0.0, team.load_mass * team.gravity])
    for _ in range(100):
        allocator.allocate(hover)
    return allocator, hover


def given(allocator: SafeAllocator, force: np.ndarray, cycles: int) -> np.ndarray:
    """What the cables give (k, 3), N; every limit holds and every imbalance is told."""
    part, forces = allocator.part, []
    before = allocator.allocate(force).directions.copy()
    for _ in range(cycles):
        answer = allocator.allocate(force)
        alpha = answer.directions
        forces.append(-answer.tensions @ alpha)
        assert (part.tension_floors(allocator.team) <= answer.tensions + 1e-9).all()
        assert (part.tension_caps(allocator.team) >= answer.tensions - 1e-9).all()
        assert np.degrees(np.arccos(-alpha[:, 2])).max() <= part.max_cone_deg + 1e-6
        assert np.degrees(pairwise_angles(alpha)).min() >= part.min_angle_deg - 1e-6
        chord = np.linalg.norm(alpha - before, axis=1).max()
        assert chord <= 2.0 * np.sin(0.5 * part.turn_rate(allocator.team) * allocator.dt) + 1e-9
        if np.linalg.norm(forces[-1] - force) > 1e-8:
            assert answer.status is Status.FORCE_REDUCED
        before = alpha.copy()
    return np.array(forces)


def settling(forces: np.ndarray) -> int:
    far = np.linalg.norm(forces - forces[-1], axis=1) > 0.01 * np.linalg.norm(forces[-1])
    return int(np.flatnonzero(far)[-1]) + 2 if far.any() else 1


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("n", [2, 4, 6, 8])
def test_an_overloaded_team_gives_all_it_can_within_a_second(n: int, direction: str) -> None:
    unit = np.array(DIRECTIONS[direction]) / np.linalg.norm(DIRECTIONS[direction])
    allocator, _ = hovering(n)
    most = np.linalg.norm(given(allocator, 10.0 * n * unit, 600)[-1])
    allocator, hover = hovering(n)
    assert settling(given(allocator, 1.2 * most * unit, 600)) <= SETTLED
    # Back in hover nothing is missing soon.
    assert np.abs(given(allocator, hover, 60)[-1] - hover).max() < 1e-8
    allocator, hover = hovering(n)
    assert settling(given(allocator, hover + 1.2 * most * unit, 600)) <= SETTLED


def test_a_formation_in_overload_comes_to_rest() -> None:
    """What leads it off a saddle moves nothing for long."""
    allocator, _ = hovering(4)
    given(allocator, np.array([0.0, 0.0, 50.0]), 300)
    before = allocator.allocate([0.0, 0.0, 50.0]).directions.copy()
    given(allocator, np.array([0.0, 0.0, 50.0]), 100)
    after = allocator.allocate([0.0, 0.0, 50.0]).directions
    assert np.linalg.norm(after - before, axis=1).max() < 1e-3


def test_a_cable_at_its_least_tension_turns_as_fast_as_any() -> None:
    """The tension is limited, not its part along the last direction."""
    team, safe = safety.problem(3)
    allocator = SafeAllocator(
        team, tension_min=0.7, tension_max=1.0, min_angle_deg=safe.min_angle_deg, dt=0.1
    )
    rng = np.random.default_rng(0)
    least = np.inf
    for _ in range(300):
        force = team.load_mass * (rng.uniform(-3.0, 3.0, 3) + [0.0, 0.0, 6.0])
        answer = allocator.allocate(force)
        assert answer.tensions.min() >= 0.7 - 1e-12
        least = min(least, float(answer.tensions.min()))
    assert least < 0.701


@pytest.fixture
def figure(monkeypatch: pytest.MonkeyPatch) -> Iterator[ModuleType]:
    """The script behind the page, as a module."""
    monkeypatch.syspath_prepend(FIGURES)
    yield lambda name: importlib.import_module(name)
    for name in ("avoidable", "rate_barrier", "pages"):
        sys.modules.pop(name, None)


@pytest.mark.parametrize(
    ("n", "case"),
    [(3, "defaults"), (8, "defaults"), (3, "100 ms"), (4, "tensions 50:1"), (4, "`spread` 1")],
)
def test_no_force_is_given_up_without_need(figure, n: int, case: str) -> None:
    pytest.importorskip("casadi", reason="optional: the extra `ipopt`")
    avoidable = figure("avoidable")
    found = avoidable.misses(n, avoidable.CASES[case], 2000, seed=99)
    assert found["cycles"] == 10_000
    assert found["avoidable"] <= (0 if case == "defaults" else 10)


def test_ipopt_tells_what_is_within_the_limits_from_what_is_not(figure) -> None:
    pytest.importorskip("casadi", reason="optional: the extra `ipopt`")
    avoidable = figure("avoidable")
    part, turn = safety.problem(4)[1], 0.06
    found = next(safety.answers(4, "noise", 20, part, seed=3))
    before, tensions = found.before[10], found.tensions[10]
    assert avoidable.reachable(found.forces[10], before, tensions, before, part, turn)
    for beyond in ([20.0, 0.0, 1.0], [0.0, 0.0, 25.0], [0.0, 0.0, 0.01]):
        assert not avoidable.reachable(np.array(beyond), before, tensions, before, part, turn)


@pytest.mark.parametrize(("n", "dt"), [(3, 0.01), (8, 0.01), (3, 0.1)])
def test_the_barrier_of_the_turning_rate_raises_no_tension(figure, n: int, dt: float) -> None:
    for more in figure("rate_barrier").more(n, dt, {}):
        assert more <= 5e-3
