"""The `colift` command as a user meets it: output, files, exit codes, interruption."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest

from colift.record.recording import Recording
from terminal import colift

SHORT = ("--set", "timing.duration=1.0", "--no-report")


def test_run_as_json_prints_one_object_and_nothing_else(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "colift", "run", "--json", "--out", str(tmp_path / "flight")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    assert colift("run", "--json", "--out", str(tmp_path / "again")).returncode == 0
    result = json.loads(done.stdout)
    assert result["outcome"] == "completed"
    assert result["metrics"]["tracking_rms_m"] <= 5e-4
    for path in result["files"].values():
        assert Path(path).stat().st_size > 0
    assert json.loads((tmp_path / "flight/metrics.json").read_text()) == result["metrics"]
    assert Recording.load(tmp_path / "flight/recording.h5").mission.name == "paper-spiral"


def test_the_resolved_mission_flies_again_with_the_same_signals(tmp_path: Path) -> None:
    assert colift("run", "hover", *SHORT, "--out", str(tmp_path / "a")).returncode == 0
    again = colift(
        "run", str(tmp_path / "a/mission.toml"), "--no-report", "--out", str(tmp_path / "b")
    )
    assert again.returncode == 0, again.stderr
    first, second = (Recording.load(tmp_path / x / "recording.h5") for x in "ab")
    for name in first:
        if name != "allocator_time":
            assert (first[name] == second[name]).all(), name


def test_results_go_to_a_dated_folder_by_default(tmp_path: Path) -> None:
    assert colift("run", "hover", *SHORT, folder=tmp_path).returncode == 0
    (folder,) = (tmp_path / "runs").iterdir()
    assert folder.name.startswith("hover-2")
    assert tomllib.loads((folder / "mission.toml").read_text())["timing"]["duration"] == 1.0


def test_set_changes_any_field_and_the_table_shows_units(tmp_path: Path) -> None:
    done = colift("run", *SHORT, "--set", "allocation.mu=0.75", "--out", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert "tracking_rms_m" in done.stdout
    assert tomllib.loads((tmp_path / "mission.toml").read_text())["allocation"]["mu"] == 0.75


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("run", "paper-spirl"), "did you mean 'paper-spiral'"),
        (("run", "--set", "load.mass=-1"), "load.mass: must be greater than 0"),
        (("run", "--set", "load.mas=1"), "did you mean 'mass'"),
        (("run", "--set", "mu"), "key=value"),
        (("run", "nowhere.toml"), "cannot be read"),
        (("run", "--nonsense"), "No such option"),
        (("run", "--with", "nowhere.py"), "not a Python file"),
        (("bench", "--sizes", "4,x"), "not a list of whole numbers"),
        (("bench", "--sizes", "0"), "between 2 and 1024"),
        (("fly-away",), "No such command"),
    ],
)
def test_a_mistake_is_named_and_nothing_is_written(
    tmp_path: Path, arguments: tuple[str, ...], says: str
) -> None:
    done = colift(*arguments, folder=tmp_path)
    assert done.returncode in (1, 2)
    assert says in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
    assert done.stdout == ""
    assert list(tmp_path.iterdir()) == []


def test_a_diverged_flight_says_so_and_keeps_its_recording(tmp_path: Path) -> None:
    changes = (
        "--set",
        "attitude_control.k_d=[900.0, 900.0, 900.0]",
        "--set",
        "timing.attitude_control=0.01",
    )
    done = colift("run", *changes, "--no-report", "--json", "--out", str(tmp_path))
    assert done.returncode == 3
    assert json.loads(done.stdout)["outcome"].startswith("diverged before t =")
    assert (tmp_path / "recording.h5").stat().st_size > 0


def test_ctrl_c_ends_quietly_and_leaves_no_half_written_file(tmp_path: Path) -> None:
    long = (
        "--set",
        "timing.duration=100000.0",
        "--set",
        "timing.recording=1.0",
        "--set",
        "timing.allocation=0.1",
    )
    process = subprocess.Popen(
        [sys.executable, "-m", "colift", "run", *long, "--out", str(tmp_path / "flight")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    time.sleep(6.0)
    assert process.poll() is None, "finished before it could be interrupted"
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in said
    assert not (tmp_path / "flight").exists()


def test_list_names_missions_and_parts() -> None:
    listing = json.loads(colift("list", "--json").stdout)
    assert "paper-spiral" in listing["missions"]
    assert {"sqp", "ring", "lopsided"} <= set(listing["parts"]["allocation"])
    assert listing["vehicles"]["x500"]["max_thrust"] == 34.2
    assert "x500" in colift("list").stdout


def test_an_estimated_inertia_is_told_before_the_flight(tmp_path: Path) -> None:
    sets = [f"drones.{text}" for text in ("mass=1.7", "arm=0.24", "max_thrust=38")]
    told = [word for text in sets for word in ("--set", text)]
    judged = colift("feasibility", "hover", "--json", *told)
    (note,) = json.loads(judged.stdout)["notes"]
    assert note.startswith("drones.inertia: is estimated from mass and arm")
    flown = colift(
        "run",
        "hover",
        "--no-report",
        *told,
        "--set",
        "timing.duration=0.1",
        "--out",
        str(tmp_path / "out"),
    )
    assert f"note: {note}" in flown.stderr
    written = (tmp_path / "out" / "mission.toml").read_text()
    assert 'inertia_from = "estimate"' in written


def test_help_teaches() -> None:
    for command in ((), ("run",), ("reproduce",), ("list",), ("bench",)):
        done = colift(*command, "--help")
        assert done.returncode == 0
        assert "Usage" in done.stdout


def test_an_allocator_in_a_file_of_ones_own_flies(tmp_path: Path) -> None:
    (tmp_path / "halves.py").write_text(
        "from colift.control.allocation.base import AllocatorPart\n"
        "def share(now, sees, params, memory, writes):\n"
        "    writes.desired_tensions[:] = abs(sees.force[2]) / len(writes.desired_tensions)\n"
        "    writes.desired_directions[:] = (0.0, 0.0, -1.0)\n"
        "    return 0\n"
        "class Halves(AllocatorPart):\n"
        "    kernel = share\n"
    )
    done = colift(
        "run", "hover", "--with", "halves.py", "--set", "allocation.kind=halves", "--set",
        "timing.duration=0.1", "--no-report", "--json", folder=tmp_path,
    )  # fmt: skip
    assert done.returncode == 4, done.stderr  # it lets all cables hang side by side, and tells so
    assert json.loads(done.stdout)["compiled"] is False


def test_two_flights_of_one_second_do_not_share_a_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from colift.cli.base import new_folder

    monkeypatch.chdir(tmp_path)
    assert len({new_folder("hover") for _ in range(20)}) == 20


@pytest.mark.parametrize("arguments", [("run", *SHORT), ("bench", "--quick", "--sizes", "4")])
def test_a_result_that_cannot_be_written_is_one_message(
    tmp_path: Path, arguments: tuple[str, ...]
) -> None:
    (tmp_path / "file").touch()
    done = colift(*arguments, "--out", str(tmp_path / "file/x"))
    assert done.returncode == 1
    said = [line for line in done.stderr.splitlines() if not line.startswith("Compiling, once")]
    assert said[0].startswith("error:")
    assert "Traceback" not in done.stderr


def test_help_names_the_default_folder() -> None:
    assert "runs/MISSION-DATE-TIME" in colift("run", "--help").stdout


def test_the_version_and_a_summary_in_words(tmp_path: Path) -> None:
    assert colift("--version").stdout.startswith("colift 0.")
    done = colift("run", "hover", *SHORT, "--json", "--out", str(tmp_path))
    assert json.loads(done.stdout)["summary"].startswith("Pass: load within ")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("x = (", "SyntaxError"),
        ("import nowhere_at_all", "nowhere_at_all"),
        ("x = 1", "holds no class"),
        (
            "from colift.kernel.jit import kernel, void, f8\n"
            "from colift.control.allocation.base import AllocatorPart\n"
            "@kernel(void(f8))\ndef share(x):\n    pass\n"
            "class Wrong(AllocatorPart):\n    kernel = share\n",
            "signature",
        ),
    ],
)
def test_a_broken_part_of_ones_own_is_explained(tmp_path: Path, text: str, says: str) -> None:
    (tmp_path / "mine.py").write_text(text)
    done = colift(
        "run", "hover", "--with", "mine.py", "--set", "allocation.kind=mine", "--no-report",
        folder=tmp_path,
    )  # fmt: skip
    assert done.returncode == 1
    assert says in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
