"""How kernels are compiled: one decorator, the array types of the kernel signatures, a clock.

A *kernel* takes arrays and numbers, writes its results into arrays of the caller, and returns
nothing or a status code. It allocates nothing and raises nothing. Kernels carry an explicit
signature, one for every implementation of a layer, so that the simulation loop can take them as
first-class functions and still be cached between processes.
"""

from __future__ import annotations

import atexit
import hashlib
import os
import shutil
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from llvmlite import binding as llvm
from llvmlite import ir
from numba import types
from numba.core import caching, cgutils, event, sigutils
from numba.core.runtime import _nrt_python as _nrt  # type: ignore[attr-defined]
from numba.extending import intrinsic, overload

from colift.kernel import prebuilt
from colift.kernel.compiling import BodyCompiler, hurried

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

config: Any = numba.config
F = TypeVar("F", bound=Callable[..., Any])

JIT_ENABLED: bool = not bool(config.DISABLE_JIT)
PACKAGE = Path(__file__).parents[1]

f8 = types.float64
i8 = types.int64
u1 = types.uint8
void = types.void
vector = types.float64[::1]
matrix = types.float64[:, ::1]
tensor = types.float64[:, :, ::1]
mask = types.boolean[::1]

# `contract` lets a*b + c become one fused instruction; nothing here assumes the absence of NaN.
_FASTMATH = {"contract"}
PATIENCE = 120.0
"""Longest time for which a process waits while another compiles the kernel that it needs, s."""


def kernel(signature: Any, *, counted: bool = True) -> Callable[[F], F]:
    """Compile a kernel for one explicit signature, cached on disk; called from Python, it lets other threads run.

    Not ``counted`` is one in which nobody counts who refers to an array: it makes and returns none, and calls others by
    their address, to each of which a call would cost as much as a small kernel takes.

    In colift's own files an index that is no constant is a place from the start, never negative, and nothing checks it
    (:mod:`colift.kernel.compiling`); in others' it is Python's.
    """

    def decorate(function: F) -> F:
        njit: Any = numba.njit
        options = {"nogil": True, "error_model": "numpy", "fastmath": _FASTMATH, "_nrt": counted}
        options |= {"no_cfunc_wrapper": True}  # others call it by the address of its code
        compiled = njit(**options)(function)
        if JIT_ENABLED:
            with _cache_for(function):
                compiled._cache = _Cache(function)
            _compile(compiled, signature)
            compiled.disable_compile()
        made.append(name_of(function))
        return cast(F, compiled)

    return decorate


def _compile(function: Any, signature: Any) -> Any:
    """For this signature, from the cache or into it; without a cache where it cannot be written."""
    try:
        with hurried():
            return type(function).compile(function, signature)
    except OSError:  # such as a full disk: Numba has compiled the function, but could not save it
        found = function.overloads.get(sigutils.normalize_signature(signature)[0])
        if found is None:
            raise
        return found.entry_point
    finally:
        if isinstance(function._cache, _Cache):
            function._cache.let_others()


def address_of(kernel: Any) -> Any:
    """Address of a kernel's machine code, by which other compiled code can call it as long as the kernel lives.

    A kernel that is not compiled stands for itself.
    """
    if not hasattr(kernel, "overloads"):
        return kernel
    (made,) = kernel.overloads.values()
    return int(made.library.get_pointer_to_function(made.fndesc.llvm_func_name))


made: list[str] = []
"""Names of the kernels of this process, in the order in which they came."""


def name_of(function: Callable[..., Any]) -> str:
    """What a person is told that a kernel is called: where it stands, without colift's own name."""
    return f"{function.__module__.removeprefix('colift.')}.{function.__name__.strip('_')}"


@contextmanager
def told_of_compilation(begin: Callable[[str], None], *, own: bool = False) -> Iterator[None]:
    """Call ``begin`` with the name of every kernel of the block that is compiled, not loaded from the cache; or of colift's own."""
    with event.install_listener("numba:compile", _Listener(begin, own)):
        yield


class _Listener(event.Listener):
    """Hears when Numba compiles; what is compiled for the sake of a kernel is a part of it."""

    def __init__(self, begin: Callable[[str], None], own: bool) -> None:
        self._begin, self._own = begin, own
        self._depth = 0

    def on_start(self, event: Any) -> None:
        function = event.data["dispatcher"].py_func
        if self._depth == 0 and (_is_ours(function) or not self._own):
            self._begin(name_of(function))
        self._depth += 1

    def on_end(self, event: Any) -> None:
        self._depth -= 1


def inline(function: F) -> F:
    """A helper that becomes part of the kernels that call it; its types follow from the call."""
    return _helper(function, forceinline=True)


def aside(function: F) -> F:
    """A helper that stays a function of its own in the kernels that call it: for what is rarely needed, or needed in many places."""
    return _helper(function, forceinline=False)


def _helper(function: F, *, forceinline: bool) -> F:
    """For kernels it is compiled without an entrance and without machine code: each has its own.

    Called from Python, it is compiled once more, with both, and cached as a kernel is.
    """
    njit: Any = numba.njit
    options = {"error_model": "numpy", "fastmath": _FASTMATH, "forceinline": forceinline}
    options |= {"no_cfunc_wrapper": True}  # nobody calls one from C
    compiled: Any = njit(**options)(function)
    if JIT_ENABLED:

        @cache
        def body() -> Any:
            return njit(**options, no_cpython_wrapper=True, pipeline_class=BodyCompiler)(function)

        def compile_(signature: Any) -> Any:
            if not isinstance(compiled._cache, _Cache) and _is_ours(function):
                with _cache_for(function):
                    compiled._cache = _Cache(function)
            return _compile(compiled, signature)

        compiled.get_call_template = lambda args, kws: body().get_call_template(args, kws)
        compiled.get_overload = lambda signature: body().get_overload(signature)
        compiled.compile = compile_
    return cast(F, compiled)


def _is_ours(function: Any) -> bool:
    """Whether all that a function calls is among the sources that its place in the cache is named after."""
    return Path(function.__code__.co_filename).is_relative_to(PACKAGE)


def splice(function: F) -> F:
    """A helper that hands out a part of an array, also to kernels in which nobody counts: its lines become theirs."""
    compiled: Any = numba.njit(error_model="numpy", fastmath=_FASTMATH, inline="always")(function)
    return cast(F, compiled)


_one_at_a_time = threading.RLock()  # for Numba's setting, which is the whole process's


class _Locator(caching.UserProvidedCacheLocator):
    """Where in the cache a kernel is: for all copies of colift the same place, as all with these sources compile the same."""

    @classmethod
    def get_suitable_cache_subpath(cls, py_file: str) -> str:
        folder = Path(py_file).parent
        if folder.is_relative_to(PACKAGE):
            return "-".join(folder.relative_to(PACKAGE.parent).parts)
        return str(super().get_suitable_cache_subpath(py_file))  # type: ignore[no-untyped-call]


class _Kept(caching.CompileResultCacheImpl):
    """What the cache keeps of a kernel, so that it is loaded without what only compiling needs: a fifth of a second a run.

    The bitcode, which another kernel may be linked with, is parsed when one asks for it; a stand-in that defines the
    same names serves until then. Environments of Numba's own helpers are left out, as each would import a module of
    Numba's: they serve to build an exception at run time, and what Numba raises there is made when it compiles.
    """

    _locator_classes = [_Locator, *caching.CompileResultCacheImpl._locator_classes]  # noqa: RUF012

    def reduce(self, cres: Any) -> Any:
        (name, kind, (code, bitcode)), *rest, environments = super().reduce(cres)  # type: ignore[no-untyped-call]
        own = cres.fndesc
        functions = (own.llvm_func_name, own.llvm_cpython_wrapper_name, own.llvm_cfunc_wrapper_name)
        stand_in = llvm.parse_assembly(
            "".join(f'define void @"{each}"() {{ unreachable }}\n' for each in functions)
        ).as_bitcode()
        needed = tuple(
            each for each in environments if not each.globals["__name__"].startswith("numba.")
        )
        return ((name, kind, (code, stand_in)), *rest, needed), bitcode

    def rebuild(self, target_context: Any, payload: Any) -> Any:
        kept, bitcode = payload
        made = super().rebuild(target_context, kept)  # type: ignore[no-untyped-call]
        library = made.library

        def for_linking() -> Any:
            library._shared_module = llvm.parse_bitcode(bitcode)
            del library._get_module_for_linking
            return library._shared_module

        library._get_module_for_linking = for_linking
        return made


class _Cache(caching.FunctionCache):
    """Numba's cache, but what was compiled is loaded without all that only compiling needs."""

    _impl_class = _Kept
    _turn: int | None = None
    """A file that is locked by this process while it compiles the kernel."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        # Of the refresh that is left out, what running code needs.
        for name, address in _nrt.c_helpers.items():
            llvm.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)
        with self._guard_against_spurious_io_errors():
            found = self._load_overload(sig, target_context)
            if found is None:
                found = prebuilt.load(self, sig, target_context)
            if found is None and self._wait():
                found = self._load_overload(sig, target_context)
            return found

    def _wait(self) -> bool:
        """Take the turn to compile, and say whether another process had it, so that the kernel may be there now."""
        if fcntl is None:
            return False
        place, end = (
            f"{self._cache_path}/{self._impl.filename_base}.turn",
            time.monotonic() + PATIENCE,
        )
        waited = False
        try:
            self._turn = os.open(place, os.O_RDWR | os.O_CREAT, 0o600)
            while time.monotonic() < end:
                try:
                    fcntl.flock(self._turn, fcntl.LOCK_EX | fcntl.LOCK_NB)
                    break
                except BlockingIOError:
                    waited = True
                    time.sleep(0.05)
        except OSError:  # a folder that cannot be written to, or a file system without locks
            pass
        return waited

    def let_others(self) -> None:
        """The turn is over, if this process had it."""
        if self._turn is not None:
            os.close(self._turn)
            self._turn = None


@contextmanager
def _cache_for(function: Callable[..., Any]) -> Iterator[None]:
    """Let Numba cache under a digest of the sources that a kernel of this folder can be made of.

    Numba looks at the kernel's own file only: after a change of a helper elsewhere it would go on
    with the old machine code.
    """
    with _one_at_a_time:
        before = config.CACHE_DIR
        config.CACHE_DIR = str(cache_folder(Path(function.__code__.co_filename).parent))
        try:
            yield
        finally:
            config.CACHE_DIR = before


@cache
def cache_folder(folder: Path) -> Path:
    """Where the kernels of a source folder are cached; ``COLIFT_CACHE`` moves it."""
    sources = list((PACKAGE / "kernel").rglob("*.py"))
    if folder.is_relative_to(PACKAGE):  # the layer's folder, with those of its helpers
        layer = folder.relative_to(PACKAGE).parts[:2]
        sources += PACKAGE.joinpath(*layer).rglob("*.py")
    digest = hashlib.sha256(numba.__version__.encode())
    for source in sorted(sources):
        digest.update(source.read_bytes())
    home = os.environ.get("COLIFT_CACHE") or config.CACHE_DIR
    name = f"{folder.name}-{digest.hexdigest()[:16]}"
    try:
        if not home:
            base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
            home = Path(base) / "colift"
        target = Path(home) / name
        target.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):  # no home, or none to write to: cache for this boot at least
        target = _temporary_folder() / name
        target.mkdir(exist_ok=True)
    return target


@cache
def _temporary_folder() -> Path:
    """A cache under the common temporary folder that only this user can reach: it holds code.

    If somebody else took the name, a folder that is gone with this process.
    """
    folder = Path(tempfile.gettempdir()) / f"colift-{os.getuid()}"
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
        if found.st_uid == os.getuid() and stat.S_IMODE(found.st_mode) == 0o700:
            return folder
    except OSError:
        pass
    folder = Path(tempfile.mkdtemp(prefix="colift-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def monotonic_ns() -> int:
    """Monotonic clock in nanoseconds, usable inside kernels (and in plain Python)."""
    return time.perf_counter_ns()


def thread_time_ns() -> int:
    """Processor time of this thread in nanoseconds, usable inside kernels (and in plain Python)."""
    return time.thread_time_ns()


def _clock(linux: int, darwin: int) -> Any:
    """`clock_gettime` of one clock by symbol name, which keeps the cache of kernels valid."""
    clock_id = darwin if sys.platform == "darwin" else linux

    @intrinsic
    def read(typingctx: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            i64, i32 = ir.IntType(64), ir.IntType(32)
            timespec = cgutils.alloca_once(builder, ir.ArrayType(i64, 2))
            function = cgutils.get_or_insert_function(
                builder.module, ir.FunctionType(i32, [i32, timespec.type]), "clock_gettime"
            )
            builder.call(function, [i32(clock_id), timespec])
            seconds = builder.load(cgutils.gep_inbounds(builder, timespec, 0, 0))
            nanoseconds = builder.load(cgutils.gep_inbounds(builder, timespec, 0, 1))
            return builder.add(builder.mul(seconds, i64(1_000_000_000)), nanoseconds)

        return types.int64(), codegen

    return read


_read_monotonic, _read_thread = _clock(linux=1, darwin=6), _clock(linux=3, darwin=16)


@overload(monotonic_ns)
def _monotonic_ns_overload() -> Any:
    return lambda: _read_monotonic()


@overload(thread_time_ns)
def _thread_time_ns_overload() -> Any:
    return lambda: _read_thread()
