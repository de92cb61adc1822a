"""Calls of kernels with the answers of Python's, and a program in C that compares."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from colift.deploy.c.templates import template
from colift.deploy.c.types import NOTHING
from colift.kernel.ports import PORTS

if TYPE_CHECKING:
    from colift.deploy.c.export import Layer
    from colift.flight.flight import Flight


class Vectors:
    """Of some layers along a flight.

    Each call is a row of numbers: step, time, dt, what it sees, what it finds of what it wrote last, memory before, and then
    status, what it wrote, and memory.
    """

    def __init__(
        self, flight: Flight, layers: Sequence[Layer], calls: int, *, single: bool = False
    ) -> None:
        self.layers, self.single, self.n = layers, single, len(flight.drones)
        self.rows: dict[str, list[Any]] = {layer.name: [] for layer in layers}
        span = min(flight.mission.timing.duration, 10.0) / calls
        for _ in range(calls):
            for layer in layers:
                self.rows[layer.name].append(_call(flight, layer))
            if len(flight.drones) == self.n:
                flight.advance(span)
            if len(flight.drones) != self.n:  # what is exported is the team of the start
                break

    def data(self) -> str:
        """The numbers, as a header."""
        real = self.layers[0].kernel.program.real
        lines = ["// Calls of the kernels and Python's answers."]
        for layer in self.layers:
            rows = self.rows[layer.name]
            lines += [f"static const {real} {layer.name}_calls[{len(rows)}][{rows[0].size}] = {{"]
            for row in rows:
                lines += ["    {", *folded([hexadecimal(v, self.single) for v in row]), "    },"]
            lines += ["};", ""]
        return "\n".join(lines)

    def program(self, further: Mapping[str, str]) -> str:
        """The program that calls the kernels and compares; ``further`` tests by name."""
        real = self.layers[0].kernel.program.real
        made = {layer.name: self._test(layer, real) for layer in self.layers} | dict(further)
        tests = "\n\n".join(made.values())
        calls = "\n".join(f"    wrong += test_{name}();" for name in made)
        within = "1e-3f" if self.single else "0.0"
        return template(
            "test.c",
            {
                "HEADER": "colift_cascade.h" if further else "colift.h",
                "TESTS": tests,
                "CALLS": calls,
                "REAL": real,
                "WITHIN": within,
                "PULLS": _PULLS if self.single else "",
            },
        )

    def _test(self, layer: Layer, real: str) -> str:
        """The function that tests one kernel."""
        port, kernel = PORTS[layer.name], layer.kernel
        sees, writes = fields_of(kernel.sees), fields_of(kernel.writes)
        sizes = {
            name: int(np.prod(port.table[name].shape_for(self.n))) for name in (*sees, *writes)
        }
        written, memory = sum(sizes[name] for name in writes), layer.memory.size
        more = "".join(f", {getattr(layer, each).size}" for each in kernel.made.lengths)
        call = f"{kernel.name}(&now, &sees, colift_{layer.name}_params, memory, &writes{more})"
        differs = (
            f"differs(written, at + 1, {written}) || differs(memory, at + 1 + {written}, {memory})"
        )
        if port.answers and self.single:
            # Where the optimum is a family, and on the way to it, single precision goes its own way.
            differs = f"pulls_otherwise(written, at + 1, {self.n})"
        marks = {
            "LAYER": layer.name, "REAL": real, "NAME": kernel.name, "SEES": _places("at", sees, sizes),
            "WRITES": _places("written", writes, sizes), "SEEN": str(sum(sizes[name] for name in sees)),
            "WRITTEN": str(written), "MEMORY": str(memory), "DIFFERS": differs,
            "CALL": f"status = {call}" if port.answers else call,
        }  # fmt: skip
        return template("test_kernel.c", marks).rstrip()


_PULLS = """// The same force on the load, from n tensions and behind them n directions
static int pulls_otherwise(const float *found, const float *wanted, int n)
{
    float sums[2][3] = {{0}};
    for (int i = 0; i < n; ++i) {
        for (int k = 0; k < 3; ++k) {
            sums[0][k] += found[i] * found[n + 3 * i + k];
            sums[1][k] += wanted[i] * wanted[n + 3 * i + k];
        }
    }
    return differs(sums[0], sums[1], 3);
}

"""
"""For allocators in single precision."""


def fields_of(kind: Any) -> list[str]:
    """Names of the arrays of a struct."""
    return [
        name for name, each in zip(kind.made._fields, kind.each, strict=True) if each != NOTHING
    ]


def _places(base: str, names: Sequence[str], sizes: dict[str, int]) -> str:
    found, at = "", 0
    for name in names:
        found += f", {base} + {at}" if at else f", {base}"
        at += sizes[name]
    return found


def _call(flight: Flight, layer: Layer) -> Any:
    """One call on a copy of all that the layer sees now, as a row."""
    wire, port = getattr(flight.wires, layer.name), PORTS[layer.name]
    sees, writes = (type(each)(*(a.copy() for a in each)) for each in (wire.sees, wire.writes))
    memory = wire.memory.copy()
    step, time = round(flight.time / flight.mission.timing.step), flight.time

    def flat(of: Any, kind: Any) -> list[Any]:
        return [getattr(of, name).ravel() for name in fields_of(kind)]

    before = [*flat(sees, layer.kernel.sees), *flat(writes, layer.kernel.writes), memory.copy()]
    before = [each.copy() for each in before]
    copy = wire._replace(sees=sees, writes=writes, memory=memory)
    status = port.invoke(copy, step, time, layer.period)
    after = [*flat(writes, layer.kernel.writes), memory]
    return np.concatenate([[step, time, layer.period], *before, [status or 0], *after])


def hexadecimal(value: float, single: bool) -> str:
    """A number as it is, in every bit."""
    if np.isnan(value):
        return "NAN"
    if np.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    if value == int(value) and abs(value) < 1e6 and not (value == 0 and np.signbit(value)):
        return f"{value:.1f}{'f' if single else ''}"
    return f"{float(np.float32(value)).hex()}f" if single else float(value).hex()


def folded(words: Sequence[str], width: int = 100) -> list[str]:
    """Words in lines, with a comma behind each."""
    lines, line = [], "       "
    for word in words:
        if len(line) + len(word) + 2 > width:
            lines.append(line)
            line = "       "
        line += f" {word},"
    return [*lines, line]
