"""What runs under valgrind: compiled calls that switch the counting of instructions on and off.

Imported only there: the requests are machine code of 64-bit x86.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from llvmlite import binding, ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from colift.control.allocation.base import INFO_SIZE, ask, unplanned
from colift.kernel.jit import address_of, f8, i8, kernel, matrix, vector, void
from colift.study.bench.instructions import CALLS, WARM_UP, cases
from colift.study.bench.problems import Problem

binding.initialize_native_asmparser()


def _request(number: int) -> Any:
    """A client request of callgrind (``callgrind.h``), which does nothing where valgrind is not there."""

    @intrinsic
    def ask(typingctx: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            i64 = ir.IntType(64)
            block = cgutils.alloca_once(builder, ir.ArrayType(i64, 6))
            for place, value in enumerate((_CALLGRIND + number, 0, 0, 0, 0, 0)):
                builder.store(i64(value), cgutils.gep_inbounds(builder, block, 0, place))
            assembly = ir.InlineAsm(
                ir.FunctionType(i64, [i64, i64]),
                "rolq $$3, %rdi; rolq $$13, %rdi; rolq $$61, %rdi; rolq $$51, %rdi; xchgq %rbx, %rbx",
                "={rdx},{rax},{rdx},~{cc},~{memory}",
                side_effect=True,
            )
            return builder.call(assembly, [builder.ptrtoint(block, i64), i64(0)])

        return types.int64(), codegen

    return ask


_CALLGRIND = ord("C") << 24 | ord("T") << 16
_dump, _zero, _start, _stop = map(_request, (0, 1, 4, 5))


@kernel(
    void(
        i8, matrix, f8, vector, vector, vector, matrix, vector, matrix
    )
)  # fmt: skip
def _counted(  # type: ignore[no-untyped-def]
    allocate, forces, dt, params, memory, tensions, directions, info, rest
):
    """Call an allocator once per force; the calls after ``WARM_UP`` make one dump of callgrind."""
    beside = unplanned(tensions.shape[0])
    for k in range(forces.shape[0]):
        if k == WARM_UP:
            _start()
            _zero()
        ask(allocate, forces[k], rest, beside, dt, params, memory, tensions, directions, info)
    _dump()
    _stop()


def work(sizes: Sequence[int]) -> None:
    """What the second Python does: one dump a case, in their order."""
    for name, family, n in cases(sizes):
        problem = Problem(name, n)
        tensions, directions = problem.start
        part = problem.own
        _counted(
            address_of(type(part).kernel), problem.forces(WARM_UP + CALLS, family), problem.period,
            part.params(problem.team), part.memory(problem.team), tensions, directions,
            np.zeros(INFO_SIZE), np.zeros((4, 3)),
        )  # fmt: skip
