"""What was skipped, and why, at the end of every run."""

from __future__ import annotations

from collections import Counter, defaultdict

import pytest


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
