"""Shares and means with what they leave open: the exact interval of Clopper and Pearson, and the bootstrap's."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache

import numpy as np

CONFIDENCE = 0.95
"""How often an interval holds the true share, at least; of means nearly."""
DRAWS = 4000
"""Of the bootstrap."""


@cache
def interval(hits: int, trials: int, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """The shares that ``hits`` of ``trials`` leave open, from 0 to 1.

    The exact interval of Clopper and Pearson (1934): outside of it, so many hits or more extreme ones have a
    probability of at most ``(1 - confidence) / 2``, on either side. All is open without trials.

    Raises
    ------
    ValueError
        For more hits than trials, or a confidence that is none.

    """
    if not 0 <= hits <= trials or not 0.0 < confidence < 1.0:
        raise ValueError(f"{hits} of {trials} at {confidence:g} is no share")
    tail = 0.5 * (1.0 - confidence)
    low = 0.0 if hits == 0 else _where(tail, hits, trials - hits + 1)
    high = 1.0 if hits == trials else _where(1.0 - tail, hits + 1, trials - hits)
    return low, high


def mean_interval(groups: Sequence[Sequence[float]]) -> tuple[float, float] | None:
    """The means of all numbers that chance leaves open; None where no group has two.

    95 % of the means of numbers drawn anew from each group, with replacement (Efron and Tibshirani, "An introduction to the bootstrap", 1993,
    section 13.3), always the same draws.
    """
    count = sum(map(len, groups))
    if all(len(group) < 2 for group in groups):
        return None
    random, total = np.random.default_rng(0), np.zeros(DRAWS)
    for group in groups:
        total += np.asarray(group)[random.integers(0, len(group), (DRAWS, len(group)))].sum(axis=1)
    tail = 50.0 * (1.0 - CONFIDENCE)
    low, high = np.percentile(total / count, [tail, 100.0 - tail])
    return float(low), float(high)


def text(hits: int, trials: int) -> str:
    """A share for people, its interval rounded outwards: ``57/60 (86-99 %)``."""
    if trials == 0:
        return "0/0"
    return f"{hits}/{trials} ({percent(*interval(hits, trials), 0 if trials < 100 else 1)})"


def percent(low: float, high: float, digits: int) -> str:
    """An interval in percent, rounded outwards."""
    scale = 10**digits
    # What bisection leaves open must not show as a digit.
    least = math.floor(100.0 * scale * low + 1e-9) / scale
    most = math.ceil(100.0 * scale * high - 1e-9) / scale
    return f"{least:.{digits}f}-{most:.{digits}f} %"


def _where(level: float, a: float, b: float) -> float:
    """Where the distribution Beta(a, b) reaches a level, by bisection."""
    low, high = 0.0, 1.0
    while True:
        middle = 0.5 * (low + high)
        if middle in (low, high):
            return middle
        if beta(a, b, middle) < level:
            low = middle
        else:
            high = middle


def beta(a: float, b: float, x: float) -> float:
    """Regularised incomplete beta function: the probability of ``a`` hits or more in ``a + b - 1`` trials."""
    if x <= 0.0 or x >= 1.0:
        return float(x >= 1.0)
    scale = math.lgamma(a + b) - math.lgamma(a) - math.lgamma(b)
    weight = math.exp(scale + a * math.log(x) + b * math.log1p(-x))
    if x < (a + 1.0) / (a + b + 2.0):
        return weight * _fraction(a, b, x) / a
    return 1.0 - weight * _fraction(b, a, 1.0 - x) / b


def _fraction(a: float, b: float, x: float) -> float:
    """The continued fraction of the incomplete beta function (DLMF 8.17.22), by Lentz's method."""
    tiny = 1e-300
    c, d = 1.0, 1.0 / ((1.0 - (a + b) * x / (a + 1.0)) or tiny)
    value = d
    for m in range(1, 1_000_000):
        even = m * (b - m) * x / ((a + 2 * m - 1.0) * (a + 2 * m))
        odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1.0))
        before = value
        for step in (even, odd):
            d = 1.0 / ((1.0 + step * d) or tiny)
            c = (1.0 + step / c) or tiny
            value *= c * d
        if abs(value - before) <= 1e-16 * abs(value):
            break
    return value
