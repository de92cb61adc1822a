"""The examples of the documentation run as printed, and run again from the compilation cache."""

from __future__ import annotations

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
