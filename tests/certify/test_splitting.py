"""Splitting: right on average, on a system whose probabilities are known exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest

from colift.mission import load_mission
from colift.study.certify import splitting
from colift.study.certify.space import Space
from colift.study.certify.trials import PILOTS, Flights, mean_of_blocks


class Walk:
    """Goes up or down by one each block; its level is 1 where it is half a step below the mark."""

    def __init__(self, blocks, mark, ends_above=None):
        self.blocks, self.mark, self.ends_above = blocks, mark, ends_above

    def begin(self, seed):
        return (0,)

    def advance(self, state, seed):
        after = (*state, state[-1] + (1 if seed >> 40 & 1 else -1))
        return after, 1.0 + (after[-1] - self.mark + 0.5) / self.mark

    def failed(self, state):
        if self.ends_above is not None:
            return state[-1] > self.ends_above
        return max(state) >= self.mark


def tail(steps, least):
    """Probability that a walk ends at ``least`` or above."""
    ups = range(math.ceil((steps + least) / 2), steps + 1)
    return sum(math.comb(steps, k) for k in ups) / 2**steps


@pytest.mark.parametrize("particles", [2, 5, 24])
def test_the_mean_of_estimates_is_the_probability(particles):
    walk = Walk(20, 14)
    truth = tail(20, 14) + tail(20, 15)  # the principle of reflection
    runs = 24_000 // particles // (1 if particles > 2 else 4)
    found = [splitting.estimate(walk, particles, seed).probability for seed in range(runs)]
    error = np.std(found, ddof=1) / math.sqrt(runs)
    assert truth == pytest.approx(1.49e-3, rel=0.01)
    assert abs(np.mean(found) - truth) < 3.5 * error
    assert error < 0.2 * truth  # so that the line above can fail


def test_a_failure_may_be_something_else_than_a_level():
    walk = Walk(20, 10, ends_above=11)
    runs = 1500
    found = [splitting.estimate(walk, 16, seed).probability for seed in range(runs)]
    error = np.std(found, ddof=1) / math.sqrt(runs)
    assert abs(np.mean(found) - tail(20, 12)) < 3.5 * error
    assert error < 0.1 * tail(20, 12)


def test_a_rare_failure_takes_far_fewer_blocks_than_flying_them_all():
    walk, truth = Walk(40, 26), tail(40, 26) + tail(40, 27)
    found = [splitting.estimate(walk, 50, seed) for seed in range(40)]
    mean = np.mean([each.probability for each in found])
    error = np.std([each.probability for each in found], ddof=1) / math.sqrt(40)
    blocks = sum(each.blocks for each in found)
    direct = 40 * truth * (1.0 - truth) / error**2  # for the same error
    assert truth < 6e-5
    assert mean == pytest.approx(truth, abs=4 * error)
    assert blocks < 0.2 * direct


def test_a_seed_repeats_its_estimate():
    walk = Walk(20, 12)
    assert splitting.estimate(walk, 8, 5) == splitting.estimate(walk, 8, 5)
    assert splitting.estimate(walk, 8, 5) != splitting.estimate(walk, 8, 6)


def test_it_ends_where_nobody_can_go_on():
    class Flat(Walk):
        def advance(self, state, seed):
            return state, 0.25

    assert splitting.estimate(Flat(5, 3), 8, 0) == (0.0, 40, 0)


GUSTY = {
    "timing.duration": 1.0,
    "disturbance": [{"kind": "dryden", "speed": 10.0}, {"kind": "drag", "rotor_drag": 0.02}],
    "criteria.tracking_max_m.max": 0.05,
}


@pytest.mark.slow
def test_flights_are_split_without_bias():
    space = Space.of("hover", GUSTY)
    system = Flights(space, 0.25, {})
    whole = mean_of_blocks(system, 150, seed=1)
    found = [splitting.estimate(system, 10, seed).probability for seed in range(12)]
    error = math.hypot(
        math.sqrt(whole * (1.0 - whole) / 150), np.std(found, ddof=1) / math.sqrt(len(found))
    )
    assert 0.02 < whole < 0.5
    assert abs(np.mean(found) - whole) < 3.5 * error


def test_flights_that_share_their_past_go_on_as_they_would_alone():
    system = Flights(Space.of("hover", GUSTY), 0.5, {})
    begin = system.begin(3)
    first, level = system.advance(begin, 7)
    one, _ = system.advance(first, 8)
    other, _ = system.advance(first, 9)
    again, level_again = system.advance(system.begin(3), 7)
    alone, _ = system.advance(again, 8)
    assert level == level_again
    np.testing.assert_array_equal(one.at.state[0], alone.at.state[0])
    assert not np.array_equal(one.at.state[0], other.at.state[0])


def test_a_level_is_counted_from_what_is_usual():
    """Or a formation that is always near its least angle, and never below, would be all that splitting looks at."""
    space = Space.of("hover", {**GUSTY, "criteria.min_angle_deg.min": 37.0})
    system, other = Flights(space, 0.5, {"wind_mps": 40.0}), Flights(space, 0.5, {"wind_mps": 40.0})
    _, before = system.advance(system.begin(3), 7)
    assert system.learn(5) == other.learn(5) == PILOTS * system.blocks
    assert system.usual == other.usual
    assert system.usual.keys() >= {"-min_angle_deg", "tracking_max_m", "wind_mps"}
    assert system.usual["-min_angle_deg"] < -37.0
    _, level = system.advance(system.begin(3), 7)
    assert before > 0.85  # by the share of its limit, though no formation ever comes nearer
    assert level < before
    for key, limit in (("tracking_max_m", 0.05), ("-min_angle_deg", -37.0)):
        assert system._level(key, system.usual[key], limit) == pytest.approx(0.0, abs=1e-12)
        assert system._level(key, limit, limit) == 1.0
    assert system._level("tracking_max_m", 0.02, 1e-6) > 1.0  # a limit that is usually missed


def test_random_numbers_come_back_with_a_snapshot():
    from colift.flight.flight import Flight

    mission = load_mission("hover", {**GUSTY, "sensing.kind": "noisy", "seed": 4})
    flight, whole = Flight(mission), Flight(mission).run()
    flight.advance(0.5)
    before = flight.snapshot()
    flight.reseed(99)
    flight.advance(0.5)
    other = flight.bus.row.copy()
    flight.restore(before)
    flight.advance(0.5)
    assert not np.array_equal(flight.bus.row, other)
    flight.restore(before)
    np.testing.assert_array_equal(flight.run()["load"], whole["load"])
