"""The kernel of a part, in C: its file, and the types through which it is called."""

from __future__ import annotations

from typing import Any

import numpy as np

from colift.deploy.c.program import Program
from colift.deploy.c.translate import Translation
from colift.deploy.c.types import INT, NOTHING, REAL, Array, Tuple, size
from colift.kernel.ports import PORTS, Now, Port
from colift.part import Part

_NOW = Tuple((INT, REAL, REAL, NOTHING), Now)


class Kernel:
    """Of one part.

    Parameters
    ----------
    part : class of parts
    kind : str
        Its name among those of its layer.
    single : bool
        Numbers of single precision.

    """

    def __init__(self, part: type[Part], kind: str, *, single: bool = False) -> None:
        self.port = PORTS[part.layer]
        self.name = f"colift_{part.layer}_{kind}".replace("-", "_")
        self.program = Program(single=single)
        self.sees = _seen(self.port, self.port.Sees, const=True)
        self.writes = _seen(self.port, self.port.Writes, const=False)
        for name, made in (("sees", self.port.Sees), ("writes", self.port.Writes)):
            self.program.share(made, f"colift_{part.layer}_{name}", _lengths(self.port, made))
        self.program.share(Now, "colift_now", {})
        kernel: Any = part.kernel
        kinds = (_NOW, self.sees, Array(const=True), Array(), self.writes)
        self.made = Translation(self.program, kernel.py_func, kinds, self.name)

    def types(self) -> str:
        """The structs of what it sees and writes."""
        return "\n\n".join(
            f"typedef struct {{\n    int n; // number of drones\n{self.program.fields(kind)}\n}} "
            f"{self.program.spelled(kind)};"
            for kind in (self.sees, self.writes)
        )

    def file(self, header: str) -> str:
        """Its C file."""
        return self.program.file([self.made], header)


def _seen(port: Port, made: Any, *, const: bool) -> Tuple:
    arrays: list[Any] = []
    for name in made._fields:
        signal = port.table[name]
        inner = tuple(each for each in signal.shape[1:] if isinstance(each, int))
        whole = len(inner) == len(signal.shape) - 1 and signal.dtype is np.float64
        arrays.append(Array(inner, size(inner), const) if whole else NOTHING)
    return Tuple(tuple(arrays), made)


def _lengths(port: Port, made: Any) -> dict[str, int | str]:
    words = {"n": "{0}->n", "n+1": "{0}->n + 1"}
    found: dict[str, int | str] = {}
    for name in made._fields:
        first = port.table[name].shape[0]
        found[name] = words[first] if isinstance(first, str) else first
    return found
