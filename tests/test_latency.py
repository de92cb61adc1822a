"""The latency measurement tells its parts apart; it never asserts how fast this machine is."""

from __future__ import annotations

import gc
import json
import subprocess
import sys

import numpy as np
import pytest

from colift.control.allocation.sqp import Sqp
from colift.study import latency
from colift.team import Team


def test_percentiles_missed_deadlines_and_the_worst_tick() -> None:
    ticks = np.tile([1_000.0, 0.0, 4_000.0, 0.0, 1.0], (1_000, 1))
    ticks[7] = [2_000.0, 900_000.0, 5_000.0, 90_000.0, 3.0]
    found = latency.judge(ticks, 1e-3)
    assert found["median_us"] == pytest.approx(5.0)
    assert found["worst_us"] == pytest.approx(997.0)
    assert found["missed"] == 0
    assert (found["own_worst_iterations"], found["most_iterations"]) == (3, 3)
    assert found["worst_is_us"] == {
        "late start": 2.0, "collector": 900.0, "allocator": 5.0, "preempted": 90.0
    }  # fmt: skip
    assert sum(found["histogram"]["ticks"]) == 1_000
    assert len(found["histogram"]["edges_us"]) == len(found["histogram"]["ticks"]) + 1


def test_skipped_ticks_count_and_wait_for_the_answer_that_came_too_late() -> None:
    assert latency.waits(np.array([5.0, 3_400.0, 6.0, 1_000.0]), 1e-3).tolist() == [
        5.0, 3_400.0, 6.0, 1_000.0, 2_400.0, 1_400.0, 400.0
    ]  # fmt: skip
    ticks = np.tile([0.0, 0.0, 5_000.0, 0.0, 1.0], (996, 1))
    ticks[500, latency.AWAY] = 4.3e6
    found = latency.judge(ticks, 1e-3)
    assert found["ticks"] == 1_000
    assert found["skipped"] == 4
    assert found["missed"] == 5
    assert found["worst_us"] == pytest.approx(4_305.0)
    assert sum(found["histogram"]["ticks"]) == 1_000


@pytest.mark.parametrize("caller", latency.CALLERS)
def test_every_caller_fills_every_tick(caller) -> None:
    ticks = np.concatenate(list(caller(Sqp(), Team.uniform(4), 0.3, 500.0)))
    assert ticks.shape == (150, 5)
    assert np.isfinite(ticks).all()
    assert (ticks[:, latency.OWN] > 0.0).all()
    assert (ticks[:, latency.ITERATIONS] >= 1.0).all()
    assert (ticks >= -1e5).all()  # no part is negative beyond the clocks' grain


def test_the_collector_shows_only_where_there_is_garbage() -> None:
    gc.collect()
    team = Team.uniform(4)
    untidy = np.concatenate(list(latency.from_untidy_python(Sqp(), team, 0.5, 500.0)))
    assert np.count_nonzero(untidy[:, latency.COLLECTOR]) > 3
    compiled = np.concatenate(list(latency.in_loop(Sqp(), team, 0.3, 500.0)))
    assert not compiled[:, latency.COLLECTOR].any()
    assert not any("collector" in repr(callback) for callback in gc.callbacks)


def test_the_command_reports_every_case_and_leaves_no_process() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "colift", "latency", "--seconds", "1", "--rate", "200",
         "--others", "1", "--json"],
        capture_output=True, text=True, check=True, timeout=300,
    )  # fmt: skip
    result = json.loads(done.stdout)
    assert [(r["caller"], r["allocator"]) for r in result["rows"]] == [
        (caller, name) for name in ("sqp", "safe") for caller in ("python", "untidy", "loop")
    ]
    assert result["schema"] == latency.SCHEMA
    assert all(row["ticks"] - row["skipped"] == 200 for row in result["rows"])
