"""What is compiled before the first test; what was skipped, and why, at the end of every run."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter, defaultdict
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

LONGEST = (
    "control/allocation/safe", "flight/loop", "control/supervision/lift", "control/allocation/sqp",
    "world/sensing/noisy", "world/plant/_chain", "world/plant/slack_cables",
    "control/estimation/predictor", "world/plant/rigid_cables",
    "control/position_control/disturbance_observer", "control/position_control/formation",
)  # fmt: skip
"""Modules with the kernels that take three quarters of the time to compile, the longest first."""


def pytest_sessionstart(session: pytest.Session) -> None:
    """Before a whole run on several workers, compile these side by side: the workers would each compile all of them."""
    config = session.config
    workers = config.getoption("numprocesses", None) or 0
    if workers < 2 or config.args_source is not pytest.Config.ArgsSource.TESTPATHS:
        return
    from colift.kernel.jit import JIT_ENABLED, PACKAGE, cache_folder

    def compiled(module: str) -> bool:
        folder = (PACKAGE / module).parent
        return any(cache_folder(folder).glob(f"*/{Path(module).name}.*.nbi"))

    missing = [f"colift.{name.replace('/', '.')}" for name in LONGEST if not compiled(name)]
    if JIT_ENABLED and missing:
        with ThreadPoolExecutor(workers) as pool:
            commands = [[sys.executable, "-c", f"import {module}"] for module in missing]
            list(
                pool.map(subprocess.run, commands)
            )  # what fails here fails in a test, with its reason


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """A line for each reason, with the files whose tests it kept from running."""
    reasons: defaultdict[str, set[str]] = defaultdict(set)
    for report in terminalreporter.stats.get("skipped", []):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple | list) else "no reason"
        reasons[reason.removeprefix("Skipped: ")].add(report.nodeid)
    if not reasons:
        return
    terminalreporter.section("skipped, and why")
    for reason, tests in sorted(reasons.items(), key=lambda found: (-len(found[1]), found[0])):
        files = Counter(test.partition("::")[0].removeprefix("tests/") for test in sorted(tests))
        where = ", ".join(f"{file} ({count})" for file, count in files.items())
        terminalreporter.line(f"{len(tests):4d}  {' '.join(reason.split())}")
        terminalreporter.line(f"      {where}")
