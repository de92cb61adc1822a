"""Signals as tables: CSV and Parquet files, and data frames of pandas, Polars and xarray.

A column a number, named by its signal and its places in it: ``load_0_x`` is the load's position along x, ``positions_2_z`` drone 2's height,
``attitudes_0_w`` the first number of drone 0's quaternion. The first column is ``time``, s. Signals that were not measured at all are
left out. What there is one of for each allocation, at times of its own, is a table of its own.
"""

from __future__ import annotations

import csv
import itertools
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from colift.errors import MissingExtraError
from colift.extras import install
from colift.kernel.signals import Signal
from colift.record.recording import Array, Recording, atomic_path

Progress = Callable[[float], None]

AXES = {3: "xyz", 4: "wxyz"}
"""Names of the last places in a signal, by their number."""
BLOCK = 1000
"""Rows that are written at once."""
NO_AXES = {"motor_health"}
"""Signals of four numbers that are no quaternion."""


def package(name: str, extra: str) -> ModuleType:
    """An optional package.

    Raises
    ------
    MissingExtraError
        Without it.

    """
    import importlib

    try:
        return importlib.import_module(name)
    except ImportError:
        raise MissingExtraError(
            f"this needs the package {name}, the extra {extra}; run: {install(extra)}"
        ) from None


def columns(
    recording: Recording, *, allocations: bool = False
) -> dict[str, tuple[Array, Signal | None]]:
    """Each column by name, with the signal that it is part of, the time first: those of each row, or those of each allocation."""
    time = recording.cycle_time if allocations else recording.time
    found: dict[str, tuple[Array, Signal | None]] = {"time": (time, None)}
    for name, values, signal in _measured(recording, allocations):
        ranges = [
            _axes(name, *each) or [str(k) for k in range(each[1])]
            for each in _named(signal, values)
        ]
        for at, places in zip(np.ndindex(*values.shape[1:]), itertools.product(*ranges), strict=True):  # fmt: skip
            found["_".join([name, *places])] = values[:, *at], signal
    return found


def _measured(recording: Recording, allocations: bool) -> Iterator[tuple[str, Array, Signal]]:
    for name, values in recording.items():
        signal = recording.signal(name)
        if (signal.each != "row") == allocations and recording.measured(name):
            yield name, values, signal


def _axes(name: str, declared: str, count: int) -> list[str]:
    """Names of the last places in a signal: axes, or the numbers of a quaternion."""
    last = declared == f"last {count}" and name not in NO_AXES
    return list(AXES.get(count, "")) if last else []


def write_csv(recording: Recording, path: Path, progress: Progress | None = None) -> list[Path]:
    """Write the rows as CSV, and beside them the allocations as ``NAME-allocations.csv``; numbers that come back in every bit."""
    written = []
    for allocations, target in _targets(recording, path):
        table = columns(recording, allocations=allocations)
        values = np.stack([each for each, _ in table.values()], axis=1)
        with (
            atomic_path(target) as temporary,
            temporary.open("w", newline="", encoding="utf-8") as file,
        ):
            writer = csv.writer(file)
            writer.writerow(table)
            for begin in range(0, len(values), BLOCK):
                rows = values[begin : begin + BLOCK].tolist()
                writer.writerows(["" if x != x else repr(x) for x in row] for row in rows)
                if progress is not None and not allocations:
                    progress(begin / len(values))
        written.append(target)
    return written


def write_parquet(recording: Recording, path: Path, progress: Progress | None = None) -> list[Path]:
    """The same as Parquet; columns know unit, frame and meaning, the file mission, outcome and versions.

    Raises
    ------
    MissingExtraError
        Without pyarrow (extra ``parquet``).

    """
    arrow, parquet = package("pyarrow", "parquet"), package("pyarrow.parquet", "parquet")
    said = {
        "colift.mission": json.dumps(recording.mission.resolved()),
        "colift.outcome": recording.outcome,
        "colift.source": recording.source,
        "colift.versions": json.dumps(recording.versions),
    }
    written = []
    for allocations, target in _targets(recording, path):
        table = columns(recording, allocations=allocations)
        fields = [
            arrow.field(name, arrow.float64(), metadata=_legend(signal))
            for name, (_, signal) in table.items()
        ]
        made = arrow.table(
            [values for values, _ in table.values()], schema=arrow.schema(fields, metadata=said)
        )
        with atomic_path(target) as temporary:
            parquet.write_table(made, temporary)
        written.append(target)
    return written


def _targets(recording: Recording, path: Path) -> list[tuple[bool, Path]]:
    beside = path.with_name(f"{path.stem}-allocations{path.suffix}")
    more = next(_measured(recording, True), None) is not None
    return [(False, path), *([(True, beside)] if more else [])]


def _legend(signal: Signal | None) -> dict[str, str]:
    if signal is None:
        return {"unit": "s", "meaning": "time"}
    return {key: getattr(signal, key) for key in ("unit", "symbol", "frame", "meaning")}


def to_pandas(recording: Recording, *, allocations: bool = False) -> Any:
    """A ``pandas.DataFrame`` with the columns, and the time as its index; units and meanings in ``attrs``."""
    table = columns(recording, allocations=allocations)
    frame = package("pandas", "frames").DataFrame({name: each for name, (each, _) in table.items()})
    frame.attrs["legend"] = {name: _legend(signal) for name, (_, signal) in table.items()}
    return frame.set_index("time")


def to_polars(recording: Recording, *, allocations: bool = False) -> Any:
    """A ``polars.DataFrame`` with the columns, time among them."""
    table = columns(recording, allocations=allocations)
    return package("polars", "frames").DataFrame({name: each for name, (each, _) in table.items()})


def to_xarray(recording: Recording) -> Any:
    """An ``xarray.Dataset``: signals as they are, along ``time`` or ``allocation`` and named dimensions, with units and meanings."""
    xarray = package("xarray", "frames")
    found = {}
    for allocations, along in ((False, "time"), (True, "allocation")):
        for name, values, signal in _measured(recording, allocations):
            names = [along, *(_dimension(name, *each) for each in _named(signal, values))]
            found[name] = (names, values, _legend(signal))
    places = {"time": recording.time, "allocation": recording.cycle_time}
    told = {"outcome": recording.outcome, "mission": json.dumps(recording.mission.resolved())}
    return xarray.Dataset(found, coords=places, attrs=told)


def _named(signal: Signal, values: Array) -> list[tuple[str, int]]:
    """Of each place in a signal what it counts, and how far; of the last one, where that is no drone, that it is the last."""
    found = [str(each) for each in [*signal.shape, *[""] * values.ndim][: values.ndim - 1]]
    if found and not found[-1].startswith("n"):
        found[-1] = f"last {values.shape[-1]}"
    return list(zip(found, values.shape[1:], strict=True))


def _dimension(name: str, declared: str, count: int) -> str:
    if declared in ("n", "n+1"):
        return "drone" if declared == "n" else "drone_or_load"
    if _axes(name, declared, count):
        return "axis" if count == 3 else "wxyz"
    return f"{name}_{count}"
