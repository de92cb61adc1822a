"""A recording survives its file exactly, and a broken file gives a readable error."""

from __future__ import annotations

import json

import h5py
import numpy as np
import pytest

import colift
from colift.errors import RecordingError
from colift.kernel.signals import CYCLE_SIGNALS, SIGNALS
from colift.record.recording import Recording, atomic_path


@pytest.fixture(scope="module")
def recording():
    return colift.run(
        "eight-drones", timing__duration=0.3, timing__allocation=0.01, seed=11
    ).recording


@pytest.fixture
def saved(recording, tmp_path):
    return recording.save(tmp_path / "flight.h5")


def test_round_trip_is_exact(recording, saved):
    again = Recording.load(saved)
    assert again.arrays.keys() == recording.arrays.keys()
    for name, values in recording.arrays.items():
        assert again[name].shape == values.shape
        assert again[name].tobytes() == np.ascontiguousarray(values).tobytes(), name
    assert again.time.tobytes() == recording.time.tobytes()
    assert again.cycle_time.tobytes() == recording.cycle_time.tobytes()
    assert again.mission.resolved() == recording.mission.resolved()
    assert again.outcome == recording.outcome == "completed"
    assert again.versions == recording.versions


def test_every_dataset_says_its_unit_and_meaning(saved):
    found = []
    with h5py.File(saved) as file:

        def visit(name, node):
            if isinstance(node, h5py.Dataset):
                found.append(name)
                for key in ("unit", "meaning", "frame", "symbol", "shape"):
                    assert node.attrs[key], (name, key)
                assert len(json.loads(node.attrs["shape"])) == node.ndim

        file.visititems(visit)
        units = {s.name: s.unit for s in SIGNALS}
        assert file["signals/tensions"].attrs["unit"] == units["tensions"] == "N"
        assert file["time"].attrs["unit"] == "s"
        assert file["allocator/solve_time"].attrs["unit"] == "s"
        assert file.attrs["seed"] == 11
        assert json.loads(file.attrs["mission"])["name"] == "eight-drones"
        assert {"colift", "numpy", "numba", "python"} <= set(json.loads(file.attrs["versions"]))
    assert len(found) == 2 + len(SIGNALS) + len(CYCLE_SIGNALS)


def test_the_saved_mission_flies_the_same_flight_again(recording, saved):
    again = colift.run(Recording.load(saved).mission).recording
    for signal in SIGNALS:
        np.testing.assert_array_equal(again[signal.name], recording[signal.name])


def test_is_a_mapping_of_signals(recording):
    assert set(recording) == {s.name for s in (*SIGNALS, *CYCLE_SIGNALS)}
    assert len(recording) == len(list(recording))
    assert recording.n == 8
    assert recording.signal("tensions").unit == "N"
    with pytest.raises(KeyError, match=r"no signal 'tension'.*tensions"):
        recording["tension"]


def test_diverged_flight_round_trips(tmp_path):
    r = colift.run(
        "hover",
        timing__duration=5.0,
        position_control__k_p=[1e9] * 3,
        position_control__k_d=[0.0] * 3,
    ).recording
    again = Recording.load(r.save(tmp_path / "diverged.h5"))
    assert again.outcome == r.outcome != "completed"
    np.testing.assert_array_equal(again["load"], r["load"])
    assert np.isnan(again["load"]).any()


def test_a_large_mission_fits_into_the_file(tmp_path):
    directions = np.random.default_rng(0).normal(size=(1024, 3)) - [0.0, 0.0, 5.0]
    r = colift.run(
        "hover", allocator="ring", drones__count=1024, start__directions=directions,
        timing__duration=0.01, drones__mass=[0.5] * 1024, drones__inertia=[[0.02, 0.02, 0.03]] * 1024,
    ).recording  # fmt: skip
    assert len(json.dumps(r.mission.resolved())) > 2**16
    assert Recording.load(r.save(tmp_path / "large.h5")).mission.resolved() == r.mission.resolved()


# ---------------------------------------------------------------- atomic writing


def test_a_failure_while_writing_leaves_the_old_file(recording, tmp_path, monkeypatch):
    path = tmp_path / "flight.h5"
    path.write_bytes(b"old")

    def fail(*_):
        raise OSError("disk full")

    monkeypatch.setattr("pathlib.Path.write_bytes", fail)
    with pytest.raises(OSError, match="disk full"):
        recording.save(path)
    monkeypatch.undo()
    assert path.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_an_interrupt_while_writing_leaves_nothing(tmp_path, error):
    path = tmp_path / "new" / "file.txt"

    def write_half():
        with atomic_path(path) as temporary:
            temporary.write_text("half")
            raise error

    with pytest.raises(error):
        write_half()
    assert list(path.parent.iterdir()) == []


def test_a_good_write_replaces_and_makes_folders(tmp_path, recording):
    path = tmp_path / "a" / "b" / "file.txt"
    for text in ("one", "two"):
        with atomic_path(path) as temporary:
            temporary.write_text(text)
            assert temporary.suffix == ".txt"
            assert temporary.parent == path.parent
        assert path.read_text() == text
    assert list(path.parent.iterdir()) == [path]


# ---------------------------------------------------------------- broken files


def test_missing_file(tmp_path):
    with pytest.raises(RecordingError, match=r"nowhere\.h5"):
        Recording.load(tmp_path / "nowhere.h5")


@pytest.mark.parametrize("content", [b"", b"name = 'hover'\n", b"\x89HDF\r\n\x1a\n"])
def test_not_hdf5(tmp_path, content):
    path = tmp_path / "other.h5"
    path.write_bytes(content)
    with pytest.raises(RecordingError, match=r"other\.h5: cannot be read as a recording"):
        Recording.load(path)


def test_another_hdf5_file(tmp_path):
    path = tmp_path / "other.h5"
    with h5py.File(path, "w") as file:
        file["time"] = [1.0]
    with pytest.raises(RecordingError, match="not a file of format 'colift recording 1'"):
        Recording.load(path)


@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
def test_truncated_file(saved, share):
    content = saved.read_bytes()
    saved.write_bytes(content[: int(share * len(content))])
    with pytest.raises(RecordingError, match="cannot be read"):
        Recording.load(saved)


def test_without_times(saved):
    with h5py.File(saved, "a") as file:
        del file["time"]
    with pytest.raises(RecordingError, match="cannot be read"):
        Recording.load(saved)


@pytest.mark.parametrize("text", ["", "{", "[]", "3", '"hover"'])
def test_a_broken_mission_inside(saved, text):
    with h5py.File(saved, "a") as file:
        file.attrs["mission"] = text
    with pytest.raises(RecordingError, match=r"flight\.h5: cannot be read"):
        Recording.load(saved)


def test_a_missing_attribute(saved):
    with h5py.File(saved, "a") as file:
        del file.attrs["outcome"]
    with pytest.raises(RecordingError, match="outcome"):
        Recording.load(saved)


def test_a_folder(tmp_path):
    with pytest.raises(RecordingError):
        Recording.load(tmp_path)
