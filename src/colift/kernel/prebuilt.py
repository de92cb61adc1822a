"""Machine code that comes with colift, so that nothing has to be compiled at the first use.

A kernel is compiled for the processor at hand, and kept. A wheel for one platform (``hatch_build.py``) holds what ``colift compile``
makes for a processor that most machines of it have; whoever has none of these compiles as ever, and so does another version of Numba or of
the sources. What was compiled for the processor at hand goes before.
"""

from __future__ import annotations

import platform
from functools import cache
from pathlib import Path
from typing import Any

from llvmlite import binding as llvm
from numba.core import caching

FOLDER = Path(__file__).parents[1] / "_compiled"
COMMON = {
    "x86_64": ("x86-64-v3", "+avx,+avx2,+bmi,+bmi2,+cx16,+f16c,+fma,+lzcnt,+movbe,+popcnt,+sse4.2")
}
"""By kind of machine, LLVM's name of the processor that its wheel is for, and what that has: here any since 2015, about."""


@cache
def processor() -> tuple[str, str] | None:
    """Name and features of the processor that machine code may come for, if this one can run it."""
    name, features = COMMON.get(platform.machine(), ("", ""))
    has = llvm.get_host_cpu_features()
    return (
        (name, features)
        if name and all(has.get(each[1:]) for each in features.split(","))
        else None
    )


def load(cached: Any, signature: Any, target_context: Any) -> Any:
    """Of the kernel of a cache the machine code that came along; None where none did."""
    if not FOLDER.is_dir() or (common := processor()) is None:
        return None
    signature, (triple, *_), code = cached._index_key(signature, target_context.codegen())
    own = Path(cached._cache_path)
    file = caching.IndexDataCacheFile(
        str(FOLDER / own.parent.name / own.name), cached._impl.filename_base, cached._impl.locator.get_source_stamp()
    )  # fmt: skip
    found = file.load((signature, (triple, *common), code))
    return None if found is None else cached._impl.rebuild(target_context, found)
