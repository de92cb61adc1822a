"""Write the tables of docs/theory/plant.md on the same mission on every plant: ``python docs/figures/plants.py [--fly]``.

From ``plants.json`` beside this file. With ``--fly`` the paper's spiral is flown first on each plant: what the flight's
metrics say, and how far positions, directions and tensions are from those on rigid cables at the same times, at most
and root mean square. Rows before 0.1 s, in which cables that stretch settle, count for positions and directions only.
"""

import numpy as np
from pages import fill, stored, table

import colift
from colift.part import find, names

SETTLED = 0.1  # s
METRICS = (
    "tracking_rms_m", "tracking_max_m", "min_angle_deg", "mean_total_tension_N", "peak_tension_N",
    "slack_time_s",
)  # fmt: skip


def fly():
    kinds = sorted(names("plant"), key=lambda kind: kind != "rigid-cables")
    rigid, found = None, {}
    for kind in kinds:
        if find("plant", kind).missing():
            continue
        flown = colift.run("paper-spiral", overrides={"plant.kind": kind})
        r = flown.recording
        found[kind] = {metric: flown.metrics[metric] for metric in METRICS}
        if rigid is None:
            rigid = r
            continue
        load = np.linalg.norm(r["load"][:, 0] - rigid["load"][:, 0], axis=1)
        chord = np.linalg.norm(r["directions"] - rigid["directions"], axis=2) / 2.0
        angle = 2.0 * np.degrees(np.arcsin(np.minimum(chord, 1.0)))
        tension = np.abs(r["tensions"] - rigid["tensions"])[r.time >= SETTLED]
        found[kind]["apart"] = [
            [float(x.max()), float(np.sqrt(np.mean(x**2)))] for x in (load, angle, tension)
        ]
    return found


def main():
    found = stored(__file__, fly)
    rows = [
        [
            f"`{kind}`",
            f"{1e3 * m['tracking_rms_m']:.4f} / {1e3 * m['tracking_max_m']:.4f}",
            f"{m['min_angle_deg']:.3f}", f"{m['mean_total_tension_N']:.4f}",
            f"{m['peak_tension_N']:.4f}", f"{m['slack_time_s']:.3g}",
        ]
        for kind, m in found.items()
    ]  # fmt: skip
    header = ["plant", "load off its path, rms / most (mm)", "smallest angle (deg)"]
    header += ["mean total tension (N)", "peak tension (N)", "slack (s)"]
    fill("theory/plant.md", "same-mission", table(header, rows))
    rows = [
        [
            f"`{kind}`",
            *(
                f"{scale * most:.2g} / {scale * rms:.2g}"
                for scale, (most, rms) in zip((1e3, 1.0, 1e3), m["apart"], strict=True)
            ),
        ]
        for kind, m in found.items()
        if "apart" in m
    ]
    header = ["against `rigid-cables`", "load (mm)", "directions (deg)", "tensions (mN)"]
    fill("theory/plant.md", "apart", table(header, rows))


if __name__ == "__main__":
    main()
