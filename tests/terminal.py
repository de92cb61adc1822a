"""The `colift` command for tests, as a terminal would run it: a process of its own for each call, started in no time.

A server imports what most commands import, once for all tests of a worker; each call is a fork of it, that runs
``python -m colift`` from there on. What only the start of Python can show is tested with processes that start anew.
"""

from __future__ import annotations

import atexit
import json
import os
import runpy
import signal
import socket
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from functools import cache
from pathlib import Path

IMPORTS = ("colift.cli", "colift.flight.runner", "colift.mission.load", "rich.console", "h5py")


def colift(
    *arguments: str,
    folder: Path | None = None,
    stdout: int | None = None,
    largest_file: int | None = None,
    check: bool = False,
    timeout: float = 300.0,
) -> subprocess.CompletedProcess[str]:
    """Run ``colift ARGUMENTS`` in a folder; standard output may go elsewhere, files may be limited in size (bytes)."""
    request = {
        "arguments": arguments,
        "folder": str(folder or Path.cwd()),
        "environment": dict(os.environ),
        "largest_file": largest_file,
    }
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err:
        server = _server()
        target = out.fileno() if stdout is None else stdout
        socket.send_fds(server, [json.dumps(request).encode() + b"\n"], [target, err.fileno()])
        pid = int(_line(server))
        server.settimeout(timeout)
        try:
            code = int(_line(server))
        except TimeoutError:
            os.kill(pid, signal.SIGKILL)
            server.settimeout(None)
            _line(server)
            raise subprocess.TimeoutExpired(["colift", *arguments], timeout) from None
        said = []
        for file in (out, err):
            file.seek(0)
            said.append(file.read().decode())
    done = subprocess.CompletedProcess(["colift", *arguments], code, *said)
    if check:
        done.check_returncode()
    return done


@cache
def _server() -> socket.socket:
    """Our end of the line to the server, which ends with this process."""
    ours, theirs = socket.socketpair()
    process = subprocess.Popen(
        [sys.executable, __file__, str(theirs.fileno())],
        stdin=subprocess.DEVNULL,
        pass_fds=[theirs.fileno()],
    )
    theirs.close()

    def end() -> None:
        ours.close()
        process.wait()

    atexit.register(end)
    return ours


def _line(line: socket.socket) -> bytes:
    said = b""
    while not said.endswith(b"\n"):
        more = line.recv(1)
        if not more:
            raise ConnectionError("the server of the tests' commands has ended")
        said += more
    return said


def _next(line: socket.socket) -> tuple[Mapping[str, object], list[int]] | None:
    """The next request, with its two files; None when the tests have ended."""
    said, files = b"", list[int]()
    while not said.endswith(b"\n"):
        more, fds, _, _ = socket.recv_fds(line, 1 << 16, 2)
        if not more:
            return None
        said += more
        files += fds
    return json.loads(said), files


def _serve(line: socket.socket) -> list[str] | None:
    """Fork for every request; return in the child, with its arguments, or in the server, at the end."""
    for name in IMPORTS:
        __import__(name)
    while (request := _next(line)) is not None:
        asked, (out, err) = request
        if pid := os.fork():
            os.close(out)
            os.close(err)
            line.sendall(b"%d\n" % pid)
            code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
            line.sendall(b"%d\n" % code)
            continue
        line.close()
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        os.dup2(out, 1)
        os.dup2(err, 2)
        os.chdir(str(asked["folder"]))
        os.environ.clear()
        os.environ.update(asked["environment"])  # type: ignore[call-overload]
        if asked["largest_file"] is not None:
            import resource

            resource.setrlimit(resource.RLIMIT_FSIZE, (asked["largest_file"],) * 2)  # type: ignore[arg-type]
        return list(asked["arguments"])  # type: ignore[call-overload]
    return None


if __name__ == "__main__":
    wanted = _serve(socket.socket(fileno=int(sys.argv[1])))
    if wanted is not None:
        sys.argv = ["colift", *wanted]
        sys.path[0] = os.getcwd()  # as `python -m` has it
        runpy.run_module("colift", run_name="__main__", alter_sys=True)
