"""A flight as data: named arrays with units, the resolved mission, seed and versions, in one file.

Layout of the HDF5 file (format version 1)::

    /                     attributes: format, mission (JSON), seed, versions (JSON), outcome,
                          source, provenance (JSON), commands (JSON)
    /time                 (rows,) s
    /signals/<name>       (rows, ...) attributes: unit, symbol, frame, meaning
    /allocator/time       (cycles,) s
    /allocator/<name>     (cycles,) attributes as above

What was not measured is NaN. Files written before ``source`` and ``provenance`` came are simulations.
"""

from __future__ import annotations

import json
import os
import platform
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.errors import MissionError, RecordingError
from colift.mission.load import load_mission
from colift.mission.schema import Mission, RealFlight
from colift.simulation.signals import CYCLE_SIGNALS, SIGNALS, Signal

Array = NDArray[np.float64]
FORMAT = "colift recording 1"


@contextmanager
def atomic_path(path: Path) -> Iterator[Path]:
    """A temporary path that replaces ``path`` when the block ends well, and vanishes otherwise."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        mask = os.umask(0)
        os.umask(mask)
        temporary.chmod(0o666 & ~mask)
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def versions() -> dict[str, str]:
    """Versions of what produced a result."""
    found = {name: metadata.version(name) for name in ("numpy", "numba", "h5py")}
    try:
        found["colift"] = metadata.version("colift")
    except metadata.PackageNotFoundError:
        found["colift"] = "not installed"
    found["python"] = platform.python_version()
    found["platform"] = platform.platform()
    return found


@dataclass(frozen=True)
class Recording(Mapping[str, Array]):
    """All signals of one flight by name.

    Attributes
    ----------
    mission : Mission or RealFlight
        As flown, with every default filled in; of a real flight, what is known of it.
    time : (rows,) array
        Times of the signals, s; increasing, in a real flight not evenly.
    cycle_time : (cycles,) array
        Times of the allocations, s.
    outcome : str
        ``"completed"``, or how the flight ended.
    provenance : dict
        Where the data of a real flight come from, and what was inferred; empty for a simulation.
    commands : list of (time, text)
        What a person did while it flew, s.

    """

    mission: Mission | RealFlight
    time: Array
    cycle_time: Array
    arrays: dict[str, Array]
    outcome: str = "completed"
    versions: dict[str, str] = field(default_factory=versions)
    provenance: dict[str, Any] = field(default_factory=dict)
    commands: Sequence[tuple[float, str]] = ()

    def __getitem__(self, name: str) -> Array:
        try:
            return self.arrays[name]
        except KeyError:
            raise KeyError(f"no signal {name!r}; there are {', '.join(self.arrays)}") from None

    def __iter__(self) -> Iterator[str]:
        return iter(self.arrays)

    def __len__(self) -> int:
        return len(self.arrays)

    @property
    def n(self) -> int:
        """Number of drones."""
        return self.mission.drones.count

    @property
    def source(self) -> str:
        """``"simulation"``, or ``"flight"`` for one that was flown in the real world."""
        return "flight" if isinstance(self.mission, RealFlight) else "simulation"

    def measured(self, *names: str) -> bool:
        """Whether each of these signals has any number in it."""
        return not any(np.isnan(self[name]).all() for name in names)

    @staticmethod
    def signal(name: str) -> Signal:
        """Unit, shape, frame and meaning of a signal."""
        return next(s for s in (*SIGNALS, *CYCLE_SIGNALS) if s.name == name)

    def save(self, path: str | Path) -> Path:
        """Write one HDF5 file, atomically; an existing file is replaced only by a whole one."""
        import h5py

        path = Path(path)
        with atomic_path(path) as temporary, h5py.File(temporary, "w") as file:
            file.attrs["format"] = FORMAT
            file.attrs["mission"] = json.dumps(self.mission.resolved())
            file.attrs["seed"] = self.mission.seed
            file.attrs["versions"] = json.dumps(self.versions)
            file.attrs["outcome"] = self.outcome
            file.attrs["source"] = self.source
            file.attrs["provenance"] = json.dumps(self.provenance)
            file.attrs["commands"] = json.dumps(list(self.commands))
            _write(file, "time", self.time, Signal("time", (), "s", "t", "-", "time"))
            _write(
                file, "allocator/time", self.cycle_time,
                Signal("time", (), "s", "t", "-", "time of each allocation"),
            )  # fmt: skip
            for signal in SIGNALS:
                _write(file, f"signals/{signal.name}", self[signal.name], signal)
            for signal in CYCLE_SIGNALS:
                short = signal.name.removeprefix("allocator_")
                target = "solve_time" if short == "time" else short
                _write(file, f"allocator/{target}", self[signal.name], signal)
        return path

    @classmethod
    def load(cls, path: str | Path) -> Recording:
        """Read a recording.

        Raises
        ------
        RecordingError
            If the file is missing, no HDF5 file, no colift recording, or lacks a signal.

        """
        import h5py

        try:
            with h5py.File(path, "r") as file:
                if file.attrs.get("format") != FORMAT:
                    raise RecordingError(f"{path}: not a file of format {FORMAT!r}")
                arrays = {s.name: file[f"signals/{s.name}"][()] for s in SIGNALS}
                for signal in CYCLE_SIGNALS:
                    short = signal.name.removeprefix("allocator_")
                    target = "solve_time" if short == "time" else short
                    arrays[signal.name] = file[f"allocator/{target}"][()]
                known = dict(json.loads(file.attrs["mission"]))
                real = file.attrs.get("source") == "flight"
                return cls(
                    mission=RealFlight.model_validate(known) if real else load_mission(known),
                    time=file["time"][()],
                    cycle_time=file["allocator/time"][()],
                    arrays=arrays,
                    outcome=str(file.attrs["outcome"]),
                    versions=json.loads(file.attrs["versions"]),
                    provenance=json.loads(file.attrs.get("provenance", "{}")),
                    commands=[
                        (float(time), str(text))
                        for time, text in json.loads(file.attrs.get("commands", "[]"))
                    ],
                )
        except (OSError, KeyError, ValueError, TypeError, MissionError) as error:
            raise RecordingError(f"{path}: cannot be read as a recording: {error}") from error


def _write(file: Any, name: str, values: Array, signal: Signal) -> None:
    dataset = file.create_dataset(name, data=values)
    dataset.attrs["unit"] = signal.unit
    dataset.attrs["symbol"] = signal.symbol
    dataset.attrs["frame"] = signal.frame
    dataset.attrs["meaning"] = signal.meaning
    dataset.attrs["shape"] = json.dumps(["time", *signal.shape])
