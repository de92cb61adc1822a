"""The stateless random numbers are as good as a generator's, along steps, channels and keys."""

from __future__ import annotations

import numpy as np
import pytest

from colift.math import noise
from colift.simulation.flight import random_key

KEY = random_key(0, "sensing")
STEPS, CHANNELS = 2000, 50


def table(function, keys=(KEY,), steps=STEPS, channels=CHANNELS):
    values = [[function(k, s, c) for c in range(channels)] for k in keys for s in range(steps)]
    return np.array(values)


@pytest.fixture(scope="module")
def uniform():
    return table(noise.uniform)


@pytest.fixture(scope="module")
def normal():
    return table(noise.normal)


def test_uniform_fills_the_unit_interval_evenly(uniform):
    assert 0.0 < uniform.min() < 1e-3
    assert 0.999 < uniform.max() < 1.0
    counts = np.histogram(uniform, 100, (0.0, 1.0))[0]
    expected = uniform.size / 100
    chi = np.sum((counts - expected) ** 2 / expected)  # 99 degrees of freedom
    assert abs(chi - 99.0) < 4.0 * np.sqrt(2.0 * 99.0)


def test_low_bits_are_even_too(uniform):
    low = (uniform * 2.0**20) % 1.0
    counts = np.histogram(low, 100, (0.0, 1.0))[0]
    chi = np.sum((counts - low.size / 100) ** 2 / (low.size / 100))
    assert abs(chi - 99.0) < 4.0 * np.sqrt(2.0 * 99.0)


def test_no_number_comes_twice(uniform):
    assert len(np.unique(uniform)) == uniform.size


def test_normal_has_the_moments_of_a_normal(normal):
    n = normal.size
    assert abs(normal.mean()) < 4.0 / np.sqrt(n)
    assert abs(normal.var() - 1.0) < 4.0 * np.sqrt(2.0 / n)
    assert abs((normal**3).mean()) < 4.0 * np.sqrt(15.0 / n)
    assert abs((normal**4).mean() - 3.0) < 4.0 * np.sqrt(96.0 / n)


@pytest.mark.parametrize("axis", [0, 1], ids=["steps", "channels"])
@pytest.mark.parametrize("lag", [1, 2, 3, 8])
def test_neighbours_are_uncorrelated(normal, axis, lag):
    x = np.moveaxis(normal, axis, 0)
    products = x[lag:] * x[:-lag]
    assert abs(products.mean()) < 4.0 / np.sqrt(products.size)
    squares = (x[lag:] ** 2 - 1.0) * (x[:-lag] ** 2 - 1.0)
    assert abs(squares.mean()) < 4.0 * 2.0 / np.sqrt(squares.size)


def test_all_channels_are_uncorrelated_with_each_other(normal):
    correlation = np.corrcoef(normal.T) - np.eye(CHANNELS)
    assert np.abs(correlation).max() < 5.0 / np.sqrt(STEPS)


def test_keys_are_uncorrelated():
    keys = [random_key(seed, name) for seed in range(4) for name in ("sensing", "link")]
    assert len(set(keys)) == 8
    values = np.array([table(noise.normal, [key], 1000, 5).ravel() for key in keys])
    correlation = np.corrcoef(values) - np.eye(len(keys))
    assert np.abs(correlation).max() < 4.5 / np.sqrt(values.shape[1])


def test_negative_steps_are_steps_like_any_other():
    values = [noise.uniform(KEY, step, 0) for step in range(-50, 50)]
    assert len(set(values)) == 100
    assert 0.3 < np.mean(values) < 0.7
