"""Values of clamped B-splines on equal knots of the unit interval, as Taylor coefficients."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numpy.typing import NDArray

Numbers = NDArray[np.float64]


def _values(knots: Numbers, degree: int, at: Numbers) -> Numbers:
    """All basis functions of a degree (len(at), len(knots) - degree - 1), by the recursion of Cox and de Boor."""
    last = np.searchsorted(knots, knots[-1]) - 1
    span = np.minimum(np.searchsorted(knots, at, side="right") - 1, last)
    N = np.zeros((len(at), len(knots) - 1))
    N[np.arange(len(at)), span] = 1.0
    for p in range(1, degree + 1):
        width = knots[p:] - knots[:-p]
        inverse = np.divide(1.0, width, out=np.zeros_like(width), where=width > 0.0)
        count = len(knots) - p - 1
        left = (at[:, None] - knots[None, :count]) * inverse[:count]
        right = (knots[None, p + 1 :] - at[:, None]) * inverse[1:]
        N = left * N[:, :count] + right * N[:, 1:]
    return N


@cache
def table(intervals: int, degree: int, orders: int, samples: int) -> Numbers:
    """Taylor coefficients (S, orders, degree + 1) of the local basis functions at S = intervals * samples + 1 places.

    Row ``k`` is the k-th derivative over k!, in unit intervals. Place ``s`` lies in interval ``min(s // samples, intervals - 1)``,
    whose local functions are those from that number on.
    """
    at = np.arange(intervals * samples + 1) / (intervals * samples)
    count = intervals + degree
    knots = np.clip(np.arange(-degree, intervals + degree + 1) / intervals, 0.0, 1.0)
    out = np.zeros((len(at), orders, degree + 1))
    change = np.eye(count)
    first = np.minimum(np.arange(len(at)) // samples, intervals - 1)
    for k in range(orders):
        p = degree - k
        inner = knots[k : len(knots) - k]
        values = _values(inner, p, at) @ change / math.factorial(k)
        out[:, k] = np.take_along_axis(values, first[:, None] + np.arange(degree + 1), axis=1)
        if k + 1 < orders:
            width = inner[1 + p : -1] - inner[1 : -1 - p]
            change = p * np.diff(change, axis=0) / width[:, None]
    return out


def refined(points: Numbers, degree: int, intervals: int) -> Numbers:
    """Control points (2 * intervals + degree, d) of the same curve on knots twice as many."""
    coarse = table(intervals, degree, 1, 8)[:, 0]
    fine = table(2 * intervals, degree, 1, 4)[:, 0]
    values = curve(points, coarse, intervals, 8)
    matrix = dense(fine, 2 * intervals, 4)
    return np.asarray(np.linalg.lstsq(matrix, values, rcond=None)[0], dtype=np.float64)


def dense(local: Numbers, intervals: int, samples: int) -> Numbers:
    """Local functions (S, degree + 1) as a matrix of all of them."""
    S, width = local.shape
    out = np.zeros((S, intervals + width - 1))
    first = np.minimum(np.arange(S) // samples, intervals - 1)
    np.put_along_axis(out, first[:, None] + np.arange(width), local, axis=1)
    return out


def curve(points: Numbers, local: Numbers, intervals: int, samples: int) -> Numbers:
    """Values (S, d) of a spline."""
    return dense(local, intervals, samples) @ points
