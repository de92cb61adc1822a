"""The paper's block diagram, and the world around it, as one loop over physics steps (paper fig. 2).

    supervision -> reference -> load control -> allocation -> link -> position control -> attitude control
        ^                                                                                   |
    estimation <- sensing <- plant <- disturbances, actuation  <----------------------------+

In a team without a leader network and agents (:mod:`colift.flight.agents`) stand where allocation and link do.
The loop is compiled when every part is, and runs as plain Python otherwise: same code, `advance` or
`advance.py_func`.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.extending import register_jitable
from numpy.typing import NDArray

from colift.catalogue import LAYERS
from colift.control.allocation.base import INFO_SIZE, Status
from colift.errors import ColiftError
from colift.flight import agents
from colift.kernel.by_reference import named_signals, signals_type
from colift.kernel.jit import f8, i8, kernel, matrix, monotonic_ns
from colift.kernel.load import add_arms, add_wanted_arms, ends_of, is_rigid
from colift.kernel.math.leaning import leaned
from colift.kernel.math.winch import paid_out
from colift.kernel.ports import MAX_DISTURBANCES, PORTS, Wire, named, type_of
from colift.kernel.signals import CYCLE_SIGNALS, named_tuple
from colift.world.disturbance import push

Array = NDArray[np.float64]

FUNCTIONS = {
    **{layer: (layer, "kernel") for layer in LAYERS},
    "plant_observe": ("plant", "observe"),
}
"""Layer and name of the function behind each port of which a flight has one."""


Wires = named_tuple("Wires", FUNCTIONS, __name__)
"""One :class:`~colift.kernel.ports.Wire` a port."""
Common = named_signals(
    "Common",
    dict.fromkeys([
        "row", "tensions", "allocator_up", "allocator_info", "wind", "external_forces", "external_moment",
        "peak_tensions", "catch_impulses", "touch_speeds", "carrying", "clock", "clock_bends", "lean", "formations", "formation", "reference",
        "reference_attitude", "reference_rates", "nominal_forces", "attachments",
        "estimated_load", "estimated_load_attitude", "estimated_load_rates", "estimated_ends", "wanted_ends", "reference_shift",
        "lift_share", "unhooked", "attached", "winches", "reeled", *agents.SIGNALS,
    ]),
    __name__,
)  # fmt: skip
"""What the loop itself sees and writes of the bus."""


class Periods(NamedTuple):
    """Physics step (s) and each layer's period, in physics steps."""

    step: float
    load_control: int
    allocation: int
    position_control: int
    attitude_control: int
    recording: int


CYCLE_WIDTH = len(CYCLE_SIGNALS)
_SILENT = int(Status.SILENT)

SIGNATURE = i8(
    i8,
    i8,
    named([f8] + [i8] * 5, Periods),
    named([PORTS[name].type for name in Wires._fields], Wires),
    i8,
    i8,
    types.UniTuple(PORTS["disturbance"].type, MAX_DISTURBANCES),
    signals_type(Common, [type_of(name) for name in Common._fields]),
    matrix,
    matrix,
)

# Compiled code knows functions by the names of this file.
_observe, _step = PORTS["plant_observe"].invoke, PORTS["plant"].invoke
_sense, _estimate = PORTS["sensing"].invoke, PORTS["estimation"].invoke
_supervise = PORTS["supervision"].invoke
_refer, _control_load = PORTS["reference"].invoke, PORTS["load_control"].invoke
_allocate, _transmit = PORTS["allocation"].invoke, PORTS["link"].invoke
_observe_forces = PORTS["observation"].invoke
_control_position = PORTS["position_control"].invoke
_control_attitude = PORTS["attitude_control"].invoke
_actuate, _detect = PORTS["actuation"].invoke, PORTS["detection"].invoke
_disturb = PORTS["disturbance"].invoke
_wish, _decide, _has_left = agents.wish, agents.decide, agents.has_left
_ALONE = agents.ALONE


@register_jitable  # plain Python in the plain loop
def follow_clock(course, t, rigid, bus):  # type: ignore[no-untyped-def]
    """From derivatives along the reference's clock to those in time; shifted, and leaning where the load is rigid.

    Of ``x(c(t))`` the derivatives are ``x' c'``, ``x" c'^2 + x' c"`` and ``x"' c'^3 + 3 x" c' c" + x' c"'``.
    """
    r, r1, r2 = bus.clock[1], bus.clock_bends[0], bus.clock_bends[1]
    wanted, shift = course.reference, bus.reference_shift
    for j in range(3):
        x1, x2, x3 = wanted[1, j], wanted[2, j], wanted[3, j]
        bus.reference[0, j] = wanted[0, j] + shift[0, j]
        bus.reference[1, j] = r * x1 + shift[1, j]
        bus.reference[2, j] = r * r * x2 + r1 * x1 + shift[2, j]
        bus.reference[3, j] = r * r * r * x3 + 3.0 * r * r1 * x2 + r2 * x1 + shift[3, j]
    for i in range(bus.nominal_forces.shape[0]):
        for j in range(3):
            w1, w2 = course.nominal_forces[i, 1, j], course.nominal_forces[i, 2, j]
            bus.nominal_forces[i, 0, j] = course.nominal_forces[i, 0, j]
            bus.nominal_forces[i, 1, j] = r * w1
            bus.nominal_forces[i, 2, j] = r * r * w2 + r1 * w1
    if rigid:
        for j in range(4):
            bus.reference_attitude[j] = course.reference_attitude[j]
        for j in range(3):
            w0, w1, w2 = (
                course.reference_rates[0, j],
                course.reference_rates[1, j],
                course.reference_rates[2, j],
            )
            bus.reference_rates[0, j] = r * w0
            bus.reference_rates[1, j] = r * r * w1 + r1 * w0
            bus.reference_rates[2, j] = r * r * r * w2 + 3.0 * r * r1 * w1 + r2 * w0
        share = leaned(bus.lean, t, bus.reference_attitude, bus.reference_rates)
        for i in range(bus.formation.shape[0]):
            for j in range(3):
                before, after = bus.formations[i, 0, j], bus.formations[i, 1, j]
                bus.formation[i, j] = before + share * (after - before)


@kernel(SIGNATURE, counted=False)
def advance(first, last, every, wires, leaderless, disturbances, disturbing, bus, log, cycles):  # type: ignore[no-untyped-def]
    """Run physics steps ``first <= k < last``; return the step reached.

    It ends early, after a whole step, when a drone is judged lost: the caller regroups. The rows of ``log`` and
    ``cycles`` are those due from ``first`` on. ``leaderless`` is one of :data:`colift.flight.agents.CENTRAL` and its like. Of the wires
    ``disturbing`` the first ``disturbances`` are in use.
    """
    dt = every.step
    n = bus.tensions.shape[0]
    rigid = is_rigid(bus.attachments)
    first_row = (first + every.recording - 1) // every.recording
    first_cycle = (first + every.allocation - 1) // every.allocation
    for k in range(first, last):
        t = k * dt
        for i in range(n):
            length, rate, bend = paid_out(bus.winches, i, t)
            bus.reeled[i, 0], bus.reeled[i, 1], bus.reeled[i, 2] = length, rate, bend
        _observe(wires.plant_observe, k, t, dt)
        _sense(wires.sensing, k, t, dt)
        _estimate(wires.estimation, k, t, dt)
        ends_of(bus.estimated_load, bus.estimated_ends)
        if rigid:
            turn = bus.estimated_load_rates
            add_arms(
                bus.attachments, bus.estimated_load_attitude, turn[0], turn[1], turn[2],
                bus.estimated_ends,
            )  # fmt: skip
        _supervise(wires.supervision, k, t, dt)
        _refer(wires.reference, k, bus.clock[0], dt)
        follow_clock(wires.reference.writes, t, rigid, bus)
        ends_of(bus.reference, bus.wanted_ends)
        if rigid:
            add_wanted_arms(
                bus.attachments, bus.reference_attitude, bus.reference_rates, bus.wanted_ends
            )

        if k % every.load_control == 0:
            if leaderless:
                _wish(wires.load_control, bus, k, t, every.load_control * dt)
            else:
                _control_load(wires.load_control, k, t, every.load_control * dt)

        if k % every.allocation == 0:
            row = k // every.allocation - first_cycle
            if leaderless:  # nobody answers for all: what an allocator says of itself is not known
                begin = monotonic_ns()
                cycle = k // every.allocation
                _decide(
                    wires.network, wires.agents, wires.allocation, bus, leaderless, cycle, t,
                    every.allocation * dt,
                )  # fmt: skip
                end = monotonic_ns()
                cycles[row, :] = np.nan
                cycles[row, 1 + INFO_SIZE] = (end - begin) * 1e-9
            elif bus.allocator_up[0] != 0.0:
                begin = monotonic_ns()
                status = _allocate(wires.allocation, k, t, every.allocation * dt)
                end = monotonic_ns()
                cycles[row, 0] = status
                for m in range(INFO_SIZE):
                    cycles[row, 1 + m] = bus.allocator_info[m]
                cycles[row, 1 + INFO_SIZE] = (end - begin) * 1e-9
            else:  # nothing was asked, so nothing was measured
                cycles[row, :] = np.nan
                cycles[row, 0] = _SILENT

        if not leaderless:
            for i in range(n):
                wires.link.sees.desired_tensions[i] = bus.lift_share[0] * bus.desired_tensions[i]
            _transmit(wires.link, k, t, dt)

        if k % every.position_control == 0:
            _observe_forces(wires.observation, k, t, every.position_control * dt)
            _control_position(wires.position_control, k, t, every.position_control * dt)
            _detect(wires.detection, k, t, every.position_control * dt)

        if k % every.attitude_control == 0:
            _control_attitude(wires.attitude_control, k, t, every.attitude_control * dt)

        _actuate(wires.actuation, k, t, dt)
        for i in range(n):
            if bus.unhooked[i] != 0.0 or (leaderless == _ALONE and bus.carrying[i] == 0.0):
                bus.attached[i] = 0.0
        bus.wind[:] = 0.0
        bus.external_forces[:] = 0.0
        bus.external_moment[:] = 0.0
        for m in range(disturbances):
            _disturb(disturbing[m], k, t, dt)
        _step(wires.plant, k, t, dt)

        if k % every.recording == 0:
            row = k // every.recording - first_row
            for m in range(bus.row.shape[0]):
                log[row, m] = bus.row[m]
            bus.peak_tensions[:] = 0.0
            bus.catch_impulses[:] = 0.0
            bus.touch_speeds[:] = 0.0
        for i in range(n):
            if _has_left(bus, leaderless, i):
                return k + 1
    return last


@dataclass(frozen=True)
class Circuit:
    """All that the loop calls, wired to one bus."""

    wires: Any
    leaderless: int
    disturbances: tuple[Wire, ...]
    common: Any

    @cached_property
    def compiled(self) -> bool:
        """Whether every kernel is compiled, and so the loop can be."""
        return all(is_compiled(wire.kernel) for wire in (*self.wires, *self.disturbances))

    @cached_property
    def arguments(self) -> tuple[Any, ...]:
        """As :func:`advance` takes them, compiled or not."""
        leaderless, used = self.leaderless, len(self.disturbances)
        if not self.compiled:
            return self.wires, leaderless, used, self.disturbances, self.common
        wires = type(self.wires)(*(wire.compiled() for wire in self.wires))
        port, found = PORTS["disturbance"], [wire.compiled() for wire in self.disturbances]
        spare = port.wire(push.Push.kernel, np.zeros(0), np.zeros(0), port.signals(1)).compiled()
        filled = (*found, *[spare] * (MAX_DISTURBANCES - used))
        return wires, leaderless, used, filled, self.common

    def keyed(self, keys: Mapping[str, int], disturbing: Iterable[int]) -> Circuit:
        """The same with other random numbers: a key for each layer, and for each disturbance."""
        wires = {
            name: getattr(self.wires, name)._replace(key=keys[layer])
            for name, (layer, _) in FUNCTIONS.items()
        }
        others = zip(self.disturbances, disturbing, strict=True)
        return replace(
            self,
            wires=Wires(**wires),
            disturbances=tuple(wire._replace(key=key) for wire, key in others),
        )


def circuit(
    bus: Any,
    parts: Mapping[str, Any],
    keys: Mapping[str, int],
    params: Mapping[str, Array],
    memory: Mapping[str, Array],
    disturbances: Iterable[tuple[type, int, Array, Array]],
) -> Circuit:
    """Wire the parts of all layers, and disturbances with key, parameters and memory, to a bus.

    Raises
    ------
    ColiftError
        For a compiled kernel that was not compiled for its layer's signature.

    """
    signals = bus._asdict()
    # The reference writes along its clock, into arrays of its own; the loop makes those of the bus of them.
    course = {name: signals[name].copy() for name in PORTS["reference"].writes}
    # Supervisors see it as it is; what the cables are told is the supervisor's share of the wanted tensions.
    own = {
        "reference": signals | course,
        "supervision": signals | {"reference": course["reference"]},
        "link": signals | {"desired_tensions": signals["desired_tensions"].copy()},
        "agents": agents.first_of(signals),
    }
    wires = {
        name: PORTS[name].wire(
            _checked(layer, parts[layer], function, PORTS[name].signature),
            params[layer], memory[layer], own.get(name, signals), key=keys[layer],
        )
        for name, (layer, function) in FUNCTIONS.items()
    }  # fmt: skip
    port = PORTS["disturbance"]
    others = tuple(
        port.wire(
            _checked("disturbance", part, "kernel", port.signature), own, kept, signals, key=key
        )
        for part, key, own, kept in disturbances
    )
    common = Common(*(signals[name] for name in Common._fields))
    decides, alone = parts["agents"].decides, parts["detection"].of_itself
    leaderless = agents.CENTRAL if not decides else agents.ALONE if alone else agents.TOLD
    return Circuit(Wires(**wires), leaderless, others, common)


def is_compiled(function: Any) -> bool:
    """Whether a part's kernel is compiled (and so can go into the compiled loop)."""
    return hasattr(function, "py_func")


def _checked(layer: str, part: type, name: str, wanted: Any) -> Any:
    function = getattr(part, name)
    offered = getattr(function, "nopython_signatures", [wanted])
    if (wanted.args, wanted.return_type) not in [(s.args, s.return_type) for s in offered]:
        raise ColiftError(
            f"{layer} part {part.__name__}: its {name} is compiled for "
            f"{', '.join(map(str, offered)) or 'nothing'}, but this layer's functions have "
            f"the signature {wanted} (see colift.kernel.ports)"
        )
    return function
