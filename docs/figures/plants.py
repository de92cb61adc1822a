"""The same mission on every plant: ``python docs/figures/plants.py [MISSION [KEY=VALUE ...]]``.

Flies the mission (paper-spiral) on each plant and prints two Markdown tables: what the flight's metrics say, and how far
positions, directions and tensions are from those on rigid cables at the same times, at most and root mean square. Rows
before 0.1 s, in which cables that stretch settle, count for the first only.
"""

import sys

import numpy as np

import colift
from colift.mission.load import parse_override
from colift.part import find, names

SETTLED = 0.1  # s

mission = sys.argv[1] if len(sys.argv) > 1 else "paper-spiral"
overrides = dict(parse_override(text) for text in sys.argv[2:])
kinds = sorted(names("plant"), key=lambda kind: kind != "rigid-cables")
flown = {
    kind: colift.run(mission, overrides={**overrides, "plant.kind": kind})
    for kind in kinds
    if not find("plant", kind).missing()
}

print(
    "| plant | load off its path, rms / most (mm) | smallest angle (deg) | mean total tension (N) ",
    end="",
)
print("| peak tension (N) | slack (s) |\n|---|---|---|---|---|---|")
for kind, run in flown.items():
    m = run.metrics
    print(
        f"| `{kind}` | {1e3 * m['tracking_rms_m']:.4f} / {1e3 * m['tracking_max_m']:.4f} "
        f"| {m['min_angle_deg']:.3f} | {m['mean_total_tension_N']:.4f} | {m['peak_tension_N']:.4f} "
        f"| {m['slack_time_s']:.3f} |"
    )

print(
    "\n| against `rigid-cables` | load (mm) | directions (deg) | tensions (mN) |\n|---|---|---|---|"
)
rigid = flown.pop("rigid-cables").recording
for kind, run in flown.items():
    r = run.recording
    load = 1e3 * np.linalg.norm(r["load"][:, 0] - rigid["load"][:, 0], axis=1)
    cosine = np.linalg.norm(r["directions"] - rigid["directions"], axis=2) / 2.0
    angle = 2.0 * np.degrees(np.arcsin(np.minimum(cosine, 1.0)))
    tension = 1e3 * np.abs(r["tensions"] - rigid["tensions"])[r.time >= SETTLED]
    cells = (
        f"{np.nanmax(x):.2g} / {np.sqrt(np.nanmean(x**2)):.2g}" for x in (load, angle, tension)
    )
    print(f"| `{kind}` | {' | '.join(cells)} |")
