"""The results of campaigns in one SQLite file; each run arrives in a transaction of its own.

``runs`` holds what was flown and its verdict, one row a hash; ``metrics`` its numbers, one row each; ``cases``
what was asked for and under which labels. A case whose run is missing has not been flown yet.
"""

from __future__ import annotations

import contextlib
import csv
import fcntl
import json
import os
import sqlite3
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from colift.errors import ColiftError, MissingExtraError
from colift.extras import install
from colift.record.recording import atomic_path
from colift.study.campaign.plan import Job, Labels
from colift.study.campaign.workers import Result

Row = dict[str, Any]
"""One case, flat: labels, how it went, metrics."""

_APPLICATION, _VERSION = 0x636F6C66, 2  # "colf"
_VERDICT = ("level TEXT NOT NULL DEFAULT ''", "reasons TEXT NOT NULL DEFAULT '[]'")
_SCHEMA = (
    f"""CREATE TABLE runs (
        key TEXT PRIMARY KEY, mission TEXT NOT NULL, code TEXT NOT NULL, outcome TEXT NOT NULL,
        error TEXT NOT NULL, wall_time REAL NOT NULL, worker TEXT NOT NULL, versions TEXT NOT NULL,
        recording TEXT, finished TEXT NOT NULL, {", ".join(_VERDICT)}
    ) WITHOUT ROWID""",
    """CREATE TABLE metrics (
        key TEXT NOT NULL REFERENCES runs, name TEXT NOT NULL, value REAL, PRIMARY KEY (key, name)
    ) WITHOUT ROWID""",
    "CREATE TABLE cases (labels TEXT NOT NULL, key TEXT NOT NULL, UNIQUE (labels, key))",
    f"PRAGMA application_id = {_APPLICATION}",
    f"PRAGMA user_version = {_VERSION}",
)
_FROM_1 = (
    *(f"ALTER TABLE runs ADD COLUMN {column}" for column in _VERDICT),
    f"PRAGMA user_version = {_VERSION}",
)
"""Brings a file of the first version, whose flights have no verdict, up to date."""


class Store:
    """One file of results, open for reading; :meth:`writing` for the one process that adds to it.

    With ``create`` a missing file is made and an older one brought up to date; its flights have no verdict.

    Raises
    ------
    ColiftError
        If the file is not a campaign's, is a later colift's, or (without ``create``) does not exist.

    """

    def __init__(self, path: str | Path, *, create: bool = False) -> None:
        self.path = Path(path)
        if create:
            _make(self.path)
        elif not self.path.is_file():
            raise ColiftError(f"{self.path}: no such file")
        self._db = sqlite3.connect(self.path, timeout=60.0, isolation_level=None)
        try:
            self._version = self._check()
            if create and self._version == 1:
                with self._transaction():
                    self._version = self._check()  # another process may have been faster
                    for statement in _FROM_1 if self._version == 1 else ():
                        self._db.execute(statement)
                self._version = _VERSION
            self._db.execute("PRAGMA journal_mode = WAL")
            self._db.execute("PRAGMA synchronous = FULL")
            self._db.execute("PRAGMA foreign_keys = ON")
        except sqlite3.DatabaseError as error:
            self._db.close()
            raise ColiftError(f"{self.path}: not a file of campaign results ({error})") from error
        except ColiftError:
            self._db.close()
            raise

    def _check(self) -> int:
        """The file's version, if it is a campaign's."""
        mark, version = (
            int(self._db.execute(f"PRAGMA {name}").fetchone()[0])
            for name in ("application_id", "user_version")
        )
        if mark != _APPLICATION:
            raise ColiftError(f"{self.path}: not a file of campaign results")
        if not 1 <= version <= _VERSION:
            raise ColiftError(
                f"{self.path}: not a file of campaign results that this colift knows: it has format "
                f"{version}, known are 1 to {_VERSION}"
            )
        return version

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *_: object) -> None:
        self._db.close()

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Be the only process that runs a campaign into this file; the system frees it of a dead one.

        Raises
        ------
        ColiftError
            If another process is at it.

        """
        # Beside the file: a lock on the file itself would disturb those of SQLite.
        with (self.path.parent / f".{self.path.name}.lock").open("a") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                message = f"{self.path}: another process is running a campaign into it"
                raise ColiftError(message) from None
            yield

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        self._db.execute("BEGIN IMMEDIATE")
        try:
            yield
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        self._db.execute("COMMIT")

    def ask(self, planned: Iterable[tuple[Labels, Job]]) -> None:
        """Note what is to be flown; what was noted before stays as it is."""
        rows = [(json.dumps(labels), job.key) for labels, job in planned]
        with self._transaction():
            self._db.executemany("INSERT OR IGNORE INTO cases VALUES (?, ?)", rows)

    def forget_failures(self, keys: Iterable[str]) -> None:
        """Remove runs that failed, so that they are flown again."""
        with self._transaction():
            self._db.executemany(
                "DELETE FROM runs WHERE key = ? AND error != ''", [(key,) for key in keys]
            )

    def finished(self) -> set[str]:
        """Keys of all runs, flown or failed."""
        return {key for (key,) in self._db.execute("SELECT key FROM runs")}

    def add(self, job: Job, result: Result, recording: Path | None) -> None:
        """Add one run, whole or not at all; a second run of the same key is an error."""
        values = (
            job.key, json.dumps(job.mission), job.code, result.outcome, result.error, result.wall_time,
            result.worker, json.dumps(result.versions), recording and str(recording),
            datetime.now(UTC).isoformat(timespec="seconds"), result.level, json.dumps(result.reasons),
        )  # fmt: skip
        with self._transaction():
            self._db.execute(f"INSERT INTO runs VALUES ({', '.join('?' * len(values))})", values)
            self._db.executemany(
                "INSERT INTO metrics VALUES (?, ?, ?)",
                [(job.key, name, value) for name, value in result.metrics.items()],
            )

    def wall_times(self) -> list[tuple[str, float, float]]:
        """Kind of allocator, simulated and wall time of every run that was flown, s."""
        return self._db.execute(
            "SELECT json_extract(mission, '$.allocation.kind'), "
            "json_extract(mission, '$.timing.duration'), wall_time FROM runs WHERE error = ''"
        ).fetchall()

    def rows(self, planned: Iterable[tuple[Labels, Job]] | None = None) -> list[Row]:
        """Every case that was asked for, or these in their order, each once; NaN where a metric is."""
        numbers: dict[str, dict[str, float]] = {}
        for key, name, value in self._db.execute("SELECT * FROM metrics"):
            numbers.setdefault(key, {})[name] = float("nan") if value is None else value
        verdict = "level, reasons" if self._version > 1 else "'', '[]'"
        found = self._db.execute(
            f"SELECT labels, key, {verdict}, error, outcome, wall_time, worker, code, recording, "
            "finished FROM cases LEFT JOIN runs USING (key) ORDER BY cases.rowid"
        )
        rows: dict[tuple[str, str], Row] = {}
        for labels, key, level, reasons, error, *rest in found:
            status = "missing" if error is None else "failed" if error else "flown"
            said = "; ".join(json.loads(reasons or "[]"))
            facts = dict(zip(FACTS, (key, status, level or "", said, error, *rest), strict=True))
            rows[labels, key] = {**json.loads(labels), **facts, **numbers.get(key, {})}
        if planned is None:
            return list(rows.values())
        asked = dict.fromkeys((json.dumps(labels), job.key) for labels, job in planned)
        return [rows[case] for case in asked]


FACTS = (
    "key", "status", "level", "reasons", "error", "outcome", "wall_time_s", "worker", "code", "recording",
    "finished",
)  # fmt: skip
"""Columns of a row between its labels and its metrics; ``level`` and ``reasons`` are the verdict's."""


def _make(path: Path) -> None:
    """An empty file of results unless there is a file, seen by others whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.exists():
        return
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=".campaign-") as folder:
        new = Path(folder) / path.name
        with contextlib.closing(sqlite3.connect(new, isolation_level=None)) as database:
            for statement in _SCHEMA:
                database.execute(statement)
        try:
            os.link(new, path)
        except FileExistsError:
            pass  # another process was faster
        except OSError:  # a file system without links
            os.replace(new, path)


def write_csv(rows: list[Row], path: Path) -> None:
    """Rows as a CSV file, whole or not at all; empty where a row has no such column or no number."""
    with atomic_path(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, columns(rows), restval="")
        writer.writeheader()
        writer.writerows(
            {k: "" if v is None or v != v else v for k, v in row.items()} for row in rows
        )


def write_parquet(rows: list[Row], path: Path) -> None:
    """Rows as a Parquet file, whole or not at all.

    Raises
    ------
    MissingExtraError
        If pyarrow is not installed.

    """
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError:
        raise MissingExtraError(
            f"Parquet needs the package pyarrow: {install('parquet')}"
        ) from None
    names = columns(rows)
    table = pyarrow.table({name: _column([row.get(name) for row in rows]) for name in names})
    with atomic_path(path) as temporary:
        parquet.write_table(table, temporary)


def _column(values: list[Any]) -> list[Any]:
    """Values of one type: as they are, or as text where labels of several types share a column."""
    types = {type(value) for value in values if value is not None}
    if types <= {int, float}:
        return (
            [None if value is None else float(value) for value in values]
            if float in types
            else values
        )
    return values if len(types) <= 1 else [None if v is None else str(v) for v in values]


def columns(rows: list[Row]) -> list[str]:
    """Names of all columns, in the order of first mention."""
    return list(dict.fromkeys(name for row in rows for name in row))
