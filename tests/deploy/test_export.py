"""`colift export c`: the folder builds by itself, and its test agrees with Python in every bit."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.skipif(
    shutil.which("gcc") is None or shutil.which("make") is None, reason="needs gcc and make"
)


def _export(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "colift", "export", "c", *arguments, "--out", str(folder)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("mission", "kernels"),
    [
        (["noisy-spiral", "--set", "allocation.kind=safe"], 9),
        (["real-world-adaptive"], 9),
        (["pick-up-and-place"], 9),
        (["agile-box"], 9),
        (["--part", "allocation"], 1),
    ],
)
def test_the_folder_builds_and_computes_what_python_computes(mission, kernels, tmp_path):
    made = _export(tmp_path, *mission)
    assert made.returncode == 0, made.stderr
    built = subprocess.run(
        ["make", "-C", str(tmp_path), "CFLAGS=-O2 -Werror", "all", "check"],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stdout + built.stderr
    assert built.stdout.count("20 of 20 calls as in Python") == kernels
    shown = subprocess.run([str(tmp_path / "example")], capture_output=True, text=True, check=True)
    assert shown.stdout.count("status 0") == 5 or "agile-box" in mission
    whole = kernels == 9 and "agile-box" not in mission  # a load that is a point, and all layers
    assert ("50 of 50 calls as in Python" in built.stdout) == whole
    assert (tmp_path / "colift_cascade.c").exists() == whole
    if whole:
        shown = subprocess.run([str(tmp_path / "example_cascade")], capture_output=True, text=True, check=True)  # fmt: skip
        assert "nan" not in shown.stdout
        assert shown.stdout.count("thrust") >= 2


def test_single_precision_holds_the_load_with_the_same_thrusts(tmp_path):
    thrusts = []
    for precision in ((), ("--float32",)):
        folder = tmp_path / "-".join(["out", *precision])
        # The paper's optimum is a family, along which each precision goes its own way; the safe one's is not.
        made = _export(folder, "paper-spiral", "--set", "allocation.kind=safe", *precision)
        assert made.returncode == 0, made.stderr
        command = ["make", "-C", str(folder), "CFLAGS=-O2 -Werror", "all"]
        subprocess.run(command, capture_output=True, check=True)
        shown = subprocess.run([str(folder / "example_cascade")], capture_output=True, text=True, check=True)  # fmt: skip
        thrusts.append([float(line.split("thrust ")[1].split()[0]) for line in shown.stdout.splitlines()])  # fmt: skip
    assert thrusts[1] == pytest.approx(thrusts[0], rel=1e-3)


def test_an_export_replaces_another_one(tmp_path):
    safe = ["noisy-spiral", "--set", "allocation.kind=safe", "--part"]
    for wanted in (("--part", "allocation,attitude_control"), (*safe, "allocation", "--float32")):
        made = _export(tmp_path, *wanted)
        assert made.returncode == 0, made.stderr
        command = ["make", "-C", str(tmp_path), "CFLAGS=-O2 -Werror", "all", "check"]
        built = subprocess.run(command, capture_output=True, text=True, check=False)
        assert built.returncode == 0, built.stdout + built.stderr


def test_a_part_in_plain_python_is_refused_and_nothing_is_written(tmp_path):
    made = _export(tmp_path / "out", "--set", "allocation.kind=slsqp", "--part", "allocation")
    assert made.returncode != 0
    assert "allocation.kind: slsqp is plain Python" in made.stderr
    assert not (tmp_path / "out").exists()


def test_a_folder_that_holds_something_else_is_refused(tmp_path):
    (tmp_path / "thesis.tex").touch()
    made = _export(tmp_path, "--part", "allocation")
    assert made.returncode != 0
    assert "is not empty" in made.stderr
