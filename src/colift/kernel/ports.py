"""Through which ports the layers see and write signals.

Every kernel of every part has the same five arguments::

    kernel(now, sees, params, memory, writes)

``now`` is a :class:`Now`; ``sees`` and ``writes`` hold the arrays of the signals that the layer's port
names, by name (``sees.estimated_load``); ``params`` and ``memory`` are the part's own vectors. Shapes, units
and frames are those of the signals (:data:`colift.kernel.signals.SIGNALS`). What a layer writes holds, on
entry, what it wrote last.

The kernel of an agent is called for one drone at a time, with that drone's rows (:data:`colift.kernel.signals.OF_ONE`).

A layer that is to see one more signal gets its name in :data:`PORTS`: one line, and no kernel that does not
use it changes. What a layer writes is said by the table of signals: each line names its one writer.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from colift.kernel.by_reference import named_signals, signals_type
from colift.kernel.jit import address_of, f8, i8, u1, vector, void
from colift.kernel.signals import HIDDEN, LEGEND, OF_ONE, Signal

Array = NDArray[np.float64]


class Now(NamedTuple):
    """When a kernel is called, and the key of its random numbers."""

    step: int
    """Number of the physics step."""
    time: float
    """Of that step, s."""
    dt: float
    """Since the last call, s: the physics step, or the layer's own period."""
    key: int
    """Of this part's random numbers (:mod:`colift.kernel.math.noise`)."""


class Wire(NamedTuple):
    """A kernel and all that it is called with, but for the time."""

    kernel: Any
    """The function; for compiled code its address (:func:`colift.kernel.jit.address_of`)."""
    key: int
    """Of its random numbers."""
    params: Array
    memory: Array
    sees: Any
    """The signals that it sees, by name."""
    writes: Any
    """The signals that it writes, by name."""

    def compiled(self) -> Wire:
        """The same for compiled code."""
        return self._replace(kernel=address_of(self.kernel))


def named(each: Iterable[Any], made: Any) -> Any:
    """Numba's type of a class of named tuples whose fields have these types."""
    return types.BaseTuple.from_types(tuple(each), made)


NOW_TYPE = named([i8, f8, f8, i8], Now)

_SIGNALS: dict[str, Signal] = {**LEGEND, **{signal.name: signal for signal in HIDDEN}}


def _words(name: str) -> str:
    return "".join(word.title() for word in name.split("_"))


def _tuple(name: str, signals: Iterable[str]) -> Any:
    globals()[name] = made = named_signals(name, signals, __name__)
    return made


def type_of(name: str) -> Any:
    """Numba's type of the array of a signal; the bus's row is one too."""
    return vector if name == "row" else _array(_SIGNALS[name])


def _array(signal: Signal) -> Any:
    return types.Array(u1 if signal.dtype is np.uint8 else f8, len(signal.shape), "C")


def _invoke(signature: Any) -> Callable[[Wire, int, float, float], Any]:
    """A function that calls the kernel of a wire with this signature, from Python or from compiled code."""

    def invoke(wire, step, time, dt):  # type: ignore[no-untyped-def]
        now = Now(step, time, dt, wire.key)
        return wire.kernel(now, wire.sees, wire.params, wire.memory, wire.writes)

    @intrinsic
    def by_address(typingctx, address, now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
        def codegen(context, builder, _, args):  # type: ignore[no-untyped-def]
            calling, returns = context.call_conv, signature.return_type
            function = calling.get_function_type(returns, signature.args).as_pointer()
            pointer = builder.inttoptr(args[0], function)
            status, answer = calling.call_function(
                builder, pointer, returns, signature.args, args[1:]
            )
            with cgutils.if_unlikely(builder, status.is_error):
                calling.return_status_propagate(builder, status)
            return answer

        return signature.return_type(i8, *signature.args), codegen

    call: Any = by_address

    @overload(invoke)
    def _(wire, step, time, dt):  # type: ignore[no-untyped-def]
        def compiled(wire, step, time, dt):  # type: ignore[no-untyped-def]
            now = Now(step, time, dt, wire.key)
            return call(wire.kernel, now, wire.sees, wire.params, wire.memory, wire.writes)

        return compiled

    return invoke


@dataclass(frozen=True)
class Port:
    """What one kind of kernel sees and writes, and so its signature.

    Attributes
    ----------
    name : str
        Of the layer; for its second function, ``layer_function``.
    sees : tuple of str
        Names of signals.
    writes : tuple of str
        Names of the signals of which it is the writer, in the order of their table.
    answers : bool
        Whether the kernel returns a status.
    signature : Numba signature
        For :func:`colift.kernel.jit.kernel`.
    table : mapping of str to Signal
        The signals by name; those of one drone for the layer whose kernels are called once for each.
    invoke : callable
        ``invoke(wire, step, time, dt)`` calls the kernel of a :class:`Wire`, from Python or from compiled code.

    """

    name: str
    sees: tuple[str, ...]
    answers: bool = False
    table: Mapping[str, Signal] = field(default_factory=lambda: _SIGNALS, repr=False)
    writes: tuple[str, ...] = field(init=False)
    Sees: Any = field(init=False, repr=False)
    Writes: Any = field(init=False, repr=False)
    signature: Any = field(init=False, repr=False)
    invoke: Any = field(init=False, repr=False)

    def __post_init__(self) -> None:
        keep = object.__setattr__
        keep(self, "writes", tuple(s.name for s in self.table.values() if s.writer == self.name))
        keep(self, "Sees", _tuple(f"{_words(self.name)}Sees", self.sees))
        keep(self, "Writes", _tuple(f"{_words(self.name)}Writes", self.writes))
        returns = i8 if self.answers else void
        sees, writes = (
            signals_type(made, (_array(self.table[name]) for name in made._fields))
            for made in (self.Sees, self.Writes)
        )
        arguments = (NOW_TYPE, sees, vector, vector, writes)
        keep(self, "signature", returns(*arguments))
        keep(self, "invoke", _invoke(self.signature))

    @property
    def type(self) -> Any:
        """Numba type of its wires."""
        _, sees, params, memory, writes = self.signature.args
        return named([i8, i8, params, memory, sees, writes], Wire)

    def signals(self, n: int, **given: Any) -> dict[str, Array]:
        """Its signals for a team of n drones: those given, for the others new arrays of their initial values."""
        if unknown := {*given} - {*self.sees, *self.writes}:
            raise TypeError(f"{self.name}: its port has no {', '.join(sorted(unknown))}")
        table = self.table
        found: dict[str, Any] = {
            name: np.ascontiguousarray(value, table[name].dtype) for name, value in given.items()
        }
        for name in {*self.sees, *self.writes} - {*found}:
            signal = table[name]
            found[name] = np.full(signal.shape_for(n), signal.initial, signal.dtype)
        return found

    def wire(
        self,
        kernel: Callable[..., Any],
        params: Array,
        memory: Array,
        signals: Mapping[str, Array],
        *,
        key: int = 0,
    ) -> Wire:
        """A kernel of this port, wired to signals by name."""
        sees = self.Sees(*(signals[name] for name in self.sees))
        writes = self.Writes(*(signals[name] for name in self.writes))
        return Wire(kernel, key, params, memory, sees, writes)


_TRUE = "load positions velocities attitudes rates"


def _named(prefix: str) -> tuple[str, ...]:
    return tuple(f"{prefix}_{name}" for name in _TRUE.split())


def _turned(prefix: str) -> tuple[str, ...]:
    return tuple(f"{prefix}load_{name}" for name in ("attitude", "rates"))


_WANTED = ("reference", "reference_attitude", "reference_rates")
_FELT = ("measured_specific_forces", "specific_force_ages")
_RECEIVED = ("received_tensions", "received_directions", "received_ages")

PORTS: dict[str, Port] = {
    port.name: port
    for port in (
        Port("sensing", sees=(*_TRUE.split(), *_turned(""), "stuck")),
        Port(
            "estimation",
            sees=(*_named("measured"), *_turned("measured_"), "measured_ages", *_FELT, "thrusts", "reeled", "found_lengths", *_RECEIVED),
        ),
        Port(
            "supervision",
            sees=(
                *_named("estimated"), "estimated_ends", "estimated_forces", "estimated_wind", "thrusts",
                "reference", "pace", "reeled", "found_lengths", *_RECEIVED,
            ),
        ),
        Port("reference", sees=()),
        Port(
            "load_control",
            sees=("estimated_load", *_turned("estimated_"), *_WANTED, "estimated_forces", "standing", "agreed_force"),
        ),
        Port(
            "allocation",
            sees=("force", "moment", *_WANTED, "estimated_load_attitude", "nominal_forces", "formation"),
            answers=True,
        ),
        Port("link", sees=("desired_tensions", "desired_directions")),
        Port("network", sees=("outboxes", "members")),
        Port(
            "agents",
            sees=(
                "wish", "steady_wish", "wish_moment", "steady_moment", "reference", "reference_attitude", "load_attitude", "formation",
                "number", "members", "inbox", "heard", "evidence", "felt", "velocity",
            ),
            answers=True,
            table={signal.name: signal for signal in OF_ONE},
        ),
        Port(
            "observation",
            sees=(
                *_named("estimated"), "estimated_ends", *_FELT, "thrusts", "standing",
                "held_forces", "reeled", "lift_share", "nominal_forces", *_RECEIVED,
            ),
        ),
        Port(
            "position_control",
            sees=(
                *_named("estimated")[1:], "estimated_ends", "estimated_forces", "estimated_wind",
                *_WANTED, "wanted_ends", "nominal_forces", "formation", "standing", "spans", "courses", "reeled",
                "found_lengths", "learned_load",
                *_RECEIVED,
            ),
        ),
        Port(
            "attitude_control",
            sees=(
                "estimated_attitudes", "estimated_rates", "estimated_ages", "desired_attitudes",
                "desired_rates", "desired_turning",
            ),
        ),
        Port("actuation", sees=("thrusts", "torques", "motor_health")),
        Port(
            "detection",
            sees=(
                "estimated_ends", *_named("estimated")[1:4], "estimated_ages", "thrusts",
                "lift_share", "reeled", *_RECEIVED,
            ),
        ),
        Port("plant_observe", sees=()),
        Port(
            "plant",
            sees=(
                "applied_thrusts", "applied_torques", "external_forces", "external_moment", "attached", "winches",
            ),
        ),
        Port(
            "disturbance",
            sees=(
                "load", *_turned(""), "ends", "positions", "velocities", "attitudes", "directions",
                "direction_rates", "applied_thrusts", "attached",
            ),
        ),
    )
}  # fmt: skip
"""By layer, in the order in which the loop calls them; a plant has two functions."""


MAX_DISTURBANCES = 8
"""Most disturbances in one mission: so many places the compiled loop has for them."""


def hold(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    """A kernel of a layer that is driven from outside: what it writes stays what it was set to."""


def hold_answer(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    """The same for a layer that answers with a status."""
    return 0
