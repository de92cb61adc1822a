"""Recordings of other versions and of parts that are not there: they open, are judged, reported and replayed.

``data/format-1.h5`` was written by the version that introduced this test and must open for ever. Older files are made
from it by taking out what came later, newer ones by putting in what is to come.
"""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

from colift.errors import AbsentSignalError, RecordingError
from colift.kernel.signals import CYCLE_SIGNALS, SIGNALS
from colift.record import metrics
from colift.record.moments import find_moments
from colift.record.recording import Recording
from colift.record.verdict import judge
from colift.show.report.figures import drawable
from colift.show.report.html import write_report
from colift.show.viewer.data import payload
from terminal import colift

KEPT = Path(__file__).parents[1] / "data" / "format-1.h5"

Change = Callable[[Any], None]


@pytest.fixture
def changed(tmp_path: Path) -> Callable[[Change], Path]:
    """A copy of the kept recording, changed."""

    def change(what: Change) -> Path:
        path = tmp_path / "changed.h5"
        shutil.copy(KEPT, path)
        with h5py.File(path, "a") as file:
            what(file)
        return path

    return change


def in_mission(change: Callable[[dict[str, Any]], None]) -> Change:
    def apply(file: Any) -> None:
        table = json.loads(file.attrs["mission"])
        change(table)
        file.attrs["mission"] = json.dumps(table)

    return apply


def everything(recording: Recording) -> dict[str, float]:
    """What is made of a recording, but for pictures; without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        numbers = metrics.compute(recording)
        assert judge(recording, numbers).level in ("pass", "warn", "fail", "lost")
        find_moments(recording)
        json.dumps(payload([recording], [numbers], ["x"]))
        drawable(recording)
    return numbers


def test_the_kept_recording() -> None:
    recording = Recording.load(KEPT)
    assert recording.n == 4
    assert recording.source == "simulation"
    assert recording.outcome == "completed"
    assert recording.mission.name == "cut-in-flight"
    assert recording.mission.seed == 1
    assert recording.mission.kinds["plant"] == "slack-cables"
    assert recording.mission.list_kinds["fault"] == ["cable-cut"]
    assert recording.mission.fault[0].at == 0.5
    assert recording.mission.allocation.min_angle_deg == 30.0
    assert recording.mission.team.load_mass == 0.225
    assert str(recording.mission.criteria["tracking_max_m"]) == "<= 0.1"
    numbers = everything(recording)
    assert numbers["tracking_max_m"] == pytest.approx(TRACKING, rel=1e-12)
    assert numbers["lost_drones"] == 1.0
    assert numbers["detection_delay_s"] == pytest.approx(0.1)
    told = [moment.text for moment in find_moments(recording)]
    assert "Cable of drone 0 cut" in told
    assert "Drone 0 is judged lost and leaves the team" in told
    assert judge(recording, numbers).level == "warn"


TRACKING = 0.044928046784103226


def test_opening_imports_no_kernel() -> None:
    """Nor anything else that takes long; what is judged of it, its numbers and moments, neither."""
    script = (
        "import sys; from colift.record.recording import Recording; from colift.record import metrics, moments, verdict\n"
        f"flight = Recording.load({str(KEPT)!r}); numbers = metrics.compute(flight)\n"
        "verdict.judge(flight, numbers); moments.find_moments(flight)\n"
        "print(*{name.partition('.')[0] for name in sys.modules})\n"
        "print(*[name for name in sys.modules if name.startswith('colift.')])"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=300, check=True
    )
    packages, own = (line.split() for line in done.stdout.splitlines())
    assert not {"numba", "llvmlite", "matplotlib", "scipy", "rich", "typer", "tomli_w"} & set(
        packages
    )
    assert not [name for name in own if name.endswith(".base") or "loop" in name]


NEWER = {"phase", "ground_forces", "touch_speeds", "clock", "measured_ages", "estimated_ages", "received_ages", "agent_status",
         "estimated_forces", "estimated_wind", "standing", "lift_share", "spans", "unhooked",
         "lifted_mass", "measured_specific_forces", "specific_force_ages", "reeled", "found_lengths", "learned_load",
         "load_attitude", "load_rates", "reference_attitude", "reference_rates", "moment",
         "measured_load_attitude", "measured_load_rates", "estimated_load_attitude",
         "estimated_load_rates", "allocator_moment_residual", "external_moment"}  # fmt: skip
"""Signals that came after the recording that is kept here."""


def test_what_came_later_is_absent() -> None:
    assert not NEWER & {*Recording.load(KEPT)}


@pytest.mark.parametrize(
    "name", [s.name for s in (*SIGNALS, *CYCLE_SIGNALS) if s.name not in NEWER]
)
def test_without_any_one_signal(name: str, changed: Callable[[Change], Path]) -> None:
    def leave_out(file: Any) -> None:
        short = name.removeprefix("allocator_")
        place = "allocator/solve_time" if name == "allocator_time" else f"allocator/{short}"
        del file[f"signals/{name}" if f"signals/{name}" in file else place]

    whole, found = Recording.load(KEPT), Recording.load(changed(leave_out))
    assert name not in found
    assert len(found) == len(whole) - 1
    with pytest.raises(AbsentSignalError, match=f"no signal '{name}'; there are "):
        found[name]
    with pytest.raises(KeyError):
        found[name]
    assert not found.measured(name)
    assert np.isnan(found.complete()[name]).all()
    before, after = metrics.compute(whole), everything(found)
    if name == "peak_tensions":  # then the peaks are those of the rows
        for key in ("peak_tension_N", "peak_total_tension_N"):
            assert 0.9 * before[key] < after.pop(key) <= before.pop(key)
    for key, value in before.items():  # as it was, or unknown; never another number
        assert after[key] == pytest.approx(value, nan_ok=True) or math.isnan(after[key]), key


def test_a_metric_of_an_absent_signal_is_unknown(changed: Callable[[Change], Path]) -> None:
    def leave_out(file: Any) -> None:
        del file["signals/attached"], file["signals/slack_times"], file["allocator"]

    numbers = everything(Recording.load(changed(leave_out)))
    for name in (
        "lost_drones",
        "detection_delay_s",
        "slack_time_s",
        "allocator_max_us",
        "allocator_failures",
    ):
        assert math.isnan(numbers[name]), name
    assert numbers["tracking_max_m"] == pytest.approx(TRACKING)


def test_a_recording_of_little_more_than_positions(
    changed: Callable[[Change], Path], tmp_path: Path
) -> None:
    """Without all that came after the first version, and then some: pictures too."""

    def leave_out(file: Any) -> None:
        for name in list(file["signals"]):
            if name not in ("load", "positions"):
                del file["signals"][name]
        del file["allocator"]
        for name in ("source", "provenance", "commands", "versions", "seed"):
            del file.attrs[name]
        file.attrs["mission"] = json.dumps({"drones": {"count": 4}})

    path = changed(leave_out)
    recording = Recording.load(path)
    assert set(recording) == {"load", "positions"}
    numbers = everything(recording)
    assert numbers["min_height_m"] == pytest.approx(recording["load"][:, 0, 2].min())
    assert set(drawable(recording)) == {"path"}
    page = write_report(recording, tmp_path / "out", metrics=numbers).read_text()
    assert "min_height_m" in page
    again = Recording.load(recording.save(tmp_path / "again.h5"))
    assert set(again) == {"load", "positions"}


def test_unknown_signals_are_kept(changed: Callable[[Change], Path], tmp_path: Path) -> None:
    def put_in(file: Any) -> None:
        rows, cycles = len(file["time"]), len(file["allocator/time"])
        for place, values, shape in (
            ("signals/contact_forces", np.arange(3.0 * rows).reshape(rows, 3), ["time", 3]),
            ("signals/allocator_age", np.arange(1.0 * rows), ["time"]),
            ("allocator/effort", np.arange(1.0 * cycles), ["time"]),
        ):
            file[place] = values
            marks = {"unit": "N", "symbol": "c", "frame": "world", "meaning": "force of the ground"}
            file[place].attrs.update({**marks, "shape": json.dumps(shape)})
        file["signals/bare"] = np.arange(rows)
        file.attrs["format"] = "colift recording 7"

    recording = Recording.load(changed(put_in))
    everything(recording)
    again = Recording.load(recording.save(tmp_path / "again.h5"))
    for found in (recording, again):
        assert found["contact_forces"].tolist() == np.arange(39.0).reshape(13, 3).tolist()
        assert found["allocator_age"].shape == (13,)
        assert found["allocator_effort"].shape == (len(found.cycle_time),)
        signal = found.signal("contact_forces")
        assert (signal.unit, signal.shape, signal.meaning) == ("N", (3,), "force of the ground")
        assert found.signal("allocator_effort").each == "allocation"
        assert found.signal("allocator_age").each == "row"
        assert found.signal("bare").unit == "?"
    with h5py.File(tmp_path / "again.h5") as file:
        assert file["signals/contact_forces"].attrs["meaning"] == "force of the ground"
        assert "effort" in file["allocator"]


def foreign(table: dict[str, Any]) -> None:
    """Parts, fields and events that nobody knows here."""
    table["plant"] = {"kind": "their-plant", "stiffness": [1.0, None]}
    table["allocation"] = {"kind": "their-allocator", "eagerness": 3}
    table["ground"] = {"kind": "their-ground", "hardness": 2.0}
    table["fault"] = [{"kind": "their-fault", "at": 0.5}, "odd"]
    table["drones"] |= {"vehicle": "their-drone", "inertia": "heavy", "cable_length": [1.0, 1.1]}
    table["load"] = {"mass": 0.3, "kind": "rigid", "size": [1, 2, 3]}
    table["timing"] |= {"sleep": 3.0}
    table["events"] = [
        {"at": 0.4, "field": "ground.hardness", "value": 3}, {"at": 0.6, "field": "drones.lose", "value": 1},
        {"at": "late"}, "odd",
    ]  # fmt: skip
    table["criteria"] |= {"their_metric": {"max": 1.0}, "min_height_m": {"min": 0.1, "near": 2}}
    table["world"] = "flat"


def test_parts_fields_and_events_that_are_unknown(
    changed: Callable[[Change], Path], tmp_path: Path
) -> None:
    path = changed(in_mission(foreign))
    recording = Recording.load(path)
    mission = recording.mission
    assert mission.kinds["plant"] == "their-plant"
    assert mission.kinds["ground"] == "their-ground"
    assert mission.list_kinds["fault"] == ["their-fault"]
    assert mission.load.mass == 0.3
    assert mission.drones.mass == 0.5  # as it is told there
    assert mission.team.n == 4
    assert mission.world.gravity == 9.81  # the default, where nothing is understood
    assert [event.field for event in mission.events] == ["ground.hardness", "drones.lose"]
    assert mission.resolved()["drones"]["vehicle"] == "their-drone"
    assert mission.resolved()["plant"] == {"kind": "their-plant", "stiffness": [1.0]}
    numbers = everything(recording)
    verdict = judge(recording, numbers)
    assert any(
        "their_metric" in reason for reason in verdict.reasons
    )  # which nobody can say that it holds
    page = write_report(recording, tmp_path / "out", metrics=numbers).read_text()
    assert "their-plant" in page
    assert "their-drone" in page
    again = Recording.load(recording.save(tmp_path / "again.h5"))
    assert again.mission.resolved() == mission.resolved()


def test_the_commands_on_a_recording_of_foreign_parts(
    changed: Callable[[Change], Path], tmp_path: Path
) -> None:
    run = tmp_path / "a run"
    run.mkdir()
    shutil.move(changed(in_mission(foreign)), run / "recording.h5")
    done = colift("report", str(run), "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["metrics"]["lost_drones"] == 1.0
    assert (run / "report.html").is_file()
    done = colift("replay", str(run), str(KEPT), "--html", str(tmp_path / "replay.html"))
    assert done.returncode == 0, done.stderr
    text = (tmp_path / "replay.html").read_text()
    assert "their-plant" in text
    done = colift("judge", str(KEPT), "--allocators", "ring")
    assert done.returncode == 1  # a drone left, which judge cannot take
    assert "needs the directions of all cables" in done.stderr


@pytest.mark.parametrize(
    "name", ["load", "positions", "directions", "tensions", "reference", "attached"]
)
@pytest.mark.parametrize("rows", [slice(0, 1), slice(4, 7), slice(None)])
def test_numbers_that_are_missing(name: str, rows: slice, tmp_path: Path) -> None:
    recording = Recording.load(KEPT)
    recording.arrays[name][rows] = np.nan
    numbers = everything(recording)
    assert math.isnan(numbers["min_height_m"]) == (name == "load" and rows == slice(None))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_report(recording, tmp_path, metrics=numbers)


def test_a_recording_of_nothing_but_nan(tmp_path: Path) -> None:
    recording = Recording.load(KEPT)
    for values in recording.arrays.values():
        values[:] = np.nan
    numbers = everything(recording)
    write_report(recording, tmp_path, metrics=numbers)
    assert all(math.isnan(value) for name, value in numbers.items()), {
        name: value for name, value in numbers.items() if not math.isnan(value)
    }


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f.pop("time"), "time"),
        (lambda f: f.pop("signals"), "signals"),
        (lambda f: f.attrs.pop("mission"), "mission"),
        (lambda f: f.attrs.update(mission="[]"), "its mission is no table"),
        (lambda f: f.attrs.update(format="other"), "not a file of format 'colift recording 1'"),
        (lambda f: (f.pop("time"), f.update(time=np.zeros(0))), "holds no times"),
        (lambda f: (f["signals"].pop("load"), f["signals"].update(load=np.zeros(3))), "signal load has the shape"),
        (lambda f: (f["signals"].pop("tensions"), f["signals"].update(tensions=np.zeros((13, 5)))), "are of 4 and of 5 drones"),
    ],
)  # fmt: skip
def test_what_is_no_recording_says_why(
    change: Change, message: str, changed: Callable[[Change], Path]
) -> None:
    def apply(file: Any) -> None:
        change(_Popping(file))

    with pytest.raises(RecordingError, match=message):
        Recording.load(changed(apply))


class _Popping:
    """Enough of a dictionary for the changes above, around a group of HDF5."""

    def __init__(self, group: Any) -> None:
        self.group, self.attrs = group, group.attrs

    def __getitem__(self, name: str) -> _Popping:
        return _Popping(self.group[name])

    def pop(self, name: str) -> None:
        del self.group[name]

    def update(self, **items: Any) -> None:
        for name, value in items.items():
            self.group[name] = value
