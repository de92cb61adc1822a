"""The ten published flights, read from the folder beside the repository; skipped where it is absent."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from colift.record import metrics
from colift.record.importing import import_flight
from colift.study.judge import ACTUAL, ON_BOARD, judge

QUICK = ("safe", "sqp", "ring", "min-norm", "internal-force")


def test_every_published_flight_is_read(shared: Path) -> None:
    files = sorted(shared.glob("*.csv"))
    assert len(files) == 10
    smallest, errors = [], []
    for file in files:
        recording = import_flight([file])
        assert recording.n == int(file.name[0])
        numbers = metrics.compute(recording)
        smallest.append(numbers["min_angle_deg"])
        errors.append(numbers["tracking_rms_m"])
    assert min(smallest) == pytest.approx(24.8, abs=0.05)
    assert 0.04 <= min(errors) <= max(errors) <= 0.2


def test_the_original_logs_give_the_published_table(shared: Path) -> None:
    """Made from the same two files by another tool, with its own alignment and digits."""
    raw = import_flight(sorted((shared / "raw").iterdir()))
    table = import_flight([shared / "2cfs_window_opt_00.csv"])
    late = len(table.time) - len(raw.time)
    assert 0 <= late <= 3
    assert raw.time + table.time[late] == pytest.approx(table.time[late:], abs=1e-4)
    for name in ("load", "reference"):
        np.testing.assert_allclose(raw[name], table[name][late:], atol=1e-9)
    np.testing.assert_allclose(
        raw["desired_tensions"][:, 0], table["desired_tensions"][late:, 0], atol=1e-6
    )
    np.testing.assert_allclose(raw["positions"][:, 0], table["positions"][late:, 0], atol=1e-9)
    # The table pairs the second drone's rows by number, we by time: up to 10 ms apart.
    moved = raw["positions"][:, 1] - table["positions"][late:, 1]
    assert np.sqrt(np.mean(moved**2)) < 2e-3
    means = [r["desired_tensions"][:, 1].mean() for r in (raw, table)]
    assert means[0] == pytest.approx(means[1], rel=1e-3)
    assert raw.measured("attitudes", "rates", "drone_forces")


def test_every_allocator_answers_every_published_flight(shared: Path) -> None:
    for file in sorted(shared.glob("*.csv")):
        recording = import_flight([file])
        rows = {a.allocator: a.numbers for a in judge(recording, QUICK).answers}
        assert list(rows) == [ON_BOARD, ACTUAL, *QUICK]
        weight = np.linalg.norm(recording["force"], axis=1).mean()
        assert rows[ON_BOARD]["residual_rms_N"] < 0.05  # what the flights' description says of them
        assert rows["safe"]["min_angle_deg"] >= 30.0, file.name
        assert rows["safe"]["turn_max_deg_s"] <= np.degrees(6.0) + 1e-6, file.name
        for kind in ("sqp", "ring", "internal-force"):
            assert rows[kind]["residual_max_N"] < 1e-9 * weight, (file.name, kind)
        assert rows["ring"]["turn_rms_deg_s"] > 4.0 * rows[ACTUAL]["turn_rms_deg_s"]
