"""The results of campaigns in one SQLite file; each run arrives in a transaction of its own.

``runs`` holds what was flown, one row a hash; ``metrics`` its numbers, one row each; ``cases`` what was asked
for and under which labels. A case whose run is missing has not been flown yet.
"""

from __future__ import annotations

import csv
import fcntl
import json
import sqlite3
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from colift.campaign.plan import Job, Labels
from colift.campaign.workers import Result
from colift.errors import ColiftError, MissingExtraError
from colift.extras import install
from colift.recording import atomic_path

Row = dict[str, Any]
"""One case, flat: labels, how it went, metrics."""

_APPLICATION, _VERSION = 0x636F6C66, 1  # "colf"
_SCHEMA = (
    """CREATE TABLE runs (
        key TEXT PRIMARY KEY, mission TEXT NOT NULL, code TEXT NOT NULL, outcome TEXT NOT NULL,
        error TEXT NOT NULL, wall_time REAL NOT NULL, worker TEXT NOT NULL, versions TEXT NOT NULL,
        recording TEXT, finished TEXT NOT NULL
    ) WITHOUT ROWID""",
    """CREATE TABLE metrics (
        key TEXT NOT NULL REFERENCES runs, name TEXT NOT NULL, value REAL, PRIMARY KEY (key, name)
    ) WITHOUT ROWID""",
    "CREATE TABLE cases (labels TEXT NOT NULL, key TEXT NOT NULL, UNIQUE (labels, key))",
    f"PRAGMA application_id = {_APPLICATION}",
    f"PRAGMA user_version = {_VERSION}",
)


class Store:
    """One file of results, open for reading; :meth:`writing` for the one process that adds to it.

    Raises
    ------
    ColiftError
        If the file is not a campaign's, or (without ``create``) does not exist.

    """

    def __init__(self, path: str | Path, *, create: bool = False) -> None:
        self.path = Path(path)
        if create:
            self.path.parent.mkdir(parents=True, exist_ok=True)
        elif not self.path.is_file():
            raise ColiftError(f"{self.path}: no such file")
        self._db = sqlite3.connect(self.path, timeout=60.0, isolation_level=None)
        try:
            self._set_up(create)
        except sqlite3.DatabaseError as error:
            self._db.close()
            raise ColiftError(f"{self.path}: not a file of campaign results ({error})") from error

    def _set_up(self, create: bool) -> None:
        def number(question: str) -> int:
            return int(self._db.execute(question).fetchone()[0])

        if create:
            with self._transaction():
                if not number("SELECT count(*) FROM sqlite_master"):
                    for statement in _SCHEMA:
                        self._db.execute(statement)
        marks = number("PRAGMA application_id"), number("PRAGMA user_version")
        if marks != (_APPLICATION, _VERSION):
            self._db.close()
            raise ColiftError(f"{self.path}: not a file of campaign results of this version")
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = FULL")
        self._db.execute("PRAGMA foreign_keys = ON")

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
            datetime.now(UTC).isoformat(timespec="seconds"),
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

    def rows(self, keys: Iterable[str] | None = None) -> list[Row]:
        """Every case that was asked for (of these keys), in that order; NaN where a metric is."""
        numbers: dict[str, dict[str, float]] = {}
        for key, name, value in self._db.execute("SELECT * FROM metrics"):
            numbers.setdefault(key, {})[name] = float("nan") if value is None else value
        wanted = None if keys is None else set(keys)
        found = self._db.execute(
            "SELECT labels, key, error, outcome, wall_time, worker, code, recording, finished "
            "FROM cases LEFT JOIN runs USING (key) ORDER BY cases.rowid"
        )
        rows = []
        for labels, key, error, outcome, *rest in found:
            if wanted is None or key in wanted:
                status = "missing" if error is None else "failed" if error else "flown"
                facts = dict(zip(_FACTS, (key, status, outcome, error, *rest), strict=True))
                rows.append({**json.loads(labels), **facts, **numbers.get(key, {})})
        return rows


_FACTS = (
    "key", "status", "outcome", "error", "wall_time_s", "worker", "code", "recording", "finished",
)  # fmt: skip


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
