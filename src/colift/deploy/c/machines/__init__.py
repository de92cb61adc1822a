"""Exported allocators on other machines, some of them emulated: the same calls there as here."""

from __future__ import annotations

import shutil
import struct
import subprocess
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from colift.deploy.c.header import header_of
from colift.deploy.c.kernels import Kernel

Array = NDArray[np.float64]

HERE = Path(__file__).parent
EXACT = ("-std=c99", "-O2", "-ffp-contract=off")
_ARM = ("arm-none-eabi-gcc", *EXACT, "-mthumb", "-mfloat-abi=hard", "-ffunction-sections", "-fdata-sections")  # fmt: skip
_LINK = ("-nostartfiles", "-Wl,--gc-sections", f"-Wl,-T,{HERE / 'board.ld'}")
_QEMU = ("qemu-system-arm", "-nographic", "-monitor", "none", "-serial", "none", "-semihosting", "-icount", "shift=6")  # fmt: skip


class Machine(NamedTuple):
    """How code is made for a machine, and run on it."""

    title: str
    compiler: tuple[str, ...]
    source: str
    """What the driver needs of it."""
    runner: tuple[str, ...] = ()
    package: str = ""
    """Debian packages that bring both."""
    link: tuple[str, ...] = ("-lm",)
    size: str = "size"
    """Program that tells the size of code."""

    def missing(self) -> str:
        """What is missing to use it, or nothing."""
        tools = [self.compiler[0], *self.runner[:1]]
        gone = [tool for tool in tools if shutil.which(tool) is None]
        return f"needs {', '.join(gone)} ({self.package})" if gone else ""


MACHINES = {
    "x86-64": Machine("this machine, gcc", ("gcc", *EXACT), "hosted.c", package="gcc"),
    "clang": Machine("this machine, clang", ("clang", *EXACT), "hosted.c", package="clang"),
    "aarch64": Machine(
        "AArch64 in qemu-user", ("aarch64-linux-gnu-gcc", *EXACT, "-static"), "hosted.c", ("qemu-aarch64",),
        "gcc-aarch64-linux-gnu libc6-dev-arm64-cross qemu-user",
    ),
    "wasm": Machine(
        "WebAssembly in Node", ("clang", *EXACT, "--target=wasm32-wasi", "--sysroot=/usr"), "hosted.c",
        ("node", "--no-warnings", str(HERE / "run.mjs")), "clang lld wasi-libc libclang-rt-dev-wasm32 nodejs",
    ),
    "m4": Machine(
        "Cortex-M4F in QEMU", (*_ARM, "-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16"), "board.c",
        (*_QEMU, "-M", "mps2-an386", "-kernel"), "gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm",
        (*_LINK, "-lm"), "arm-none-eabi-size",
    ),
    "m7": Machine(
        "Cortex-M7 in QEMU", (*_ARM, "-mcpu=cortex-m7", "-mfpu=fpv5-d16"), "board.c",
        (*_QEMU, "-M", "mps2-an500", "-kernel"), "gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-arm",
        (*_LINK, "-lm"), "arm-none-eabi-size",
    ),
}  # fmt: skip
"""By name."""


class Calls(NamedTuple):
    """What an allocator is asked, one call after the other.

    Attributes
    ----------
    params, memory : array
        Of its kernel.
    directions : (n, 3) array
        Of the cables at first.
    forces : (calls, 3) array
        N.
    moments : (calls, 3) array
        N m.
    dt : float
        From one call to the next, s.

    """

    params: Array
    memory: Array
    directions: Array
    forces: Array
    moments: Array
    formation: Array
    dt: float = 0.01

    def packed(self) -> bytes:
        """The file that the driver reads."""
        n = len(self.directions)
        head = struct.pack("<4id", n, len(self.forces), self.params.size, self.memory.size, self.dt)
        level = np.array([1.0, 0.0, 0.0, 0.0])
        vectors = (
            self.params,
            self.memory,
            self.directions,
            level,
            self.formation,
            np.hstack([self.forces, self.moments]),
        )
        return head + b"".join(np.ascontiguousarray(each, "<f8").tobytes() for each in vectors)


class Answers(NamedTuple):
    """Of all calls: status, what the allocator says of itself, tensions, directions; instructions and bytes of stack."""

    status: Array
    info: Array
    tensions: Array
    directions: Array
    instructions: Array
    stack: int


def _run(command: Sequence[str], folder: Path) -> str:
    return subprocess.run(command, cwd=folder, check=True, text=True, stdout=subprocess.PIPE).stdout


@cache
def _compiled(text: str, header: str, command: tuple[str, ...]) -> bytes:
    """A kernel as a compiler makes it, once for all teams of a process."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "colift.h").write_text(header)
        (folder / "kernel.c").write_text(text)
        _run([*command, "-c", "kernel.c", "-o", "kernel.o"], folder)
        return (folder / "kernel.o").read_bytes()


class Driver:
    """A kernel of an allocator, compiled for a machine together with what calls it; it has a folder, until it is closed.

    Raises
    ------
    subprocess.CalledProcessError
        If the compiler refuses.

    """

    def __init__(
        self, kernel: Kernel, machine: str, most: tuple[int, int, int], flags: Sequence[str] = ()
    ) -> None:
        self.machine, self._stack = MACHINES[machine], ExitStack()
        self.folder = Path(self._stack.enter_context(tempfile.TemporaryDirectory()))
        command = (*self.machine.compiler, *flags)
        header = header_of([kernel])
        (self.folder / "colift.h").write_text(header)
        (self.folder / "kernel.o").write_bytes(_compiled(kernel.file("colift.h"), header, command))
        drones, params, memory = most
        made = [
            f"-DKERNEL={kernel.name}", f"-DREAL={kernel.program.real}", f"-DDRONES={drones}", f"-DPARAMS={params}", f"-DMEMORY={memory}",
            f"-I{HERE}", "-I.",
        ]  # fmt: skip
        sources = ["kernel.o", str(HERE / "driver.c"), str(HERE / self.machine.source)]
        _run([*command, *made, *sources, *self.machine.link, "-o", "driver"], self.folder)

    def __enter__(self) -> Driver:
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        """Remove its files."""
        self._stack.close()

    def __call__(self, calls: Calls) -> Answers:
        """The answers to these calls."""
        (self.folder / "calls.bin").write_bytes(calls.packed())
        runner = self.machine.runner
        _run([*runner, "driver"] if runner else ["./driver"], self.folder)
        raw, n = (self.folder / "answers.bin").read_bytes(), len(calls.directions)
        rows = np.frombuffer(raw[:-4], "<f8").reshape(len(calls.forces), 9 + 4 * n)
        return Answers(
            rows[:, 0], rows[:, 2:9], rows[:, 9 : 9 + n], rows[:, 9 + n :].reshape(-1, n, 3), rows[:, 1],
            struct.unpack("<i", raw[-4:])[0],
        )  # fmt: skip

    def code(self) -> int:
        """Bytes of code and constants of the kernel, without the C library's."""
        return int(_run([self.machine.size, "kernel.o"], self.folder).splitlines()[1].split()[0])
