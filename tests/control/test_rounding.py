"""Thresholds of rounding have a value for each precision, and it is the right one there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from colift.control.allocation.paper import newton
from colift.kernel import rounding
from colift.kernel.jit import JIT_ENABLED
from colift.kernel.math import quaternion

DOUBLE = {name: value for name, value in vars(rounding).items() if isinstance(value, float)}
SINGLE = rounding.SINGLE


def plain(function):
    return function.py_func if JIT_ENABLED else function


def test_each_has_both_values_and_they_differ_no_more_than_the_precisions_do():
    assert {*SINGLE} == {*DOUBLE}
    coarser = float(np.finfo(np.float32).eps / np.finfo(float).eps)
    for name, double in DOUBLE.items():
        assert 1.0 < SINGLE[name] / double < 2.0 * coarser, name


def _norms(threshold, monkeypatch, kind):
    """Norms of the attitudes of thrusts that point almost straight down, in one precision."""
    monkeypatch.setattr(quaternion, "DOWNWARD", threshold)
    rng, found = np.random.default_rng(0), []
    for _ in range(2000):
        tilt, turn = 10.0 ** rng.uniform(-8.0, 0.0), rng.uniform(0.0, 2.0 * math.pi)
        u = np.array([tilt * math.cos(turn), tilt * math.sin(turn), -1.0])
        u = (u / np.linalg.norm(u)).astype(kind)
        q = plain(quaternion.from_thrust_direction)(*u)
        found.append(np.linalg.norm(np.array(q, dtype=float)))
    return np.array(found)


@pytest.mark.parametrize(("kind", "values"), [(np.float64, DOUBLE), (np.float32, SINGLE)])
def test_an_attitude_is_one_in_either_precision(kind, values, monkeypatch):
    assert np.abs(_norms(values["DOWNWARD"], monkeypatch, kind) - 1.0).max() < 1e-3


def test_single_precision_needs_a_value_of_its_own(monkeypatch):
    with np.errstate(all="ignore"):
        wrong = _norms(DOUBLE["DOWNWARD"], monkeypatch, np.float32)
    assert np.abs(wrong - 1.0).max() > 0.1


@pytest.mark.parametrize(("kind", "values"), [(np.float64, DOUBLE), (np.float32, SINGLE)])
@pytest.mark.parametrize("n", [2, 3, 8])
def test_the_best_alignment_settles_before_the_cap(kind, values, n, monkeypatch):
    """Of 60 steps."""
    monkeypatch.setattr(newton, "SETTLED", values["SETTLED"])
    steps = []
    monkeypatch.setattr(newton, "abs", lambda x: steps.append(x) or math.fabs(x), raising=False)
    for mu in np.geomspace(1e-3, 1e3, 40):
        steps.clear()
        a = plain(newton.optimal_alignment)(n, kind(mu))
        assert len(steps) < 30
        lead, shift = (3.0, n) if n > 2 else (4.0, 4.0)
        if mu * 2.0 * n**3 > 1.0:
            exact = max(np.roots([lead * mu, -shift * mu, 0.0, -1.0]).real)
            assert float(a) == pytest.approx(exact, rel=30.0 * float(np.finfo(kind).eps))
