"""What the figures were measured on."""

from __future__ import annotations

import os
import platform
from importlib import metadata
from typing import Any

from colift.record.recording import versions

SOLVERS = ("scipy", "casadi", "daqp")


def machine() -> dict[str, Any]:
    """Processor, cores and versions."""
    model = platform.processor()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:
            model = next(
                line.split(":", 1)[1].strip() for line in file if line.startswith("model name")
            )
    except (OSError, StopIteration):
        pass
    found = {}
    for name in SOLVERS:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return {"processor": model, "cores": os.cpu_count(), **versions(), **found}
