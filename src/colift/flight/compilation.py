"""Compile beforehand what would be compiled at its first use: everything, or what one mission or allocator needs."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from colift import catalogue
from colift.mission import crew

Progress = Callable[[float, str], None]
"""Called with the share that is done, between 0 and 1, and the name of what comes next."""

STUDIES = (
    "colift.study.bench.timing", "colift.study.latency", "colift.study.rehearsal", "colift.study.safety", "colift.plan.planner",
    "colift.learn.kernels",
)  # fmt: skip
"""Modules with kernels that no flight calls, but a study, the planner or a learner."""


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
                crew.take(step)
            if mission is not None:
                _load(_table(mission), changes)
    compiled += [kernel for kernel in theirs if kernel not in compiled]
    if progress is not None:
        progress(1.0, "")
    loaded = len(jit.made) - before - len(compiled)
    return Warmed(tuple(compiled), loaded, time.perf_counter() - begin)


@contextmanager
def _helpers(steps: Sequence[crew.Step]) -> Iterator[tuple[Callable[[], None], list[str]]]:
    """When the function is called for the first time, other processes begin. The list has, in the end, what they compiled."""
    started: list[subprocess.Popen[str]] = []
    theirs: list[str] = []

    def call() -> None:
        if not started and len(steps) > 1:
            started.extend(crew.processes(steps, subprocess.PIPE))

    try:
        yield call, theirs
    finally:
        for process in started:
            process.terminate()
            theirs += process.communicate()[0].split()


def _steps(mission: Any, allocator: str | None) -> tuple[list[crew.Step], dict[str, Any]]:
    """What is to be imported, the longest first, and what changes in the mission."""
    if mission is None and allocator is not None:
        return [("allocation", allocator)], {}
    if mission is None:
        parts = [(layer, kind) for layer in catalogue.FOLDERS for kind in catalogue.names(layer)]
        return crew.ordered(parts, [*crew.FLIGHT, *STUDIES]), {}
    if allocator is None:
        return crew.steps_of(_table(mission)), {}
    return crew.steps_of(_table(mission), ("allocation", allocator)), {"allocation.kind": allocator}


def _load(table: dict[str, Any], changes: dict[str, Any]) -> None:
    """With whatever is still missing, or wrong."""
    from colift.mission.load import load_mission  # which imports the loop

    load_mission(table, changes)


def _table(mission: Any) -> dict[str, Any]:
    if isinstance(mission, Mapping):
        return dict(mission)
    resolved = getattr(mission, "resolved", None)
    return resolved() if resolved else catalogue.read_source(mission)[1]
