"""Least distances under attack (docs/theory/safe.md): ``python docs/figures/distances.py [--fly]``.

From ``distances.json`` beside this file. With ``--fly`` it is measured first, some minutes: a million cycles for each team, a
fifth of them for each family of forces, and a tenth of that without the distances.
"""

from dataclasses import asdict

from pages import fill, stored, table

from colift.study import safety

SIZES = (2, 3, 4, 6, 8, 12, 16)
CYCLES = 200_000


def fly():
    rows = []
    for n in SIZES:
        for family in safety.FAMILIES:
            for part, share in zip(safety.metric_parts(n), (1, 10), strict=True):
                found = safety.attack(n, family, CYCLES // share, part, metres=True)
                rows.append({**asdict(found), "holds": found.holds})
        print(rows[-2], flush=True)
    return {"cycles": CYCLES, "rows": rows}


def main():
    found = stored(__file__, fly)
    rows = []
    for n in SIZES:
        ours, angles = ([r for r in found["rows"] if r["n"] == n][k::2] for k in (0, 1))
        cells = [str(n), str(sum(r["cycles"] for r in ours))]
        cells.append(str(sum(not r["holds"] for r in ours)))
        for room in ("drone_room", "cable_room"):
            cells += [f"{1e3 * min(r[room] for r in some):+.1f}" for some in (ours, angles)]
        cells.append(f"{100 * sum(r['avoidable_share'] for r in ours) / len(ours):.4f}")
        for family in ("smooth", "noise"):
            one, other = (next(r for r in some if r["family"] == family) for some in (ours, angles))
            cells += [f"{one['median_us']:.1f} / {other['median_us']:.1f}"]
        rows.append(cells)
    header = [
        "n", "cycles", "families broken", "drones, mm", "angles only", "cables, mm", "angles only",
        "not proved, %", "smooth, us", "noise, us",
    ]  # fmt: skip
    fill("theory/safe.md", "distances", table(header, rows))


if __name__ == "__main__":
    main()
