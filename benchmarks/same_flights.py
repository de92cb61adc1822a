"""Fly every shipped mission with two source trees, compare all metrics bit for bit, and time the loops.

    git worktree add /tmp/before COMMIT
    python benchmarks/same_flights.py /tmp/before/src src

Metrics that are times of this machine are left out, and those that one of the trees does not have. The loop's time is the shortest of several flights, in turns of the two
trees, on whatever else the machine does. Exits with 1 when a metric differs.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

WORKER = """
import json, sys
import colift
from colift.mission import mission_names
sys.stdout.write(json.dumps(sorted(mission_names())) + "\\n"); sys.stdout.flush()
for line in sys.stdin:
    run = colift.run(line.strip())
    found = {name: float(value).hex() for name, value in run.metrics.items() if not name.endswith("_us")}
    sys.stdout.write(json.dumps([run.loop_time, found]) + "\\n"); sys.stdout.flush()
"""


class Tree:
    """A process that flies missions with one source tree."""

    def __init__(self, source: Path) -> None:
        self.source = source.resolve()
        self.process = subprocess.Popen(
            [sys.executable, "-c", WORKER], text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": str(self.source)}, cwd=self.source.anchor,
        )  # fmt: skip
        self.missions: list[str] = self._answer()

    def _answer(self) -> Any:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise SystemExit(f"{self.source}: its process ended")
        return json.loads(line)

    def fly(self, mission: str) -> tuple[float, dict[str, str]]:
        """Time in the loop, s, and the metrics as exact text."""
        assert self.process.stdin is not None
        self.process.stdin.write(mission + "\n")
        self.process.stdin.flush()
        time, metrics = self._answer()
        return time, metrics


def main() -> int:
    """Compare, print a row a mission."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("before", type=Path)
    parser.add_argument("after", type=Path)
    parser.add_argument("--flights", type=int, default=5, help="of each mission and tree")
    chosen = parser.parse_args()
    before, after = Tree(chosen.before), Tree(chosen.after)
    ratios, different = [], 0
    for mission in before.missions:
        times: tuple[list[float], list[float]] = ([], [])
        for _ in range(chosen.flights):
            (t, a), (u, b) = before.fly(mission), after.fly(mission)
            times[0].append(t)
            times[1].append(u)
        changed = sorted(name for name in {*a} & {*b} if a[name] != b[name])
        ratios.append(min(times[1]) / min(times[0]))
        different += bool(changed)
        said = "the same" if not changed else "different: " + ", ".join(changed)
        print(f"{mission:20} {1e3 * min(times[0]):8.1f} ms {ratios[-1]:6.3f} x  {said}", flush=True)
    mean = math.exp(sum(map(math.log, ratios)) / len(ratios))
    print(
        f"{len(ratios) - different} of {len(ratios)} missions the same; loop {mean:.3f} x (geometric mean)"
    )
    return 1 if different else 0


if __name__ == "__main__":
    sys.exit(main())
