"""The paper's block diagram as one loop over physics steps (paper fig. 2).

    reference -> load control -> allocation -> position control -> attitude control -> plant

The loop is compiled when every part is, and runs as plain Python otherwise: same code, `advance` or
`advance.py_func`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from colift.allocation import base as allocation
from colift.allocation.base import INFO_SIZE
from colift.attitude_control import base as attitude_control
from colift.errors import ColiftError
from colift.jit import f8, i8, kernel, matrix, monotonic_ns, vector, void
from colift.load_control import base as load_control
from colift.plant import base as plant
from colift.position_control import base as position_control
from colift.reference import base as reference
from colift.simulation.signals import BUS_TYPE, CYCLE_SIGNALS

Array = NDArray[np.float64]


class Vectors(NamedTuple):
    """One vector per layer: its parameters, or its memory."""

    reference: Array
    load_control: Array
    allocation: Array
    position_control: Array
    attitude_control: Array
    plant: Array


class Periods(NamedTuple):
    """Physics step (s) and each layer's period, in physics steps."""

    step: float
    load_control: int
    allocation: int
    position_control: int
    attitude_control: int
    recording: int


VECTORS_TYPE = types.NamedUniTuple(vector, 6, Vectors)
PERIODS_TYPE = types.NamedTuple([f8] + [i8] * 5, Periods)
CYCLE_WIDTH = len(CYCLE_SIGNALS)

SIGNATURE = void(
    i8,
    i8,
    PERIODS_TYPE,
    types.FunctionType(reference.SIGNATURE),
    types.FunctionType(load_control.SIGNATURE),
    types.FunctionType(allocation.SIGNATURE),
    types.FunctionType(position_control.SIGNATURE),
    types.FunctionType(attitude_control.SIGNATURE),
    types.FunctionType(plant.OBSERVE_SIGNATURE),
    types.FunctionType(plant.STEP_SIGNATURE),
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
    reference,
    control_load,
    allocate,
    control_position,
    control_attitude,
    observe,
    step,
    params,
    memory,
    info,
    bus,
    log,
    cycles,
):
    """Run physics steps ``first <= k < last``."""
    dt = every.step
    for k in range(first, last):
        observe(
            params.plant,
            memory.plant,
            bus.load,
            bus.positions,
            bus.velocities,
            bus.attitudes,
            bus.rates,
            bus.directions,
            bus.direction_rates,
        )
        reference(k * dt, params.reference, bus.reference)

        if k % every.load_control == 0:
            control_load(
                bus.load,
                bus.reference,
                every.load_control * dt,
                params.load_control,
                memory.load_control,
                bus.force,
            )

        if k % every.allocation == 0:
            begin = monotonic_ns()
            status = allocate(
                bus.force,
                bus.reference[2],
                every.allocation * dt,
                params.allocation,
                memory.allocation,
                bus.desired_tensions,
                bus.desired_directions,
                info,
            )
            end = monotonic_ns()
            row = k // every.allocation
            cycles[row, 0] = status
            for m in range(INFO_SIZE):
                cycles[row, 1 + m] = info[m]
            cycles[row, 1 + INFO_SIZE] = (end - begin) * 1e-9

        if k % every.position_control == 0:
            control_position(
                bus.positions,
                bus.velocities,
                bus.reference,
                bus.desired_tensions,
                bus.desired_directions,
                every.position_control * dt,
                params.position_control,
                memory.position_control,
                bus.drone_forces,
                bus.thrusts,
                bus.desired_attitudes,
                bus.desired_rates,
            )

        if k % every.attitude_control == 0:
            control_attitude(
                bus.attitudes,
                bus.rates,
                bus.desired_attitudes,
                bus.desired_rates,
                every.attitude_control * dt,
                params.attitude_control,
                memory.attitude_control,
                bus.torques,
            )

        step(
            bus.thrusts,
            bus.torques,
            bus.external_forces,
            bus.attached,
            dt,
            params.plant,
            memory.plant,
            bus.tensions,
            bus.slack_times,
        )

        if k % every.recording == 0:
            log[k // every.recording, :] = bus.row


def is_compiled(function: Any) -> bool:
    """Whether a part's kernel is compiled (and so can go into the compiled loop)."""
    return hasattr(function, "py_func")


KERNEL_SIGNATURES = {
    "reference": {"kernel": reference.SIGNATURE},
    "load_control": {"kernel": load_control.SIGNATURE},
    "allocation": {"kernel": allocation.SIGNATURE},
    "position_control": {"kernel": position_control.SIGNATURE},
    "attitude_control": {"kernel": attitude_control.SIGNATURE},
    "plant": {"observe": plant.OBSERVE_SIGNATURE, "kernel": plant.STEP_SIGNATURE},
}
"""Which functions the part of each layer must have, in the order in which the loop takes them."""


def kernels_of(parts: Mapping[str, type]) -> list[Any]:
    """The kernels of one part a layer, in the loop's order.

    Raises
    ------
    ColiftError
        For a compiled kernel that was not compiled for its layer's signature.

    """
    found = []
    for layer, signatures in KERNEL_SIGNATURES.items():
        for name, wanted in signatures.items():
            function = getattr(parts[layer], name)
            offered = getattr(function, "nopython_signatures", [wanted])
            if (wanted.args, wanted.return_type) not in [(s.args, s.return_type) for s in offered]:
                raise ColiftError(
                    f"{layer} part {parts[layer].__name__}: its {name} is compiled for "
                    f"{', '.join(map(str, offered)) or 'nothing'}, but this layer's functions have "
                    f"the signature {wanted} (see colift.{layer}.base)"
                )
            found.append(function)
    return found
