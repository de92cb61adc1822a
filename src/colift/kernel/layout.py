"""Names for the places of a kernel's parameters or memory.

A vector holds some fields of the whole team and then one row of fields for each drone::

    MEMORY = Layout(drone={"started": 1, "integral": 3})
    M = MEMORY.at

    o = M.rows + M.width * i           # in a kernel: the row of drone i
    memory[o + M.integral + k]

Compiled code takes the places for constants. Size, initial value, what a regrouped team keeps and how tests look at a
vector follow from the table.

A size that depends on settings stays open::

    MEMORY = Layout(drone={"started": 1, "queue": None})
    MEMORY.filled(queue=20)            # of these settings

Compiled code knows the places up to there; it is told any further ones, such as ``width``, as parameters.

Where a function wants a field of all drones in one piece, the rows are taken as columns, and one field stands after the
other. It is for the kernel to choose, by :func:`colift.kernel.math.columns.column`::

    alpha = column(memory, M.rows, n, MEMORY.spans.alpha)
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
        Fields that stand once, first. The size is None where it depends on settings.
    drone : mapping of name to size
        Fields of each drone, in a row of its own.

    Attributes
    ----------
    at : named tuple of int
        By name the first place of a field: in the vector for the team's, in its row for a drone's. ``at.rows`` is where the
        first row begins, ``at.width`` the length of a row. What stands behind an open size is missing.
    spans : named tuple of (int, int)
        By name place and size of a field, for a column of it; of fields whose size is known.

    """

    def __init__(
        self,
        team: Mapping[str, int | None] | None = None,
        drone: Mapping[str, int | None] | None = None,
    ) -> None:
        self.team, self.drone = dict(team or {}), dict(drone or {})
        self._sizes = {
            name: size for name, size in {**self.team, **self.drone}.items() if size is not None
        }
        places: list[tuple[str, int]] = []
        for fields, end in ((self.team, "rows"), (self.drone, "width")):
            place = 0
            for name in [*fields, end]:
                places.append((name, place))
                if name in fields and name not in self._sizes:
                    break
                place += self._sizes.get(name, 0)
        names, begins = zip(*places, strict=True)
        self.at: Any = named_tuple("Places", names, __name__)(*begins)
        spans = {name: (place, self._sizes[name]) for name, place in places if name in self._sizes}
        self.spans: Any = named_tuple("Spans", spans, __name__)(*spans.values())

    def filled(self, **sizes: int) -> Layout:
        """The same with these sizes for those that are open."""
        if wrong := {*sizes} ^ ({*self.team, *self.drone} - {*self._sizes}):
            raise TypeError(f"a size too many or too few: {', '.join(sorted(wrong))}")
        known = {**self._sizes, **sizes}
        return Layout(
            {name: known[name] for name in self.team}, {name: known[name] for name in self.drone}
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
            return vector[begin : begin + self._sizes[name]]
        rows = vector[self.at.rows :].reshape(-1, self.at.width)
        return rows[:, begin : begin + self._sizes[name]]

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
        """Into ``fresh`` what the team keeps, and the row of each drone that stays; see :meth:`colift.part.Part.carry_over`.

        What a vector holds behind its rows is that of ``fresh``.
        """
        rows, width = self.at.rows, self.at.width
        fresh[:rows] = old[:rows]
        for new, place in enumerate(places):
            if place >= 0:
                now, before = rows + width * new, rows + width * int(place)
                fresh[now : now + width] = old[before : before + width]
        return fresh
