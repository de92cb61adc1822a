"""Measure what worker processes gain: the same campaign with one worker and with several, in turn.

    python benchmarks/campaign.py [--flights 16] [--seconds 120] [--workers 2] [--repeat 3]

Each flight is the paper's mission for that many simulated seconds, about one second of work for every 100 of
them. The time is that of the whole campaign: planning, starting workers, loading kernels, flying, writing.
Efficiency is the time with one worker over the time with N, over N. Nothing fails when a machine is slow;
run it where nothing else runs.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
from pathlib import Path

from colift.study.campaign import engine
from colift.study.campaign.plan import Case, plan
from colift.study.campaign.workers import cores


def campaign(cases: list[Case], workers: int) -> tuple[float, list[float]]:
    """Wall time of a fresh campaign and of each of its flights, s."""
    with tempfile.TemporaryDirectory() as folder:
        outcome = engine.run(
            plan(cases), engine.Options(Path(folder) / "c.sqlite", workers=workers)
        )
    assert all(row["status"] == "flown" for row in outcome.rows)
    return outcome.wall_time, [row["wall_time_s"] for row in outcome.rows]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=16)
    parser.add_argument("--seconds", type=float, default=120.0, help="simulated, of each flight")
    parser.add_argument("--workers", type=int, default=cores())
    parser.add_argument("--repeat", type=int, default=3)
    given = parser.parse_args()
    timing = {"timing.duration": given.seconds, "timing.recording": 0.01}
    cases = [
        Case({"seed": seed}, "paper-spiral", {"seed": seed, **timing})
        for seed in range(given.flights)
    ]
    campaign(cases[:1], 1)  # compiles, where nothing is in the cache yet
    alone, together, flights = [], [], []
    for turn in range(given.repeat):
        wall, each = campaign(cases, 1)
        alone.append(wall)
        flights += each
        together.append(campaign(cases, given.workers)[0])
        gain = alone[-1] / (given.workers * together[-1])
        print(
            f"{turn + 1}: {given.flights} flights, 1 worker {alone[-1]:.2f} s, {given.workers} workers "
            f"{together[-1]:.2f} s, efficiency {gain:.2f}",
            flush=True,
        )
    best = min(alone), min(together)
    print(
        f"a flight of {given.seconds:g} s takes {statistics.median(flights):.2f} s; "
        f"{given.flights / best[0]:.2f} flights per second with one worker, "
        f"{given.flights / best[1] / given.workers:.2f} for each of {given.workers}; "
        f"efficiency of the best times {best[0] / (given.workers * best[1]):.2f}"
    )


if __name__ == "__main__":
    main()
