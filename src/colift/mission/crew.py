"""Compile what a mission needs on all cores: other processes begin when something has to be compiled.

No two compile the same kernel at the same time (:mod:`colift.kernel.jit`), so they meet where nothing is left to do.
"""

from __future__ import annotations

import atexit
import importlib
import json
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from colift import catalogue
from colift.kernel import jit
from colift.part import find

FLIGHT = ("colift.flight.loop", "colift.control.reference.descent")
"""Modules with kernels that any flight may call."""
LONGEST = (("allocation", "safe"), ("supervision", "lift"))
"""Parts that take longest to compile: they come first, so that no process is left with one at the end."""
CORES = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
Step = tuple[str, ...]
"""A module to import, or layer and kind of a part to find; either compiles what is not in the cache."""

MOST = 3
"""Most processes beside one that waits to fly: its longest kernel takes a quarter of all the time, so more gain nothing."""

_at_work: list[subprocess.Popen[str]] = []


@contextmanager
def on_all_cores(table: Mapping[str, Any]) -> Iterator[None]:
    """If a kernel of colift is compiled in this block, other processes compile what else the mission of this table needs.

    They go on after the block, until nothing is left or this process ends. Workers of a campaign call nobody: they are on all cores already.
    """
    if (
        CORES < 2
        or multiprocessing.parent_process()
        or any(each.poll() is None for each in _at_work)
    ):
        yield
        return

    called: list[subprocess.Popen[str]] = []

    def call(kernel: str) -> None:
        if not called:
            called.extend(processes(steps_of(table), subprocess.DEVNULL, MOST))
            _at_work[:] = called
            for process in called:
                atexit.register(process.terminate)

    with jit.told_of_compilation(call, own=True):
        yield


def processes(
    steps: Sequence[Step], out: int, most: int = CORES - 1
) -> list[subprocess.Popen[str]]:
    """One for each further core, and no more than ``most``, which take these steps, from elsewhere or from the end, and print what they compile."""
    paths = os.pathsep.join([str(Path(__file__).parents[2]), os.environ.get("PYTHONPATH", "")])
    started = []
    count = 1 + min(CORES - 1, most)
    for number in range(1, count):
        begin = number // 2 * 2 * len(steps) // count
        order = [*steps[begin:], *steps[:begin]]
        if number % 2:
            order.reverse()
        code = f"from {__name__} import help_; help_({json.dumps(order)})"
        process = subprocess.Popen(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONPATH": paths},
            text=True,
            stdin=subprocess.DEVNULL,
            stdout=out,
            stderr=subprocess.DEVNULL,
        )
        started.append(process)
    return started


def help_(steps: Sequence[Step]) -> None:
    """Take these steps, and print the name of every kernel that has to be compiled."""
    with jit.told_of_compilation(lambda kernel: print(kernel, flush=True)):
        for step in steps:
            take(step)


def take(step: Step) -> None:
    """Import the module, or find the part."""
    if len(step) == 1:
        importlib.import_module(*step)
    else:
        find(*step)


def steps_of(table: Mapping[str, Any], *more: Step) -> list[Step]:
    """What a mission's table asks to be imported, the longest first."""
    return ordered([*more, *_parts(table)], FLIGHT)


def ordered(parts: Sequence[Step], modules: Sequence[str]) -> list[Step]:
    """The longest first; what is not there is left out, for the mission's checks to name."""
    known = [part for part in dict.fromkeys(parts) if part[1] in catalogue.names(part[0])]
    first = [part for part in known if part in LONGEST]
    rest = [part for part in known if part not in LONGEST]
    return [*first, *((name,) for name in modules), *rest]


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
