"""Compile beforehand what would be compiled at its first use: everything, or what one mission or allocator needs."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from colift import catalogue
from colift.part import find

Progress = Callable[[float, str], None]
"""Called with the share that is done, between 0 and 1, and the name of what comes next."""

FLIGHT = ("colift.flight.loop", "colift.control.reference.descent")
"""Modules with kernels that any flight may call."""
STUDIES = ("colift.study.bench.timing", "colift.study.latency", "colift.study.safety")
"""Modules with kernels that only a command of this name calls."""


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

    def tell(kernel: str) -> None:
        compiled.append(kernel)
        if progress is not None:
            progress(share, kernel)

    steps = _steps(mission, allocator)
    with jit.told_of_compilation(tell):
        for number, step in enumerate(steps):
            share = number / len(steps)
            step()
    if progress is not None:
        progress(1.0, "")
    loaded = len(jit.made) - before - len(compiled)
    return Warmed(tuple(compiled), loaded, time.perf_counter() - begin)


def _steps(mission: Any, allocator: str | None) -> list[Callable[[], object]]:
    """Imports, one after the other, that compile or load what is needed."""
    if mission is None and allocator is not None:
        return [partial(find, "allocation", allocator)]
    if mission is None:
        parts = [(layer, kind) for layer in catalogue.FOLDERS for kind in catalogue.names(layer)]
        modules = [*FLIGHT, *STUDIES]
        last: list[Callable[[], object]] = []
    else:
        changes = {} if allocator is None else {"allocation.kind": allocator}
        table = _table(mission)
        parts = (
            [*_parts(table)] if allocator is None else [("allocation", allocator), *_parts(table)]
        )
        modules = [*FLIGHT]
        last = [partial(_load, table, changes)]  # with whatever is still missing, or wrong
    known = [partial(find, *part) for part in parts if part[1] in catalogue.names(part[0])]
    return [*(partial(importlib.import_module, name) for name in modules), *known, *last]


def _load(table: dict[str, Any], changes: dict[str, Any]) -> None:
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
