"""What each plant costs: ``python benchmarks/plants.py``.

Hovers in balance with the `ring` allocator, 4 and 16 drones, on each plant, and prints the time of the loop per
simulated second, best of three, with that of everything but the plant's step included. A plant in plain
Python makes the whole loop interpreted. Reports only.
"""

from __future__ import annotations

import numpy as np
from rich.console import Console
from rich.table import Table

import colift
from colift.part import find, names

FLIGHT = 2.0  # s


def cost(kind: str, n: int) -> float:
    """Loop time per simulated second, s."""
    settings = {"plant.kind": kind, "drones.count": n, "timing.duration": FLIGHT}
    settings["start.load_offset"] = [0.0, 0.0, 0.0]  # so that no cable goes slack
    runs = [colift.run("hover", allocator="ring", overrides=settings) for _ in range(3)]
    return min(run.loop_time for run in runs) / FLIGHT


def main() -> None:
    table = Table(title="Loop time per simulated second at steps of 1 ms", title_justify="left")
    for name in ("plant", "4 drones (ms)", "16 drones (ms)", "times real time (4 drones)"):
        table.add_column(name, justify="left" if name == "plant" else "right")
    for kind in names("plant"):
        if message := find("plant", kind).missing():
            table.add_row(kind, message)
            continue
        times = np.array([cost(kind, n) for n in (4, 16)])
        table.add_row(kind, *(f"{1e3 * t:.3g}" for t in times), f"{1.0 / times[0]:.3g}")
    Console().print(table)


if __name__ == "__main__":
    main()
