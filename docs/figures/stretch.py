"""Write what stretch does to the paper's controllers (docs/theory/plant.md): ``python docs/figures/stretch.py [--fly]``.

From ``stretch.json`` beside this file. With ``--fly`` the paper's spiral is flown first on elastic cables and on heavy ones.
"""

import numpy as np
from pages import fill, stored, table

import colift

ELASTIC, HEAVY = {"plant.kind": "elastic-cables"}, {"plant.kind": "bead-cables"}
FORWARD = {"position_control.kind": "feed-forward"}
CASES = (
    ELASTIC,
    {**ELASTIC, "plant.damping_ratio": 0.01},
    {**ELASTIC, "plant.damping_ratio": 0.003},
    {**ELASTIC, "plant.stiffness": 2e4},
    {**ELASTIC, "plant.stiffness": 1e4},
    {**ELASTIC, "plant.stiffness": 1e4, "plant.damping_ratio": 0.05},
    {**ELASTIC, "plant.stiffness": 1e4, **FORWARD},
    {**HEAVY, "plant.density": 2e-3},
    {**HEAVY, "plant.density": 2e-3, "timing.step": 5e-4},
    {**HEAVY, "plant.density": 2e-3, **FORWARD},
)


def fly():
    found = []
    for changes in CASES:
        flown = colift.run("paper-spiral", overrides=changes)
        r, m = flown.recording, flown.metrics
        settled = r["tensions"][r.time >= 1.0]
        known = settled[np.isfinite(settled).all(axis=1)]
        found.append(
            {
                "set": changes,
                "outcome": r.outcome,
                "tracking_max_m": m["tracking_max_m"],
                "slack_time_s": m["slack_time_s"],
                "peak_tension_N": float(known.max()) if known.size else None,
            }
        )
    return found


def main():
    rows = []
    for each in stored(__file__, fly):
        sets = ", ".join(
            f"`{key}={value:g}`" if isinstance(value, float) else f"`{key}={value}`"
            for key, value in each["set"].items()
        )
        lost = each["outcome"] != "completed" or each["tracking_max_m"] > 0.5
        far = "the load is lost" if lost else f"{1e3 * each['tracking_max_m']:.2g}"
        peak = "-" if lost or each["peak_tension_N"] is None else f"{each['peak_tension_N']:.2g}"
        rows.append([sets, far, "-" if lost else f"{each['slack_time_s']:.3g}", peak])
    header = ["`--set`", "load off its path, most (mm)", "slack, sum of the cables (s)"]
    fill("theory/plant.md", "stretch", table([*header, "peak tension after 1 s (N)"], rows))


if __name__ == "__main__":
    main()
