"""Several logs become one recording; the published flights come out as their authors' data say."""

from __future__ import annotations

import json
import math
import re
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_flights import cables, flight_columns, load_path, usd_log, write_csv

from colift.errors import FlightDataError
from colift.record import metrics
from colift.record.importing import import_flight
from colift.record.importing._clocks import merge
from colift.record.importing.base import DRONE_COLUMNS, Log
from colift.record.recording import Recording
from colift.show.report import figures, html
from terminal import colift

TIME = np.arange(600) * 0.01


def test_logs_of_several_drones_are_put_together(tmp_path: Path) -> None:
    """Clocks that differ by 7 s and by half a row, one log shorter: aligned to a millisecond."""
    files, clocks = [], (3.0, 10.005, 1.25)
    for k, clock in enumerate(clocks):
        files.append(tmp_path / f"cf{k}")
        time = TIME if k == 0 else TIME[20 * k : 580] + 0.004
        files[k].write_bytes(usd_log(flight_columns(3, time), k, clock))
    recording = import_flight(files, name="three")
    assert recording.mission.name == "three"
    for file, clock in zip(recording.provenance["files"], clocks, strict=True):
        assert file["clock_offset_s"] == pytest.approx(clocks[0] - clock, abs=1e-3)
        assert file["load_mismatch_rms_m"] < 1e-3
    assert recording.time == pytest.approx(TIME[: len(recording.time)])
    assert len(recording.time) in (539, 540)
    assert recording["directions"] == pytest.approx(np.broadcast_to(cables(3), (len(recording.time), 3, 3)), abs=6e-3)  # fmt: skip
    assert recording["attitudes"][0] == pytest.approx(np.tile([math.sqrt(0.5), 0, 0, math.sqrt(0.5)], (3, 1)))  # fmt: skip


def logs(shift: float, seed: int) -> tuple[Log, Log]:
    random = np.random.default_rng(seed)
    made = []
    for place, clock in enumerate((0.0, shift)):
        time = np.cumsum(random.uniform(0.008, 0.012, 500))
        load = load_path(time + clock) + random.normal(0.0, 1e-3, (500, 3))
        drones = {name: np.full((500, 1, w), 1.0 + place) for name, w in DRONE_COLUMNS.items()}
        made.append(Log(time, np.stack([load, load], axis=1), np.zeros((500, 2, 3)), drones))
    return made[0], made[1]


@settings(max_examples=15, deadline=None)
@given(shift=st.floats(-1.5, 1.5), seed=st.integers(0, 1000))
def test_any_shift_of_the_clocks_is_found(shift: float, seed: int) -> None:
    _, offsets = merge(logs(shift, seed), ["a", "b"])
    assert offsets[1].seconds == pytest.approx(shift, abs=1e-3)
    assert offsets[1].residual < 4e-3


def test_logs_of_different_flights_are_refused(tmp_path: Path) -> None:
    files = [tmp_path / "cf1", tmp_path / "cf2"]
    columns = flight_columns(2, TIME)
    files[0].write_bytes(usd_log(columns, 0, 0.0))
    for axis in "xy":
        columns[f"load_{axis}"] = columns[f"load_{axis}"][::-1] * 0.7
    files[1].write_bytes(usd_log(columns, 1, 0.0))
    with pytest.raises(FlightDataError, match=r"cf2: cannot be aligned with .*cf1"):
        import_flight(files)


def test_a_turned_over_quaternion_is_the_same_attitude() -> None:
    first, other = logs(0.0, 1)
    for log in (first, other):
        log.drones["attitudes"][:] = [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]
        log.drones["attitudes"][::3] *= -1.0
    merged, _ = merge([first, other], ["a", "b"])
    found = np.abs(merged.drones["attitudes"][:, 1])
    assert found == pytest.approx(
        np.broadcast_to([math.sqrt(0.5), 0, 0, math.sqrt(0.5)], found.shape)
    )


def test_a_real_flight_is_judged_and_reported_without_a_warning(tmp_path: Path) -> None:
    file = write_csv(tmp_path / "made-up.csv", flight_columns(3, TIME))
    recording = import_flight([file])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        numbers = metrics.compute(recording)
        page = html.write_report(recording, tmp_path, metrics=numbers).read_text()
    assert {"path", "angles", "wanted_tensions"} <= set(figures.drawable(recording))
    assert not {"tensions", "tension_tracking", "allocator_time"} & set(figures.drawable(recording))
    assert "real flight" in page
    assert recording.provenance["files"][0]["sha256"] in page
    assert not re.search(r"\bnan\b", page)


def test_the_commands(tmp_path: Path) -> None:
    write_csv(tmp_path / "made-up.csv", flight_columns(2, TIME))
    target = tmp_path / "flight.h5"
    done = colift("import", str(tmp_path / "made-up.csv"), "--out", str(target), "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["drones"] == 2
    assert Recording.load(target).mission.load.mass == 0.01
    done = colift("report", str(target), "--json")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "flight" / "report.html").is_file()
    assert json.loads(done.stdout)["metrics"]["peak_tension_N"] is None
    assert colift("import", str(tmp_path / "absent.csv")).returncode == 1
    done = colift("import", str(tmp_path / "made-up.csv"), "--load-mass", "-1")
    assert done.returncode == 2
    assert "--load-mass" in done.stderr
