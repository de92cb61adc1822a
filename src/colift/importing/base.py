"""What every log format is turned into, and how a file's format is found.

A format is one file in this folder (``formats`` lists them) with two functions::

    recognises(head: bytes, path: Path) -> bool     from the first bytes of a file
    read(path: Path) -> Log                         or FlightDataError, with file and place
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from colift.errors import FlightDataError

Array = NDArray[np.float64]

HEAD = 4096
"""Bytes that a format is recognised by."""

DRONE_COLUMNS = {
    "positions": 3,
    "velocities": 3,
    "attitudes": 4,
    "rates": 3,
    "drone_forces": 3,
    "commands": 3,
    "shares": 3,
}
"""What a log may hold of each drone, and its number of components.

The first five are the recording's signals of that name. ``commands`` are the drones' own copies of
the total force wanted on the load, N; ``shares`` are the parts of it that each gave to its own cable,
N, as the force on the load: tension times the direction from the load to the drone.
"""


@dataclass(frozen=True)
class Log:
    """What one file recorded of a flight: SI units, world frame with z up, NaN where not recorded.

    Attributes
    ----------
    time : (rows,) array
        s, increasing, on the file's own clock.
    load, reference : (rows, 2, 3) arrays
        Position and velocity of the load, and of where it should be.
    drones : mapping
        Arrays (rows, n, k), with the names and components of :data:`DRONE_COLUMNS`.

    """

    time: Array
    load: Array
    reference: Array
    drones: Mapping[str, Array]

    @property
    def n(self) -> int:
        """Number of drones in the file."""
        return int(self.drones["positions"].shape[1])


def formats() -> dict[str, ModuleType]:
    """The modules that each read one format, by name."""
    package = importlib.import_module("colift.importing")
    found = sorted(module.name for module in pkgutil.iter_modules(package.__path__))
    return {
        name.replace("_", "-"): importlib.import_module(f"colift.importing.{name}")
        for name in found
        if not name.startswith("_") and name != "base"
    }


def read(path: Path) -> tuple[str, Log]:
    """Name of a file's format, and what it recorded.

    Raises
    ------
    FlightDataError
        If no format recognises the file, or it is damaged.
    OSError
        If it cannot be opened.

    """
    with path.open("rb") as file:
        head = file.read(HEAD)
    known = formats()
    for name, module in known.items():
        if module.recognises(head, path):
            return name, module.read(path)
    raise FlightDataError(f"{path}: no known log format; there are {', '.join(known)}")
