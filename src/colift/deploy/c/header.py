"""The header of an export: the types through which its kernels are called."""

from __future__ import annotations

from collections.abc import Sequence

from colift.deploy.c.kernels import Kernel
from colift.kernel.status import Status

_WHAT = """// What flows between the layers: arrays of numbers, a row a drone where there is one for each.
// Units, frames and meanings: colift's table of signals. A kernel writes into the arrays of `writes`, of which it
// finds what it wrote last. `params` and `memory` are its own: colift_team.h."""


def header_of(kernels: Sequence[Kernel]) -> str:
    """For these kernels."""
    real = kernels[0].program.real
    now = f"""// When a kernel is called.
typedef struct {{
    int step;    // number of the call
    {real} time; // of it, s
    {real} dt;   // since the last call, s
}} colift_now;"""
    parts = ["#ifndef COLIFT_H\n#define COLIFT_H", _statuses(), _WHAT, now]
    for kernel in kernels:
        parts += [kernel.types(), f"{kernel.made.signature()};"]
    return "\n\n".join([*parts, "#endif"]) + "\n"


def _statuses() -> str:
    lines = [f"    COLIFT_{each.name} = {int(each)}," for each in Status]
    return "\n".join(
        ["// How an allocation ends: what an allocator returns.", "enum {", *lines, "};"]
    )
