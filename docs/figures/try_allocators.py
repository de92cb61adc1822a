"""Write docs/try/allocators.json: the paper's and the safe allocator as WebAssembly, and what a page must know to call them.

python docs/figures/try_allocators.py

Needs the Debian packages that ``colift.deploy.c.machines`` names for WebAssembly.
"""

from __future__ import annotations

import ast
import hashlib
import inspect
import json
import subprocess
import tempfile
from base64 import b64encode
from itertools import pairwise
from pathlib import Path
from typing import Any

from pages import DOCS

from colift.control.allocation import base
from colift.control.allocation.base import Status
from colift.control.allocation.limits import cycle, distance
from colift.control.allocation.safe import Safe
from colift.control.allocation.sqp import PARAMS, Sqp
from colift.deploy.c.header import header_of
from colift.deploy.c.kernels import Kernel
from colift.deploy.c.machines import MACHINES
from colift.kernel.layout import Layout
from colift.record.moments import status_word
from colift.team import Team

DRONES = 8
"""Most drones of the page."""
PARTS: dict[str, tuple[Any, Layout]] = {"sqp": (Sqp(), PARAMS), "safe": (Safe(mu=0.15), cycle.PARAMS)}  # fmt: skip
FILE = DOCS / "try" / "allocators.json"
CALLER = DOCS / "try" / "ask.c"
LIBRARY = ("-nostartfiles", "-Wl,--no-entry", "-Wl,--strip-all", "-lm")


def sources() -> dict[str, str]:
    """The C files by name."""
    files = {CALLER.name: CALLER.read_text("utf-8")}
    for kind, (part, _) in PARTS.items():
        kernel = Kernel(type(part), kind)
        files |= {f"{kind}.h": header_of([kernel]), f"{kind}.c": kernel.file(f"{kind}.h")}
    return files


def digest(files: dict[str, str]) -> str:
    """What tells these sources from any others."""
    return hashlib.sha256("\0".join(sorted(files.values())).encode()).hexdigest()


def compiler() -> str:
    """The compiler's version."""
    command = [MACHINES["wasm"].compiler[0], "--version"]
    done = subprocess.run(command, check=True, text=True, stdout=subprocess.PIPE)
    return done.stdout.splitlines()[0]


def compiled(files: dict[str, str]) -> bytes:
    """The WebAssembly."""
    team, command = Team.uniform(DRONES), MACHINES["wasm"].compiler
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        for kind, (part, _) in PARTS.items():
            sizes = f"-DPARAMS={part.params(team).size}", f"-DMEMORY={part.memory(team).size}"
            told = f"-DKIND={kind}", f"-DKERNEL=colift_allocation_{kind}", f'-DHEADER="{kind}.h"'
            for source, flags in ((f"{kind}.c", ()), (CALLER.name, (*told, *sizes, f"-DDRONES={DRONES}"))):  # fmt: skip
                made = f"{kind}_{source}.o"
                subprocess.run([*command, *flags, "-c", source, "-o", made], cwd=folder, check=True)
        objects = [f"{kind}_{name}.o" for kind in PARTS for name in (f"{kind}.c", CALLER.name)]
        subprocess.run([*command, *objects, *LIBRARY, "-o", "all.wasm"], cwd=folder, check=True)
        return (Path(folder) / "all.wasm").read_bytes()


def _meanings() -> list[str]:
    """The docstring below each status."""
    (definition,) = ast.parse(inspect.getsource(Status)).body
    assert isinstance(definition, ast.ClassDef)
    pairs = pairwise(definition.body)
    return [
        " ".join(ast.literal_eval(text.value).split())
        for each, text in pairs
        if isinstance(each, ast.Assign) and isinstance(text, ast.Expr)
    ]


def told() -> dict[str, Any]:
    """Places and values of parameters, what statuses mean, places of what an allocator says of itself."""
    found: dict[str, Any] = {
        "drones": DRONES, "cause": distance.ANGLE, "statuses": [[status_word(code), text] for code, text in enumerate(_meanings())],
        "info": {name.removeprefix("INFO_").lower(): getattr(base, name) for name in vars(base)
                 if name.startswith("INFO_") and name != "INFO_SIZE"},
    }  # fmt: skip
    for kind, (part, layout) in PARTS.items():
        params = part.params(Team.uniform(2))[: layout.size(2)]
        found[kind] = {
            "places": {**layout.at._asdict()},
            "memory": part.memory(Team.uniform(DRONES)).size,
            "team": {name: layout.view(params, name)[0] for name in layout.team},
            "drone": {name: layout.view(params, name)[0, 0] for name in layout.drone},
        }
    return found


def main() -> None:
    """Write the file."""
    files = sources()
    found = told() | {
        "sources": digest(files), "compiler": compiler(), "wasm": b64encode(compiled(files)).decode(),
    }  # fmt: skip
    FILE.write_text(json.dumps(found, indent=1, allow_nan=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
