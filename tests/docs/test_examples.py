"""The examples of the documentation run as printed, and run again from the compilation cache."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import colift
import terminal

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


@pytest.mark.slow
def test_every_example_flies_twice(tmp_path: Path) -> None:
    """Of files that nothing was compiled of; colift's own kernels may be there already."""
    folder = shutil.copytree(EXAMPLES, tmp_path / "examples")
    for compiled in (True, False):  # then loaded
        done = subprocess.run(
            [sys.executable, "-c", TELLING, str(folder / "fly_all.py")],
            capture_output=True, text=True, timeout=300, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        assert "completed" in done.stdout
        assert ("equal_share compiled" in done.stdout) is compiled, done.stdout


TELLING = """
import runpy, sys
from colift.kernel.jit import told_of_compilation
with told_of_compilation(lambda name: name.startswith("colift_user") and print(name.rpartition(".")[2], "compiled")):
    runpy.run_path(sys.argv[1], run_name="__main__")
"""


def test_an_allocator_of_ones_own_is_one_short_file() -> None:
    assert len((EXAMPLES / "my_plain_allocator.py").read_text().splitlines()) <= 40


def test_the_example_at_the_top_flies_from_the_command_line(tmp_path: Path) -> None:
    path = EXAMPLES.parents[1] / "examples" / "my_allocator.py"
    assert len(path.read_text().splitlines()) < 40
    charge = [1.0, 0.5, 1.0, 0.8]
    options = ["--set", "allocation.kind=my-allocator", "--set", f"allocation.charge={charge}"]
    options += ["--set", "timing.duration=5.0", "--out", str(tmp_path), "--json"]
    done = terminal.colift("run", "hover", "--with", str(path), *options)
    assert done.returncode == 0, done.stderr
    metrics = json.loads(done.stdout)["metrics"]
    assert metrics["tracking_rms_m"] < 0.01
    assert metrics["allocator_failures"] == 0
    assert metrics["tension_imbalance"] > 1.2  # the weak battery carries less


def test_a_signal_of_ones_own_is_one_file_and_one_line(tmp_path: Path) -> None:
    page = (EXAMPLES.parent / "extend.md").read_text(encoding="utf-8")
    (line,) = re.findall(r"^```{code-block} python\n( *Signal\(.*\n)```$", page, re.MULTILINE)
    (command,) = re.findall(r"^colift (run .*my_signal_part\.py.*)$", page, re.MULTILINE)
    source = tmp_path / "src"
    shutil.copytree(
        Path(colift.__file__).parent,
        source / "colift",
        ignore=shutil.ignore_patterns("__pycache__"),
    )
    table = source / "colift" / "kernel" / "signals.py"
    before, end, after = table.read_text(encoding="utf-8").partition(")  # fmt: skip\n")
    assert "SIGNALS = (" in before
    table.write_text(before + line + end + after, encoding="utf-8")
    done = subprocess.run(
        [
            *(sys.executable, "-m", "colift", *command.split()),
            *("--set", "timing.duration=5.0", "--out", str(tmp_path / "out")),
            *("--set", "allocation.kind=ring"),  # which takes a tenth of the time to compile
        ],
        capture_output=True,
        text=True,
        cwd=EXAMPLES,
        env=os.environ | {"COLIFT_CACHE": str(tmp_path / "cache"), "PYTHONPATH": str(source)},
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    # Read by a colift that does not know the signal: the file says what it is.
    (path,) = (tmp_path / "out").rglob("*.h5")
    recording = colift.Recording.load(path)
    weighed = recording["weighed_mass"]
    assert weighed.shape == (len(recording.time), 1)
    assert recording.signal("weighed_mass").unit == "kg"
    assert abs(weighed[-1, 0] - 1.2 * recording.mission.team.load_mass) < 0.003
