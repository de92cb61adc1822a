"""The file of results: what it refuses, and what leaves it."""

from __future__ import annotations

import concurrent.futures
import contextlib
import csv
import sqlite3
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from campaign_helpers import hover

from colift.errors import ColiftError, MissingExtraError
from colift.study.campaign.plan import Job, plan
from colift.study.campaign.store import Store, write_csv, write_parquet
from colift.study.campaign.workers import Result


def filled(path: Path) -> list[Job]:
    """A file with a flown run, a failed one and a case that is still to be flown."""
    planned = plan([hover("sqp"), hover("ring"), hover("safe")])
    with Store(path, create=True) as store, store.writing():
        store.ask(planned)
        store.ask(planned)  # asking twice changes nothing
        jobs = [job for _, job in planned]
        numbers = {"tracking_rms_m": 0.25, "tension_integral_10s_Ns": float("nan")}
        flown = Result(
            jobs[0].key, outcome="completed", level="fail", reasons=["too far", "too near"],
            metrics=numbers, wall_time=1.5, worker="w:1",
        )  # fmt: skip
        store.add(jobs[0], flown, None)
        store.add(jobs[1], Result(jobs[1].key, error="no, it is\n broken"), None)
    return jobs


def test_rows_say_what_was_flown_what_failed_and_what_is_missing(tmp_path: Path) -> None:
    jobs = filled(tmp_path / "c.sqlite")
    with Store(tmp_path / "c.sqlite") as store:
        rows = store.rows()
        assert [row["status"] for row in rows] == ["flown", "failed", "missing"]
        assert [row["key"] for row in rows] == [job.key for job in jobs]
        assert [row["level"] for row in rows] == ["fail", "", ""]
        assert [row["reasons"] for row in rows] == ["too far; too near", "", ""]
        assert rows[0]["tracking_rms_m"] == 0.25
        assert rows[0]["tension_integral_10s_Ns"] != rows[0]["tension_integral_10s_Ns"]  # NaN
        assert store.wall_times() == [("sqp", 0.2, 1.5)]
        asked = [
            ({"allocator": name, "seed": 0}, jobs[k]) for k, name in ((2, "safe"), (1, "ring"))
        ]
        assert [row["key"] for row in store.rows(asked)] == [jobs[2].key, jobs[1].key]


def test_a_run_cannot_be_counted_twice(tmp_path: Path) -> None:
    job, *_ = filled(tmp_path / "c.sqlite")
    with Store(tmp_path / "c.sqlite") as store:
        before = store.rows()
        again = Result(job.key, outcome="completed", metrics={"tracking_rms_m": 9.0})
        with pytest.raises(sqlite3.IntegrityError):
            store.add(job, again, None)
        assert repr(store.rows()) == repr(before)


def test_a_run_whose_numbers_cannot_be_kept_leaves_nothing(tmp_path: Path) -> None:
    _, _, job = filled(tmp_path / "c.sqlite")
    bad: Any = {"tracking_rms_m": 1.0, "worse": object()}
    with Store(tmp_path / "c.sqlite") as store:
        with pytest.raises(sqlite3.Error):
            store.add(job, Result(job.key, outcome="completed", metrics=bad), None)
        assert store.rows()[2]["status"] == "missing"
        assert "tracking_rms_m" not in store.rows()[2]


def old(path: Path) -> list[Job]:
    """A file as the first version wrote it."""
    jobs = filled(path)
    with contextlib.closing(sqlite3.connect(path)) as database, database:
        for column in ("level", "reasons"):
            database.execute(f"ALTER TABLE runs DROP COLUMN {column}")
        database.execute("PRAGMA user_version = 1")
    return jobs


def test_a_file_without_verdicts_is_read_and_brought_up_to_date_when_added_to(
    tmp_path: Path,
) -> None:
    path = tmp_path / "c.sqlite"
    jobs = old(path)
    before = path.read_bytes()
    with Store(path) as store:
        rows = store.rows()
    assert path.read_bytes() == before
    with Store(path, create=True) as store:
        assert repr(store.rows()) == repr(rows)
        assert [row["status"] for row in rows] == ["flown", "failed", "missing"]
        assert [row["level"] for row in rows] == ["", "", ""]
        store.add(jobs[2], Result(jobs[2].key, outcome="completed", level="pass"), None)
    with Store(path) as store:
        assert [row["level"] for row in store.rows()] == ["", "", "pass"]


def test_a_file_of_a_later_colift_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "c.sqlite"
    filled(path)
    with contextlib.closing(sqlite3.connect(path)) as database:
        database.execute("PRAGMA user_version = 7")
    for create in (False, True):
        with pytest.raises(ColiftError, match="has format 7, known are 1 to 2"):
            Store(path, create=create)


def test_a_new_file_is_seen_whole_or_not_at_all(tmp_path: Path) -> None:
    """Whoever reads while a campaign begins finds no file or one without results."""
    path, begun = tmp_path / "c.sqlite", threading.Event()

    def read() -> int:
        found = 0
        while not (begun.is_set() and found):
            if path.exists():
                with Store(path) as store:
                    assert store.rows() == []
                found += 1
        return found

    with concurrent.futures.ThreadPoolExecutor() as pool:
        reading = pool.submit(read)
        Store(path, create=True).__exit__()
        begun.set()
        assert reading.result(60.0)
    assert [entry.name for entry in tmp_path.iterdir() if "campaign" in entry.name] == []


def test_csv_and_parquet_hold_every_row(tmp_path: Path) -> None:
    filled(tmp_path / "c.sqlite")
    with Store(tmp_path / "c.sqlite") as store:
        rows = store.rows()
    write_csv(rows, tmp_path / "c.csv")
    with (tmp_path / "c.csv").open(newline="") as file:
        read = list(csv.DictReader(file))
    assert [row["allocator"] for row in read] == ["sqp", "ring", "safe"]
    assert (read[0]["tracking_rms_m"], read[0]["tension_integral_10s_Ns"]) == ("0.25", "")
    assert read[1]["error"] == "no, it is\n broken"

    parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra parquet")
    write_parquet(rows, tmp_path / "c.parquet")
    table = parquet.read_table(tmp_path / "c.parquet").to_pydict()
    assert table["status"] == ["flown", "failed", "missing"]
    assert table["tracking_rms_m"] == [0.25, None, None]


def test_labels_of_several_types_share_a_column_as_text(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet", reason="needs the extra parquet")
    rows = [{"x": 1, "y": 1}, {"x": 0.5, "y": "safe"}, {"x": None}]
    write_parquet(rows, tmp_path / "c.parquet")
    table = parquet.read_table(tmp_path / "c.parquet").to_pydict()
    assert table == {"x": [1.0, 0.5, None], "y": ["1", "safe", None]}


def test_without_pyarrow_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(MissingExtraError, match=r"package pyarrow: .*pip install 'pyarrow"):
        write_parquet([{"x": 1}], tmp_path / "c.parquet")
    assert list(tmp_path.iterdir()) == []


def test_other_files_are_refused_and_left_alone(tmp_path: Path) -> None:
    text, other = tmp_path / "notes.txt", tmp_path / "other.sqlite"
    text.write_text("not a database, and long enough to be read as one" * 100)
    with sqlite3.connect(other) as database:
        database.execute("CREATE TABLE mine (x)")
    before = text.read_bytes(), other.read_bytes()
    for path in (text, other):
        for create in (False, True):
            with pytest.raises(ColiftError, match="not a file of campaign results"):
                Store(path, create=create)
    assert (text.read_bytes(), other.read_bytes()) == before
    with pytest.raises(ColiftError, match="no such file"):
        Store(tmp_path / "nowhere.sqlite")
