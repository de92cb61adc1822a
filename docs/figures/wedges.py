"""Write the tables on `wahba-hoenig` of docs/theory/compared.md: ``python docs/figures/wedges.py [--fly]``.

The angles in hover are closed forms. The flights, of the paper's spiral with an answer every 10 ms, are in ``wedges.json``
beside this file; ``--fly`` flies them first.
"""

import math

from pages import fill, stored, table

import colift
from colift.control.allocation.wahba_hoenig import WahbaHoenig
from colift.team import Team
from colift.team.geometry import pairwise_angles, ring

TEAMS = (2, 4, 7, 16)
DISTANCES = (0.2, 0.5, 0.8, 1.1)
METRICS = ("min_angle_deg", "tension_integral_Ns", "peak_total_tension_N", "tracking_rms_m")


def angles(n):
    """Wedge, and least angle between the cables that rest against the wedges in hover, degrees."""
    half = float(WahbaHoenig().tilts(Team.uniform(n))[0])
    cone = math.atan(math.tan(half) / math.sin(math.pi / n))
    return math.degrees(2.0 * half), math.degrees(float(pairwise_angles(ring(n, cone)).min()))


def fly():
    flights = {f"wahba-hoenig {d}": {"kind": "wahba-hoenig", "distance": d} for d in DISTANCES}
    flights["sqp"] = {"kind": "sqp"}
    found = {}
    for name, allocation in flights.items():
        changes = {"allocation": allocation, "timing.allocation": 0.01}
        metrics = colift.run("paper-spiral", overrides=changes).metrics
        found[name] = {metric: metrics[metric] for metric in METRICS}
    return found


def main():
    both = [angles(n) for n in TEAMS]
    rows = [
        ["wedge $2\\theta$ (0.5 m, cables of 1 m), deg", *(f"{wedge:.1f}" for wedge, _ in both)],
        ["least angle between two cables, deg", *(f"{least:.1f}" for _, least in both)],
    ]
    fill("theory/compared.md", "wedges", table(["n", *map(str, TEAMS)], rows))
    found = stored(__file__, fly)
    rows = []
    for name, m in found.items():
        kind, _, distance = name.partition(" ")
        rows.append(
            [
                f"`{kind}`" + (f", `distance` = {distance} m" if distance else ""),
                f"{m['min_angle_deg']:.1f}", f"{m['tension_integral_Ns']:.1f}",
                f"{m['peak_total_tension_N']:.2f}", f"{100.0 * m['tracking_rms_m']:.2f}",
            ]
        )  # fmt: skip
    header = ["allocator", "smallest angle, deg", "tension integral, N s", "peak total tension, N"]
    fill("theory/compared.md", "distances", table([*header, "tracking RMS, cm"], rows))


if __name__ == "__main__":
    main()
