"""The examples of the documentation run as printed, and run again from the compilation cache."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def test_every_example_flies_twice(tmp_path: Path) -> None:
    environment = os.environ | {"COLIFT_CACHE": str(tmp_path)}
    for _ in range(2):  # compiled, then loaded
        done = subprocess.run(
            [sys.executable, str(EXAMPLES / "fly_all.py")],
            capture_output=True,
            text=True,
            env=environment,
            timeout=300,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert "completed" in done.stdout


def test_an_allocator_of_ones_own_is_one_short_file() -> None:
    assert len((EXAMPLES / "my_plain_allocator.py").read_text().splitlines()) <= 40


def test_the_example_at_the_top_flies_from_the_command_line(tmp_path: Path) -> None:
    path = EXAMPLES.parents[1] / "examples" / "my_allocator.py"
    assert len(path.read_text().splitlines()) < 40
    charge = [1.0, 0.5, 1.0, 0.8]
    options = ["--set", "allocation.kind=my-allocator", "--set", f"allocation.charge={charge}"]
    command = [sys.executable, "-m", "colift", "run", "hover", "--with", str(path), *options]
    done = subprocess.run(
        [*command, "--set", "timing.duration=5.0", "--out", str(tmp_path), "--json"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    metrics = json.loads(done.stdout)["metrics"]
    assert metrics["tracking_rms_m"] < 0.01
    assert metrics["allocator_failures"] == 0
    assert metrics["tension_imbalance"] > 1.2  # the weak battery carries less
