"""CSV flights: known geometry comes back as known angles, mistakes are named with their place."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_flights import LENGTH, SPREAD, WEIGHT, cables, flight_columns, write_csv

from colift.errors import FlightDataError
from colift.record import metrics
from colift.record.importing import Assumed, Reading, import_flight, read
from colift.record.recording import Recording
from colift.team.geometry import matrix_of

UNEVEN = np.cumsum(np.tile([0.01, 0.01, 0.05, 0.01], 60)) - 0.01
"""Times with gaps, as real logs have them, s."""


@pytest.mark.parametrize("n", [1, 2, 3, 5])
def test_known_geometry_gives_known_numbers(n: int, tmp_path: Path) -> None:
    file = write_csv(tmp_path / "made-up.csv", flight_columns(n, UNEVEN))
    made = import_flight([file], Assumed(load_mass=WEIGHT / 9.81))
    recording = Recording.load(made.save(tmp_path / "made-up.h5"))
    assert recording.source == "flight"
    assert recording.n == n
    assert recording.time == pytest.approx(UNEVEN)
    assert recording.mission.team.cable_lengths == pytest.approx(LENGTH)
    assert recording["directions"][7] == pytest.approx(cables(n))
    assert recording["desired_directions"][7] == pytest.approx(cables(n))
    assert recording["desired_tensions"] == pytest.approx(WEIGHT / (n * math.cos(SPREAD)))
    assert recording["direction_rates"] == pytest.approx(0.0, abs=1e-12)
    numbers = metrics.compute(recording)
    assert numbers["tracking_rms_m"] == pytest.approx(0.05)
    if n > 1:  # one leaning cable cannot balance a weight
        assert recording["allocator_force_residual"] == pytest.approx(0.0, abs=1e-12)
        expected = 2.0 * math.degrees(math.asin(math.sin(SPREAD) * math.sin(math.pi / n)))
        assert numbers["min_angle_deg"] == pytest.approx(expected)
        assert numbers["min_desired_angle_deg"] == pytest.approx(expected)
    assert math.isnan(numbers["mean_total_tension_N"])
    assert math.isnan(numbers["allocator_failures"])


@settings(deadline=None)
@given(shift=st.floats(-1e3, 1e3), turn=st.floats(0.0, 6.28), n=st.integers(2, 4))
def test_angles_depend_on_neither_place_nor_heading(
    shift: float, turn: float, n: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    columns = flight_columns(n, UNEVEN[:20])
    c, s = math.cos(turn), math.sin(turn)
    for name in [name for name in columns if name.endswith("x")]:
        x, y = columns[name], columns[name[:-1] + "y"]
        place = shift if name.endswith("_x") else 0.0
        columns[name], columns[name[:-1] + "y"] = c * x - s * y + place, s * x + c * y
    file = write_csv(tmp_path_factory.mktemp("turned") / "a.csv", columns)
    numbers = metrics.compute(import_flight([file]))
    expected = 2.0 * math.degrees(math.asin(math.sin(SPREAD) * math.sin(math.pi / n)))
    assert numbers["min_angle_deg"] == pytest.approx(expected, abs=1e-6)
    assert numbers["min_desired_angle_deg"] == pytest.approx(expected, abs=1e-6)


def test_only_time_and_positions_are_needed(tmp_path: Path) -> None:
    columns = flight_columns(2, UNEVEN)
    few = {
        k: v
        for k, v in columns.items()
        if k == "t" or (k.startswith(("load_", "uav")) and k[-2] == "_")
    }
    recording = import_flight([write_csv(tmp_path / "few.csv", few)])
    assert recording.measured("directions", "positions")
    for name in ("reference", "force", "desired_tensions", "velocities", "attitudes", "tensions"):
        assert not recording.measured(name), name
    assert math.isnan(metrics.compute(recording)["tracking_rms_m"])


def test_a_cell_without_a_number_is_unknown_where_it_may_be(tmp_path: Path) -> None:
    columns = flight_columns(2, UNEVEN)
    columns["uav1_mux"] = columns["uav1_mux"].copy()
    columns["uav1_mux"][3] = np.nan
    recording = import_flight([write_csv(tmp_path / "gap.csv", columns)])
    assert np.isnan(recording["desired_tensions"][3]).tolist() == [False, True]
    assert np.isfinite(recording["desired_tensions"][4]).all()


def test_other_text_is_not_taken_for_a_flight(tmp_path: Path) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("nothing of the kind")
    with pytest.raises(
        FlightDataError,
        match=r"no known log format; there are (\S+, )*flight-csv, (\S+, )*usd-log$",
    ):
        read(file)


LINES = "t,load_x,load_y,load_z,uav0_x,uav0_y,uav0_z\n0,0,0,0,0,0,1\n0.1,0,0,0,0,0,1\n"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("load_y", "load_q", "column load_y is missing"),
        ("uav0_z\n", "uav0_z,colour\n", "unknown column 'colour'"),
        ("uav0_z\n", "uav0_z,load_x\n", "column load_x stands there twice"),
        ("uav0_z\n", "uav0_z,uav0_vx\n", "column uav0_vy is missing beside uav0_v"),
        ("uav0_", "uav1_", "column uav0_x is missing"),
        ("0.1,0,0,0", "0.1,0,zero,0", "column load_y, line 3: 'zero' is not a number"),
        ("0.1,0,0,0", ",0,0,0", "column t, line 3: '' must be a finite number"),
        ("0,0,0,0,0,0,1\n", "0,0,0,0,0,1\n", "line 2 has 6 cells; the header has 7"),
        ("0.1,0,0,0", "0.1,0,0,0,0", "line 3 has 8 cells; the header has 7"),
        ("0.1,", "0,", "column t, line 3: time 0 does not come after 0"),
        (",0,0,0,0,0,1", ",,,,0,0,1", "no two rows with a position of the load"),
        ("0.1,0,0,0,0,0,1\n", "", "holds 1 rows"),
        (LINES, "", "column t is missing"),
    ],
)
def test_a_mistake_is_named_with_its_place(
    old: str, new: str, message: str, tmp_path: Path
) -> None:
    file = tmp_path / "flight.csv"
    file.write_text(LINES.replace(old, new))
    with pytest.raises(FlightDataError) as caught:
        import_flight([file])
    assert message in str(caught.value)
    assert str(file) in str(caught.value)


def test_bytes_that_are_no_text(tmp_path: Path) -> None:
    file = tmp_path / "flight.csv"
    file.write_bytes(b"t,load_x\n\xff\xfe")
    with pytest.raises(FlightDataError, match=r"flight\.csv"):
        import_flight([file])


def test_the_attitude_of_a_rigid_load_is_kept(tmp_path: Path) -> None:
    def turned(**told: str) -> tuple[np.ndarray, np.ndarray]:
        columns = flight_columns(2, UNEVEN[:20])
        for x in [name for name in columns if name.endswith("x") and "frame" in told]:
            y, z = x[:-1] + "y", x[:-1] + "z"
            columns[x], columns[y], columns[z] = columns[y], columns[x], -columns[z]
        half = np.linspace(0.1, 0.4, 20)
        attitude = np.column_stack(
            [np.cos(half), 0.6 * np.sin(half), 0.0 * half, 0.8 * np.sin(half)]
        )
        columns |= {f"load_q{name}": attitude[:, k] for k, name in enumerate("wxyz")}
        columns["load_qw"][7] = 9.0
        file = write_csv(tmp_path / f"bar{len(told)}.csv", columns)
        recording = import_flight([file], told=Reading(**told))
        (finding,) = recording.provenance["findings"]
        assert finding["of"] == "attitude of load"
        found = recording["load_attitude"]
        assert np.isnan(found[7]).all()
        return np.delete(found, 7, axis=0), np.delete(attitude, 7, axis=0)

    found, given = turned()
    np.testing.assert_allclose(found, given, atol=1e-9)
    found, given = turned(frame="ned")
    north = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    for up, down in zip(found, given, strict=True):
        np.testing.assert_allclose(
            matrix_of(up), north @ matrix_of(down) @ np.diag([1.0, -1.0, -1.0]), atol=1e-9
        )


def test_a_log_without_it_knows_no_attitude_of_the_load(tmp_path: Path) -> None:
    recording = import_flight([write_csv(tmp_path / "a.csv", flight_columns(2, UNEVEN[:20]))])
    assert np.isnan(recording["load_attitude"]).all()
