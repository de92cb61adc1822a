"""The paper's block diagram, and the world around it, as one loop over physics steps (paper fig. 2).

    reference -> load control -> allocation -> link -> position control -> attitude control
        ^                                                                        |
    estimation <- sensing <- plant <- disturbances, actuation  <-----------------+

The loop is compiled when every part is, and runs as plain Python otherwise: same code, `advance` or
`advance.py_func`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from colift.actuation import base as actuation
from colift.allocation import base as allocation
from colift.allocation.base import INFO_SIZE, Status
from colift.attitude_control import base as attitude_control
from colift.detection import base as detection
from colift.disturbance import base as disturbance
from colift.disturbance import push
from colift.errors import ColiftError
from colift.estimation import base as estimation
from colift.jit import f8, i8, kernel, matrix, monotonic_ns, vector
from colift.link import base as link
from colift.load_control import base as load_control
from colift.plant import base as plant
from colift.position_control import base as position_control
from colift.reference import base as reference
from colift.sensing import base as sensing
from colift.simulation.signals import CYCLE_SIGNALS, SIGNALS, Bus

Array = NDArray[np.float64]

MAX_DISTURBANCES = 8
"""Most disturbances in one mission: so many places the compiled loop has for them."""

KERNEL_SIGNATURES = {
    "reference": {"kernel": reference.SIGNATURE},
    "sensing": {"kernel": sensing.SIGNATURE},
    "estimation": {"kernel": estimation.SIGNATURE},
    "load_control": {"kernel": load_control.SIGNATURE},
    "allocation": {"kernel": allocation.SIGNATURE},
    "link": {"kernel": link.SIGNATURE},
    "position_control": {"kernel": position_control.SIGNATURE},
    "attitude_control": {"kernel": attitude_control.SIGNATURE},
    "actuation": {"kernel": actuation.SIGNATURE},
    "detection": {"kernel": detection.SIGNATURE},
    "plant": {"observe": plant.OBSERVE_SIGNATURE, "kernel": plant.STEP_SIGNATURE},
}
"""Which functions the part of each layer must have, in the order in which the loop takes them."""


class Vectors(NamedTuple):
    """One vector per layer: its parameters, or its memory."""

    reference: Array
    sensing: Array
    estimation: Array
    load_control: Array
    allocation: Array
    link: Array
    position_control: Array
    attitude_control: Array
    actuation: Array
    detection: Array
    plant: Array


class Keys(NamedTuple):
    """Keys of the random numbers of each layer that has some."""

    sensing: int
    link: int
    actuation: int


class Periods(NamedTuple):
    """Physics step (s) and each layer's period, in physics steps."""

    step: float
    load_control: int
    allocation: int
    position_control: int
    attitude_control: int
    recording: int


class Disturbances(NamedTuple):
    """How many there are, and their kernels, keys, parameters and memories, filled up to the most."""

    number: int
    kernels: tuple[Any, ...]
    keys: tuple[int, ...]
    params: tuple[Array, ...]
    memory: tuple[Array, ...]

    def arguments(self) -> tuple[Any, ...]:
        """As the loop takes them."""
        return self.number, *self.kernels, self.keys, self.params, self.memory

    @classmethod
    def of(cls, each: Sequence[tuple[Any, int, Array, Array]]) -> Disturbances:
        """From kernel, key, parameters and memory of each."""
        filled = [*each]
        while len(filled) < MAX_DISTURBANCES:
            filled.append((push.Push.kernel, 0, np.zeros(0), np.zeros(0)))
        return cls(len(each), *(tuple(column) for column in zip(*filled, strict=True)))


VECTORS_TYPE = types.NamedUniTuple(vector, len(Vectors._fields), Vectors)
KEYS_TYPE = types.NamedUniTuple(i8, len(Keys._fields), Keys)
BUS_TYPE = types.NamedTuple(
    [vector] + [vector if len(signal.shape) == 1 else matrix for signal in SIGNALS], Bus
)
PERIODS_TYPE = types.NamedTuple([f8] + [i8] * 5, Periods)
CYCLE_WIDTH = len(CYCLE_SIGNALS)
_SILENT = int(Status.SILENT)


SIGNATURE = i8(
    i8,
    i8,
    PERIODS_TYPE,
    KEYS_TYPE,
    *(
        types.FunctionType(signature)
        for functions in KERNEL_SIGNATURES.values()
        for signature in functions.values()
    ),
    i8,
    *[types.FunctionType(disturbance.SIGNATURE)] * MAX_DISTURBANCES,
    types.UniTuple(i8, MAX_DISTURBANCES),
    types.UniTuple(vector, MAX_DISTURBANCES),
    types.UniTuple(vector, MAX_DISTURBANCES),
    VECTORS_TYPE,
    VECTORS_TYPE,
    vector,
    BUS_TYPE,
    matrix,
    matrix,
)


@kernel(SIGNATURE)
def advance(  # type: ignore[no-untyped-def]
    first,
    last,
    every,
    keys,
    reference,
    sense,
    estimate,
    control_load,
    allocate,
    transmit,
    control_position,
    control_attitude,
    actuate,
    detect,
    observe,
    step,
    disturbances,
    disturb_0,
    disturb_1,
    disturb_2,
    disturb_3,
    disturb_4,
    disturb_5,
    disturb_6,
    disturb_7,
    disturbance_keys,
    disturbance_params,
    disturbance_memory,
    params,
    memory,
    info,
    bus,
    log,
    cycles,
):
    """Run physics steps ``first <= k < last``; return the step reached.

    It ends early, after a whole step, when a drone is judged lost: the caller regroups. The rows of ``log`` and
    ``cycles`` are those due from ``first`` on.
    """
    disturb = (
        disturb_0, disturb_1, disturb_2, disturb_3, disturb_4, disturb_5, disturb_6, disturb_7
    )  # fmt: skip
    dt = every.step
    n = bus.tensions.shape[0]
    first_row = (first + every.recording - 1) // every.recording
    first_cycle = (first + every.allocation - 1) // every.allocation
    for k in range(first, last):
        observe(
            params.plant, memory.plant, bus.load, bus.positions, bus.velocities, bus.attitudes,
            bus.rates, bus.directions, bus.direction_rates,
        )  # fmt: skip
        sense(
            k, keys.sensing, dt, bus.load, bus.positions, bus.velocities, bus.attitudes, bus.rates,
            bus.stuck, params.sensing, memory.sensing, bus.measured_load, bus.measured_positions,
            bus.measured_velocities, bus.measured_attitudes, bus.measured_rates,
        )  # fmt: skip
        estimate(
            k, dt, bus.measured_load, bus.measured_positions, bus.measured_velocities,
            bus.measured_attitudes, bus.measured_rates, bus.thrusts, bus.received_tensions,
            bus.received_directions, params.estimation, memory.estimation, bus.estimated_load,
            bus.estimated_positions, bus.estimated_velocities, bus.estimated_attitudes,
            bus.estimated_rates,
        )  # fmt: skip
        reference(k * dt, params.reference, bus.reference)

        if k % every.load_control == 0:
            control_load(
                bus.estimated_load, bus.reference, every.load_control * dt, params.load_control,
                memory.load_control, bus.force,
            )  # fmt: skip

        if k % every.allocation == 0:
            row = k // every.allocation - first_cycle
            if bus.allocator_up[0] != 0.0:
                begin = monotonic_ns()
                status = allocate(
                    bus.force, bus.reference[2], every.allocation * dt, params.allocation,
                    memory.allocation, bus.desired_tensions, bus.desired_directions, info,
                )  # fmt: skip
                end = monotonic_ns()
                cycles[row, 0] = status
                for m in range(INFO_SIZE):
                    cycles[row, 1 + m] = info[m]
                cycles[row, 1 + INFO_SIZE] = (end - begin) * 1e-9
            else:  # nothing was asked, so nothing was measured
                cycles[row, :] = np.nan
                cycles[row, 0] = _SILENT

        transmit(
            k, keys.link, dt, bus.desired_tensions, bus.desired_directions, params.link,
            memory.link, bus.received_tensions, bus.received_directions,
        )  # fmt: skip

        if k % every.position_control == 0:
            control_position(
                bus.estimated_positions, bus.estimated_velocities, bus.estimated_attitudes,
                bus.estimated_rates, bus.reference, bus.received_tensions,
                bus.received_directions, every.position_control * dt,
                params.position_control, memory.position_control, bus.drone_forces, bus.thrusts,
                bus.desired_attitudes, bus.desired_rates,
            )  # fmt: skip
            detect(
                every.position_control * dt, bus.estimated_load, bus.estimated_positions,
                bus.estimated_velocities, bus.estimated_attitudes, bus.thrusts,
                bus.received_tensions, bus.received_directions, params.detection,
                memory.detection, bus.carrying,
            )  # fmt: skip

        if k % every.attitude_control == 0:
            control_attitude(
                bus.estimated_attitudes, bus.estimated_rates, bus.desired_attitudes,
                bus.desired_rates, every.attitude_control * dt, params.attitude_control,
                memory.attitude_control, bus.torques,
            )  # fmt: skip

        actuate(
            k, keys.actuation, dt, bus.thrusts, bus.torques, bus.motor_health, params.actuation,
            memory.actuation, bus.applied_thrusts, bus.applied_torques, bus.saturated_times,
        )  # fmt: skip
        bus.wind[:] = 0.0
        bus.external_forces[:] = 0.0
        for m in range(disturbances):
            disturb[m](
                k, disturbance_keys[m], dt, bus.load, bus.positions, bus.velocities,
                bus.attitudes, bus.directions, bus.direction_rates, bus.applied_thrusts,
                bus.attached, disturbance_params[m], disturbance_memory[m], bus.wind,
                bus.external_forces,
            )  # fmt: skip
        step(
            bus.applied_thrusts, bus.applied_torques, bus.external_forces, bus.attached, dt,
            params.plant, memory.plant, bus.tensions, bus.peak_tensions, bus.catch_impulses,
            bus.slack_times,
        )  # fmt: skip

        if k % every.recording == 0:
            log[k // every.recording - first_row, :] = bus.row
            bus.peak_tensions[:] = 0.0
            bus.catch_impulses[:] = 0.0
        for i in range(n):
            if bus.carrying[i] == 0.0:
                return k + 1
    return last


def is_compiled(function: Any) -> bool:
    """Whether a part's kernel is compiled (and so can go into the compiled loop)."""
    return hasattr(function, "py_func")


def kernels_of(parts: Mapping[str, type]) -> list[Any]:
    """The kernels of one part a layer, in the loop's order.

    Raises
    ------
    ColiftError
        For a compiled kernel that was not compiled for its layer's signature.

    """
    return [
        _checked(layer, parts[layer], name, wanted)
        for layer, signatures in KERNEL_SIGNATURES.items()
        for name, wanted in signatures.items()
    ]


def disturbance_kernel(part: type) -> Any:
    """The kernel of a disturbance; errors as for :func:`kernels_of`."""
    return _checked("disturbance", part, "kernel", disturbance.SIGNATURE)


def _checked(layer: str, part: type, name: str, wanted: Any) -> Any:
    function = getattr(part, name)
    offered = getattr(function, "nopython_signatures", [wanted])
    if (wanted.args, wanted.return_type) not in [(s.args, s.return_type) for s in offered]:
        raise ColiftError(
            f"{layer} part {part.__name__}: its {name} is compiled for "
            f"{', '.join(map(str, offered)) or 'nothing'}, but this layer's functions have "
            f"the signature {wanted} (see colift.{layer}.base)"
        )
    return function
