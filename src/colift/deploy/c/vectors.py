"""Calls of kernels with the answers of Python's, and a program in C that compares."""

from __future__ import annotations

from collections.abc import Sequence
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
                lines += ["    {", *_folded([_hex(v, self.single) for v in row]), "    },"]
            lines += ["};", ""]
        return "\n".join(lines)

    def program(self) -> str:
        """The program that calls the kernels and compares."""
        real = self.layers[0].kernel.program.real
        tests = "\n\n".join(self._test(layer, real) for layer in self.layers)
        calls = "\n".join(f"    wrong += test_{layer.name}();" for layer in self.layers)
        return template("test.c", {"TESTS": tests, "CALLS": calls, "REAL": real})

    def _test(self, layer: Layer, real: str) -> str:
        port, kernel = PORTS[layer.name], layer.kernel
        sees, writes = _fields(kernel.sees), _fields(kernel.writes)
        sizes = {
            name: int(np.prod(port.table[name].shape_for(self.n))) for name in (*sees, *writes)
        }
        seen = sum(sizes[name] for name in sees)
        written = sum(sizes[name] for name in writes)
        memory = layer.memory.size
        lines = [f"static int test_{layer.name}(void)", "{", "    int wrong = 0;"]
        lines += [
            f"    for (int k = 0; k < (int)(sizeof({layer.name}_calls) / sizeof({layer.name}_calls[0])); ++k) {{"
        ]
        lines += [f"        const {real} *at = {layer.name}_calls[k];"]
        lines += ["        const colift_now now = {(int)at[0], at[1], at[2]};", "        at += 3;"]
        lines += [
            f"        const colift_{layer.name}_sees sees = {{COLIFT_DRONES{_places('at', sees, sizes)}}};"
        ]
        lines += [f"        {real} written[{max(written, 1)}], memory[{max(memory, 1)}];"]
        lines += [
            f"        copy(written, at + {seen}, {written});",
            f"        copy(memory, at + {seen + written}, {memory});",
        ]
        lines += [
            f"        const colift_{layer.name}_writes writes = {{COLIFT_DRONES{_places('written', writes, sizes)}}};"
        ]
        more = "".join(f", {getattr(layer, each).size}" for each in kernel.made.lengths)
        call = f"{kernel.name}(&now, &sees, colift_{layer.name}_params, memory, &writes{more})"
        lines += [f"        const int status = {call};" if port.answers else f"        {call};"]
        lines += [f"        at += {seen + written + memory};"]
        lines += ["        wrong += status != (int)at[0];" if port.answers else ""]
        lines += [
            f"        wrong += differs(written, at + 1, {written});",
            f"        wrong += differs(memory, at + {1 + written}, {memory});",
            "    }",
        ]
        lines += [
            f'    return told("{kernel.name}", wrong, (int)(sizeof({layer.name}_calls) / sizeof({layer.name}_calls[0])));',
            "}",
        ]
        return "\n".join(line for line in lines if line)


def _fields(kind: Any) -> list[str]:
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
        return [getattr(of, name).ravel() for name in _fields(kind)]

    before = [*flat(sees, layer.kernel.sees), *flat(writes, layer.kernel.writes), memory.copy()]
    before = [each.copy() for each in before]
    copy = wire._replace(sees=sees, writes=writes, memory=memory)
    status = port.invoke(copy, step, time, layer.period)
    after = [*flat(writes, layer.kernel.writes), memory]
    return np.concatenate([[step, time, layer.period], *before, [status or 0], *after])


def _hex(value: float, single: bool) -> str:
    if np.isnan(value):
        return "NAN"
    if np.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    if value == int(value) and abs(value) < 1e6 and not (value == 0 and np.signbit(value)):
        return f"{value:.1f}{'f' if single else ''}"
    return f"{float(np.float32(value)).hex()}f" if single else float(value).hex()


def _folded(words: Sequence[str], width: int = 100) -> list[str]:
    lines, line = [], "       "
    for word in words:
        if len(line) + len(word) + 2 > width:
            lines.append(line)
            line = "       "
        line += f" {word},"
    return [*lines, line]
