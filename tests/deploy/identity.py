"""Allocators in C against Python's: python identity.py PART ... prints what is found of each part, as JSON.

In one process, so that each kernel is translated once and compiled once for each machine. Needs NUMBA_CPU_NAME=generic.
"""

from __future__ import annotations

import json
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from colift.deploy.c.asked import CASES, LIMITED, allocator, by_python, calls, the_same, within
from colift.deploy.c.kernels import Kernel
from colift.deploy.c.layers import EMBEDDED, SINGLE
from colift.deploy.c.machines import Driver
from colift.part import find

ALLOCATORS: tuple[tuple[str, dict[str, Any]], ...] = (("sqp", {}), ("safe", {}), ("safe", LIMITED))
COUNTS = {"x86-64": 300, "clang": 100, "aarch64": 60, "wasm": 100, "m7": 30}
"""Calls of each allocator, team and kind of force; ``docs/figures/deploy.py`` makes more."""
CHIP_CALLS = 150


@cache
def kernel(kind: str, *, single: bool = False) -> Kernel:
    return Kernel(find("allocation", kind), kind, single=single)


@contextmanager
def driver(kind: str, machine: str, asked: Any, *, single: bool = False, flags: Any = (), spare: int = 0) -> Iterator[Driver]:  # fmt: skip
    """For all that is asked, and with so much room beyond it."""
    sizes = [(len(a.directions), a.params.size + spare, a.memory.size + spare) for a in asked]
    most = tuple(max(each) for each in zip(*sizes, strict=True))
    with Driver(kernel(kind, single=single), machine, most, flags) as made:
        yield made


@cache
def asked_and_answered(kind: str, limited: bool, n: int, case: str) -> tuple[Any, Any]:
    """Calls, as many as any machine is asked, and Python's answers."""
    part, team = allocator(kind, n, **(LIMITED if limited else {}))
    asked = calls(part, team, case, max(COUNTS.values()), 40 + n)
    return asked, by_python(part, asked)


def same(machine: str) -> dict[str, int]:
    """Answers that differ in any bit."""
    # With more drones sqp leaves a saddle along angles whose sine WebAssembly's C library rounds otherwise.
    drones, few, found = (
        (1, 2, 3, 4, 9, 12 if machine == "wasm" else 16),
        slice(COUNTS[machine]),
        {},
    )
    for kind, settings in ALLOCATORS:
        each = {(n, case): asked_and_answered(kind, bool(settings), n, case) for n in drones for case in CASES}  # fmt: skip
        with driver(kind, machine, [asked for asked, _ in each.values()]) as made:
            for (n, case), (asked, answers) in each.items():
                some = asked._replace(forces=asked.forces[few], moments=asked.moments[few])
                wrong = ~the_same(made(some), answers)
                found[f"{kind} {len(settings)} {n} {case}"] = int(wrong.sum())
    return found


def one_sine(machine: str) -> dict[str, int]:
    """The same with one sine, cosine and arc cosine on both, in calls that end otherwise without."""
    found, flags = {}, ["-include", str(Path(__file__).with_name("one_sine.h"))]
    for kind, settings in ALLOCATORS:
        part, team = allocator(kind, 16, **settings)
        asked = calls(part, team, "rough", 15_000, 716)
        asked = asked._replace(forces=asked.forces[:100], moments=asked.moments[:100])
        answers = []
        for each in ("x86-64", machine):
            with driver(kind, each, [asked], flags=flags) as made:
                answers.append(made(asked))
        found[f"{kind} {len(settings)}"] = int((~the_same(*answers)).sum())
    return found


def inside(machine: str) -> dict[str, int]:
    """Runs with every place in memory checked."""
    flags, found = ["-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"], {}
    for kind, settings in (ALLOCATORS[0], ALLOCATORS[2]):
        for n in (1, 4, 9):
            part, team = allocator(kind, n, **settings)
            asked = calls(part, team, "rough", 100, 80 + n)
            with driver(
                kind, machine, [asked], flags=flags, spare=-1
            ) as made:  # it has room for one more
                found[f"{kind} {n}"] = len(made(asked).status)
    return found


def single(machine: str) -> dict[str, Any]:
    """What single precision keeps."""
    found = {}
    for kind, settings in ALLOCATORS:
        parts = {n: allocator(kind, n, **{**SINGLE[kind], **settings}) for n in (2, 3, 4, 8)}
        each = {(n, case): calls(*parts[n], case, 500, 50 + n) for n in parts for case in CASES}
        with driver(kind, machine, each.values(), single=True) as made:
            for (n, case), asked in each.items():
                found[f"{kind} {len(settings)} {n} {case}"] = _kept(parts[n][0], kind, asked, made(asked))  # fmt: skip
    return found


def _kept(part: Any, kind: str, asked: Any, answers: Any) -> dict[str, Any]:
    size = np.linalg.norm(asked.forces, axis=1)
    given = (answers.tensions[:, :, None] * answers.directions).sum(1)
    missing = np.linalg.norm(given + asked.forces, axis=1)
    good = (answers.status == 0) & (size > 0)
    return {
        "numbers": bool(np.isfinite(answers.tensions).all() and np.isfinite(answers.directions).all()),
        "balance": float((missing[good] / size[good]).max(initial=0.0)),
        "norm": float(abs(np.linalg.norm(answers.directions, axis=2) - 1.0).max()),
        "converged": float(good.mean()),
        "beyond": within(part, asked, answers) if kind == "safe" else {},
    }  # fmt: skip


def chip(machine: str) -> dict[str, Any]:
    """What a microcontroller needs: mean and most instructions and stack, and code."""
    found: dict[str, Any] = {}
    for kind, settings in ALLOCATORS:
        parts = {n: allocator(kind, n, **{**EMBEDDED[kind], **settings}) for n in (1, 2, 3, 4)}
        each = {(n, case): calls(*parts[n], case, CHIP_CALLS, 60 + n) for n in parts for case in CASES}  # fmt: skip
        with driver(kind, machine, each.values(), single=True) as made:
            for (n, case), asked in each.items():
                used = (answers := made(asked)).instructions
                needs = found.setdefault(f"{kind} {len(settings)} {n}", {"code": made.code()})
                needs[case] = [float(used.mean()), float(used.max()), answers.stack]
    return found


PARTS = {
    **{f"same {machine}": (same, machine) for machine in COUNTS},
    "one_sine wasm": (one_sine, "wasm"),
    "one_sine m7": (one_sine, "m7"),
    "inside": (inside, "x86-64"),
    "single": (single, "x86-64"),
    "chip": (chip, "m4"),
}


def main() -> None:
    found = {}
    for name in sys.argv[1:]:
        function, machine = PARTS[name]
        try:
            found[name] = {"found": function(machine)}
        except Exception:  # the other parts are still to be judged
            found[name] = {"failed": traceback.format_exc()}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
