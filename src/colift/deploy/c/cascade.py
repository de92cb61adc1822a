"""Layers of a mission as one function of C: from measurements to each drone's thrust and moment.

The layers are called as :mod:`colift.flight.loop` calls them, each at its own period, with nothing between allocator and drones. Where the load
is a point: all cables end there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from colift.deploy.c.program import wrapped
from colift.deploy.c.templates import template
from colift.deploy.c.vectors import fields_of, folded, hexadecimal
from colift.flight.flight import Flight
from colift.kernel.ports import PORTS
from colift.part import make

if TYPE_CHECKING:
    from colift.deploy.c.export import Layer
    from colift.mission.mission import Mission

LAYERS = ("load_control", "allocation", "observation", "position_control", "attitude_control")
"""In the order in which they are called."""
COURSE = ("supervision", "reference")
"""What is called before them where the function also knows what is wanted."""
STEPS = 50
"""Physics steps in the test."""
GIVEN = ("estimated_ends", "wanted_ends", "received_tensions", "received_directions", "received_ages")  # fmt: skip
"""What the step itself makes of the load, the reference and the allocator's answer."""
ANSWERS = ("thrusts", "torques")


ALONG_THE_CLOCK = ("reference", "nominal_forces", "reference_attitude", "reference_rates")
"""What a reference writes by its own clock, into ``course_...``; the loop makes the signals of these names of it."""


class Cascade:
    """Of a mission.

    Parameters
    ----------
    mission : Mission
        Its link is taken for an ideal one.
    layers : sequence of Layer
        All that are exported; :meth:`possible` says whether they will do.
    names : sequence of str
        Of the layers that the function calls.
    step : float, optional
        Time from one call to the next, s; the mission's step if not given.
    named : (str, str)
        Names of the struct and of the function.

    """

    def __init__(
        self, mission: Mission, layers: Sequence[Layer], names: Sequence[str] = LAYERS, *,
        step: float | None = None, named: tuple[str, str] = ("colift_cascade", "colift_step"),
    ) -> None:  # fmt: skip
        found = {layer.name: layer for layer in layers}
        self.mission, self.layers, self.named = mission, [found[name] for name in names], named
        self.flight = Flight(mission.model_copy(update={"link": make("link", {"kind": "ideal"})}))
        self.n, self.step = len(self.flight.drones), step or mission.timing.step
        self.program = self.layers[0].kernel.program
        written = [name for each in self.layers for name in self._fields(each, "writes")]
        seen = [name for each in self.layers for name in self._fields(each, "sees")]
        self.given = GIVEN if "allocation" in names else ()
        inner = [*dict.fromkeys([*written, *self.given])]
        if "reference" in names:
            inner += [name for name in ALONG_THE_CLOCK if name not in inner]
        more = ("lift_share",) if self.given else ()
        self.inputs = [name for name in dict.fromkeys([*seen, *more]) if name not in inner]
        self.sizes = {name: self._size(name) for name in (*self.inputs, *inner)}
        before = {name: values.copy() for name, values in self.values().items()}
        self.flight.advance(mission.timing.step)  # in which is measured
        self.begin = before | {name: self.values()[name].copy() for name in self.inputs}

    @staticmethod
    def _fields(layer: Layer, what: str) -> list[str]:
        """Fields of the struct that a layer sees or writes, in the order of its port."""
        names = fields_of(getattr(layer.kernel, what))
        own = layer.name == "reference" or (layer.name == "supervision" and what == "sees")
        return [f"course_{name}" if own and name in ALONG_THE_CLOCK else name for name in names]

    @staticmethod
    def possible(mission: Mission, layers: Sequence[Layer]) -> bool:
        """Whether all its layers are there, one allocator answers for all, and the load is a point."""
        names = {layer.name for layer in layers}
        return (
            names.issuperset(LAYERS)
            and mission.team.body is None
            and not type(mission.agents).decides
        )

    def _size(self, name: str) -> int:
        name = name.removeprefix("course_")
        table = next(p.table for p in PORTS.values() if name in p.table)
        return int(np.prod(table[name].shape_for(self.n)))

    def values(self) -> dict[str, Any]:
        """The signals now, by name, flat."""
        found: dict[str, Any] = {}
        for layer in self.layers:  # the bus's: the reference and the link have arrays of their own
            wire = getattr(self.flight.wires, layer.name)
            for what in ("writes", "sees"):
                each = getattr(wire, what)
                names = zip(self._fields(layer, what), fields_of(getattr(layer.kernel, what)), strict=True)  # fmt: skip
                found |= {name: np.ravel(getattr(each, own)) for name, own in names if name in self.sizes}  # fmt: skip
        return found

    def files(self, *, example: bool = True) -> dict[str, str]:
        """Header, source and example by name."""
        struct, function = self.named
        first = ("supervision", "reference", "load_control", "allocation")
        calls = {each.name: self._call(each) for each in self.layers}
        marks = {
            "REAL": self.program.real, "INPUTS": self._declared(self.inputs),
            "INNER": self._declared([name for name in self.sizes if name not in self.inputs]),
            "MEMORY": "\n".join(
                f"    {self.program.real} {each.name}_memory[{max(each.memory.size, 1)}];" for each in self.layers
            ),
            "STEP": self.program.number(self.step), "START": self._start(),
            "COURSE": "\n".join(calls[name] for name in COURSE if name in calls),
            "CALLS": "\n".join(calls[name] for name in first[2:] if name in calls),
            "MORE": "\n".join(text for name, text in calls.items() if name not in first),
            "NAME": struct, "GUARD": f"{struct.upper()}_H", "FUNCTION": function,
        }  # fmt: skip
        marks["PERIOD"] = f"{function.upper()}" if struct != "colift_cascade" else "COLIFT"
        blocks = {"ENDS": bool(self.given), "CLOCK": "reference" in calls}
        names = {f"{struct}.h": "colift_cascade.h", f"{struct}.c": "colift_cascade.c"}
        if example:
            names["example_cascade.c"] = "example_cascade.c"
        return {name: template(of, marks, blocks) for name, of in names.items()}

    def _declared(self, names: Sequence[str]) -> str:
        return "\n".join(f"    {self.program.real} {name}[{self.sizes[name]}];" for name in names)

    def _start(self) -> str:
        number = self.program.number
        lines = [
            f"    c->{name}[{k}] = {number(float(self.begin[name][k]))};"
            for name in self.sizes
            for k in np.flatnonzero(self.begin[name])
        ]
        return "\n".join([*lines, *(f"    colift_{e.name}_start(c->{e.name}_memory);" for e in self.layers)])  # fmt: skip

    def _call(self, layer: Layer) -> str:
        kernel, name = layer.kernel, layer.name
        sees, writes = ("".join(f", c->{f}" for f in self._fields(layer, k)) for k in ("sees", "writes"))  # fmt: skip
        more = "".join(f", {getattr(layer, each).size}" for each in kernel.made.lengths)
        status = "c->status = " if PORTS[name].answers else ""
        call = f"{status}{kernel.name}(&now, &sees, colift_{name}_params, c->{name}_memory, &writes{more});"
        at = "c->clock[0]" if name == "reference" else "time"
        body = [
            f"        const colift_now now = {{step, {at}, {self.program.number(layer.period)}}};",
            f"        const colift_{name}_sees sees = {{COLIFT_DRONES{sees}}};",
            f"        const colift_{name}_writes writes = {{COLIFT_DRONES{writes}}};",
            f"        {call}",
        ]
        every = round(layer.period / self.step)
        head = f"    if (step % {every} == 0) {{" if every > 1 else "    {"
        return "\n".join([head, *(wrapped(line) for line in body), "    }"])

    def test(self) -> tuple[str, str]:
        """What a flight measured and wanted, step by step, as a table; and the function that compares."""
        rows = []
        for _ in range(STEPS):
            values = self.values()
            rows.append(np.concatenate([values[name] for name in (*self.inputs, *ANSWERS)]))
            self.flight.advance(self.step)
            if len(self.flight.drones) != self.n:
                break
        table = [f"static const double cascade_steps[{len(rows)}][{rows[0].size}] = {{"]
        for row in rows:
            table += ["    {", *folded([hexadecimal(v, single=False) for v in row]), "    },"]
        take = "\n".join(
            f"        copy(c.{name}, at, {size});\n        at += {size};"
            for name, size in ((name, self.sizes[name]) for name in self.inputs)
        )
        marks: Mapping[str, str] = {"TAKE": take, "STEPS": str(len(rows))}
        return "\n".join([*table, "};", ""]), template("test_cascade.c", marks).rstrip()
