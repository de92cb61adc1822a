"""Instructions of one compiled call, counted by valgrind: the same on a busy machine as on a quiet one.

A second Python under ``valgrind --tool=callgrind`` calls the allocators in a compiled loop that switches the
counting on and off by itself (valgrind's client requests), so neither the start of Python nor the warm-up counts.
valgrind knows no AVX-512: the kernels are compiled for :data:`TARGET`, whose code may differ from the
machine's own. Once without valgrind, so that compiled code is found in the cache.
"""

from __future__ import annotations

import os
import platform
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from colift.errors import ColiftError
from colift.study.bench.problems import FAMILIES, NAMES, Family, Name

TARGET = {"NUMBA_CPU_NAME": "x86-64-v3", "NUMBA_CPU_FEATURES": ""}
CALLS, WARM_UP = 200, 200
LARGEST = 64
"""Most cables for which instructions are counted: a call takes some fifty times longer meanwhile."""


Case = tuple[Name, Family, int]


def cases(sizes: Sequence[int]) -> list[Case]:
    """Problem, family of forces and number of cables of every count, in their order."""
    return [(name, family, n) for name in NAMES for family in FAMILIES for n in sizes]


def reason_against() -> str:
    """Why no instructions can be counted here; empty where they can."""
    if platform.machine() not in ("x86_64", "AMD64"):
        return f"needs a 64-bit x86 processor; this is {platform.machine()}"
    if shutil.which("valgrind") is None:
        return "needs valgrind, which is not installed (Debian: apt install valgrind)"
    return ""


def count(sizes: Sequence[int]) -> dict[str, Any]:
    """Mean instructions of a call of our allocators, or why they cannot be counted."""
    if reason := reason_against():
        return {"reason": reason}
    task = f"from colift.study.bench._under_valgrind import work; work({list(sizes)!r})"
    plain = [sys.executable, "-c", task]
    environment = os.environ | TARGET
    with tempfile.TemporaryDirectory() as folder:
        dump = Path(folder) / "dump"
        watched = [
            "valgrind", "--tool=callgrind", "--instr-atstart=no", f"--callgrind-out-file={dump}", *plain
        ]  # fmt: skip
        for command in (plain, watched):
            done = subprocess.run(command, env=environment, capture_output=True, text=True)
            if done.returncode:
                last = (done.stderr.strip().splitlines() or ["no message"])[-1]
                return {"reason": f"{command[0]} ended with {done.returncode}: {last}"}
        counts = [_total(Path(f"{dump}.{k + 1}")) for k in range(len(cases(sizes)))]
    return {
        "target": TARGET["NUMBA_CPU_NAME"],
        "tool": subprocess.run(
            ["valgrind", "--version"], capture_output=True, text=True, check=True
        ).stdout.strip(),
        "calls": CALLS,
        "rows": [
            {"problem": name, "family": family, "n": n, "instructions": total / CALLS}
            for (name, family, n), total in zip(cases(sizes), counts, strict=True)
        ],
    }


def _total(dump: Path) -> int:
    """Instructions in one dump of callgrind."""
    found = re.search(r"^(?:totals|summary): (\d+)", dump.read_text(), re.MULTILINE)
    if found is None:
        raise ColiftError(f"valgrind wrote no count into {dump.name}")
    return int(found[1])
