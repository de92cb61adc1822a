"""Write what docs/deploy.md says of exported kernels: whether they compute what Python computes, and what a Cortex-M needs for them.

python docs/figures/deploy.py [--fly [identity] [chip] [single]]

From ``deploy.json`` beside this file, which ``--fly`` makes first, all of it (an hour on two cores) or what is named; it needs gcc, make, and
the Debian packages that ``colift.deploy.c.machines`` names.
"""

from __future__ import annotations

import os
from concurrent.futures import ProcessPoolExecutor
from typing import Any

from pages import fill, stored_parts, table

os.environ["NUMBA_CPU_NAME"] = "generic"  # fuses nothing, as C

import numpy as np

from colift.deploy.c.asked import CASES, LIMITED, allocator, by_python, calls, the_same, within
from colift.deploy.c.kernels import Kernel
from colift.deploy.c.layers import EMBEDDED, SINGLE
from colift.deploy.c.machines import MACHINES, Driver
from colift.part import find

ALLOCATORS: dict[str, tuple[str, dict[str, Any]]] = {
    "sqp": ("sqp", {}),
    "safe": ("safe", {}),
    "safe, limited thrust": ("safe", LIMITED),
}
DRONES = (1, 2, 3, 4, 6, 9, 16)
COUNTS = {"x86-64": 15_000, "wasm": 15_000, "aarch64": 15_000, "clang": 5_000, "m7": 100}
"""Calls of each allocator, team and kind of force."""
ON_CHIP, HOSTILE = 1_000, 5_000
FIRST = 700
"""Seeds of what is judged here: from it on, as nothing was chosen with them."""
BUDGET = 168_000
"""Instructions of a call that the embedded profile keeps to: 1 ms at 168 MHz and one a cycle."""


def driver(kind: str, settings: Any, drones: Any, machine: str, *, single: bool) -> Driver:
    """The allocator of a part on a machine, for these teams."""
    found = [allocator(kind, n, **settings) for n in drones]
    most = max(drones), max(p.params(t).size for p, t in found), max(p.memory(t).size for p, t in found)  # fmt: skip
    return Driver(Kernel(find("allocation", kind), kind, single=single), machine, most)


def identity(name: str, case: str) -> dict[str, list[int]]:
    """Of one allocator and kind of force, by machine: answers that are the same in every bit, and all."""
    kind, settings = ALLOCATORS[name]
    found = {machine: [0, 0] for machine in COUNTS}
    drivers = {m: driver(kind, settings, DRONES, m, single=False) for m in COUNTS}
    for n in DRONES:
        part, team = allocator(kind, n, **settings)
        asked = calls(part, team, case, max(COUNTS.values()), FIRST + n)
        wanted = by_python(part, asked)
        for machine, made in drivers.items():
            few = slice(COUNTS[machine])
            some = asked._replace(forces=asked.forces[few], moments=asked.moments[few])
            same = the_same(made(some), wanted)
            found[machine][0] += int(same.sum())
            found[machine][1] += len(same)
    for made in drivers.values():
        made.close()
    return found


def chip(name: str, n: int, profile: str) -> dict[str, Any]:
    """What a Cortex-M4F needs for one allocator and team in single precision."""
    kind, settings = ALLOCATORS[name]
    settings = {**{"single": SINGLE, "embedded": EMBEDDED}[profile][kind], **settings}
    part, team = allocator(kind, n, **settings)
    found: dict[str, Any] = {"allocator": name, "drones": n, "profile": profile}
    with driver(kind, settings, (n,), "m4", single=True) as made:
        for case in CASES:
            asked = calls(part, team, case, ON_CHIP, FIRST + n)
            answers = made(asked)
            used = answers.instructions
            found[case] = {
                "mean": round(float(used.mean())), "p99": round(float(np.quantile(used, 0.99))),
                "max": round(float(used.max())), "missing": float(np.nanmean(missing(asked, answers))),
            }  # fmt: skip
            found["stack"] = max(found.get("stack", 0), answers.stack)
        found["ram"] = 4 * (asked.params.size + asked.memory.size)
        found["code"] = made.code()
    return found


def missing(asked: Any, answers: Any) -> Any:
    """Size of the force that each answer leaves out, N."""
    given = (answers.tensions[:, :, None] * answers.directions).sum(axis=1)
    return np.linalg.norm(given + np.where(np.isfinite(asked.forces), asked.forces, np.nan), axis=1)


def single(name: str, n: int) -> dict[str, Any]:
    """How far single precision is from double, and by how much limits are missed, in hostile runs too."""
    kind, settings = ALLOCATORS[name]
    settings = {**SINGLE[kind], **settings}
    part, team = allocator(kind, n, **settings)
    found: dict[str, Any] = {"allocator": name, "drones": n}
    with driver(kind, settings, (n,), "x86-64", single=True) as made:
        for case in CASES:
            asked = calls(part, team, case, HOSTILE, FIRST + n)
            answers, double = made(asked), by_python(part, asked)
            size = np.linalg.norm(asked.forces, axis=1)
            good = (double.status == 0) & (answers.status == 0) & (size > 0.0)
            found[case] = {
                "converged": float(np.mean(answers.status == 0)),
                "in_double": float(np.mean(double.status == 0)),
                "balance": float((missing(asked, answers)[good] / size[good]).max(initial=0.0)),
                "beyond": within(part, asked, answers) if kind == "safe" else None,
                "missing": [float(np.nanmean(missing(asked, each))) for each in (answers, double)],
            }
    return found


def _do(job: tuple[Any, ...]) -> Any:
    function, *arguments = job
    return globals()[function](*arguments)


JOBS: dict[str, list[tuple[Any, ...]]] = {
    "identity": [("identity", name, case) for name in ALLOCATORS for case in reversed(CASES)],
    "chip": [
        ("chip", name, n, profile)
        for profile, drones in (("single", (3, 4, 6)), ("embedded", (1, 2, 3, 4)))
        for name in ALLOCATORS
        for n in drones
    ],
    "single": [("single", name, n) for name in ALLOCATORS for n in (2, 3, 4, 6, 8)],
}
"""All that is measured, by part."""


def measure(parts: list[str]) -> dict[str, Any]:
    """Parts of it, on two cores."""
    todo = [job for part in parts for job in JOBS[part]]
    with ProcessPoolExecutor(2) as pool:
        found = list(pool.map(_do, todo))
    result: dict[str, Any] = {part: {} if part == "identity" else [] for part in parts}
    for job, each in zip(todo, found, strict=True):
        if job[0] == "identity":
            result["identity"].setdefault(job[1], {})[job[2]] = each
        else:
            result[job[0]].append(each)
    return result


def of(pair: list[int]) -> str:
    """So many of so many."""
    same, total = pair
    return f"all {total:,}" if same == total else f"{same:,} of {total:,}"


def k(value: float) -> str:
    """Instructions in thousands or millions."""
    return f"{value / 1e6:.3g}\u00a0M" if value >= 999_500 else f"{value / 1000:.3g}\u00a0k"


def of_identity(found: Any) -> str:
    """Which answers are the same in every bit."""
    rows = [
        [MACHINES[m].title, name, *(of(found[name][case][m]) for case in CASES)]
        for m in COUNTS
        for name in ALLOCATORS
    ]
    return table(["machine", "allocator", *CASES], rows)


def of_chip(found: Any) -> str:
    """What a Cortex-M4F needs."""
    rows = [
        [
            f"{e['allocator']}, n = {e['drones']}", k(e["smooth"]["mean"]),
            *(k(e["noisy"][x]) for x in ("mean", "p99", "max")), k(e["rough"]["max"]),
            str(e["stack"]), str(e["ram"]), f"{e['code'] / 1000:.1f}\u00a0kB",
        ]
        for e in found
        if e["profile"] == "single"
    ]  # fmt: skip
    head = ["", "smooth: mean", "noisy: mean", "99 %", "most", "rough: most"]
    return table([*head, "stack, B", "RAM, B", "code"], rows)


def of_budget(found: Any) -> str:
    """What the embedded profile needs at most."""
    rows = [
        [
            f"{e['allocator']}, n = {e['drones']}", *(k(e[c]["max"]) for c in CASES),
            f"{100 * max(e[c]['max'] for c in CASES) / BUDGET:.0f} %",
        ]
        for e in found
        if e["profile"] == "embedded"
    ]  # fmt: skip
    return table(["most instructions of a call", *CASES, "of the budget"], rows)


def of_single(found: Any) -> str:
    """What single precision keeps."""
    rows = [
        [
            f"{e['allocator']}, n = {e['drones']}",
            *(f"{100 * e[c]['converged']:.4g} ({100 * e[c]['in_double']:.4g})" for c in CASES),
            "{:.3g} ({:.3g})".format(*e["rough"]["missing"]),
            f"{max(e[c]['balance'] for c in CASES):.1e}",
            *(_beyond(e, key) for key in ("angle", "cone", "tension", "turn")),
        ]
        for e in found
    ]
    head = ["", *(f"{c}, %" for c in CASES), "missing, N", "balance"]
    return table([*head, "angle, °", "cone, °", "tension, N", "turn, rad/s"], rows)


def _beyond(row: dict[str, Any], key: str) -> str:
    if row["smooth"]["beyond"] is None:
        return "–"
    worst = max(row[case]["beyond"][key] for case in CASES)
    return "kept" if worst <= 0.0 else f"{worst:.1e}"


def main() -> None:
    """Write the tables."""
    found = stored_parts(__file__, JOBS, measure)
    fill("deploy.md", "identity", of_identity(found["identity"]))
    fill("deploy.md", "chip", of_chip(found["chip"]))
    fill("deploy.md", "embedded", of_budget(found["chip"]))
    fill("deploy.md", "single", of_single(found["single"]))


if __name__ == "__main__":
    main()
