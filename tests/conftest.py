"""What is compiled before the first test; what was skipped, and why, at the end of every run."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator

import pytest


def pytest_sessionstart(session: pytest.Session) -> None:
    """Before a whole run on several workers, compile everything on all cores: the workers would wait for each other."""
    config = session.config
    workers = config.getoption("numprocesses", None) or 0
    if workers < 2 or config.args_source is not pytest.Config.ArgsSource.TESTPATHS:
        return
    # What fails here fails in a test, with its reason.
    subprocess.run([sys.executable, "-m", "colift", "compile"], stdout=subprocess.DEVNULL)


@pytest.fixture(scope="module", autouse=True)
def _parts_of_the_module() -> Iterator[None]:
    """What the tests of a module register is gone for those of the next."""
    from colift import part

    before = dict(part._registered)
    yield
    part._registered.clear()
    part._registered.update(before)


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
