"""Margins of the loops: of loops that are known in closed form or by another way, and of missions that fly or shake."""

from __future__ import annotations

import importlib.util
import math
from pathlib import Path

import numpy as np
import pytest

from colift.control import margins
from colift.control.margins import Loops, Places, Seen, Timing, Turning
from colift.control.tuning import loop_growth
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.mission.stability import LEAST, loops_of
from colift.mission.warnings import warnings_of

TEAMS = Path(__file__).parents[2] / "benchmarks" / "any_team.py"


def timing(period, delay=0.0, lag=0.0, **told):
    return Timing(delay, delay, delay, delay, lag, period, period, **told)


def test_an_attitude_is_unstable_where_it_grows_from_period_to_period():
    """Counting zeros along the circle, against the eigenvalues of the sampled loop."""
    rng = np.random.default_rng(5)
    seen = set()
    for _ in range(60):
        period = rng.uniform(0.002, 0.02)
        delay, lag = rng.integers(0, 4) * period, rng.choice([0.0, 0.02])
        K, slope = rng.uniform(0.05, 2.5) / period, rng.uniform(1.0, 40.0)
        growth = loop_growth(K, slope, 1.0, period=period, delay=delay, lag=lag)
        if abs(growth - 1.0) < 0.01:
            continue
        w = margins.frequencies(math.pi / period)
        found, _, _ = margins.turn_loop(w, Turning(K, slope, 1.0), timing(period, delay, lag))
        assert found.stable == (growth < 1.0)
        seen.add(found.stable)
    assert seen == {True, False}


def test_prediction_bears_what_the_delay_alone_does_not_and_not_a_wrong_delay():
    law, period, delay = Turning(40.0, 20.0, 1.0), 0.005, 0.04
    w = margins.frequencies(math.pi / period)
    late, _, _ = margins.turn_loop(w, law, timing(period, delay))
    told, angle, _ = margins.turn_loop(w, law, timing(period, delay, told_delay=delay))
    wrong, _, _ = margins.turn_loop(w, law, timing(period, 3.0 * delay, told_delay=delay))
    assert not late.stable
    assert told.stable
    assert not wrong.stable
    assert 0.3 < told.modulus < 1.0
    assert abs(angle[0] - 1.0) < 1e-3  # it gets to where it is told


@pytest.mark.parametrize(("k1", "k2"), [(3.0, 1.0), (6.0, 12.0), (2.0, 4.0)])
def test_a_place_bears_the_delay_of_the_closed_form(k1, k2):
    """``(k1 s + k2) / s^2`` crosses over at ``w^2 = (k1^2 + sqrt(k1^4 + 4 k2^2)) / 2`` with the phase ``atan(k1 w / k2)``."""
    cross = math.sqrt(0.5 * (k1**2 + math.sqrt(k1**4 + 4.0 * k2**2)))
    most = math.atan2(k1 * cross, k2) / cross
    w = margins.frequencies(400.0)
    one, none = np.ones(w.size), np.zeros(w.size)
    for share, stable in ((0.97, True), (1.03, False)):
        late = np.exp(-1j * w * share * most)
        view = Seen(late, none, 1j * w * late, none)
        loops = Loops(
            w, one, none, timing(0.001), Places(k1, k2), margins.Hanging(), (0.0, 0.0), view, view
        )
        assert loops.alone(3).stable == stable


def test_shipped_missions_have_their_margins():
    """That none of them warns is in tests/mission/test_warnings.py."""
    for name, loops in (("real-world", 3), ("two-drones", 3), ("paper-spiral", 2)):
        judged = loops_of(load_mission(name))  # nobody knows how the paper's allocator leans
        assert len(judged) == loops
        assert min(each.margin.modulus for each in judged) > LEAST, name


def test_what_follows_from_the_bodies_of_random_teams_has_its_margins():
    spec = importlib.util.spec_from_file_location("teams_of_margins", TEAMS)
    teams = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(teams)
    for seed in range(200, 206):
        mission = load_mission(teams.draw(seed), must_fly=False)
        judged = loops_of(mission)
        assert [each.loop for each in judged] == ["attitude", "position", "load"]
        assert min(each.margin.modulus for each in judged) > 2.0 * LEAST, seed


CALM = {
    "disturbance": [], "timing.duration": 6.0, "truth.load_mass_factor": 1.0, "reference": {"kind": "hover"},
    "criteria": {},
}  # fmt: skip


def shaking(mission):
    flown = Flight(mission).run()
    rates = flown["rates"][flown.time > 4.0]
    return float(np.sqrt(np.mean(rates**2)))


def test_a_gain_that_shakes_the_drones_is_told_with_one_that_does_not():
    wild = load_mission("real-world", {**CALM, "position_control.gain": 2.6})
    (told,) = (each for each in warnings_of(wild) if each.path == "position_control.gain")
    assert "the position loop is unstable near" in told.message
    better = float(told.message.split("gain = ")[1].split(" ")[0])
    assert 0.5 < better < 1.7
    mended = load_mission("real-world", {**CALM, "position_control.gain": better})
    assert warnings_of(mended) == []
    assert shaking(wild) > 0.5 > 2.0 * shaking(mended)


def test_a_loop_that_hardly_holds_is_told_its_margin():
    low, high = 0.85, 2.6
    for _ in range(9):
        gain = 0.5 * (low + high)
        mission = load_mission("real-world", {**CALM, "position_control.gain": gain})
        found = loops_of(mission)[1].margin
        low, high = (gain, high) if found.modulus >= 0.03 else (low, gain)
    mission = load_mission("real-world", {**CALM, "position_control.gain": low})
    (told,) = warnings_of(mission)
    assert told.path == "position_control.gain"
    assert "modulus margin (least |1 + L|) of 0.03" in told.message
    assert "less than 0.05: 3." in told.message
