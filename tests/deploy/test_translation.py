"""The translator: every kernel of the controllers is C without a warning, and what C would do otherwise is refused."""

from __future__ import annotations

import importlib.util
import shutil
import subprocess
import textwrap
from pathlib import Path

import pytest

from colift import catalogue
from colift.deploy.c.header import header_of
from colift.deploy.c.kernels import Kernel
from colift.deploy.c.layers import LAYERS
from colift.deploy.c.program import Program
from colift.deploy.c.source import UntranslatableError
from colift.deploy.c.types import INT, REAL, Array
from colift.part import find

FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror")  # fmt: skip

compiler = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
KERNELS = [
    (layer, kind)
    for layer in LAYERS
    for kind in catalogue.own_names(layer)
    if hasattr(find(layer, kind).kernel, "py_func")
]


def test_all_but_the_oracles_are_compiled_kernels():
    plain = {
        f"{layer}/{kind}"
        for layer in LAYERS
        for kind in catalogue.own_names(layer)
        if (layer, kind) not in KERNELS
    }
    assert plain == {f"allocation/{kind}" for kind in ("ipopt", "slsqp", "wahba-hoenig", "wahba-hoenig-wrench")}  # fmt: skip


@compiler
@pytest.mark.parametrize("single", [False, True])
@pytest.mark.parametrize(("layer", "kind"), KERNELS)
def test_every_kernel_is_c_without_a_warning(layer, kind, single, tmp_path):
    kernel = Kernel(find(layer, kind), kind, single=single)
    text = kernel.file("colift.h")
    assert not [word for word in ("malloc", "static double ", "double ") if word in text and single]
    (tmp_path / "colift.h").write_text(header_of([kernel]))
    (tmp_path / "kernel.c").write_text(text)
    more = ["-Wdouble-promotion"] if single else []
    subprocess.run(["gcc", *FLAGS, *more, "-c", "kernel.c"], cwd=tmp_path, check=True)


def _helper(text: str, folder: Path):
    """A function of a file of its own, as translator and Python find it."""
    file = folder / "helper.py"
    file.write_text("import math\n\n" + textwrap.dedent(text))
    spec = importlib.util.spec_from_file_location("helper_of_a_test", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.f


@pytest.mark.parametrize(
    ("body", "why"),
    [
        ("return a[-1]", "counted from the end"),
        ("return a[n - 1] or x", "and, or as something else"),
        ("return x if n and x else x", "and, or as something else"),
        ("return x ** 0.5", "powers"),
        ("return x ** n", "powers"),
        ("return 3000000000 + n", "32 bits"),
        ("return math.gamma(x)", "no such function"),
        ("b = a[::2]\n    return b[0]", "a part with a step"),
        ("for i in range(n):\n        x += i\n    return x + i", "used behind the loop"),
        ("for i in range(n):\n        i = 0\n    return x", "counts a loop"),
        ("for v in a:\n        x += v\n    return x", "only loops over a range"),
        ("try:\n        x = 1.0 / x\n    except ZeroDivisionError:\n        x = 0.0\n    return x", "no such statement"),
        ("b = [v for v in a]\n    return x", "no such expression"),
        ("if n > 0:\n        return x\n    return a", "different kinds"),
        ("a.fill(0.0)\n    return x", "no such"),
        ("y = a if n > 2 else x\n    return x", "now of one kind"),
        ("return x // 2.0", "for other numbers"),
        ("if n == 0:\n        x = 1.0\n    elif (x, 2.0, x)[n] > 0.0:\n        x = 2.0\n    return x", "a variable of its own"),
        ("return x if n > 2 or (x, 2.0, x)[n] > 0.0 else 2.0", "a variable of its own"),
        ("return g(x)\n\nfrom colift.kernel.jit import inline\n\n@inline\ndef g(x, n=1):\n    return x", "other arguments"),
    ],
)  # fmt: skip
def test_what_c_does_otherwise_is_refused_with_file_and_line(body, why, tmp_path):
    function = _helper(f"def f(a, n, x):\n    {body}\n", tmp_path)
    kinds = (Array(), INT, REAL)
    with pytest.raises(UntranslatableError, match=rf"helper.py:\d+: .*{why}"):
        Program().translation(function, kinds)


def test_order_that_c_leaves_open_is_refused(tmp_path):
    function = _helper(
        """
        from colift.kernel.jit import inline

        @inline
        def put(a):
            a[0] = 1.0
            return a[0]

        def f(a):
            return a[0] + put(a)
        """,
        tmp_path,
    )
    with pytest.raises(UntranslatableError, match="which comes first"):
        Program().translation(function, (Array(),))


@compiler
def test_what_c_counts_with_hides_no_variable(tmp_path):
    text = "k = n - 1\n    b = a[:k]\n    b[:] = 0.0\n    return a[k]"
    program = Program()
    made = program.translation(_helper(f"def f(a, n):\n    {text}\n", tmp_path), (Array(), INT))
    (tmp_path / "none.h").touch()
    (tmp_path / "f.c").write_text(program.file([made], "none.h"))
    subprocess.run(["gcc", *FLAGS, "-Wshadow", "-c", "f.c"], cwd=tmp_path, check=True)


@compiler
@pytest.mark.parametrize(
    ("body", "arguments"),
    [
        ("return float(n // 3) + 10.0 * float(n % 3)", [(0.0, n) for n in range(-7, 8)]),
        ("return x % 2.5", [(x, 0) for x in (-7.5, -2.5, -1.0, -0.0, 0.0, 1.0, 2.5, 7.25)]),
        ("return min(x, 1.0) + 10.0 * max(x, -1.0, 0.5)", [(x, 0) for x in (-2.0, 0.7, float("nan"))]),
        ("return x ** 7 + (x + 1.0) ** 3", [(x, 0) for x in (-1.5, 0.25, 1.125)]),
        ("y, x = x, 2.0 * x\n    return y - 3.0 * x", [(1.1, 0)]),
        ("return float(round(x))", [(x, 0) for x in (-2.5, -1.5, 0.5, 1.5, 2.4999)]),
        ("return float(n / 4) - n / 3.0", [(0.0, n) for n in (-5, 7)]),
        ("return 1.0 if 0 < n <= 3 else -(-x)", [(0.5, n) for n in range(5)]),
        ("for k in range(n):\n        if k == 3:\n            break\n    else:\n        return 1.0\n    return 2.0", [(0.0, 2), (0.0, 9)]),
        ("for k in range(n, 0, -2):\n        n -= 1\n        x = 2.0 * x + k\n    return x + n", [(0.1, 9)]),
        ("return 1.0 if n in (n | 1, 2) else x", [(0.5, n) for n in range(4)]),
        ("k_end = 3\n    for k in range(n + k_end):\n        k_end += 1\n        x = 2.0 * x + k_end\n    return x", [(0.1, 2)]),
        ("a = b = c = d = e = 1\n    for k in range(n):\n        e = d\n        d = c\n        c = b\n        b = a\n        a = x\n    return float(e)", [(0.5, n) for n in range(7)]),
        ("t = (x, 2.0, 3.0)\n    s = 0.0\n    for k in range(3):\n        s = s * x + t[k]\n    return s", [(1.3, 0)]),
    ],
)  # fmt: skip
def test_c_computes_what_python_computes(body, arguments, tmp_path):
    function = _helper(f"def f(x, n):\n    {body}\n", tmp_path)
    program = Program()
    made = program.translation(function, (REAL, INT))
    calls = "".join(
        f'printf("%a\\n", {made.name}({"NAN" if x != x else x.hex()}, {n}));' for x, n in arguments
    )
    (tmp_path / "none.h").write_text("#include <stdio.h>\n")
    text = program.file([made], "none.h") + f"int main(void) {{ {calls} return 0; }}\n"
    (tmp_path / "f.c").write_text(text.replace("\ndouble helper", "\nstatic double helper"))
    subprocess.run(["gcc", *FLAGS, "f.c", "-o", "f", "-lm"], cwd=tmp_path, check=True)
    found = subprocess.run([str(tmp_path / "f")], capture_output=True, text=True, check=True)
    wanted = [float(function(x, n)) for x, n in arguments]
    assert [float.fromhex(line).hex() for line in found.stdout.split()] == [w.hex() for w in wanted]
