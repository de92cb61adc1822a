"""A load that has an attitude: its inertia, and where the cables end on it."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from colift.errors import SettingError
from colift.wording import numbers, shown

Array = NDArray[np.float64]


LEVEL = (1.0, 0.0, 0.0, 0.0)
"""The attitude in which the load's frame is the world's."""


@dataclass(frozen=True)
class Body:
    """A rigid load, in the frame that is fixed to it; what is called its place is that frame's origin, its middle.

    Attributes
    ----------
    inertia : (3, 3) array
        About the centre of mass, kg m^2.
    attachments : (n, 3) array
        Where the cables end, m.
    centre : (3,) array
        Centre of mass, m.
    size : (3,) array
        Edges of the box around it, m, which has its middle in the origin.
    points : (k, 3) array
        With which it touches others and the ground, m; left out, the corners of that box.
    hang : (4,) array
        Attitude in hover beside that which is wanted, unit quaternion wxyz: level, but of a load that only leaning hangs on its cables.

    Raises
    ------
    SettingError
        For a wrong shape, numbers that are not finite, or an inertia that no body has.

    """

    inertia: Array
    attachments: Array
    centre: Array = None  # type: ignore[assignment]  # what is left out becomes an array
    size: Array = None  # type: ignore[assignment]
    points: Array = None  # type: ignore[assignment]
    hang: Array = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        keep = object.__setattr__
        inertia = numbers("inertia", self.inertia, (3, 3))
        if flaw := flaw_of(inertia):
            raise SettingError.of("inertia", shown(inertia.tolist()), flaw)
        keep(self, "inertia", inertia)
        n = np.shape(self.attachments)[0] if np.ndim(self.attachments) == 2 else 0
        if n < 1:
            raise SettingError.of(
                "attachments", shown(self.attachments), "must be at least 1 point"
            )
        keep(self, "attachments", numbers("attachments", self.attachments, (n, 3)))
        centre = np.zeros(3) if self.centre is None else numbers("centre", self.centre, (3,))
        keep(self, "centre", centre)
        around = 2.0 * np.abs(self.attachments).max(axis=0)
        size = around if self.size is None else numbers("size", self.size, (3,), least=0.0)
        keep(self, "size", size)
        points = corners(size) if self.points is None else self.points
        keep(self, "points", numbers("points", points, (np.shape(points)[0], 3)))
        hang = LEVEL if self.hang is None else numbers("hang", self.hang, (4,))
        keep(self, "hang", np.asarray(hang) / np.linalg.norm(hang))

    @property
    def n(self) -> int:
        """Number of cables."""
        return int(self.attachments.shape[0])

    @property
    def sole(self) -> float:
        """How far below its middle it touches the ground when it stands level, m."""
        return -float(self.points[:, 2].min())

    @property
    def arms(self) -> Array:
        """Attachments (n, 3) from the centre of mass, m."""
        return self.attachments - self.centre

    def of(self, drones: Sequence[int]) -> Body:
        """The load on the cables of these drones."""
        return replace(self, attachments=self.attachments[list(drones)])

    def with_masses(self, mass: float, more: Array) -> Body:
        """The load of this mass (kg) with point masses (n,) at the attachments, kg."""
        total = mass + float(more.sum())
        centre = (mass * self.centre + more @ self.attachments) / total
        inertia = self.inertia + mass * parallel_axis(self.centre - centre)
        for extra, place in zip(more, self.attachments, strict=True):
            inertia = inertia + extra * parallel_axis(place - centre)
        return replace(self, centre=centre, inertia=inertia)


Pose = tuple[Array, Array, Array]
"""Motion (4, 3), attitude (4,), wxyz, and rates with two derivatives (3, 3) that are wanted of a load."""


def times_of(first: ArrayLike, then: ArrayLike) -> Array:
    """Quaternion (4,), wxyz, of the attitude ``first``, turned in its own frame by ``then``."""
    (w, x, y, z), (a, b, c, d) = (np.asarray(each, dtype=float).tolist() for each in (first, then))
    return np.array(
        [
            w * a - x * b - y * c - z * d,
            w * b + a * x + y * d - z * c,
            w * c + a * y + z * b - x * d,
            w * d + a * z + x * c - y * b,
        ]
    )


def from_to(first: ArrayLike, then: ArrayLike) -> Array:
    """By what ``first`` is turned in its own frame to be ``then``, quaternions (4,)."""
    return times_of(np.asarray(first) * (1.0, -1.0, -1.0, -1.0), then)


def parallel_axis(offset: Array) -> Array:
    """Moment of inertia (3, 3) of a unit mass with this offset (3,), m^2."""
    return np.asarray(offset @ offset * np.eye(3) - np.outer(offset, offset))


def corners(size: Array) -> Array:
    """Corners (k, 3) of a box with its middle in the origin, m; two for a bar, four for a sheet."""
    edges = [(-0.5 * edge, 0.5 * edge) if edge > 0.0 else (0.0,) for edge in size]
    return np.array(list(itertools.product(*edges)))


def box_inertia(mass: float, size: Array) -> Array:
    """Inertia (3, 3) of a uniform box, kg m^2."""
    x, y, z = np.square(size)
    return np.diag([y + z, z + x, x + y]) * (mass / 12.0)


def flaw_of(inertia: Array) -> str:
    """Why no body has this inertia (3, 3); empty where one has."""
    if not np.allclose(inertia, inertia.T, rtol=1e-9, atol=0.0):
        return "must be symmetric"
    least, middle, most = np.linalg.eigvalsh(inertia)
    if least <= 0.0:
        return f"must have principal moments above 0; the least is {least:.4g} kg m^2"
    if most > (least + middle) * (1.0 + 1e-9):
        return (
            f"must have principal moments of which none exceeds the sum of the others: "
            f"{least:.4g}, {middle:.4g}, {most:.4g} kg m^2"
        )
    return ""


def usual_attachments(n: int, size: Array) -> Array:
    """Where n cables end on a box by default (n, 3), m: on its upper face, two at the ends, four on the corners, others around."""
    x, y, z = 0.5 * np.asarray(size, dtype=float)
    if n == 1:
        return np.array([[0.0, 0.0, z]])
    if n == 2:
        along = (x, 0.0) if x >= y else (0.0, y)
        return np.array([[*along, z], [-along[0], -along[1], z]])
    if n == 4:
        return np.array([[x, y, z], [-x, y, z], [-x, -y, z], [x, -y, z]])
    angles = 2.0 * math.pi * np.arange(n) / n
    return np.column_stack([x * np.cos(angles), y * np.sin(angles), np.full(n, z)])


def edge_attachments(n: int, size: Array, first: float) -> Array:
    """Ends (n, 3) on the edges of a box's upper face, m, at equal angles of the ellipse within them from ``first`` on, rad.

    Each goes straight out from the ellipse to the edge: four from 45 degrees on are the corners, eight the corners and the middles of all edges.
    """
    x, y, z = 0.5 * np.asarray(size, dtype=float)
    angles = first + 2.0 * math.pi * np.arange(n) / n
    ring = np.column_stack([np.cos(angles), np.sin(angles)])
    ring /= np.abs(ring).max(axis=1, keepdims=True)
    return np.column_stack([x * ring[:, 0], y * ring[:, 1], np.full(n, z)])
