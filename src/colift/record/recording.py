"""A flight as data: named arrays with units, the resolved mission, seed and versions, in one file.

Layout of the HDF5 file (format version 1)::

    /                     attributes: format, mission (JSON), seed, versions (JSON), outcome,
                          source, provenance (JSON), commands (JSON)
    /time                 (rows,) s
    /signals/<name>       (rows, ...) attributes: unit, symbol, frame, meaning
    /allocator/time       (cycles,) s
    /allocator/<name>     (cycles,) attributes as above

What was not measured is NaN. Files written before ``source`` and ``provenance`` came are simulations.

A recording outlives the code: a signal that the file lacks is absent, one that this version does not know is
kept with its legend, and the mission is read without looking up any part (:mod:`colift.record.recorded`). Opening a file
imports no kernel.
"""

from __future__ import annotations

import json
import os
import platform
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from colift.errors import AbsentSignalError, RecordingError
from colift.kernel.signals import CYCLE_SIGNALS, LEGEND, SIGNALS, Signal
from colift.mission.schema import Described
from colift.record.recorded import RecordedMission

if TYPE_CHECKING:
    from colift.record.moments import Moment

Array = NDArray[np.float64]
FORMAT = "colift recording 1"
RECORDING = "recording.h5"
"""Name of the recording in the result folder of a run."""
_FORMATS = "colift recording "
_CYCLE = "allocator_"
"""How the names of signals of one value an allocation begin, beside others."""


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
    except BaseException as error:
        temporary.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.errno and error.filename is None:
            error.filename = str(path)  # a write does not say it, as on a full disk
        raise


def versions() -> dict[str, str]:
    """Versions of what produced a result."""
    return dict(_versions())


@cache
def _versions() -> dict[str, str]:
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
    mission : Mission, RealFlight or RecordedMission
        As flown, with every default filled in; of a real flight, what is known of it; of a file, what is
        written there.
    time : (rows,) array
        Times of the signals, s; increasing, in a real flight not evenly.
    cycle_time : (cycles,) array
        Times of the allocations, s.
    outcome : str
        ``"completed"``, or how the flight ended.
    provenance : dict
        Where the data of a real flight come from, and what was inferred; of a simulation its ``warnings``, and as ``outlooks`` how a rigid
        load went on when the team had changed, each a time, s, and words.
    commands : list of (time, text)
        What a person did while it flew, s.
    foreign : dict
        Legend of the signals that this version of colift does not know, by name.

    """

    mission: Described
    time: Array
    cycle_time: Array
    arrays: dict[str, Array]
    outcome: str = "completed"
    versions: dict[str, str] = field(default_factory=versions)
    provenance: dict[str, Any] = field(default_factory=dict)
    commands: Sequence[tuple[float, str]] = ()
    foreign: Mapping[str, Signal] = field(default_factory=dict)

    def __getitem__(self, name: str) -> Array:
        try:
            return self.arrays[name]
        except KeyError:
            raise AbsentSignalError(name, list(self.arrays)) from None

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
        return self.mission.source

    @cached_property
    def moments(self) -> list[Moment]:
        """What is worth a mark, in order of time (:mod:`colift.record.moments`)."""
        from colift.record.moments import find_moments

        return find_moments(self)

    def measured(self, *names: str) -> bool:
        """Whether each of these signals is there and has any number in it."""
        return all(name in self and not np.isnan(self[name]).all() for name in names)

    def complete(self) -> Recording:
        """A copy that has every signal that this version knows; what is absent is NaN."""
        rows, cycles = len(self.time), len(self.cycle_time)
        unknown = {s.name: (rows, *s.shape_for(self.n)) for s in SIGNALS}
        unknown |= {s.name: (cycles,) for s in CYCLE_SIGNALS}
        absent = {
            name: np.broadcast_to(np.nan, shape)
            for name, shape in unknown.items()
            if name not in self
        }
        return replace(self, arrays={**self.arrays, **absent}) if absent else self

    def signal(self, name: str) -> Signal:
        """Unit, shape, frame and meaning of a signal."""
        return self.foreign[name] if name in self.foreign else LEGEND[name]

    def save(self, path: str | Path) -> Path:
        """Write one HDF5 file, atomically; an existing file is replaced only by a whole one.

        Raises
        ------
        OSError
            If it cannot be written, as on a full disk; with the path.

        """
        path = Path(path)
        with atomic_path(path) as temporary:
            # HDF5 does not survive a disk that fills up while it writes, so it writes into memory.
            temporary.write_bytes(self._image())
        return path

    def _image(self) -> bytes:
        """The file, byte by byte."""
        import h5py

        with h5py.File("recording", "w", driver="core", backing_store=False) as file:
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
            for name, values in self.arrays.items():
                signal = self.signal(name)
                _write(file, _place(signal), values, signal)
            file.flush()
            return bytes(file.id.get_file_image())

    @classmethod
    def load(cls, path: str | Path) -> Recording:
        """Read a recording, also one of another version of colift, or of parts that are not installed.

        ``path`` is the file, or the result folder of a run.

        Raises
        ------
        RecordingError
            If the file is missing or damaged, no HDF5 file or no colift recording.

        """
        import h5py

        path = Path(path)
        if path.is_dir():
            path /= RECORDING
        if not path.exists():
            raise RecordingError(f"{path}: there is no such file")
        try:
            with h5py.File(path, "r") as file:
                if not str(file.attrs.get("format", "")).startswith(_FORMATS):
                    raise RecordingError(f"{path}: not a file of format {FORMAT!r}")
                return _read(file)
        except (OSError, KeyError, ValueError, TypeError, RuntimeError) as error:
            raise RecordingError(f"{path}: cannot be read as a recording: {error}") from error


def _place(signal: Signal) -> str:
    """Where a signal stands in the file."""
    if signal.each == "row":
        return f"signals/{signal.name}"
    short = signal.name.removeprefix(_CYCLE)
    return f"allocator/{'solve_time' if short == 'time' else short}"


def _write(file: Any, name: str, values: Array, signal: Signal) -> None:
    """One dataset with what there is to say of it, past h5py's own way, which takes three times as long."""
    from h5py import h5a, h5s, h5t, string_dtype

    dataset = file.create_dataset(name, data=values).id
    text, one = h5t.py_create(string_dtype(), logical=True), h5s.create(h5s.SCALAR)
    said = {key: getattr(signal, key) for key in ("unit", "symbol", "frame", "meaning")}
    for key, value in {**said, "shape": json.dumps(["time", *signal.shape])}.items():
        h5a.create(dataset, key.encode(), text, one).write(np.array(value, dtype=object))


def _read(file: Any) -> Recording:
    time = np.asarray(file["time"][()], dtype=float)
    if time.ndim != 1 or not len(time):
        raise ValueError("it holds no times")
    cycles = file.get("allocator", {})
    cycle_time = np.asarray(cycles["time"][()], dtype=float) if "time" in cycles else np.zeros(0)
    found = {name: (file["signals"][name], "row") for name in file["signals"]}
    for short in cycles:
        name = _CYCLE + ("time" if short == "solve_time" else short)
        if short != "time":
            found[name] = (cycles[short], "allocation")
    arrays, legend = {}, {}
    for name, (dataset, each) in found.items():
        if name in LEGEND:
            arrays[name] = np.asarray(dataset[()], dtype=float)
        elif hasattr(dataset, "shape"):  # a dataset, and no group
            arrays[name], legend[name] = dataset[()], _legend(name, dataset, each)
    table = json.loads(file.attrs["mission"])
    if not isinstance(table, dict):
        raise ValueError("its mission is no table")
    drones = _count(arrays, table)
    for name in arrays.keys() - legend.keys():
        rows = len(time) if LEGEND[name].each == "row" else len(cycle_time)
        shape, expected = arrays[name].shape, (rows, *LEGEND[name].shape_for(drones))
        if shape != expected:
            raise ValueError(f"signal {name} has the shape {shape}, not {expected}")
    return Recording(
        mission=RecordedMission.read(
            table, drones=drones, source=str(file.attrs.get("source", "simulation"))
        ),
        time=time,
        cycle_time=cycle_time,
        arrays=arrays,
        outcome=str(file.attrs["outcome"]),
        versions=json.loads(file.attrs.get("versions", "{}")),
        provenance=json.loads(file.attrs.get("provenance", "{}")),
        commands=[
            (float(time), str(text)) for time, text in json.loads(file.attrs.get("commands", "[]"))
        ],
        foreign=legend,
    )


def _count(arrays: Mapping[str, Array], table: Mapping[str, Any]) -> int:
    """Number of drones: that of the signals, which must agree; that of the mission where none tells it."""
    told = {
        values.shape[1]
        for name, values in arrays.items()
        if name in LEGEND and LEGEND[name].shape[:1] == ("n",) and values.ndim > 1
    }
    if len(told) > 1:
        raise ValueError(f"its signals are of {' and of '.join(map(str, sorted(told)))} drones")
    return told.pop() if told else int(table["drones"]["count"])


def _legend(name: str, dataset: Any, each: str) -> Signal:
    """What the file says of a signal that this version does not know."""
    unit, symbol, frame, meaning = (
        str(dataset.attrs.get(key, "?")) for key in ("unit", "symbol", "frame", "meaning")
    )
    try:
        shape = tuple(json.loads(dataset.attrs["shape"]))[1:]
    except (KeyError, ValueError, TypeError):
        shape = tuple(dataset.shape[1:])
    return Signal(name, shape, unit, symbol, frame, meaning, each=each)
