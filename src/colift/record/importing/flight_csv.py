"""Whole flights as CSV: one row a time, the load, its reference and every drone in columns.

Columns, in SI units and a world frame with z up unless the reader is told otherwise: ``t``;
``load_{x,y,z}``, ``load_v{x,y,z}``, ``load_q{w,x,y,z}`` (attitude of a rigid load, load to world); ``ref_{x,y,z}``, ``ref_v{x,y,z}``; and for drone K = 0, 1, ...:
``uavK_{x,y,z}``, ``uavK_v{x,y,z}``, ``uavK_q{w,x,y,z}`` (attitude, body to world; as ``uavK_q{0,1,2,3}`` the
order must be told), ``uavK_w{x,y,z}`` (body rates), ``uavK_fd{x,y,z}`` (total force wanted on the load, as this
drone computed it) and ``uavK_mu{x,y,z}`` (this cable's share of it). Time and positions are required, the rest may
be absent; an empty cell or ``nan`` is a number that was not recorded. Cells are separated by commas, semicolons or
tabs; where it is not the comma, a decimal comma is read.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from colift.errors import FlightDataError
from colift.record.importing._axes import upright
from colift.record.importing._plausible import SECONDS, doubt_time
from colift.record.importing.base import DRONE_COLUMNS, Array, Finding, Log, Reading

_AXES = "xyz"
_DRONE = {
    "positions": ("", "xyz"),
    "velocities": ("v", "xyz"),
    "attitudes": ("q", "wxyz"),
    "rates": ("w", "xyz"),
    "commands": ("fd", "xyz"),
    "shares": ("mu", "xyz"),
}
_LENGTHS = ("positions", "velocities")
_MISSING = {"", "nan", "na", "n/a", "null", "none", "-", "--", "inf", "+inf", "-inf", "infinity"}
_MOST = 1e9
"""Largest number that counts as one, time aside; what is beyond was not measured."""
_SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab"}


def recognises(head: bytes, path: Path) -> bool:
    """Whether the first line is a header with a time and the load's position."""
    if path.suffix.lower() in (".csv", ".tsv"):
        return True
    try:
        first, _ = _header(io.StringIO(_decoded(head, errors="ignore")))
    except (csv.Error, UnicodeError):
        return False
    return {"t", "load_x"} <= set(first)


def read(path: Path, told: Reading) -> Log:
    """Read one file.

    Raises
    ------
    FlightDataError
        For a missing, unknown or doubled column, a cell that is no number, a row of another length, a
        time that does not increase, with column and line; for numbers that look like another unit than the one
        told or documented.

    """
    data = path.read_bytes()
    text, damage = _text(path, data)
    lines = io.StringIO(text, newline="")
    try:
        header, separator = _header(lines)
        header = _quaternions(path, header, told)
        n = _check_header(path, header, separator)
        values, cut = _table(path, header, lines, separator)
    except csv.Error as error:
        raise FlightDataError(f"{path}: is not a CSV file: {error}") from error
    damage = damage or cut
    if len(values) < 2:
        raise FlightDataError(
            f"{path}: holds {len(values)} rows of numbers; a flight has at least 2"
            + (f" ({damage})" if damage else "")
        )
    column = {name: values[:, k] for k, name in enumerate(header)}
    doubt_time(path, column["t"], told)
    time = (column["t"] - column["t"][0]) * SECONDS[told.time_unit or "s"]
    findings = [Finding("damage", path.name, len(time), 0.0, float(time[-1]), damage)] * bool(
        damage
    )
    log = _log(column, time, n)
    if told.unit == "mm":
        log = _scaled(log, 1e-3)
    return replace(upright(log) if told.frame == "ned" else log, findings=findings)


def _decoded(data: bytes, errors: str = "strict") -> str:
    """Text in UTF-8, or in UTF-16 that says so."""
    wide = data.startswith((b"\xff\xfe", b"\xfe\xff"))
    return data.decode("utf-16" if wide else "utf-8-sig", errors)


def _text(path: Path, data: bytes) -> tuple[str, str]:
    """The file's text, and why it ends early if it does."""
    damage = ""
    if not data.startswith((b"\xff\xfe", b"\xfe\xff")) and b"\0" in data:
        end = data.index(b"\0")
        end = data.rfind(b"\n", 0, end) + 1  # the row that the zeros begin in is not whole
        damage = f"from byte {end} on it holds zeros, as of a file that was not closed"
        data = data[:end]
    try:
        return _decoded(data), damage
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise FlightDataError(
            f"{path}: is not a CSV file in UTF-8: line {line}: {error.reason}"
        ) from error


def _header(lines: io.StringIO) -> tuple[list[str], str]:
    """Names of the columns and what separates them; a spreadsheet's line ``sep=;`` is passed over."""
    first = lines.readline()
    if re.fullmatch(r'"?sep=.\s*"?\s*', first):
        first = lines.readline()
    separator = max(_SEPARATORS, key=first.count)
    cells = next(csv.reader([first], delimiter=separator), [])
    return [name.strip().lower() for name in cells], separator


def _quaternions(path: Path, header: list[str], told: Reading) -> list[str]:
    """The header with the numbered components of quaternions named, in the order that was told."""
    numbered = [name for name in header if re.fullmatch(r"(uav\d{1,4}|load)_q[0-3]", name)]
    if not numbered:
        return header
    if told.quaternion is None:
        raise FlightDataError(
            f"{path}: columns {numbered[0][:-1]}0 to 3 do not say their order: name them "
            f"{numbered[0][:-1]}w, x, y, z, or give --quaternion wxyz or xyzw"
        )
    return [
        name[:-1] + told.quaternion[int(name[-1])] if name in numbered else name for name in header
    ]


def _names(n: int) -> tuple[list[str], list[list[str]]]:
    """Columns that a file of n drones must have, and the vectors that it may have."""
    must = ["t", *(f"load_{axis}" for axis in _AXES)]
    may = [[f"{prefix}{axis}" for axis in _AXES] for prefix in ("load_v", "ref_", "ref_v")]
    may.append([f"load_q{axis}" for axis in "wxyz"])
    for k in range(n):
        must += [f"uav{k}_{axis}" for axis in _AXES]
        may += [
            [f"uav{k}_{head}{axis}" for axis in axes] for head, axes in list(_DRONE.values())[1:]
        ]
    return must, may


def _check_header(path: Path, header: list[str], separator: str) -> int:
    """Number of drones in a header that has all it needs and nothing else."""
    found = [int(match[1]) for name in header if (match := re.match(r"uav(\d{1,4})_", name))]
    n = max(found, default=0) + 1
    must, may = _names(n)
    for name in must:
        if name not in header:
            alone = f"; cells are taken to be separated by {_SEPARATORS[separator]}s"
            raise FlightDataError(
                f"{path}: column {name} is missing{alone if len(header) < 3 else ''}"
            )
    known = {*must, *(name for vector in may for name in vector)}
    for name in header:
        if name not in known:
            raise FlightDataError(
                f"{path}: unknown column {name!r} (columns: {', '.join(sorted(known))})"
            )
        if header.count(name) > 1:
            raise FlightDataError(f"{path}: column {name} stands there twice")
    for vector in may:
        absent = [name for name in vector if name not in header]
        if absent and len(absent) < len(vector):
            raise FlightDataError(f"{path}: column {absent[0]} is missing beside {vector[0][:-1]}*")
    return n


def _table(path: Path, header: list[str], lines: io.StringIO, separator: str) -> tuple[Array, str]:
    """Numbers (rows, columns), and why the last row is left out if it is."""
    first = 2 if lines.tell() == 0 else lines.getvalue()[: lines.tell()].count("\n") + 1
    rows: list[list[float]] = []
    t = header.index("t")
    broken = None  # the last row, if it may be cut off
    ended = lines.getvalue().endswith("\n")
    for number, cells in enumerate(csv.reader(lines, delimiter=separator), start=first):
        if not any(cell.strip() for cell in cells):
            continue
        if broken is not None:
            raise broken
        try:
            row = _numbers(path, header, number, cells, separator)
        except FlightDataError as error:
            if len(cells) > len(header) or (len(cells) == len(header) and ended):
                raise
            broken = error
            continue
        if math.isnan(row[t]):
            raise FlightDataError(
                f"{path}: column t, line {number}: {cells[t]!r} must be a finite number"
            )
        if rows and row[t] <= rows[-1][t]:
            raise FlightDataError(
                f"{path}: column t, line {number}: time {row[t]:.12g} does not come after {rows[-1][t]:.12g}"
            )
        rows.append(row)
    values = np.array(rows, dtype=float).reshape(len(rows), len(header))
    return values, f"its last row is cut off ({str(broken).partition(': ')[2]})" if broken else ""


def _numbers(
    path: Path, header: list[str], line: int, cells: list[str], separator: str
) -> list[float]:
    """The numbers of one row."""
    if len(cells) != len(header):
        what = f"{path}: line {line} has {len(cells)} cells; the header has {len(header)}"
        if separator == "," and len(cells) > 1.5 * len(header):
            what += ". Is a decimal comma used? Then separate the cells by semicolons or tabs"
        raise FlightDataError(what)
    return [
        _number(path, name, line, cell, separator) for name, cell in zip(header, cells, strict=True)
    ]


def _number(path: Path, name: str, line: int, cell: str, separator: str) -> float:
    """The number in a cell; NaN where none was recorded."""
    text = cell.strip()
    if text.lower() in _MISSING:
        return math.nan
    if "," in text and "." not in text and (separator != "," or text.count(",") == 1):
        text = text.replace(",", ".")
    try:
        if "_" in text or not text.isascii():  # which Python would take
            raise ValueError
        value = float(text)
    except ValueError:
        raise FlightDataError(
            f"{path}: column {name}, line {line}: {cell!r} is not a number"
        ) from None
    return value if math.isfinite(value) and (name == "t" or abs(value) <= _MOST) else math.nan


def _log(column: Mapping[str, Array], time: Array, n: int) -> Log:
    missing = np.full(len(time), np.nan)

    def vectors(prefix: str, axes: str = _AXES) -> Array:
        return np.stack([column.get(prefix + axis, missing) for axis in axes], axis=-1)

    drones = {
        name: np.stack(
            [vectors(f"uav{k}_{_DRONE[name][0]}", _DRONE[name][1]) for k in range(n)], axis=1
        )
        if name in _DRONE
        else np.full((len(time), n, width), np.nan)
        for name, width in DRONE_COLUMNS.items()
    }
    return Log(
        time=time,
        load=np.stack([vectors("load_"), vectors("load_v")], axis=1),
        reference=np.stack([vectors("ref_"), vectors("ref_v")], axis=1),
        drones=drones,
        load_attitude=vectors("load_q", "wxyz") if "load_qw" in column else None,
    )


def _scaled(log: Log, factor: float) -> Log:
    """With positions and velocities in another unit; forces and attitudes as they are."""
    drones = {k: factor * v if k in _LENGTHS else v for k, v in log.drones.items()}
    return replace(log, load=factor * log.load, reference=factor * log.reference, drones=drones)
