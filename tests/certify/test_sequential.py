"""The test that may be looked at after every trial: how often it is wrong, computed exactly."""

from __future__ import annotations

import math
from functools import cache

import pytest
from scipy import stats

from colift.kernel.math import sequential
from colift.kernel.math.shares import interval
from colift.study.certify.certificate import CERTIFIED, OPEN, REFUTED, mean_limits, verdict


def ever(said, p, most, bound, confidence, judge=verdict):
    """Probability that one of the first ``most`` looks says something, where trials fail with ``p``; by all counts of failures."""
    alive, told = {0: 1.0}, 0.0
    for n in range(1, most + 1):
        after = {}
        for k, share in alive.items():
            after[k] = after.get(k, 0.0) + share * (1.0 - p)
            after[k + 1] = after.get(k + 1, 0.0) + share * p
        for k in [k for k in after if judge(k, n, bound, confidence) == said]:
            told += after.pop(k)
        alive = {k: share for k, share in after.items() if share > 1e-15}
    return told


@pytest.mark.parametrize("p", [0.05, 0.08])
def test_a_bound_that_does_not_hold_is_rarely_certified_at_any_look(p):
    assert ever(CERTIFIED, p, 600, 0.05, 0.95) <= 0.05


@pytest.mark.parametrize("p", [0.05, 0.02])
def test_a_bound_that_holds_is_rarely_refuted_at_any_look(p):
    assert ever(REFUTED, p, 600, 0.05, 0.95) <= 0.05


def test_looking_after_every_trial_with_an_interval_for_one_look_is_wrong_more_often():
    @cache
    def most(n, bound, confidence):
        """Failures with which it would still be certified; -1 if none."""
        k = -1
        while interval(k + 1, n, 2.0 * confidence - 1.0)[1] < bound:
            k += 1
        return k

    def naive(k, n, bound, confidence):
        return CERTIFIED if k <= most(n, bound, confidence) else OPEN

    assert ever(CERTIFIED, 0.05, 600, 0.05, 0.95, naive) > 0.06


def test_it_decides_where_the_truth_is_clear():
    assert ever(CERTIFIED, 0.01, 600, 0.05, 0.95) > 0.9
    assert ever(REFUTED, 0.15, 600, 0.05, 0.95) > 0.9


@pytest.mark.parametrize(("bound", "confidence"), [(0.1, 0.95), (0.01, 0.95), (0.001, 0.99)])
def test_without_a_failure_it_takes_an_eighth_more_flights_than_one_look_would(bound, confidence):
    n = math.ceil(math.log(1.0 - confidence) / math.log1p(-bound))  # for one look
    assert verdict(0, n, bound, confidence) == OPEN
    assert verdict(0, math.ceil(1.12 * n), bound, confidence) == CERTIFIED


@pytest.mark.parametrize(("k", "n"), [(0, 40), (1, 40), (12, 40), (40, 40), (3, 100_000)])
def test_an_interval_ends_where_the_verdict_changes(k, n):
    low, high = sequential.interval(k, n, 0.95)
    assert 0.0 <= low <= k / n <= high <= 1.0
    if high < 1.0 - 1e-9:
        assert verdict(k, n, high * (1 + 1e-6), 0.95) == CERTIFIED
        assert verdict(k, n, high * (1 - 1e-6), 0.95) != CERTIFIED
    if low > 0.0:
        assert verdict(k, n, low * (1 - 1e-6), 0.95) == REFUTED


@pytest.mark.parametrize("freedom", [1, 4, 19, 200])
@pytest.mark.parametrize("level", [0.9, 0.95, 0.999])
def test_students_distribution(level, freedom):
    assert sequential.student(level, freedom) == pytest.approx(stats.t.ppf(level, freedom))


def test_estimates_that_found_no_failures_say_nothing():
    assert mean_limits([0.0] * 20, 0.95) is None
    low, high = mean_limits([1e-3, 2e-3, 3e-3, 2e-3, 2e-3], 0.95)
    assert low < 2e-3 < high
