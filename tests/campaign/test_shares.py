"""Intervals of shares: against closed forms, against the binomial sum, and against SciPy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from colift.kernel.math.shares import interval, mean_interval, percent, text


def at_least(hits: int, trials: int, share: float) -> float:
    """Probability of so many hits or more, term by term."""
    return math.fsum(
        math.comb(trials, k) * share**k * (1.0 - share) ** (trials - k)
        for k in range(hits, trials + 1)
    )


def test_all_and_none_have_closed_forms() -> None:
    for n in (1, 4, 60, 240):
        edge = 0.025 ** (1.0 / n)
        assert interval(n, n) == (pytest.approx(edge, abs=1e-12), 1.0)
        assert interval(0, n) == (0.0, pytest.approx(1.0 - edge, abs=1e-12))
    assert interval(0, 0) == (0.0, 1.0)


def test_published_values() -> None:
    """Clopper and Pearson, Biometrika 26 (1934): 95 % limits; and the flights of the stress."""
    low, high = interval(5, 10)
    assert (round(low, 4), round(high, 4)) == (0.1871, 0.8129)
    low, high = interval(236, 240)
    assert (round(low, 4), round(high, 4)) == (0.9579, 0.9954)


@settings(deadline=None)
@given(st.integers(1, 80), st.data(), st.sampled_from([0.5, 0.9, 0.95, 0.999]))
def test_each_end_leaves_out_half_of_what_is_left(n: int, data: st.DataObject, sure: float) -> None:
    k = data.draw(st.integers(0, n))
    low, high = interval(k, n, sure)
    assert 0.0 <= low <= k / n <= high <= 1.0
    if k > 0:
        assert at_least(k, n, low) == pytest.approx(0.5 * (1.0 - sure), rel=1e-9)
    if k < n:
        assert 1.0 - at_least(k + 1, n, high) == pytest.approx(0.5 * (1.0 - sure), rel=1e-9)


@pytest.mark.parametrize(
    ("hits", "trials"), [(1, 3), (57, 60), (236, 240), (17, 100_000), (999_990, 1_000_000)]
)
def test_as_scipy_has_it(hits: int, trials: int) -> None:
    beta = pytest.importorskip("scipy.stats", reason="needs the extra solvers").beta
    low, high = interval(hits, trials)
    assert low == pytest.approx(beta.ppf(0.025, hits, trials - hits + 1), rel=1e-8)
    assert high == pytest.approx(beta.ppf(0.975, hits + 1, trials - hits), rel=1e-8)


def test_no_share_is_refused() -> None:
    for hits, trials, sure in ((5, 4, 0.95), (-1, 4, 0.95), (1, 4, 1.0), (1, 4, 0.0)):
        with pytest.raises(ValueError, match="is no share"):
            interval(hits, trials, sure)


def test_texts_round_outwards() -> None:
    assert text(60, 60) == "60/60 (94-100 %)"
    assert text(0, 4) == "0/4 (0-61 %)"
    assert text(236, 240) == "236/240 (95.7-99.6 %)"
    assert text(0, 0) == "0/0"
    assert percent(0.25, 0.5, 0) == "25-50 %"


def test_a_mean_lies_in_its_interval_about_as_often_as_is_said() -> None:
    random, inside = np.random.default_rng(11), 0
    for _ in range(400):
        found = mean_interval([random.normal(1.0, 1.0, 15).tolist(), random.normal(5.0, 1.0, 15)])
        assert found is not None
        inside += found[0] <= 3.0 <= found[1]  # groups far apart make no interval wider
    assert 0.90 < inside / 400 < 0.97
    assert mean_interval([[2.0, 2.0], [4.0]]) == pytest.approx((8.0 / 3.0, 8.0 / 3.0))
    assert mean_interval([[1.0], [2.0]]) is None
    assert mean_interval([]) is None
