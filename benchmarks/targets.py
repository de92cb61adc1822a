"""Measure what colift promises about speed, and say which promises hold on this machine.

    python benchmarks/targets.py

Runs `colift bench`, then whole processes: a first flight with an empty compilation cache and later
ones. Reports only; nothing fails when a machine is slow. The folder is apart from the tests because
wall time is no test.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from rich.console import Console
from rich.table import Table

from colift import benchmark


def whole_process(arguments: list[str], cache: str | None = None) -> float:
    """Wall time of `colift ARGUMENTS` from start to finish, s."""
    environment = os.environ | ({"COLIFT_CACHE": cache} if cache else {})
    begin = time.perf_counter()
    subprocess.run(
        [sys.executable, "-m", "colift", *arguments],
        check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=environment,
    )  # fmt: skip
    return time.perf_counter() - begin


def main() -> None:
    console = Console()
    result = benchmark.run([4, 64, 1024])
    benchmark.show(result, console)
    rows = {row["n"]: row for row in result["allocator"]}
    with tempfile.TemporaryDirectory() as folder:
        flight = ["run", "--out", str(Path(folder) / "flight")]
        first = whole_process(flight, cache=str(Path(folder) / "cache"))
        whole_process(flight)
        later = statistics.median(whole_process(flight) for _ in range(5))
    slsqp = {n: rows[n].get("slsqp_ratio", float("nan")) for n in (4, 64)}
    targets = (
        ("allocation in the loop, n = 4, median", "us", rows[4]["loop"]["median_us"], 1.5, "<="),
        (
            "allocation in the loop, n = 4, 99th percentile",
            "us",
            rows[4]["loop"]["p99_us"],
            3.0,
            "<=",
        ),
        ("allocation in the loop, n = 64, median", "us", rows[64]["loop"]["median_us"], 15.0, "<="),
        (
            "allocation in the loop, n = 1024, median",
            "us",
            rows[1024]["loop"]["median_us"],
            350.0,
            "<=",
        ),
        ("allocate() from Python, n = 4, median", "us", rows[4]["python"]["median_us"], 10.0, "<="),
        ("faster than SLSQP, n = 4", "x", slsqp[4], 300.0, ">="),
        ("faster than SLSQP, n = 64", "x", slsqp[64], 1000.0, ">="),
        ("20 s mission, in the loop, median", "s", result["closed_loop"]["median_s"], 0.2, "<="),
        ("colift run, whole process, median of 5", "s", later, 3.0, "<="),
        ("colift run, first time, with compilation", "s", first, 40.0, "<="),
    )
    table = Table(title="Promises", title_justify="left")
    for name in ("what", "measured", "promised", "holds"):
        table.add_column(name, justify="left" if name == "what" else "right")
    for what, unit, value, bound, sense in targets:
        holds = value <= bound if sense == "<=" else value >= bound
        table.add_row(
            what, f"{value:.4g} {unit}", f"{sense} {bound:g} {unit}", "yes" if holds else "no"
        )
    console.print(table)


if __name__ == "__main__":
    main()
