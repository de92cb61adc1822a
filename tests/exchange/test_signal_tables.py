"""Recordings as CSV, Parquet and data frames, read by those who own the formats."""

from __future__ import annotations

import csv
import json
import subprocess
import sys

import numpy as np
import pytest

from colift.errors import MissingExtraError
from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.record.exchange import tables, written
from terminal import colift


@pytest.fixture(scope="module")
def flown():
    return Flight(load_mission("four-to-three", {"timing.duration": 9.0})).run()


def test_columns_have_the_places_of_their_signals(flown):
    found = tables.columns(flown)
    assert next(iter(found)) == "time"
    assert found["load_1_z"][0] is not None
    np.testing.assert_array_equal(found["load_1_z"][0], flown["load"][:, 1, 2])
    np.testing.assert_array_equal(found["positions_2_y"][0], flown["positions"][:, 2, 1])
    np.testing.assert_array_equal(found["attitudes_0_w"][0], flown["attitudes"][:, 0, 0])
    np.testing.assert_array_equal(found["motor_health_1_3"][0], flown["motor_health"][:, 1, 3])
    assert found["tensions_3"][1].unit == "N"
    whole = sum(np.prod(flown[name].shape[1:], dtype=int) for name in flown if flown.signal(name).each == "row" and flown.measured(name))  # fmt: skip
    assert len(found) == 1 + whole
    assert "allocator_time" in tables.columns(flown, allocations=True)


def test_csv_comes_back_in_every_bit(flown, tmp_path):
    rows, allocations = written(flown, "csv", tmp_path / "flight.csv")
    assert allocations.name == "flight-allocations.csv"
    for path, more in ((rows, False), (allocations, True)):
        with path.open(newline="") as file:
            header, *lines = csv.reader(file)
        values = np.array([[float(cell or "nan") for cell in line] for line in lines])
        expected = tables.columns(flown, allocations=more)
        assert header == [*expected]
        np.testing.assert_array_equal(values, np.stack([v for v, _ in expected.values()], axis=1))


def test_parquet_knows_units_and_mission(flown, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    rows, _ = written(flown, "parquet", tmp_path / "flight.parquet")
    table = parquet.read_table(rows)
    np.testing.assert_array_equal(table["positions_0_x"].to_numpy(), flown["positions"][:, 0, 0])
    assert table.schema.field("positions_0_x").metadata[b"unit"] == b"m"
    mission = json.loads(table.schema.metadata[b"colift.mission"])
    assert mission["drones"]["count"] == 4
    assert table.schema.metadata[b"colift.outcome"] == b"completed"


def test_frames_are_those_of_their_libraries(flown):
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    frame = tables.to_pandas(flown)
    assert isinstance(frame, pandas.DataFrame)
    np.testing.assert_array_equal(frame.index, flown.time)
    np.testing.assert_array_equal(frame["load_0_x"], flown["load"][:, 0, 0])
    assert frame.attrs["legend"]["load_0_x"]["frame"] == "world"
    frame = tables.to_polars(flown, allocations=True)
    assert isinstance(frame, polars.DataFrame)
    np.testing.assert_array_equal(frame["time"].to_numpy(), flown.cycle_time)


def test_xarray_has_named_dimensions(flown):
    xarray = pytest.importorskip("xarray")
    found = tables.to_xarray(flown)
    assert isinstance(found, xarray.Dataset)
    assert found["positions"].dims == ("time", "drone", "axis")
    assert found["attitudes"].dims == ("time", "drone", "wxyz")
    assert found["external_forces"].dims == ("time", "drone_or_load", "axis")
    assert found["allocator_time"].dims == ("allocation",)
    assert found["tensions"].attrs["unit"] == "N"
    last = found["positions"].sel(time=3.0, method="nearest").isel(drone=1)
    np.testing.assert_array_equal(last, flown["positions"][np.argmin(np.abs(flown.time - 3.0)), 1])


def test_rerun_opens_its_recording(flown, tmp_path):
    pytest.importorskip("rerun")
    (path,) = written(flown, "rerun", tmp_path / "flight.rrd")
    for check in (["verify"], ["print"]):
        command = [sys.executable, "-m", "rerun", "rrd", *check, str(path)]
        done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120)
        assert done.returncode == 0, done.stderr
    for name in ("/world/load", "/world/drone_3", "/world/cable_0", "/tension/cable_2", "/error"):
        assert name in done.stdout


@pytest.mark.parametrize(
    ("kind", "package", "extra"),
    [("parquet", "pyarrow", "parquet"), ("rerun", "rerun", "rerun"), ("bag", "rosbags.typesys", "bags")],
)  # fmt: skip
def test_a_package_that_is_missing_is_named(flown, tmp_path, monkeypatch, kind, package, extra):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingExtraError, match=rf"the extra {extra}; run: .*pip install"):
        written(flown, kind, tmp_path / "flight.any")
    assert list(tmp_path.iterdir()) == []


def test_the_command(flown, tmp_path):
    flown.save(tmp_path / "flight.h5")
    done = colift("export", "csv", "flight.h5", "--json", folder=tmp_path, check=True)
    assert json.loads(done.stdout)["files"] == ["flight.csv", "flight-allocations.csv"]
    wrong = colift("export", "csv", "flight.h5", "--part", "allocation", folder=tmp_path)
    assert wrong.returncode == 2
    assert "are for c, not for csv" in wrong.stderr
    wrong = colift("export", "csv", "nowhere.h5", folder=tmp_path)
    assert "nowhere.h5: there is no such file" in wrong.stderr
    wrong = colift("export", "csv", "flight.h5", "--set", "seed=3", folder=tmp_path)
    assert "csv is of a recording" in wrong.stderr
