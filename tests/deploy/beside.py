"""Fly a mission with each compiled kernel of the controllers also called as C, on copies: python beside.py SECONDS MISSION ...

Prints, by mission and kernel, how often it was called and how often C did anything else. Needs NUMBA_CPU_NAME=generic.
"""

from __future__ import annotations

import ctypes
import json
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import colift
from colift.deploy.c.header import header_of
from colift.deploy.c.kernels import Kernel
from colift.deploy.c.layers import LAYERS
from colift.deploy.c.vectors import fields_of
from colift.flight.flight import Flight
from colift.part import kind_of


class Now(ctypes.Structure):
    """``colift_now``."""

    _fields_ = [("step", ctypes.c_int), ("time", ctypes.c_double), ("dt", ctypes.c_double)]


class Compiled:
    """A kernel as the C compiler made it, called with Python's arrays."""

    def __init__(self, part: Any, folder: Path) -> None:
        self.kernel = Kernel(part, kind_of(part))
        name = self.kernel.name
        (folder / "colift.h").write_text(header_of([self.kernel]))
        (folder / f"{name}.c").write_text(self.kernel.file("colift.h"))
        command = ["gcc", "-std=c99", "-O2", "-ffp-contract=off", "-shared", "-fPIC", f"{name}.c"]
        subprocess.run([*command, "-o", f"{name}.so", "-lm"], cwd=folder, check=True)
        self.function = getattr(ctypes.CDLL(str(folder / f"{name}.so")), name)
        self.kinds = self.kernel.sees, self.kernel.writes
        self.structs = [
            type("Struct", (ctypes.Structure,), {"_fields_": [("n", ctypes.c_int), *((f, ctypes.c_void_p) for f in fields_of(kind))]})
            for kind in self.kinds
        ]  # fmt: skip

    def __call__(self, n: int, now: Any, sees: Any, params: Any, memory: Any, writes: Any) -> int:
        structs = [
            made(n, *(getattr(given, f).ctypes.data for f in fields_of(kind)))
            for made, kind, given in zip(self.structs, self.kinds, (sees, writes), strict=True)
        ]
        vectors = {"params": params, "memory": memory}
        places = [ctypes.c_void_p(each.ctypes.data) for each in vectors.values()]
        lengths = [vectors[each].size for each in self.kernel.made.lengths]
        told = ctypes.byref(Now(now.step, now.time, now.dt))
        return int(
            self.function(told, ctypes.byref(structs[0]), *places, ctypes.byref(structs[1]), *lengths)
        )  # fmt: skip


def same(a: Any, b: Any) -> bool:
    """Whether two arrays are the same in every bit; what is no number is that in both."""
    equal = np.ascontiguousarray(a).view(np.int64) == np.ascontiguousarray(b).view(np.int64)
    return bool(np.all(equal | (np.isnan(a) & np.isnan(b))))


def flown(name: str, seconds: float, compiled: Callable[[Any], Compiled]) -> dict[str, list[int]]:
    """Of each kernel the calls along a mission's flight, and how many were otherwise in C."""
    calls: Counter[str] = Counter()
    wrong: Counter[str] = Counter()
    flight: Any = None

    def beside(part: Any) -> Any:
        inner, code = type(part).kernel, compiled(type(part))
        kind = code.kernel.name

        def kernel(now, sees, params, memory, writes):
            kept, told = memory.copy(), type(writes)(*(each.copy() for each in writes))
            n = len(flight.drones)
            status = code(n, now, sees, params, kept, told)
            answer = inner(now, sees, params, memory, writes)
            calls[kind] += 1
            agree = same(memory, kept) and all(
                same(a, b) for a, b in zip(writes, told, strict=True)
            )
            wrong[kind] += not agree or (answer is not None and answer != status)
            return answer

        like = {"__module__": type(part).__module__, "kernel": staticmethod(kernel)}
        made = type(type(part).__name__, (type(part),), like)
        values = {field: getattr(part, field) for field in type(part).model_fields}
        return made.model_construct(_fields_set=part.model_fields_set, **values)

    mission = colift.load_mission(name)
    changes = {layer: beside(getattr(mission, layer)) for layer in LAYERS}
    flight = Flight(mission)
    for layer, part in changes.items():
        flight._parts[layer] = part
    flight.regroup(flight.drones)
    flight.advance(seconds)
    return {kind: [calls[kind], wrong[kind]] for kind in calls}


def main() -> None:
    """Fly."""
    with tempfile.TemporaryDirectory() as folder:
        compiled = cache(lambda part: Compiled(part, Path(folder)))
        seconds, names = float(sys.argv[1]), sys.argv[2:]
        print(json.dumps({name: flown(name, seconds, compiled) for name in names}))


if __name__ == "__main__":
    main()
