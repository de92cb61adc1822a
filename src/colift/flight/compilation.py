"""Compile beforehand what would be compiled at its first use: everything, or what one mission or allocator needs."""

from __future__ import annotations

import importlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from colift import catalogue
from colift.part import find

Progress = Callable[[float, str], None]
"""Called with the share that is done, between 0 and 1, and the name of what comes next."""

FLIGHT = ("colift.flight.loop", "colift.control.reference.descent")
"""Modules with kernels that any flight may call."""
STUDIES = (
    "colift.study.bench.timing", "colift.study.latency", "colift.study.rehearsal", "colift.study.safety", "colift.plan.planner",
    "colift.learn.kernels",
)  # fmt: skip
"""Modules with kernels that no flight calls, but a study, the planner or a learner."""
LONGEST = (("allocation", "safe"), ("supervision", "lift"))
"""Parts that take longest to compile: they come first, so that no process is left with one at the end."""
CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
Step = tuple[str, ...]
"""A module to import, or layer and kind of a part to find; either compiles what is not in the cache."""


@dataclass(frozen=True)
class Warmed:
    """What :func:`warm` did.

    Attributes
    ----------
    compiled : tuple of str
        Names of the kernels that were compiled now.
    loaded : int
        Kernels that were found in the cache; one that the process had already is not counted.
    seconds : float
        Wall time, s.

    """

    compiled: tuple[str, ...]
    loaded: int
    seconds: float


def warm(
    mission: str | Path | Mapping[str, Any] | None = None,
    *,
    allocator: str | None = None,
    progress: Progress | None = None,
) -> Warmed:
    """Compile what a mission, or calls of an allocator by hand, will need; without either, everything.

    Compiled kernels are cached on disk: the next call, and the next process, only loads them.

    Parameters
    ----------
    mission
        What :func:`colift.run` takes.
    allocator
        Name of an allocator: of the mission's, instead of it.
    progress
        Called before every kernel that has to be compiled, and at the end; nothing is printed.

    Raises
    ------
    ColiftError
        For a mission or an allocator that is not there.

    """
    from colift.kernel import jit  # Numba, which takes a while

    begin, before = time.perf_counter(), len(jit.made)
    compiled: list[str] = []
    share = 0.0
    steps, changes = _steps(mission, allocator)
    with _helpers(steps) as (call, theirs):

        def tell(kernel: str) -> None:
            call()
            compiled.append(kernel)
            if progress is not None:
                progress(share, kernel)

        with jit.told_of_compilation(tell):
            for number, step in enumerate(steps):
                share = number / len(steps)
                _take(step)
            if mission is not None:
                _load(_table(mission), changes)
    compiled += [kernel for kernel in theirs if kernel not in compiled]
    if progress is not None:
        progress(1.0, "")
    loaded = len(jit.made) - before - len(compiled)
    return Warmed(tuple(compiled), loaded, time.perf_counter() - begin)


@contextmanager
def _helpers(steps: Sequence[Step]) -> Iterator[tuple[Callable[[], None], list[str]]]:
    """When the function is called for the first time, other processes begin to take the same steps, one a core.

    They begin elsewhere or from the end. No two compile the same kernel at the same time
    (:mod:`colift.kernel.jit`), so they meet where nothing is left to do. The list has, in the end, what they compiled.
    """
    processes: list[subprocess.Popen[str]] = []
    theirs: list[str] = []

    def call() -> None:
        if processes or len(steps) < 2:
            return
        paths = os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
        for number in range(1, CORES):
            begin = number // 2 * 2 * len(steps) // CORES
            order = [*steps[begin:], *steps[:begin]]
            if number % 2:
                order.reverse()
            code = f"from {__name__} import help_; help_({json.dumps(order)})"
            process = subprocess.Popen(
                [sys.executable, "-c", code],
                env={**os.environ, "PYTHONPATH": paths},
                text=True,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
            )
            processes.append(process)

    try:
        yield call, theirs
    finally:
        for process in processes:
            process.terminate()
            theirs += process.communicate()[0].split()


def help_(steps: Sequence[Step]) -> None:
    """Take these steps, and print the name of every kernel that has to be compiled."""
    from colift.kernel import jit

    with jit.told_of_compilation(lambda kernel: print(kernel, flush=True)):
        for step in steps:
            _take(step)


def _take(step: Step) -> None:
    if len(step) == 1:
        importlib.import_module(*step)
    else:
        find(*step)


def _steps(mission: Any, allocator: str | None) -> tuple[list[Step], dict[str, Any]]:
    """What is to be imported, the longest first, and what changes in the mission."""
    if mission is None and allocator is not None:
        return [("allocation", allocator)], {}
    changes: dict[str, Any] = {}
    if mission is None:
        parts = [(layer, kind) for layer in catalogue.FOLDERS for kind in catalogue.names(layer)]
        modules = [*FLIGHT, *STUDIES]
    else:
        parts, modules = [*_parts(_table(mission))], [*FLIGHT]
        if allocator is not None:
            parts.insert(0, ("allocation", allocator))
            changes["allocation.kind"] = allocator
    known = [part for part in dict.fromkeys(parts) if part[1] in catalogue.names(part[0])]
    first = [part for part in known if part in LONGEST]
    rest = [part for part in known if part not in LONGEST]
    return [*first, *((name,) for name in modules), *rest], changes


def _load(table: dict[str, Any], changes: dict[str, Any]) -> None:
    """With whatever is still missing, or wrong."""
    from colift.mission.load import load_mission  # which imports the loop

    load_mission(table, changes)


def _table(mission: Any) -> dict[str, Any]:
    if isinstance(mission, Mapping):
        return dict(mission)
    resolved = getattr(mission, "resolved", None)
    return resolved() if resolved else catalogue.read_source(mission)[1]


def _parts(table: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Layer and kind of the parts that a mission's table asks for, also of those that its events put in place."""
    sections = [(layer, table.get(layer, {})) for layer in catalogue.LAYERS]
    sections += [(name, item) for name in catalogue.LISTS for item in _list(table.get(name))]
    for event in _list(table.get("events")):
        if isinstance(event, Mapping):
            layer, _, leaf = str(event.get("field")).partition(".")
            value = event.get("value")
            sections.append((layer, {"kind": value} if leaf == "kind" else value))
    for layer, section in sections:
        if layer in catalogue.FOLDERS and isinstance(section, Mapping):
            kind = section.get("kind", catalogue.default_kind(layer, table))
            if isinstance(kind, str):
                yield layer, kind


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []
