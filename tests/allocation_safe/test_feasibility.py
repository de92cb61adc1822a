"""Formations, widest angles, hover margins and the errors that name two limits."""

from __future__ import annotations

import importlib
import math
from pathlib import Path

import numpy as np
import pytest

from colift.control.allocation.limits.feasibility import (
    POLISHED,
    QUICK,
    feasibility,
    formations,
    limits_of,
    most_cables,
    spread_formation,
    widest_angle,
    widest_formation,
)
from colift.control.allocation.limits.heaviest import Limits, best_tensions, extreme
from colift.control.allocation.safe import Safe, SafeAllocator
from colift.team import Team
from colift.team.geometry import pairwise_angles, ring
from colift.world.actuation.motors import Motors

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
    with pytest.raises(ValueError, match=r"min_angle: conflicts with cone 45 deg.*found 60 deg"):
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


def test_what_binds_is_named_default_or_not():
    """An unset tension_max of 5 N is a limit like any other."""
    found = feasibility(Team.uniform(4), Safe(min_angle_deg=40.0))
    assert str(found.binding[0]) == "allocation.tension_max = 5 N (the default)"
    assert found.binding[0].price == pytest.approx(1.0, abs=0.01)
    assert str(found.binding[1]) == "allocation.min_angle_deg = 40 deg"
    tenth = feasibility(Team.uniform(4), Safe(min_angle_deg=44.0))
    assert tenth.heaviest < found.heaviest
    strong = feasibility(Team.uniform(4), Safe(tension_max=100.0), Motors(max_thrust=2.0))
    assert strong.binding[0].path == "actuation.max_thrust"
    assert not strong.binding[0].default
    told = feasibility(
        Team.uniform(4), Safe(tension_max=100.0, max_thrust=8.0), Motors(max_thrust=2.1)
    )
    assert told.binding[0].path == "allocation.max_thrust"


def held_by_ring(cone, *, mass=0.5, thrust):
    """Weight that four cables on a ring hold with this thrust a drone: |m g e3 - T alpha| = f."""
    own = mass * 9.81
    c, s = math.cos(cone), math.sin(cone)
    tension = math.sqrt(thrust**2 - (own * s) ** 2) - own * c
    return 4.0 * tension * c


def test_thrust_counts_the_tilt_of_the_cables():
    narrow = math.asin(math.sin(math.radians(15.0)) / math.sin(math.pi / 4.0))
    found = feasibility(Team.uniform(4), Safe(tension_max=100.0), Motors(max_thrust=1.87))
    assert found.heaviest == pytest.approx(held_by_ring(narrow, thrust=7.48), rel=3e-3)
    assert found.heaviest < 4.0 * (7.48 - 0.5 * 9.81)  # what vertical cables would hold
    assert found.heaviest <= limits_of(Team.uniform(4), Safe(), np.full(4, 7.48)).bound()


def test_tilt_and_unequal_drones_count():
    """A strong drone takes the middle; one that may hardly tilt pulls its cable where it can."""
    team = Team.uniform(5)
    even = feasibility(team, Safe(tension_max=2.0)).heaviest
    caps = [2.0, 2.0, 6.0, 2.0, 2.0]
    strong = feasibility(team, Safe(tension_max=caps)).heaviest
    assert strong > even + 3.9  # all of its 4 N more, and a narrower place for it
    free = feasibility(team, Safe(tension_max=50.0, max_thrust=12.0)).heaviest
    tilted = feasibility(team, Safe(tension_max=50.0, max_thrust=12.0, max_tilt_deg=8.0))
    assert tilted.heaviest < 0.95 * free
    assert tilted.binding[0].path in ("allocation.max_tilt_deg", "allocation.max_thrust")


def test_three_drones_that_may_hardly_tilt_are_judged_by_narrow_formations():
    limits = Limits(
        weights=np.array([21.85, 6.52, 6.19]), low=np.array([1.4, 1.76, 2.67]), high=np.array([184.5, 15.89, 132.2]),
        thrust=np.array([81.37, 24.64, 19.66]), cone=math.radians(58.0), min_angle=math.radians(43.0),
        tilt=math.radians(12.5),
    )  # fmt: skip
    assert extreme(limits, formations(3, limits)).weight > 63.5  # wide ones alone: 26.4


@pytest.mark.slow
def test_ipopt_finds_no_heavier_load_for_random_teams(monkeypatch):
    """Of the teams of docs/figures/feasibility.py the first; there are all, and more starts."""
    pytest.importorskip("casadi", reason="optional: the extra ipopt (casadi)")
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "docs" / "figures")
    against = importlib.import_module("feasibility")
    rng = np.random.default_rng(against.SEED)
    held = 0
    for k in range(8):
        team, safe, motors, _ = against.draw(rng)
        heaviest, missed, _, _ = against.by_colift(team, safe, motors)
        theirs = against.by_ipopt(team, safe, motors, np.random.default_rng(k), starts=6)
        assert missed < against.KEPT
        assert heaviest >= (1.0 - against.CLOSE) * theirs
        held += theirs > 0.95 * heaviest > 0.0
    assert held >= 6  # IPOPT did its work: the comparison is not empty


def test_tensions_along_given_cables_are_those_of_a_linear_programme():
    scipy = pytest.importorskip("scipy.optimize")
    rng = np.random.default_rng(3)
    solved = 0
    for _ in range(60):
        n = int(rng.integers(2, 12))
        d = rng.normal(size=(n, 3))
        d[:, 2] = -np.abs(d[:, 2]) - 0.3
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        limits = Limits(np.full(n, 5.0), rng.random(n), 2.0 + 5.0 * rng.random(n), 7.0 + 8.0 * rng.random(n),
                        math.radians(89.0), 0.0)  # fmt: skip
        weight, tensions = best_tensions(limits, d)
        high = limits.ceiling(-d[:, 2])
        if np.any(high <= limits.low):
            assert math.isnan(weight)
            continue
        bounds = list(zip(limits.low, high, strict=True))
        exact = scipy.linprog(d[:, 2], A_eq=d[:, :2].T, b_eq=[0.0, 0.0], bounds=bounds)
        if exact.status == 2:
            assert math.isnan(weight)
            continue
        solved += 1
        assert weight == pytest.approx(-exact.fun, rel=1e-6)
        assert np.all(tensions >= limits.low - 1e-9)
        assert np.all(tensions <= high + 1e-9)
    assert solved > 20


@pytest.mark.parametrize("n", [2, 3, 5, 9, 30, 200])
def test_the_question_in_flight_is_bounded_and_agrees_with_the_search(n, monkeypatch):
    settings = Safe(min_angle_deg=min(30.0, 100.0 / math.sqrt(n)))
    motors = np.full(n, 9.0)
    solve, solved = np.linalg.solve, []
    monkeypatch.setattr(np.linalg, "solve", lambda A, b: solved.append(len(b)) or solve(A, b))
    limits = limits_of(Team.uniform(n), settings, motors)
    now = (
        widest_formation(n, limits.cone, enough=1.05 * limits.min_angle)[0]
        if n < 100
        else ring(n, 1.0)
    )
    best = extreme(limits, formations(n, limits)).weight if n <= 9 else 0.85 * limits.bound()
    for share, holds in ((0.5, True), (0.96 if n <= 9 else 0.9, True), (1.0 / 0.85, False)):
        team = Team.uniform(n, load_mass=share * best / 9.81)
        solved.clear()
        found = settings.cannot_hold(team, motors, now)
        assert (found == []) is holds, (share, found)
        assert len(solved) <= (QUICK if n <= POLISHED else 2 * 25 * 7)
    if not holds:
        assert "tension_max" in found[0]
        assert f"{team.load_mass * 9.81:.4g} N" in found[0]


@pytest.mark.parametrize(("angle", "cone", "least"), [(30, 60, 16), (30, 45, 10), (59, 60, 6)])
def test_the_number_of_cables_that_an_angle_allows(angle, cone, least):
    found, bound = most_cables(math.radians(angle), math.radians(cone))
    assert least <= found <= bound
    assert math.degrees(widest_angle(found + 1, math.radians(cone))) < angle
    directions = spread_formation(found, math.radians(cone), math.radians(angle))
    assert np.degrees(pairwise_angles(directions).min()) >= angle
