"""The engine flies what is missing, once, whatever dies on the way."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from campaign_helpers import fly, gone, hover, wait_for

from colift.errors import ColiftError, MissionError
from colift.mission.criteria import METRICS
from colift.record.recording import Recording
from colift.study.campaign.engine import Estimate, Options, Progress
from colift.study.campaign.plan import Source, plan
from colift.study.campaign.store import Store
from terminal import colift

Write = Callable[[str], Path]


def test_a_campaign_is_flown_once_and_every_number_is_kept(tmp_path: Path) -> None:
    file, seen = tmp_path / "new/c.sqlite", list[Progress]()
    cases = [hover(name, seed) for seed in range(2) for name in ("sqp", "ring")]
    options = Options(file, workers=2, progress=seen.append, recordings=tmp_path / "kept")
    first = fly([*cases, cases[0]], options)  # a case twice is one run
    assert (first.flown, len(first.rows)) == (4, 4)
    for row, case in zip(first.rows, cases, strict=True):
        assert {name: row[name] for name in case.labels} == case.labels
        assert (row["status"], row["outcome"], row["error"]) == ("flown", "completed", "")
        assert {metric.name for metric in METRICS} <= row.keys()
        recording = Recording.load(row["recording"])
        assert recording.mission.seed == row["seed"]
        assert recording.mission.kinds["allocation"] == row["allocator"]
    assert len({row["worker"] for row in first.rows}) == 2
    assert os.getpid() not in {int(row["worker"].rpartition(":")[2]) for row in first.rows}
    assert [(p.done, p.total) for p in seen] == [(k, 4) for k in range(1, 5)]
    assert seen[0].remaining > 0.0
    assert seen[-1].remaining == 0.0

    again = fly([*cases, hover("ring", 2)], Options(file, workers=1))
    assert again.flown == 1
    for row, before in zip(again.rows, first.rows, strict=False):
        assert json.dumps(row) == json.dumps(before)


def test_metrics_are_those_of_a_flight_by_hand(tmp_path: Path) -> None:
    import colift

    case = hover("sqp", 5)
    (row,) = fly([case], Options(tmp_path / "c.sqlite", workers=1)).rows
    for name, value in colift.run("hover", overrides=case.overrides).metrics.items():
        if not name.endswith("_us"):
            assert row[name] == pytest.approx(value, rel=1e-12, nan_ok=True), name


def test_a_mistake_is_found_before_anything_is_made(tmp_path: Path) -> None:
    with pytest.raises(MissionError):
        fly([hover("sqp"), hover("sqp", **{"load.mass": -1})], Options(tmp_path / "c.sqlite"))
    assert list(tmp_path.iterdir()) == []


def test_a_failure_is_recorded_and_stops_nobody(tmp_path: Path, allocator: Write) -> None:
    source = Source.read(allocator("broken"))
    cases = [hover("broken"), hover("sqp"), hover("ring")]
    options = Options(tmp_path / "c.sqlite", workers=1)
    rows = fly(cases, options, [source]).rows
    assert [row["status"] for row in rows] == ["failed", "flown", "flown"]
    assert rows[0]["error"].startswith("ValueError: not today (broken.py, line ")
    assert fly(cases, options, [source]).flown == 0
    retry = Options(options.file, workers=1, retry_failed=True)
    assert fly(cases, retry, [source]).flown == 1


def test_a_worker_that_dies_is_replaced_and_its_job_flown_again(
    tmp_path: Path, allocator: Write
) -> None:
    sources = [Source.read(allocator(name)) for name in ("once", "mortal")]
    cases = [hover("once"), hover("mortal"), hover("sqp"), hover("ring")]
    rows = fly(cases, Options(tmp_path / "c.sqlite", workers=2), sources).rows
    assert [row["status"] for row in rows] == ["flown", "failed", "flown", "flown"]
    assert rows[1]["error"] == "the worker died 2 times (exit code 7)"


def sweep(folder: Path, extra: Path, *more: str) -> list[str]:
    over = "load.mass=0.2:0.3:12"
    command = [
        sys.executable,
        "-m",
        "colift",
        "sweep",
        "hover",
        "--over",
        over,
        "--with",
        str(extra),
    ]
    sets = ["allocation.kind=slow", "timing.duration=0.2", "timing.allocation=0.01"]
    flags = [flag for text in sets for flag in ("--set", text)]
    return [*command, *flags, "--out", str(folder), "--json", *more]


def rows_of(file: Path) -> list[dict[str, Any]]:
    if not file.exists():
        return []
    try:
        with Store(file) as store:
            return [row for row in store.rows() if row["status"] != "missing"]
    except ColiftError:  # the file is there, its tables not yet
        return []


@pytest.mark.slow
def test_killed_half_way_it_goes_on_and_counts_nothing_twice(
    tmp_path: Path, allocator: Write
) -> None:
    slow, folder = allocator("slow"), tmp_path / "out"
    file = folder / "campaign.sqlite"
    process = subprocess.Popen(
        sweep(folder, slow, "--workers", "2"), stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    wait_for(lambda: len(rows_of(file)) >= 4 or process.poll() is not None)
    process.send_signal(signal.SIGKILL)
    process.communicate(timeout=60)
    assert process.returncode == -signal.SIGKILL, "finished before it could be killed"
    before = {row["key"]: row for row in rows_of(file)}
    assert 4 <= len(before) < 12
    for pid in {int(row["worker"].rpartition(":")[2]) for row in before.values()}:
        wait_for(lambda pid=pid: gone(pid))  # workers notice and leave no orphan

    done = colift(*sweep(folder, slow)[3:])
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["flown"] == 12 - len(before)
    after = rows_of(file)
    assert len(after) == len({row["key"] for row in after}) == 12
    for row in after:
        if row["key"] in before:
            assert json.dumps(row) == json.dumps(before[row["key"]])  # as it was, not flown anew


def test_ctrl_c_leaves_the_file_whole_and_no_process(tmp_path: Path, allocator: Write) -> None:
    slow, folder = allocator("slow"), tmp_path / "out"
    file = folder / "campaign.sqlite"
    process = subprocess.Popen(
        sweep(folder, slow), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    wait_for(lambda: len(rows_of(file)) >= 2 or process.poll() is not None)
    process.send_signal(signal.SIGINT)
    said, error = process.communicate(timeout=60)
    assert (process.returncode, said) == (130, "")
    assert "Traceback" not in error
    rows = rows_of(file)
    assert 2 <= len(rows) < 12
    assert all(gone(int(row["worker"].rpartition(":")[2])) for row in rows)
    assert all(row["status"] == "flown" for row in rows)


def test_two_campaigns_into_one_file_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "c.sqlite"
    with Store(file, create=True) as store, store.writing():
        with pytest.raises(ColiftError, match="another process is running a campaign into it"):
            fly([hover("ring")], Options(file))
        with Store(file) as reader:  # looking is allowed
            assert reader.rows() == []
    assert fly([hover("ring")], Options(file, workers=1)).flown == 1


def test_the_estimate_knows_each_kind_and_asks_the_others_of_an_unknown_one() -> None:
    jobs = [job for _, job in plan([hover("sqp", 1), hover("sqp", 2), hover("ring")])]
    estimate = Estimate()
    assert estimate.remaining([], 2) != estimate.remaining([], 2)  # NaN: nothing is known
    estimate.learn("sqp", 10.0, 20.0)  # 2 s for each simulated second
    assert estimate.remaining(jobs, 1) == pytest.approx(3 * 0.2 * 2.0)
    estimate.learn("ring", 10.0, 5.0)
    assert estimate.remaining(jobs, 2) == pytest.approx((2 * 0.2 * 2.0 + 0.2 * 0.5) / 2)
