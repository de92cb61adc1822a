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
