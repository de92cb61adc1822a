"""Contact: the first of many moments in which two drones, a drone and another's cable, or a drone and the load touch.

A drone counts as an ellipsoid about its centre with its radius, half as tall: rotors lie in one plane, which leans. A cable
counts where it is straight, a load as a point or as the box around it, and who has no known radius touches nobody.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FLAT = 0.5
"""Height of a drone over its width."""
STRAIGHT = 0.98
"""Share of its length from which on a cable that spans it is straight."""
PAIRED = 200_000
"""Pairs of drones that are looked at at a time."""


class Boxes(NamedTuple):
    """A rigid load at many moments."""

    size: Array
    """Edges (3,), m."""
    places: Array
    """Of its middle (rows, 3), m."""
    attitudes: Array
    """Unit quaternions (rows, 4), wxyz."""

    def away(self, positions: Array) -> Array:
        """From the nearest point of the box to each place (rows, n, 3), world, m; zero within it."""
        w, v = self.attitudes[:, :1, None], self.attitudes[:, None, 1:]

        def turned(vectors: Array, sense: float) -> Array:
            across = 2.0 * np.cross(v, vectors)
            return np.asarray(vectors + sense * w * across + np.cross(v, across))

        own = turned(positions - self.places[:, None], -1.0)
        half = 0.5 * np.asarray(self.size)
        return turned(own - np.clip(own, -half, half), 1.0)

    def of(self, rows: slice) -> Boxes:
        """At some of these moments."""
        return Boxes(self.size, self.places[rows], self.attitudes[rows])


def first_contact(
    radii: Array,
    lengths: Array,
    positions: Array,
    ends: Array,
    attached: Array,
    boxes: Boxes | None = None,
) -> tuple[int, str] | None:
    """Row of the first contact, and who touches whom, with drones by their place ``{0}``, ``{1}``; None without contact.

    Parameters
    ----------
    radii : (n,) array
        Of the drones, m; NaN where it is not known.
    lengths : (n,) or (rows, n) array
        Of the cables, m.
    positions, ends : (rows, n, 3) array
        Of the drones, and of the cables' ends on the load, m.
    attached : (rows, n) array
        1 while a cable holds.
    boxes : Boxes, optional
        Of a rigid load: who comes as near to it as its radius touches it. Left out, who comes to its own cable's end does.

    """
    n = radii.size
    lengths = np.broadcast_to(lengths, positions.shape[:2])
    rows = max(1, PAIRED // (n * n))
    for begin in range(0, len(positions), rows):
        part = slice(begin, begin + rows)
        found = min(
            _contacts(
                radii,
                lengths[part],
                positions[part],
                ends[part],
                attached[part],
                boxes.of(part) if boxes else None,
            ),
            key=lambda found: found[0],
            default=None,
        )
        if found is not None:
            return begin + found[0], found[1]
    return None


def _contacts(
    radii: Array,
    lengths: Array,
    positions: Array,
    ends: Array,
    attached: Array,
    boxes: Boxes | None,
) -> Iterator[tuple[int, str]]:
    """The first contact of each kind."""
    squeeze = np.array([1.0, 1.0, 1.0 / FLAT])
    taut = (np.linalg.norm(ends - positions, axis=-1) > STRAIGHT * lengths) & (attached > 0.0)
    at, ends = positions * squeeze, ends * squeeze
    one, other = np.triu_indices(radii.size, k=1)
    near = np.linalg.norm(at[:, one] - at[:, other], axis=-1) < radii[one] + radii[other]
    yield from _first(near, one, other, "drones {0} and {1} touched")
    every = np.arange(radii.size)
    missing = at - ends if boxes is None else boxes.away(positions) * squeeze
    near = np.linalg.norm(missing, axis=-1) < radii
    yield from _first(near, every, every, "drone {0} touched the load")
    one, other = (k.ravel() for k in np.nonzero(~np.eye(radii.size, dtype=bool)))
    cable = (ends - at)[:, other]
    away = at[:, one] - at[:, other]
    square = np.maximum(np.sum(cable**2, axis=-1), 1e-12)
    share = np.clip(np.sum(away * cable, axis=-1) / square, 0.0, 1.0)
    near = np.linalg.norm(away - share[..., None] * cable, axis=-1) < radii[one]
    yield from _first(near & taut[:, other], one, other, "drone {0} touched the cable of drone {1}")


def _first(
    near: NDArray[np.bool_], one: NDArray[np.intp], other: NDArray[np.intp], text: str
) -> Iterator[tuple[int, str]]:
    rows = np.flatnonzero(near.any(axis=1))
    if rows.size:
        k = int(np.argmax(near[rows[0]]))
        yield int(rows[0]), text.format(f"{{{one[k]}}}", f"{{{other[k]}}}")


def watched(radii: Array) -> bool:
    """Whether any radius is known."""
    return any(map(math.isfinite, radii))
