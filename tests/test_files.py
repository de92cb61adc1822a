"""Disks that are full, folders that are taken, files that are not there: one clear line each, and nothing half-written."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from terminal import colift

SHORT = ("--set", "timing.duration=2")


NO_ROOM = 40_000
"""Writing more bytes than these into a file fails, as on a full disk."""


def one_line(done: subprocess.CompletedProcess[str]) -> str:
    """The one line that a command has said before it ended with an error."""
    assert done.returncode == 1, done.stderr
    (line,) = done.stderr.splitlines()
    assert line.startswith("error: ")
    return line


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> None:
    """Every kernel of the flights below is in the cache, so that they need no room for it."""
    out = tmp_path_factory.mktemp("compiled")
    assert colift("run", "hover", *SHORT, "--out", str(out), "--no-report").returncode == 0


@pytest.mark.usefixtures("compiled")
def test_without_room_the_flight_is_told_all_the_same(tmp_path: Path) -> None:
    out = tmp_path / "out"
    done = colift("run", "hover", *SHORT, "--out", str(out), largest_file=NO_ROOM)
    assert one_line(done) == f"error: {out}/recording.h5: File too large"
    assert "tracking_max_m" in done.stdout
    assert "Pass" in done.stdout
    assert list(out.iterdir()) == []
    done = colift("run", "hover", *SHORT, "--out", str(out), "--json", largest_file=NO_ROOM)
    assert one_line(done).endswith("recording.h5: File too large")
    told = json.loads(done.stdout)
    assert told["verdict"]["level"] == "pass"
    assert told["files"] == {}
    assert "File too large" in told["error"]


def test_without_room_for_the_cache_kernels_are_compiled_for_once(tmp_path: Path) -> None:
    (tmp_path / "made.py").write_text(
        "import resource\n"
        "from colift.kernel.jit import f8, kernel\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n\n"
        "@kernel(f8(f8))\n"
        "def twice(x):\n"
        "    return 2.0 * x\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", "import made; print(made.twice(3.0), made.twice.nopython_signatures)"],
        cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout == "6.0 [(float64,) -> float64]\n"


def test_an_earlier_run_survives_a_later_one_without_room(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert colift("run", "hover", *SHORT, "--out", str(out), "--no-report").returncode == 0
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    assert set(before) == {"recording.h5", "metrics.json", "mission.toml"}
    assert colift("run", "hover", *SHORT, "--out", str(out), largest_file=NO_ROOM).returncode == 1
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_standard_output_without_room(tmp_path: Path) -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("no /dev/full")
    with full.open("w") as target:
        done = colift("run", "hover", *SHORT, "--out", str(tmp_path / "out"), "--no-report", stdout=target.fileno())  # fmt: skip
    assert "No space left on device" in one_line(done)


@pytest.mark.slow
def test_a_folder_with_something_else_is_not_written_into(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").write_text("chapter one")
    few = ("--seeds", "1", "--set", "timing.duration=0.1")
    for command in (
        ("run", "hover"), ("judge", "x.h5"), ("reproduce",), ("sweep", "hover", "--over", "allocation.mu=0.1,0.2", *few),
    ):  # fmt: skip
        line = one_line(colift(*command, "--out", str(tmp_path)))
        assert f"--out {tmp_path}: is not empty and holds no results of this command" in line
    line = one_line(colift("run", "hover", "--out", str(tmp_path / "thesis.tex")))
    assert "is a file, not a folder" in line
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.slow
def test_what_an_earlier_run_left_is_replaced_as_a_whole(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert colift("run", "hover", *SHORT, "--out", str(out)).returncode == 0
    assert {"report.html", "replay.html"} <= {path.name for path in out.iterdir()}
    done = colift("run", "hover", *SHORT, "--seed", "5", "--out", str(out), "--no-report")
    assert done.returncode == 0, done.stderr
    left = {path.name for path in out.iterdir()}
    assert not {"report.html", "replay.html"} & left  # they were of the flight before
    done = colift("report", str(out), "--json")
    assert done.returncode == 0, done.stderr
    assert Path(json.loads(done.stdout)["report"]) == out / "report.html"


@pytest.mark.parametrize("command", ["report", "replay", "judge", "render", "import"])
def test_a_file_that_is_not_there(command: str, tmp_path: Path) -> None:
    options = {"render": ("--png", str(tmp_path / "x.png"))}.get(command, ())
    line = one_line(colift(command, str(tmp_path / "nowhere.h5"), *options))
    assert "nowhere.h5" in line
    assert "no such file" in line.lower()


@pytest.mark.parametrize("command", ["report", "replay"])
def test_a_folder_that_is_no_run(command: str, tmp_path: Path) -> None:
    line = one_line(colift(command, str(tmp_path)))
    assert line == f"error: {tmp_path}/recording.h5: there is no such file"


def test_render_without_its_extra(tmp_path: Path) -> None:
    (tmp_path / "playwright.py").write_text("raise ImportError('blocked')")
    kept = Path(__file__).parent / "data" / "format-1.h5"
    script = "import sys; sys.path.insert(0, sys.argv.pop(1)); from colift.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path), "render", str(kept), "--png", str(tmp_path / "x.png")],
        capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert "need the package playwright" in one_line(done)
    assert not (tmp_path / "x.png").exists()
