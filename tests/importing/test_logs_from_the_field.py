"""Logs as people have them: other frames, units, separators, gaps, swapped drones, files cut off. Read right, or refused with the reason."""

from __future__ import annotations

import contextlib
import itertools
import json
import math
import random
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from made_up_flights import LENGTH, flight_columns, usd_bytes, usd_log, write_csv

from colift.errors import FlightDataError
from colift.record import metrics
from colift.record.importing import Reading, import_flight
from colift.record.recording import Recording
from colift.record.verdict import judge as verdict_of
from colift.show.report.html import write_report
from colift.show.viewer.data import payload
from colift.study.judge import judge

TIME = np.arange(400) * 0.01
Columns = dict[str, np.ndarray]


@pytest.fixture
def columns() -> Columns:
    return flight_columns(2, TIME)


def rotated(columns: Columns) -> Columns:
    """The same flight in north-east-down."""
    names = [name[:-1] for name in columns if name.endswith("z")]
    turned = {"t": columns["t"]}
    for name in names:
        x, y, z = (columns[name + axis] for axis in "xyz")
        turned.update({f"{name}x": y, f"{name}y": x, f"{name}z": -z})
    return turned


def millimetres(columns: Columns) -> Columns:
    return {k: v if k == "t" or "_fd" in k or "_mu" in k else 1e3 * v for k, v in columns.items()}


def same(found: Recording, columns: Columns, tmp_path: Path) -> None:
    """The recording is that of the columns, as they are documented."""
    plain = import_flight([write_csv(tmp_path / "plain.csv", columns)])
    assert found.time == pytest.approx(plain.time, abs=1e-6)
    for name in ("load", "reference", "positions", "velocities", "force", "desired_directions"):
        np.testing.assert_allclose(found[name], plain[name], atol=1e-9, err_msg=name)


@pytest.mark.parametrize(
    ("change", "told", "suspicion", "option"),
    [
        (rotated, {"frame": "ned"}, "below the load", "--frame ned"),
        (millimetres, {"unit": "mm"}, "cables of 500 m", "--unit mm"),
        (lambda c: {**c, "t": 1e3 * c["t"]}, {"time_unit": "ms"}, "rows 10 s apart", "--time-unit ms"),
        (lambda c: {**c, "t": 1e6 * c["t"] + 7.0}, {"time_unit": "us"}, "apart in seconds", "--time-unit us"),
        (lambda c: {**c, "t": 1e9 * c["t"] + 1.7e18}, {"time_unit": "ns"}, "apart in seconds", "--time-unit ns"),
        (lambda c: {**c, "t": 1e3 * c["t"] + 1.7e12}, {"time_unit": "ms"}, "apart in seconds", "--time-unit ms"),
        (lambda c: rotated(millimetres(c)), {"unit": "mm", "frame": "ned"}, "cables of 500 m", "--unit mm"),
    ],
)  # fmt: skip
def test_another_convention_is_suspected_and_read_when_told(
    change: Callable[[Columns], Columns], told: dict[str, str], suspicion: str, option: str,
    columns: Columns, tmp_path: Path,
) -> None:  # fmt: skip
    file = write_csv(tmp_path / "other.csv", change(columns))
    with pytest.raises(FlightDataError) as caught:
        import_flight([file])
    assert suspicion in str(caught.value)
    assert option in str(caught.value)
    found = import_flight([file], told=Reading(**told))  # type: ignore[arg-type]
    same(found, columns, tmp_path)
    assert found.provenance["findings"] == []


@pytest.mark.parametrize(
    ("told", "message"),
    [
        ({"frame": "ned"}, "Leave out --frame ned"),
        ({"unit": "mm"}, "leave out --unit mm"),
        ({"time_unit": "ms"}, "leave out --time-unit"),
        ({"time_unit": "ns"}, "leave out --time-unit"),
    ],
)
def test_an_option_that_does_not_fit_is_refused(
    told: dict[str, str], message: str, columns: Columns, tmp_path: Path
) -> None:
    file = write_csv(tmp_path / "good.csv", columns)
    with pytest.raises(FlightDataError, match=message):
        import_flight([file], told=Reading(**told))  # type: ignore[arg-type]


def test_what_looks_wrong_and_is_right_is_read_when_told(tmp_path: Path) -> None:
    """A long line of a large helicopter, and a log of one row in two seconds."""
    columns = flight_columns(2, 2.0 * np.arange(30))
    for name, k in itertools.product(("x", "y", "z"), (0, 1)):
        load, drone = columns[f"load_{name}"], columns[f"uav{k}_{name}"]
        columns[f"uav{k}_{name}"] = load + 100.0 * (drone - load)
    file = write_csv(tmp_path / "long.csv", columns)
    with pytest.raises(FlightDataError, match="--time-unit s if it is right"):
        import_flight([file])
    with pytest.raises(FlightDataError, match="--unit m if it is right"):
        import_flight([file], told=Reading(time_unit="s"))
    found = import_flight([file], told=Reading(time_unit="s", unit="m"))
    assert found.mission.team.cable_lengths == pytest.approx(100.0 * LENGTH)


def test_velocities_tell_of_a_wrong_unit_of_time(columns: Columns, tmp_path: Path) -> None:
    """Ten milliseconds written as 0.1 ms could be a fast log, were it not for the velocities."""
    columns["t"] = columns["t"] * 0.02
    with pytest.raises(FlightDataError, match="positions change 50 times as fast"):
        import_flight([write_csv(tmp_path / "fast.csv", columns)])


# ---------------------------------------------------------------- tables


def written(columns: Columns, separator: str, decimal: str, quote: str = "") -> str:
    rows = [separator.join(quote + name + quote for name in columns)]
    for row in zip(*columns.values(), strict=True):
        cells = (repr(float(v)).replace(".", decimal) for v in row)
        rows.append(separator.join(quote + cell + quote for cell in cells))
    return "\n".join(rows) + "\n"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize(
    ("separator", "decimal", "quote"),
    [(";", ",", ""), (";", ".", ""), ("\t", ",", ""), ("\t", ".", '"'), (",", ",", '"')],
)
def test_other_locales(
    separator: str, decimal: str, quote: str, encoding: str, columns: Columns, tmp_path: Path
) -> None:
    file = tmp_path / "flight.csv"
    text = written(columns, separator, decimal, quote)
    file.write_text(text if encoding != "utf-8" else f"sep={separator}\n{text}", encoding=encoding)
    same(import_flight([file]), columns, tmp_path)


def test_a_decimal_comma_between_commas_is_suspected(columns: Columns, tmp_path: Path) -> None:
    file = tmp_path / "flight.csv"
    file.write_text(written(columns, ",", ","))
    with pytest.raises(FlightDataError, match="Is a decimal comma used"):
        import_flight([file])


@settings(deadline=None, max_examples=20)
@given(order=st.randoms(use_true_random=False), upper=st.booleans())
def test_the_order_of_columns_does_not_matter(
    order: random.Random, upper: bool, tmp_path_factory: pytest.TempPathFactory
) -> None:
    columns = flight_columns(3, TIME[:50])
    names = list(columns)
    order.shuffle(names)
    folder = tmp_path_factory.mktemp("order")
    shuffled = {name.upper() if upper else name: columns[name] for name in names}
    same(import_flight([write_csv(folder / "flight.csv", shuffled)]), columns, folder)


def test_attitudes_by_name_by_number_and_in_another_frame(columns: Columns, tmp_path: Path) -> None:
    """A drone that leans forward by 0.2 rad and heads east, which in north-east-down is a yaw of 90 degrees."""
    lean = {"w": math.cos(0.1), "x": 0.0, "y": math.sin(0.1), "z": 0.0}
    ones = np.ones(len(TIME))
    named = dict(columns)
    for k, axis in itertools.product((0, 1), "zyxw"):
        named[f"uav{k}_q{axis}"] = lean[axis] * ones
    for k, axis in itertools.product((0, 1), "xyz"):
        named[f"uav{k}_w{axis}"] = {"x": 0.1, "y": 0.2, "z": 0.3}[axis] * ones
    found = import_flight([write_csv(tmp_path / "named.csv", named)])
    assert found["attitudes"][3] == pytest.approx(np.tile(list(lean.values()), (2, 1)))
    assert found["rates"][3] == pytest.approx(np.tile([0.1, 0.2, 0.3], (2, 1)))

    for order in ("wxyz", "xyzw"):
        numbered = dict(columns)
        for k, (place, axis) in itertools.product((0, 1), enumerate(order)):
            numbered[f"uav{k}_q{place}"] = lean[axis] * ones
        file = write_csv(tmp_path / "numbered.csv", numbered)
        with pytest.raises(FlightDataError, match="--quaternion wxyz or xyzw"):
            import_flight([file])
        again = import_flight([file], told=Reading(quaternion=order))  # type: ignore[arg-type]
        np.testing.assert_array_equal(again["attitudes"], found["attitudes"])

    down = rotated(columns)
    c, s = math.cos(math.pi / 4), math.sin(math.pi / 4)
    # Yaw by 90 degrees about down, then pitch nose down (negative about right) by 0.2 rad.
    turned = [c * lean["w"], s * lean["y"], -c * lean["y"], s * lean["w"]]
    for k in (0, 1):
        down.update({f"uav{k}_q{axis}": v * ones for axis, v in zip("wxyz", turned, strict=True)})
        down.update(
            {f"uav{k}_w{axis}": v * ones for axis, v in zip("xyz", (0.1, -0.2, -0.3), strict=True)}
        )
    ned = import_flight([write_csv(tmp_path / "ned.csv", down)], told=Reading(frame="ned"))
    alike = np.abs(np.sum(ned["attitudes"] * found["attitudes"], axis=-1))
    assert alike == pytest.approx(1.0)
    assert ned["rates"] == pytest.approx(found["rates"])


def test_quaternions_that_are_none_are_left_out(columns: Columns, tmp_path: Path) -> None:
    for k, axis in itertools.product((0, 1), "wxyz"):
        columns[f"uav{k}_q{axis}"] = (axis == "w") * np.ones(len(TIME))
    columns["uav0_qw"][7] = 0.0
    found = import_flight([write_csv(tmp_path / "q.csv", columns)])
    assert np.isnan(found["attitudes"][7, 0]).all()
    assert np.isfinite(found["attitudes"][:, 1]).all()
    assert [f["of"] for f in found.provenance["findings"]] == ["attitude of drone 0"]


# ---------------------------------------------------------------- gaps and swapped drones


@pytest.mark.parametrize("body", ["load", "uav1"])
@pytest.mark.parametrize(
    ("fill", "rows"),
    [
        *itertools.product((np.nan, 0.0), (slice(100, 112), slice(0, 5), slice(390, 400))),
        (9999.0, slice(100, 112)),  # at an end nothing tells where the body is instead
    ],
)
def test_a_gap_is_left_out_and_counted(
    fill: float, body: str, rows: slice, columns: Columns, tmp_path: Path
) -> None:
    for axis in "xyz":
        columns[f"{body}_{axis}"][rows] = fill
    file = write_csv(tmp_path / "gap.csv", columns)
    found = import_flight([file])
    position = found["load"][:, 0] if body == "load" else found["positions"][:, 1]
    missing = np.zeros(len(TIME), dtype=bool)
    missing[rows] = True
    np.testing.assert_array_equal(np.isnan(position).any(axis=1), missing)
    (finding,) = found.provenance["findings"]
    assert finding["kind"] == "gap"
    assert finding["rows"] == missing.sum()
    assert finding["begin"] == pytest.approx(TIME[rows][0])
    assert finding["end"] == pytest.approx(TIME[rows][-1])
    numbers = metrics.compute(found)
    clean = metrics.compute(import_flight([write_csv(tmp_path / "b.csv", flight_columns(2, TIME))]))
    for name in ("tracking_max_m", "min_angle_deg"):
        assert numbers[name] == pytest.approx(clean[name], rel=1e-6), name
    assert found.mission.team.cable_lengths == pytest.approx(LENGTH)


def test_a_flight_with_gaps_is_reported_replayed_and_judged(tmp_path: Path) -> None:
    columns = flight_columns(3, TIME)
    for body, rows in (("load", slice(50, 60)), ("uav1", slice(100, 112)), ("uav2", slice(0, 3))):
        for axis in "xyz":
            columns[f"{body}_{axis}"][rows] = np.nan
    flight = import_flight([write_csv(tmp_path / "gap.csv", columns)])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        numbers = metrics.compute(flight)
        page = write_report(flight, tmp_path, metrics=numbers).read_text()
        json.dumps(payload([flight], [numbers], ["x"]), allow_nan=False)
    assert "12 rows left out" in page
    verdict = verdict_of(flight, numbers)
    assert verdict.level == "warn"
    assert len(verdict.reasons) == 3
    assert any("drone 1: 12 rows left out (1.00 to 1.11 s)" in reason for reason in verdict.reasons)
    judged = judge(flight, ["ring"])
    assert len(judged.answers[0].time) == 400 - 10 - 12 - 3
    assert math.isnan(numbers["lost_drones"])


def test_a_start_at_the_origin_is_no_gap(tmp_path: Path) -> None:
    columns = flight_columns(2, TIME)
    for axis in "xyz":
        begin = columns[f"load_{axis}"][0]
        for name in columns:
            if name.endswith(f"_{axis}"):
                columns[name] = columns[name] - begin
    assert import_flight([write_csv(tmp_path / "origin.csv", columns)]).provenance["findings"] == []


@pytest.mark.parametrize("order", [(1, 0, 2), (2, 1, 0), (1, 2, 0)])
@pytest.mark.parametrize("last", [250, 400])
def test_drones_taken_for_each_other_are_flagged(
    order: tuple[int, ...], last: int, tmp_path: Path
) -> None:
    columns = flight_columns(3, TIME)
    swapped = {k: v.copy() for k, v in columns.items()}
    for i, j in enumerate(order):
        for axis in "xyz":
            swapped[f"uav{i}_{axis}"][200:last] = columns[f"uav{j}_{axis}"][200:last]
    found = import_flight([write_csv(tmp_path / "swap.csv", swapped)])
    (finding,) = found.provenance["findings"]
    who = [f"drone {i}" for i, j in enumerate(order) if i != j]
    assert finding["kind"] == "swap"
    assert finding["of"] == f"{', '.join(who[:-1])} and {who[-1]}"
    assert finding["begin"] == pytest.approx(2.0)
    assert finding["end"] == pytest.approx(TIME[last - 1])
    assert finding["rows"] == last - 200


def test_a_drone_that_was_never_seen_is_no_flight(columns: Columns, tmp_path: Path) -> None:
    for fill in (np.nan, 0.0):
        for axis in "xyz":
            columns[f"uav1_{axis}"] = np.full(len(TIME), fill)
        with pytest.raises(FlightDataError, match="no two rows with a position of drone 1"):
            import_flight([write_csv(tmp_path / "one.csv", columns)])


# ---------------------------------------------------------------- files cut off


def test_a_table_that_was_cut_off_is_read_up_to_there(columns: Columns, tmp_path: Path) -> None:
    whole = written(columns, ",", ".").encode()
    lines = whole.splitlines(keepends=True)
    before = b"".join(lines[:300])
    file = tmp_path / "cut.csv"
    for rest in (
        lines[300][:40],
        lines[300][:-7] + b"e",
        b"\0" * 512,
        lines[300][:90] + b"\0" * 5000,
    ):
        file.write_bytes(before + rest)
        found = import_flight([file])
        assert len(found.time) == 299
        (finding,) = found.provenance["findings"]
        assert (finding["kind"], finding["rows"]) == ("damage", 299)
        assert "299 rows read" in finding["text"]


def test_a_short_row_in_the_middle_is_a_mistake(columns: Columns, tmp_path: Path) -> None:
    lines = written(columns, ",", ".").splitlines(keepends=True)
    lines[100] = lines[100][:50] + "\n"
    file = tmp_path / "short.csv"
    file.write_text("".join(lines))
    with pytest.raises(FlightDataError, match="line 101 has"):
        import_flight([file])


def test_a_log_that_was_not_closed_is_read_with_a_warning(columns: Columns, tmp_path: Path) -> None:
    whole = usd_log(columns, 1, clock=20.0)
    file = tmp_path / "cf2_01"
    for data, rows in (
        (whole[:-30], 399),
        (whole[:-4] + bytes(4096), 400),
        (whole + bytes(512), 400),
    ):
        file.write_bytes(data)
        found = import_flight([file])
        assert len(found.time) == rows
        damages = [f for f in found.provenance["findings"] if f["kind"] == "damage"]
        assert [f["rows"] for f in damages] == ([] if data.startswith(whole) else [rows])
    file.write_bytes(whole[:3000] + b"\xff" + whole[3001:])
    with pytest.raises(FlightDataError, match="checksum"):
        import_flight([file])


def test_other_names_of_a_firmware(columns: Columns, tmp_path: Path) -> None:
    sources = {"stateEstimate.": "uav1_", "stateEstimate.v": "uav1_v", "stateEstimate.p": "load_",
               "stateEstimate.pv": "load_v", "ctrltarget.": "ref_"}  # fmt: skip
    pairs = [
        (head + axis, columns[tail + axis]) for head, tail in sources.items() for axis in "xyz"
    ]
    values = zip(*(v.tolist() for _, v in pairs), strict=True)
    rows = [(round(1e6 * t), v) for t, v in zip(TIME + 1.0, values, strict=True)]
    file = tmp_path / "cf2_01"
    file.write_bytes(usd_bytes([(name, "f") for name, _ in pairs], rows))
    found = import_flight([file])
    for k, axis in enumerate("xyz"):
        assert found["load"][:, 0, k] == pytest.approx(columns[f"load_{axis}"], abs=1e-6)
        assert found["positions"][:, 0, k] == pytest.approx(columns[f"uav1_{axis}"], abs=1e-6)
        assert found["reference"][:, 0, k] == pytest.approx(columns[f"ref_{axis}"], abs=1e-6)


def test_options_of_tables_do_not_apply_to_a_log_with_units(
    columns: Columns, tmp_path: Path
) -> None:
    file = tmp_path / "cf2_01"
    file.write_bytes(usd_log(columns, 1, clock=20.0))
    with pytest.raises(FlightDataError, match="leave out --unit"):
        import_flight([file], told=Reading(unit="mm"))


# ---------------------------------------------------------------- several logs


def test_a_log_given_twice_is_refused(columns: Columns, tmp_path: Path) -> None:
    files = [tmp_path / "cf1", tmp_path / "cf1-copy"]
    files[0].write_bytes(usd_log(columns, 0, 0.0))
    later = {name: values[50:] for name, values in columns.items()}
    files[1].write_bytes(usd_log(later, 0, 5.0))  # not the same bytes, but the same drone
    for pair in ((files[0], files[0]), files):
        with pytest.raises(FlightDataError, match="is of the same drone as"):
            import_flight(pair)


def test_a_flight_that_only_looks_alike_is_refused(columns: Columns, tmp_path: Path) -> None:
    """Another try of the same path, 15 mm beside it along the way; 3 mm are taken for one flight."""
    files = [tmp_path / "cf1", tmp_path / "cf2"]
    files[0].write_bytes(usd_log(columns, 0, 0.0))
    for apart, fits in ((0.003, True), (0.02, False)):
        other = dict(columns)
        other["load_z"] = columns["load_z"] + apart * np.sqrt(2.0) * np.sin(11.0 * TIME)
        files[1].write_bytes(usd_log(other, 1, 0.0))
        if fits:
            found = import_flight(files)
            assert found.provenance["files"][1]["load_mismatch_rms_m"] == pytest.approx(
                0.003, abs=1e-3
            )
        else:
            with pytest.raises(FlightDataError, match=r"stay 2\d mm RMS apart"):
                import_flight(files)


def test_a_load_that_hovers_tells_nothing(tmp_path: Path) -> None:
    columns = flight_columns(2, TIME)
    for name in list(columns):
        if name.endswith(("_x", "_y", "_z")):
            load = columns[f"load_{name[-1]}"]
            columns[name] = columns[name] - load + load[0] + 1e-3 * np.sin(2.0 * TIME)
        elif "_v" in name:
            columns[name] = 0.0 * columns[name]
    files = [tmp_path / "cf1", tmp_path / "cf2"]
    noise = np.random.default_rng(0)
    for k, file in enumerate(files):
        seen = {a: columns[f"load_{a}"] + noise.normal(0.0, 1e-3, len(TIME)) for a in "xyz"}
        file.write_bytes(usd_log({**columns, **{f"load_{a}": v for a, v in seen.items()}}, k, 0.0))
    with pytest.raises(FlightDataError, match="moves too little"):
        import_flight(files)


# ---------------------------------------------------------------- anything at all


def tried(path: Path) -> None:
    """A recording, or one error of ours; nothing else."""
    with contextlib.suppress(FlightDataError):
        recording = import_flight([path])
        numbers = metrics.compute(recording)
        assert all(isinstance(value, float) for value in numbers.values())
        again = Recording.load(recording.save(path.with_suffix(".h5")))
        assert again.n == recording.n
        json.dumps(recording.provenance)


CSV = written(flight_columns(2, TIME[:40]), ",", ".").encode()
USD = usd_log(flight_columns(2, TIME[:40]), 0, 3.0)


@settings(deadline=None, max_examples=300)
@given(data=st.data(), kind=st.sampled_from(["csv", "usd"]))
def test_no_damage_is_a_traceback(
    data: st.DataObject, kind: str, tmp_path_factory: pytest.TempPathFactory
) -> None:
    whole = bytearray(CSV if kind == "csv" else USD)
    for _ in range(data.draw(st.integers(0, 3))):
        at = data.draw(st.integers(0, len(whole) - 1))
        change = data.draw(st.sampled_from(["bit", "byte", "cut", "insert", "zeros"]))
        if change == "bit":
            whole[at] ^= 1 << data.draw(st.integers(0, 7))
        elif change == "byte":
            whole[at] = data.draw(st.integers(0, 255))
        elif change == "cut":
            del whole[max(at, 1) :]
        elif change == "insert":
            whole[at:at] = data.draw(st.binary(max_size=8))
        else:
            whole[at:] = bytes(len(whole) - at)
    path = tmp_path_factory.mktemp("any") / f"log.{kind}"
    path.write_bytes(bytes(whole))
    tried(path)


@settings(deadline=None, max_examples=100)
@given(
    cells=st.lists(
        st.lists(
            st.one_of(
                st.floats(width=32).map(repr), st.sampled_from(["", "nan", "1e308", "-1e308", "1e-320", "1_0", "٣", '"', "0"])
            ),
            min_size=7, max_size=7,
        ),
        max_size=8,
    ),
    step=st.sampled_from([0.01, 1e-300, 1e300]),
)  # fmt: skip
def test_no_number_is_a_traceback(
    cells: list[list[str]], step: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    path = tmp_path_factory.mktemp("any") / "flight.csv"
    lines = ["t,load_x,load_y,load_z,uav0_x,uav0_y,uav0_z"]
    lines += [",".join([repr(step * k), *row[1:]]) for k, row in enumerate(cells)]
    path.write_text("\n".join(lines) + "\n")
    tried(path)
