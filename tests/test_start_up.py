"""Help and names come at once, kernels when they are needed; messages say what can be installed."""

from __future__ import annotations

import ast
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import colift
from colift import catalogue, extras
from colift.cli import _commands
from colift.kernel import jit, prebuilt
from colift.part import find

ROOT = Path(__file__).parents[1]
HEAVY = {"numpy", "numba", "llvmlite", "scipy", "h5py", "matplotlib"}
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
needs_jit = pytest.mark.skipif(not jit.JIT_ENABLED, reason="compiled kernels only")


def modules_after(*arguments: str) -> set[str]:
    """What `colift ARGUMENTS` has imported when it ends."""
    script = (
        "import sys\n"
        f"sys.argv = ['colift', *{arguments!r}]\n"
        "from colift.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "print('\\n@' + ' '.join(sys.modules))\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], text=True, capture_output=True, check=True, timeout=900
    )
    return set(done.stdout.rpartition("@")[2].split())


def test_help_imports_nothing_heavy():
    found = modules_after("--help")
    assert not found & {*HEAVY, "pydantic", "rich.console", "rich.progress"}
    assert not {name for name in found if name.startswith("colift.cli.")} - {
        "colift.cli.base", "colift.cli._commands",
    }  # fmt: skip


def test_list_imports_neither_kernels_nor_numbers():
    found = modules_after("list")
    assert not found & HEAVY
    assert not found & {"colift.part", "colift.kernel.jit", "colift.mission.load"}


def test_a_command_imports_itself_alone():
    found = modules_after("list", "--json")
    assert not found & {"rich.table", "rich.progress", "colift.cli.run", "colift.cli.stress"}


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    modules_after("compile", "paper-spiral", "--json")
    folder = tmp_path_factory.mktemp("flight") / "out"
    return modules_after(
        "run", "--no-report", "--json", "--set", "timing.duration=0.1", "--out", str(folder)
    )


def test_a_run_without_report_draws_nothing(flown):
    assert not flown & {"matplotlib", "scipy.linalg", "rich.progress", "PIL", "mujoco", "casadi"}


@needs_jit
def test_a_run_loads_the_kernels_of_its_mission_only(flown):
    kernels = {
        name for name in flown
        if (parts := name.split("."))[0] == "colift" and len(parts) == 4
        and parts[2] in catalogue.FOLDERS and parts[3].replace("_", "-") in catalogue.own_names(parts[2])
    }  # fmt: skip
    assert "colift.control.allocation.sqp" in kernels
    assert "colift.control.allocation.safe" not in kernels
    assert (
        len(kernels) <= len(catalogue.LAYERS) + 2
    )  # a descent, and a push in the place of no disturbance


@needs_jit
def test_what_is_compiled_is_loaded_without_the_means_to_compile_which_come_when_needed(
    flown, tmp_path
):
    assert not flown & {
        "numba.np.arraymath",
        "numba.np.npyimpl",
        "numba.np.arrayobj",
        "scipy.linalg",
    }
    program = tmp_path / "program.py"
    program.write_text("""
import sys
import numpy as np
import colift.control.reference.spiral
before = "numba.np.arraymath" in sys.modules
from colift.kernel.jit import f8, kernel, vector
@kernel(f8(vector))
def total(values):
    return np.sum(np.sort(values)) + len([v for v in values if v > 1.0])
assert total(np.array([3.0, 1.0, 2.0])) == 8.0
print(before, "numba.np.arraymath" in sys.modules)
""")
    done = subprocess.run(
        [sys.executable, str(program)], text=True, capture_output=True, check=True, timeout=600
    )
    assert done.stdout.split() == ["False", "True"]


@needs_jit
def test_a_kernel_from_the_cache_can_be_part_of_a_new_one(tmp_path):
    """Its bitcode is read again when another is compiled with it; what a helper raises is raised."""
    (tmp_path / "inner.py").write_text("""
from colift.kernel.jit import f8, inline, kernel, vector
@inline
def at_least_one(x):
    if x < 1.0:
        raise ValueError("too small", x)
    return x * 2.0
@kernel(f8(vector))
def twice(values):
    return at_least_one(values[0])
""")
    outer = """
from colift.kernel.jit import f8, kernel, vector
from inner import twice
@kernel(f8(vector))
def more(values):
    return twice(values) + {}
"""
    program = """
import sys
sys.path.insert(0, {folder!r})
import numpy as np
import inner, outer
print(outer.more(np.array([3.0])), sum(inner.twice.stats.cache_hits.values()))
try:
    inner.twice(np.array([0.5]))
except ValueError as error:
    print(error.args)
"""
    said = []
    for added in (
        "1.0",
        "2.00",
    ):  # of another length: Python's own cache knows a file by its second and size
        (tmp_path / "outer.py").write_text(outer.format(added))
        done = subprocess.run(
            [sys.executable, "-c", program.format(folder=str(tmp_path))],
            env=os.environ | {"COLIFT_CACHE": str(tmp_path / "cache")},
            text=True, capture_output=True, check=True, timeout=600,
        )  # fmt: skip
        said.append(done.stdout.splitlines())
    assert said == [["7.0 0", "('too small', 0.5)"], ["8.0 1", "('too small', 0.5)"]]


def test_help_says_of_each_command_what_its_file_says():
    app = __import__("colift.cli", fromlist=["app"]).app
    for name, module in _commands.files().items():
        __import__(f"colift.cli.{module}")
        (info,) = (
            i for i in app.registered_commands if i.callback.__module__.endswith(f".{module}")
        )
        assert (info.name or info.callback.__name__) == name
        first = " ".join(info.callback.__doc__.split())
        assert _commands.summary(module)
        assert first.startswith(_commands.summary(module))


def test_a_misspelt_command_names_the_nearest():
    done = subprocess.run(
        [sys.executable, "-m", "colift", "comapre"], text=True, capture_output=True, check=False
    )
    assert done.returncode == 2
    assert "'compare'" in done.stderr


# ---------------------------------------------------------------- compiling beforehand


@needs_jit
def test_warm_compiles_once_and_tells(tmp_path):
    script = """
import json
import colift
told = []
done = colift.warm(allocator="min-norm", progress=lambda share, kernel: told.append([share, kernel]))
again = colift.warm(allocator="min-norm")
colift.Allocator(__import__("colift.part").part.find("allocation", "min-norm")(), 4).allocate([0, 0, 2])
print(json.dumps([told, done.compiled, done.loaded, again.compiled, again.loaded]))
"""
    environment = os.environ | {"COLIFT_CACHE": str(tmp_path)}
    runs = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", script],
            env=environment, text=True, capture_output=True, check=True, timeout=600,
        )  # fmt: skip
        assert done.stderr == ""  # a library prints nothing
        runs.append(json.loads(done.stdout))
    first, second = runs
    call, own = "control.allocation.base.ask", "control.allocation.min_norm.allocate"
    assert first == [[[0.0, call], [0.0, own], [1.0, ""]], [call, own], 0, [], 0]
    assert second == [[[1.0, ""]], [], 2, [], 0]


@needs_jit
def test_compile_says_how_much_it_did_and_is_done_when_another_copy_of_colift_did_it(tmp_path):
    command = [sys.executable, "-m", "colift", "compile", "--allocator", "min-norm", "--json"]
    here, copy = Path(colift.__file__).parent, tmp_path / "src" / "colift"
    shutil.copytree(here, copy, ignore=shutil.ignore_patterns("__pycache__"))
    done = []
    for package in (here, copy):
        environment = os.environ | {
            "COLIFT_CACHE": str(tmp_path / "cache"), "PYTHONPATH": str(package.parent)
        }  # fmt: skip
        said = subprocess.run(
            command, env=environment, text=True, capture_output=True, check=True, timeout=600
        ).stdout
        done.append(json.loads(said))
    assert [(each["compiled"], each["loaded"]) for each in done] == [
        (["control.allocation.base.ask", "control.allocation.min_norm.allocate"], 0), ([], 2),
    ]  # fmt: skip


@needs_jit
def test_machine_code_that_came_along_is_not_compiled(tmp_path):
    """As in a wheel that ``hatch_build.py`` has put it into."""
    if prebuilt.processor() is None:
        pytest.skip("no machine code comes for a processor like this one")
    command = [sys.executable, "-m", "colift", "compile", "--allocator", "min-norm", "--json"]
    name, features = prebuilt.processor()
    package = tmp_path / "src" / "colift"
    shutil.copytree(
        Path(colift.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__")
    )

    def compiled(cache, **told):
        environment = {"COLIFT_CACHE": str(tmp_path / cache), "PYTHONPATH": str(package.parent)}
        said = subprocess.run(
            command, env=os.environ | environment | told, text=True, capture_output=True, check=True, timeout=600,
        ).stdout  # fmt: skip
        return len(json.loads(said)["compiled"])

    assert compiled("release", NUMBA_CPU_NAME=name, NUMBA_CPU_FEATURES=features) == 2
    (tmp_path / "release").rename(package / prebuilt.FOLDER.name)
    assert compiled("empty") == 0


def test_machine_code_for_a_processor_with_more_is_left_alone(monkeypatch):
    monkeypatch.setattr(prebuilt, "COMMON", {platform.machine(): ("generic", "+no-such-feature")})
    assert prebuilt.processor.__wrapped__() is None


@needs_jit
def test_what_a_mission_needs_is_there_after_it_was_warmed():
    script = """
import colift
from colift.kernel import jit, prebuilt
mission = {"name": "x", "reference": {"kind": "hover"}, "plant": {"kind": "slack-cables"},
           "disturbance": [{"kind": "wind"}], "timing": {"duration": 0.1},
           "events": [{"at": 0.05, "field": "allocation.kind", "value": "sqp"}]}
colift.warm(mission)
before = len(jit.made)
colift.run(mission)
assert len(jit.made) == before, jit.made[before:]
"""
    subprocess.run([sys.executable, "-c", script], check=True, timeout=900)


@needs_jit
def test_everything_is_every_file_with_a_kernel():
    """But for the one that runs only under another program, which counts its instructions."""
    script = """
import sys
from pathlib import Path
import colift
colift.warm()
root = Path(colift.__file__).parent
for path in root.rglob("*.py"):
    name = ".".join(("colift", *path.relative_to(root).with_suffix("").parts))
    if "\\n@kernel(" in path.read_text() and name not in sys.modules:
        print(name)
"""
    done = subprocess.run(
        [sys.executable, "-c", script], text=True, capture_output=True, check=True, timeout=900
    )
    assert done.stdout.split() == ["colift.study.bench._under_valgrind"]


def test_what_cannot_be_warmed_is_refused():
    with pytest.raises(colift.ColiftError, match="did you mean 'safe'"):
        colift.warm(allocator="saef")
    with pytest.raises(colift.ColiftError, match="no mission named 'hovr'"):
        colift.warm("hovr")


# ---------------------------------------------------------------- what can be installed


@pytest.mark.parametrize("extra", EXTRAS)
@pytest.mark.parametrize("installed", [True, False])
def test_what_a_message_installs_is_what_the_project_declares(extra, installed, monkeypatch):
    if not installed:

        def absent(_name):
            raise extras.importlib.metadata.PackageNotFoundError

        monkeypatch.setattr(extras.importlib.metadata, "requires", absent)  # fmt: skip
    found = {Requirement(text) for text in extras.requirements(extra)}
    assert found == {Requirement(text) for text in EXTRAS[extra]}
    assert all(f"{each.name}" in extras.install(extra) for each in found)
    assert "colift[" not in extras.install(extra)


def test_the_command_is_for_this_python(monkeypatch):
    monkeypatch.setattr(
        extras.shutil, "which", lambda _, path=None: None if path else "/usr/bin/pip"
    )
    assert extras.install("qp").startswith(f"{sys.executable} -m pip install ")


def test_no_message_names_an_install_that_does_not_work():
    """Every text in the sources that says how to install takes its command from the project's own declaration."""
    for path in (ROOT / "src/colift").rglob("*.py"):
        texts = [
            node.value for node in ast.walk(ast.parse(path.read_text()))
            if isinstance(node, ast.Constant) and isinstance(node.value, str)
        ]  # fmt: skip
        assert not [text for text in texts if re.search(r"pip install \S|colift\[", text)], path
    for path in [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]:
        assert "colift[" not in path.read_text(), path


def test_every_part_that_needs_a_package_names_an_extra_that_brings_it(monkeypatch):
    needing = [
        part for layer in catalogue.LAYERS for kind in catalogue.own_names(layer)
        if (part := find(layer, kind)).needs
    ]  # fmt: skip
    assert len(needing) >= 4
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    for part in needing:
        package, extra = part.needs
        assert any(Requirement(text).name == package for text in EXTRAS[extra])
        assert f"needs the package {package}: " in part.missing()
        assert extras.install(extra) in part.missing()
