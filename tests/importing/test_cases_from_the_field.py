"""Logs made after reports from the field, read from the folder beside the repository; skipped where it is absent."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colift.errors import FlightDataError
from colift.record.importing import Reading, import_flight

SIGNALS = (
    "load",
    "positions",
    "velocities",
    "reference",
    "force",
    "desired_tensions",
    "directions",
)


def findings(path: Path) -> list[tuple[str, str, int, float, float]]:
    found = import_flight([path]).provenance["findings"]
    return [
        (f["kind"], f["of"], f["rows"], round(f["begin"], 6), round(f["end"], 6)) for f in found
    ]


@pytest.mark.parametrize(
    ("name", "told", "option"),
    [
        ("m01_ned", {"frame": "ned"}, "--frame ned"),
        ("m02_millimetres", {"unit": "mm"}, "--unit mm"),
        ("m06_time_ns_epoch", {"time_unit": "ns"}, "--time-unit ns"),
        ("m13_semicolon_decimal_comma", {}, ""),
    ],
)
def test_conventions(cases: Path, name: str, told: dict[str, Any], option: str) -> None:
    file, good = cases / f"{name}.csv", import_flight([cases / "m00_good.csv"])
    if told:
        with pytest.raises(FlightDataError, match=option):
            import_flight([file])
    found = import_flight([file], told=Reading(**told))
    rows = len(found.time)
    assert rows == (199 if name.startswith("m13") else 400)
    assert found.time == pytest.approx(good.time[:rows], abs=1e-6)
    for signal in SIGNALS:
        np.testing.assert_allclose(found[signal], good[signal][:rows], atol=1e-9, err_msg=signal)
    assert not found.provenance["findings"]


@pytest.mark.parametrize("name", ["m03_gap_blank", "m10_gap_zero_filled"])
def test_gaps(cases: Path, name: str) -> None:
    assert findings(cases / f"{name}.csv") == [("gap", "drone 1", 12, 1.5, 1.61)]
    found, good = (import_flight([cases / f"{n}.csv"]) for n in (name, "m00_good"))
    gap = slice(150, 162)
    assert np.isnan(found["positions"][gap, 1]).all()
    assert np.isnan(found["directions"][gap, 1]).all()
    kept = np.delete(np.arange(400), np.arange(150, 162))
    np.testing.assert_array_equal(found["positions"][kept], good["positions"][kept])


def test_exchanged_drones(cases: Path) -> None:
    swap = ("swap", "drone 0 and drone 1", 50, 2.0, 2.49)
    assert findings(cases / "m12_identity_swap.csv") == [swap]
    assert findings(cases / "m00_good.csv") == []


@pytest.mark.parametrize(
    ("name", "rows", "why"),
    [
        ("u03_no_crc_power_cut", 1199, "27 bytes after that are no events"),
        ("u13_zeros_tail", 1200, "only zeros follow"),
        ("u10_float_names", 1200, ""),
    ],
)
def test_micro_sd_logs(cases: Path, name: str, rows: int, why: str) -> None:
    found = import_flight([cases / name])
    assert len(found.time) == rows
    assert found.mission.team.cable_lengths == pytest.approx(0.5, abs=2e-3)
    damages = [f for f in found.provenance["findings"] if f["kind"] == "damage"]
    assert len(damages) == bool(why)
    assert all(f["rows"] == rows and why in f["text"] for f in damages)


def test_pairs(cases: Path, shared: Path) -> None:
    logs = {
        name: cases / "pairs" / f"coltransplanning__{name}"
        for name in ("cf3_34", "cf9_33", "cf9_34")
    }
    raw = sorted((shared / "raw").iterdir())
    for pair in ((logs["cf3_34"], logs["cf9_33"]), raw):
        for order in (pair, pair[::-1]):
            left = import_flight(order).provenance["files"][1]["load_mismatch_rms_m"]
            assert 0.0008 < left < 0.003
    others = [(logs["cf3_34"], logs["cf9_34"]), (logs["cf9_33"], logs["cf9_34"])]
    others += itertools.product(logs.values(), raw)
    for pair in others:
        for order in (pair, pair[::-1]):
            with pytest.raises(FlightDataError, match="cannot be aligned"):
                import_flight(order)
    for log in (*logs.values(), *raw):
        with pytest.raises(FlightDataError, match="same drone"):
            import_flight([log, log])
