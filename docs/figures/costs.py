"""Write what plants and live pages cost (docs/theory/plant.md, docs/live.md): ``python docs/figures/costs.py [--fly]``.

From ``costs.json`` beside this file. With ``--fly`` ``benchmarks/plants.py`` and ``benchmarks/live.py`` measure first; on
a quiet machine.
"""

import asyncio
import sys

from pages import DOCS, fill, stored, table

sys.path.insert(0, str(DOCS.parent / "benchmarks"))


def measure():
    import plants

    import live
    from colift.part import find, names

    kinds = [kind for kind in names("plant") if not find("plant", kind).missing()]
    return {
        "plants": {kind: {n: plants.cost(kind, n) for n in (4, 16)} for kind in kinds},
        "live": {count: asyncio.run(live.measure(count, 20.0)) for count in live.PAGES},
    }


def main():
    found = stored(__file__, measure)
    rows = [
        [f"`{kind}`", *(f"{float(f'{1e3 * each[n]:.2g}'):g}" for n in ("4", "16"))]
        for kind, each in found["plants"].items()
    ]
    fill("theory/plant.md", "costs", table(["plant", "4 drones (ms)", "16 drones (ms)"], rows))
    rows = [
        [count, f"{100 * own:.1f}", f"{100 * whole:.1f}", f"{speed:.3f}", f"{1e3 * lag:.0f}"]
        for count, (own, whole, speed, lag) in found["live"].items()
    ]
    header = ["pages", "flying thread, % of a core", "whole process, % of a core", "speed"]
    fill("live.md", "pages", table([*header, "largest lag, ms"], rows))


if __name__ == "__main__":
    main()
