#!/usr/bin/env python3
"""Set colift up in a virtual environment of its own, then fly, test or run a command.

    python3 bootstrap.py run  [ARGUMENT ...]     set up, then: colift run ARGUMENT ...
    python3 bootstrap.py test [ARGUMENT ...]     set up with the test tools, then: pytest ARGUMENT ..., on all cores
    python3 bootstrap.py check                   set up with all tools: lint, types, docs, benchmark
    python3 bootstrap.py COMMAND [ARGUMENT ...]  set up, then: colift COMMAND ARGUMENT ...

Needs only Python 3.11 to 3.13. Everything goes into ./.venv, from lock files with hashes; the
system's Python is left alone. A second call installs nothing unless a lock file has changed.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import venv
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

ROOT = Path(__file__).resolve().parent
ENVIRONMENT = ROOT / ".venv"
BIN = ENVIRONMENT / ("Scripts" if os.name == "nt" else "bin")
SUPPORTED = ((3, 11), (3, 13))
CHECKS = (
    (
        ("ruff", "check", "."),
        ("ruff", "format", "--check", "."),
        ("mypy",),
        ("lint-imports",),
    ),
    (
        ("colift", "compile"),
        ("sphinx-build", "-W", "--keep-going", "-q", "-b", "html", "docs", "docs/_build/html"),
        ("colift", "bench", "--quick"),
    ),
)
"""What is checked, in rows that go on side by side."""


def set_up(lock: str) -> None:
    """Make the environment hold exactly what the lock file names, and this project (editable)."""
    first, last = SUPPORTED
    if not first <= sys.version_info[:2] <= last:
        wanted = f"{first[0]}.{first[1]} to {last[0]}.{last[1]}"
        sys.exit(f"colift needs Python {wanted}; this is {sys.version.split()[0]}")
    requirements = ROOT / lock
    project = (ROOT / "pyproject.toml").read_bytes()
    key = hashlib.sha256(requirements.read_bytes() + project + str(ROOT).encode()).hexdigest()
    stamp = ENVIRONMENT / f"{lock}.installed"
    if stamp.is_file() and stamp.read_text() == key:
        return
    print(f"Setting up {ENVIRONMENT} from {lock} (once; a few minutes at most)", file=sys.stderr)
    if not (BIN / "python").exists() and not (BIN / "python.exe").exists():
        venv.create(ENVIRONMENT, with_pip=True)
    elif not any(BIN.glob("pip*")):  # interrupted while it was made, or made by a tool without pip
        execute([str(BIN / "python"), "-m", "ensurepip", "--default-pip"])
    pip = [str(BIN / "python"), "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    execute([*pip, "--require-hashes", "--requirement", str(requirements)])
    execute([*pip, "--no-deps", "--editable", str(ROOT)])
    stamp.write_text(key)


def execute(command: list[str]) -> None:
    """Run a command; end with its exit code if it fails."""
    code = subprocess.call(
        command, cwd=ROOT, stdout=sys.stderr if {"pip", "ensurepip"} & {*command} else None
    )
    if code:
        sys.exit(code)


def check(row: Sequence[Sequence[str]]) -> list[str]:
    """Run commands one after the other, print what each says when it ends, and return those that failed."""
    failed = []
    for name, *options in row:
        done = subprocess.run(
            [BIN / name, *options], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.STDOUT
        )
        command = f"{name} {' '.join(options)}".strip()
        print(f"== {command}\n{done.stdout.decode(errors='replace')}", end="", flush=True)
        if done.returncode:
            failed.append(command)
    return failed


def main() -> None:
    """Do what the first argument says."""
    arguments = sys.argv[1:] or ["run"]
    if arguments[0] in {"-h", "--help"}:
        print(__doc__)
        return
    task, rest = arguments[0], arguments[1:]
    set_up("requirements-dev.lock" if task in {"test", "check"} else "requirements.lock")
    if task == "test":
        chosen = any(each.startswith(("-n", "--numprocesses")) for each in rest)
        workers = [] if chosen else ["-n", "auto", "--dist", "worksteal"]
        execute([str(BIN / "python"), "-m", "pytest", *workers, *rest])
    elif task == "check":
        with ThreadPoolExecutor() as pool:
            if failed := [found for row in pool.map(check, CHECKS) for found in row]:
                sys.exit(f"failed: {', '.join(failed)}")
    else:
        execute([str(BIN / "colift"), task, *rest])


if __name__ == "__main__":
    try:
        main()
    except KeyboardInterrupt:
        sys.exit(130)
