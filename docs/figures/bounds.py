"""Write what two bounds are good for (docs/theory/control.md, docs/world.md): ``python docs/figures/bounds.py [--fly]``.

From ``bounds.json`` beside this file. With ``--fly`` the missions are flown first over 40 seeds, with the bound and without.
"""

import numpy as np
from pages import fill, stored, table

import colift

SEEDS = range(1000, 1040)
CASES = {
    "push": (
        "real-world-adaptive",
        "position_control.max_push",
        100.0,
        {"truth.load_mass_factor": 0.5},
    ),
    "turn": ("cut-in-flight", "allocation.max_rate", 6.0, {}),
}
"""Mission, the bound, a value that bounds nothing, and other changes."""
LOST = 1.0  # m


def fly():
    found = {}
    for name, (mission, bound, free, changes) in CASES.items():
        for label, more in ((mission, {}), (f"--set {bound}={free:g}", {bound: free})):
            runs = [colift.run(mission, seed=s, overrides={**changes, **more}) for s in SEEDS]
            far = [run.metrics["tracking_max_m"] for run in runs]
            held = [
                f < LOST and run.recording.outcome == "completed"
                for f, run in zip(far, runs, strict=True)
            ]
            kept = [f for f, ok in zip(far, held, strict=True) if ok]
            found.setdefault(name, []).append(
                {
                    "label": label, "flights": len(runs), "held": int(np.sum(held)),
                    "median_m": float(np.median(kept)) if kept else None,
                    "most_m": max(kept) if kept else None,
                }
            )  # fmt: skip
    return found


def shown(name, flights):
    changes = "".join(f" --set {key}={value:g}" for key, value in CASES[name][3].items())
    rows = []
    for k, each in enumerate(flights):
        far = (each["median_m"], each["most_m"])
        rows.append(
            [
                f"`colift run {each['label']}{changes}`"
                if k == 0
                else f"the same, `{each['label']}`",
                f"{each['held']} of {each['flights']}",
                *("-" if x is None else f"{100.0 * x:.1f} cm" for x in far),
            ]
        )
    header = [f"seeds {SEEDS[0]} to {SEEDS[-1]}", "held", "load off its path, median", "most"]
    return table(header, rows)


def main():
    found = stored(__file__, fly)
    fill("theory/control.md", "push", shown("push", found["push"]))
    fill("world.md", "turn", shown("turn", found["turn"]))


if __name__ == "__main__":
    main()
