"""What every log format is turned into, and how a file's format is found.

A format is one file in this folder (``formats`` lists them) with two functions::

    recognises(head: bytes, path: Path) -> bool     from the first bytes of a file
    read(path: Path, told: Reading) -> Log          or FlightDataError, with file and place
"""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Literal

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


Frame = Literal["enu", "ned"]
Unit = Literal["m", "mm"]
TimeUnit = Literal["s", "ms", "us", "ns"]
QuaternionOrder = Literal["wxyz", "xyzw"]


@dataclass(frozen=True)
class Reading:
    """What a person says of a log's conventions; what is None is as documented, and doubted where it looks wrong.

    Attributes
    ----------
    frame : {"enu", "ned"}, optional
        Axes of the world: z up, or north-east-down with bodies forward-right-down.
    unit : {"m", "mm"}, optional
        Of positions and velocities.
    time_unit : {"s", "ms", "us", "ns"}, optional
        Of the time stamps.
    quaternion : {"wxyz", "xyzw"}, optional
        Order of a quaternion whose columns are numbered.

    """

    frame: Frame | None = None
    unit: Unit | None = None
    time_unit: TimeUnit | None = None
    quaternion: QuaternionOrder | None = None


@dataclass(frozen=True)
class Finding:
    """Something wrong with a log that was read all the same.

    Attributes
    ----------
    kind : str
        ``gap`` (rows whose numbers are left out), ``swap`` (drones taken for each other), ``jump`` (farther than
        can be flown, kept), ``damage`` (the rest of the file is lost).
    of : str
        What it concerns.
    rows : int
        How many rows.
    begin, end : float
        First and last of their times, s, on the log's clock.
    why : str
        How it shows.

    """

    kind: str
    of: str
    rows: int
    begin: float
    end: float
    why: str

    def __str__(self) -> str:
        when = (
            f"{self.begin:.2f} to {self.end:.2f} s" if self.rows > 1 else f"at {self.begin:.2f} s"
        )
        if self.kind == "gap":
            return (
                f"{self.of}: {self.rows} row{'s' * (self.rows != 1)} left out ({when}): {self.why}"
            )
        if self.kind == "damage":
            return f"{self.of}: {self.rows} rows read, up to {self.end:.2f} s: {self.why}"
        return f"{self.of}: {when}: {self.why}"


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
    findings : sequence of Finding
        What is wrong with it.
    load_attitude : (rows, 4) array, optional
        Of a rigid load, wxyz, load to world; none where the log has none.

    """

    time: Array
    load: Array
    reference: Array
    drones: Mapping[str, Array]
    findings: Sequence[Finding] = ()
    load_attitude: Array | None = None

    @property
    def n(self) -> int:
        """Number of drones in the file."""
        return int(self.drones["positions"].shape[1])


def formats() -> dict[str, ModuleType]:
    """The modules that each read one format, by name."""
    package = importlib.import_module("colift.record.importing")
    found = sorted(module.name for module in pkgutil.iter_modules(package.__path__))
    return {
        name.replace("_", "-"): importlib.import_module(f"colift.record.importing.{name}")
        for name in found
        if not name.startswith("_") and name != "base"
    }


def read(path: Path, told: Reading | None = None) -> tuple[str, Log]:
    """Name of a file's format, and what it recorded.

    Raises
    ------
    FlightDataError
        If no format recognises the file, or it is damaged.
    OSError
        If it cannot be opened.

    """
    head = b""
    if not path.is_dir():  # a bag is one
        with path.open("rb") as file:
            head = file.read(HEAD)
    known = formats()
    for name, module in known.items():
        if module.recognises(head, path):
            return name, module.read(path, told or Reading())
    raise FlightDataError(f"{path}: no known log format; there are {', '.join(known)}")
