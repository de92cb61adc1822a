"""Names for the places of a kernel's parameters or memory.

A vector holds some fields of the whole team and then one row of fields for each drone::

    MEMORY = Layout(drone={"started": 1, "integral": 3})
    M = MEMORY.at

    o = M.rows + M.width * i           # in a kernel: the row of drone i
    memory[o + M.integral + k]

Compiled code takes the places for constants. Size, initial value, what a regrouped team keeps and how tests look at a
vector follow from the table.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from colift.kernel.signals import named_tuple

Array = NDArray[np.float64]


class Layout:
    """Where each field of a vector stands.

    Parameters
    ----------
    team : mapping of name to size
        Fields that stand once, first.
    drone : mapping of name to size
        Fields of each drone, in a row of its own.

    Attributes
    ----------
    at : named tuple of int
        By name the first place of a field: in the vector for the team's, in its row for a drone's. ``at.rows`` is where the
        first row begins, ``at.width`` the length of a row.

    """

    def __init__(
        self, team: Mapping[str, int] | None = None, drone: Mapping[str, int] | None = None
    ) -> None:
        self.team, self.drone = dict(team or {}), dict(drone or {})
        places, end = {}, 0
        for name, size in self.team.items():
            places[name], end = end, end + size
        rows, end = end, 0
        for name, size in self.drone.items():
            places[name], end = end, end + size
        self.at: Any = named_tuple("Places", [*places, "rows", "width"], __name__)(
            *places.values(), rows, end
        )

    def size(self, n: int) -> int:
        """Length of the vector for n drones."""
        return int(self.at.rows + self.at.width * n)

    def zeros(self, n: int) -> Array:
        """A vector for n drones that knows nothing."""
        return np.zeros(self.size(n))

    def view(self, vector: Array, name: str) -> Array:
        """The places of one field in a vector: ``(size,)``, or ``(n, size)`` for a field of each drone."""
        begin = getattr(self.at, name)
        if name in self.team:
            return vector[begin : begin + self.team[name]]
        rows = vector[self.at.rows :].reshape(-1, self.at.width)
        return rows[:, begin : begin + self.drone[name]]

    def pack(self, n: int, **values: ArrayLike) -> Array:
        """A vector for n drones from a value for each field.

        A field of each drone takes ``(n,)`` or, if it has a size, ``(n, size)``; or one value for all drones.
        """
        if wrong := {*self.team, *self.drone} ^ {*values}:
            raise TypeError(f"a value too many or too few: {', '.join(sorted(wrong))}")
        vector = self.zeros(n)
        for name, value in values.items():
            place = self.view(vector, name)
            if self.drone.get(name) == 1:
                place[:, 0] = value
            else:
                place[...] = value
        return vector

    def carry_over(self, old: Array, fresh: Array, places: NDArray[np.int64]) -> Array:
        """Into ``fresh`` what the team keeps, and the row of each drone that stays; see :meth:`colift.part.Part.carry_over`."""
        rows, width = self.at.rows, self.at.width
        fresh[:rows] = old[:rows]
        if width:
            stay = places >= 0
            fresh[rows:].reshape(-1, width)[stay] = old[rows:].reshape(-1, width)[places[stay]]
        return fresh
