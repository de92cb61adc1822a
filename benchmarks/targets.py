"""Measure what colift promises about speed, and say which promises hold on this machine.

    python benchmarks/targets.py

Runs `colift bench`, then whole processes: a first flight with an empty compilation cache and later
ones. Reports only; nothing fails when a machine is slow. The folder is apart from the tests because
wall time is no test.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from rich.table import Table

from colift.cli.base import out
from colift.study.bench.problems import FAMILIES, NAMES
from colift.study.bench.tables import own, ratio


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
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bench.json"
        bench = ["bench", "--sizes", "4,16,64,1024", "--out", str(file)]
        subprocess.run([sys.executable, "-m", "colift", *bench], check=True)
        result = json.loads(file.read_text())
    rows = {
        (problem, family): [
            row for row in result["results"] if (row["problem"], row["family"]) == (problem, family)
        ]
        for problem in NAMES
        for family in FAMILIES
    }
    smooth = rows["paper", "smooth"]
    with tempfile.TemporaryDirectory() as folder:
        flight = ["run", "--out", str(Path(folder) / "flight")]
        first = whole_process(flight, cache=str(Path(folder) / "cache"))
        whole_process(flight)
        later = statistics.median(whole_process(flight) for _ in range(5))
    mission = result["closed_loop"]["median_s"]
    targets = (
        *(
            (f"paper's problem in the loop, n = {n}, {what}", "us", own(smooth, n, "loop")[key], most, "<=")
            for n, what, key, most in (
                (4, "median", "median_us", 0.8),
                (4, "99th percentile", "p99_us", 1.5),
                (64, "median", "median_us", 7.0),
                (1024, "median", "median_us", 146.0),
            )
        ),
        ("the same from Python, n = 4, median", "us", own(smooth, 4, "python")["median_us"], 4.0, "<="),
        ("the same, faster than SLSQP, n = 4", "x", ratio(smooth, 4), 1000.0, ">="),
        ("the same, faster than SLSQP, n = 64", "x", ratio(smooth, 64), 1000.0, ">="),
        *(
            (
                f"safe problem in the loop, n = {n}, {family} force, median", "us",
                own(rows["safe", family], n, "loop")["median_us"], most, "<=",
            )
            for n, family, most in (
                (4, "smooth", 1.8), (4, "noisy", 2.6), (16, "smooth", 10.0), (16, "noisy", 18.0)
            )
        ),
        ("20 s mission, in the loop, median", "s", mission, 0.05, "<="),
        ("colift run, whole process, median of 5", "s", later, 1.2, "<="),
        ("colift run, first time, with compilation", "s", first, 12.0, "<="),
    )  # fmt: skip
    table = Table(title="Promises", title_justify="left")
    for name in ("what", "measured", "promised", "holds"):
        table.add_column(name, justify="left" if name == "what" else "right")
    for what, unit, value, bound, sense in targets:
        holds = value <= bound if sense == "<=" else value >= bound
        table.add_row(
            what, f"{value:.4g} {unit}", f"{sense} {bound:g} {unit}", "yes" if holds else "no"
        )
    out.print(table)


if __name__ == "__main__":
    main()
