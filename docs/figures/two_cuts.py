"""Two cables of five that break, beside a published benchmark: ``python docs/figures/two_cuts.py [--fly]``.

Writes the table of ``docs/tasks.md`` from ``two_cuts.json`` beside this file. With ``--fly`` the mission is flown first, with seeds that nothing was tuned on.
"""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
from pages import fill, stored, table

MISSION = "five-drones-two-cuts"
SEEDS = range(3_000_000, 3_000_240)
WAYS = {
    "as shipped: noise, radio, motors": {},
    "exact sensors, no radio, ideal rotors, as there": {
        "sensing.kind": "ideal", "link.kind": "ideal", "actuation.kind": "ideal",
    },
}  # fmt: skip
THERE = (
    ("Tether_Grace V4, one seed", 0.328, 95.2, 104.6),
    ("Tether_Grace V6, one seed", 0.326, 76.1, 107.6),
)
"""RMS of the distance from the reference (m), deepest sag (mm) and largest tension (N), of its table of results."""
FROM, CUT = 8.0, 12.0
"""When the numbers there begin, and the first cut, s."""


def measured(task):
    """Level of the verdict and the three numbers of one seed's flight."""
    from colift import run
    from colift.mission.load import load_mission
    from colift.study.campaign.plan import varied

    changes, seed = task
    flown = run(varied(load_mission(MISSION, changes), seed))
    recording = flown.recording
    late, cut = recording.time >= FROM, recording.time >= CUT
    off = recording["load"][:, 0] - recording["reference"][:, 0]
    rms = float(np.sqrt((off[late] ** 2).sum(axis=1).mean())) if late.any() else None
    sag = float(-1e3 * off[cut, 2].min()) if cut.any() else None
    peak = float(np.nanmax(recording["peak_tensions"][late, :-1])) if late.any() else None
    return flown.verdict.level, rms, sag, peak


def fly():
    with ProcessPoolExecutor(mp_context=get_context("spawn")) as pool:
        return {
            name: list(pool.map(measured, [(changes, seed) for seed in SEEDS]))
            for name, changes in WAYS.items()
        }


def main():
    from colift.kernel.math.shares import interval, mean_interval, percent

    rows = [
        [f"{name}", "-", f"{rms:.3f}", f"{sag:.0f}", f"{peak:.0f}", "-"]
        for name, rms, sag, peak in THERE
    ]
    least = [min(row[k] for row in THERE) for k in (1, 2, 3)]
    for name, found in stored(__file__, fly).items():
        held = [row for row in found if row[0] in ("pass", "warn")]
        better = sum(all(map(float.__lt__, row[1:], least)) for row in held)
        cells = []
        for k, digits in ((1, 3), (2, 0), (3, 0)):
            values = [row[k] for row in held]
            low, high = mean_interval([values])
            cells.append(
                f"{np.mean(values):.{digits}f} ({low:.{digits}f}-{high:.{digits}f}), most {max(values):.{digits}f}"
            )
        share = f"{better} of {len(found)} ({percent(*interval(better, len(found)), 1)})"
        rows.append([name, f"{len(held)} of {len(found)}", *cells, share])
    head = [
        "",
        "held",
        "RMS (m)",
        "sag (mm)",
        "peak tension (N)",
        "better in all three than either",
    ]
    fill("tasks.md", "cuts", table(head, rows))


if __name__ == "__main__":
    main()
