"""The controllers of a mission as a folder of C: kernels, constants of the team, an example and a test.

What a kernel computes is the same as in Python, bit for bit, if the C compiler neither fuses nor reorders
(``-O2 -ffp-contract=off``) and Numba does not fuse either: the answers in the test are made with
``NUMBA_CPU_NAME=generic`` (:mod:`colift.deploy.c.layers`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from colift.deploy.c.cascade import Cascade
from colift.deploy.c.header import header_of
from colift.deploy.c.kernels import Kernel
from colift.deploy.c.layers import LAYERS
from colift.deploy.c.program import wrapped
from colift.deploy.c.templates import template
from colift.deploy.c.vectors import Vectors
from colift.errors import ColiftError
from colift.flight.flight import Flight
from colift.part import kind_of
from colift.record.recording import atomic_path

if TYPE_CHECKING:
    from colift.mission.mission import Mission

CALLS = 20
"""Calls of each kernel in the test."""


@dataclass(frozen=True)
class Layer:
    """One layer of the mission's controllers.

    Attributes
    ----------
    name : str
    kernel : Kernel
    params, memory : array
        For the mission's team, the memory as at the start.
    period : float
        Of its calls, s.

    """

    name: str
    kernel: Kernel
    params: Any
    memory: Any
    period: float


def layers_of(flight: Flight, names: Iterable[str], *, single: bool = False) -> list[Layer]:
    """The layers of a flight that has not begun.

    Raises
    ------
    ColiftError
        For a part in plain Python, or one that cannot be translated.

    """
    mission, found = flight.mission, []
    periods = flight.mission.timing.multiples()
    periods |= dict.fromkeys(("observation", "detection"), periods["position_control"])
    for name in names:
        part, wire = getattr(mission, name), getattr(flight.wires, name)
        kind = kind_of(type(part))
        if not hasattr(type(part).kernel, "py_func"):
            raise ColiftError(f"{name}.kind: {kind} is plain Python, and so cannot be C")
        found.append(
            Layer(
                name, Kernel(type(part), kind, single=single), wire.params.copy(), wire.memory.copy(),
                periods.get(name, 1) * mission.timing.step,
            )
        )  # fmt: skip
    return found


def profiled(mission: Mission, profile: Mapping[str, Mapping[str, float]]) -> Mission:
    """The mission with an allocator's settings of a profile, where it does not give them itself.

    Raises
    ------
    ColiftError
        For an allocator that the profile does not know.

    """
    part = mission.allocation
    kind = kind_of(type(part))
    if kind not in profile:
        raise ColiftError(
            f"allocation.kind: in single precision {' and '.join(profile)} were tried, not {kind}"
        )
    changes = {k: v for k, v in profile[kind].items() if k not in part.model_fields_set}
    return mission.model_copy(update={"allocation": part.model_copy(update=changes)})


def files_of(
    mission: Mission, names: Sequence[str] = LAYERS, *, single: bool = False
) -> dict[str, str]:
    """Text of each file by its name."""
    flight = Flight(mission)
    layers = layers_of(flight, names, single=single)
    vectors = Vectors(flight, layers, CALLS, single=single)
    allocator = next((layer.kernel for layer in layers if layer.name == "allocation"), None)
    cascade = Cascade(mission, layers) if Cascade.possible(mission, layers) else None
    marks = {
        "EXAMPLE": " ".join(["example"] * bool(allocator) + ["example_cascade"] * bool(cascade)),
        "MORE_FLAGS": "-Wdouble-promotion" if single else "",
        "ALLOCATE": allocator.name if allocator else "",
        "REAL": layers[0].kernel.program.real,
    }
    files = {f"{layer.kernel.name}.c": layer.kernel.file("colift.h") for layer in layers}
    files["colift.h"] = header_of([layer.kernel for layer in layers])
    files["colift_team.h"], files["colift_team.c"] = team_of(layers, len(flight.drones))
    table, tests = "", {}
    if cascade:
        files |= cascade.files()
        if not single:  # in which a memory goes its own way
            table, tests["cascade"] = cascade.test()
    files["test_vectors.h"], files["test.c"] = vectors.data() + table, vectors.program(tests)
    sources = (name for name in files if name.startswith("colift_") and name.endswith(".c"))
    marks["KERNELS"] = " ".join(sorted(name.replace(".c", ".o") for name in sources))
    for name in ("Makefile", "README.md", "LICENSE", *(["example.c"] if allocator else [])):
        files[name] = template(name, marks)
    return files


def team_of(layers: Sequence[Layer], n: int) -> tuple[str, str]:
    """Header and source of what the kernels are told of the mission's team."""
    real = layers[0].kernel.program.real
    head = ["#ifndef COLIFT_TEAM_H", "#define COLIFT_TEAM_H", "", f"#define COLIFT_DRONES {n}", ""]
    body = ['#include "colift_team.h"', "", "#include <math.h>", ""]
    for layer in layers:
        name, number = f"colift_{layer.name}", layer.kernel.program.number
        upper = name.upper()
        head += [
            f"// {layer.kernel.name.removeprefix('colift_')}: called every {layer.period:g} s.",
            f"#define {upper}_PARAMS {layer.params.size}",
            f"#define {upper}_MEMORY {layer.memory.size}",
            f"extern const {real} {name}_params[{max(layer.params.size, 1)}];",
            f"void {name}_start({real} *memory); // memory as before the first call",
            "",
        ]
        values = ", ".join(number(float(v)) for v in layer.params) or number(0.0)
        body += [
            wrapped(f"const {real} {name}_params[{max(layer.params.size, 1)}] = {{{values}}};"),
            "",
        ]
        body += [f"void {name}_start({real} *memory)", "{"]
        body += (
            [
                f"    for (int k = 0; k < {upper}_MEMORY; ++k) {{",
                f"        memory[k] = {number(0.0)};",
                "    }",
            ]
            if layer.memory.size
            else ["    (void)memory;"]
        )
        body += [
            f"    memory[{k}] = {number(float(layer.memory[k]))};"
            for k in np.flatnonzero(layer.memory)
        ]
        body += ["}", ""]
    return "\n".join([*head, "#endif", ""]), "\n".join(body)


def write(files: Mapping[str, str], folder: Path) -> dict[str, Path]:
    """Write them, each whole or not at all."""
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        with atomic_path(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return {name: folder / name for name in files}
