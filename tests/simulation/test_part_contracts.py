"""What every part of every layer must keep, over everything that discovery finds."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys

import colift
from colift import part
from colift.control.allocation import base as allocation
from colift.errors import ColiftError, SettingError, UnknownNameError
from colift.flight.flight import Flight
from colift.flight.loop import FUNCTIONS
from colift.kernel import jit
from colift.kernel.ports import PORTS
from colift.kernel.signals import CONDITIONS, HIDDEN, SIGNALS
from colift.mission import load_mission
from colift.team import Team
from colift.wording import meanings
from colift.world.fault.base import LOAD
from colift.world.plant.base import Start

SIGNATURES = {
    layer: {
        function: PORTS[port].signature
        for port, (of, function) in {**FUNCTIONS, "disturbance": ("disturbance", "kernel")}.items()
        if of == layer
    }
    for layer in (*part.LAYERS, "disturbance")
}
EVERY = [(layer, name) for layer in (*part.LAYERS, "disturbance") for name in part.names(layer)]
FAULTS = part.names("fault")
IDS = [f"{layer}/{name}" for layer, name in EVERY]
needs_jit = pytest.mark.skipif(not jit.JIT_ENABLED, reason="compiled kernels only")


def mission_with(layer, name, **overrides):
    table = {"name": "test", "reference": {"kind": "spiral"}, "timing": {"duration": 1.2}}
    if name == "motor-degraded":
        table["actuation"] = {"kind": "motors"}
    if name == "leaderless-wrench":  # for a load with an attitude only
        table["load"] = {"kind": "rigid", "mass": 0.5, "size": [0.6, 0.4, 0.2]}
    table[layer] = [{"kind": name}] if layer in part.LISTS else {"kind": name}
    return load_mission(table, overrides)


def test_every_folder_has_a_part():
    assert set(PORTS) == {*FUNCTIONS, "disturbance"}
    assert {layer for layer, _ in FUNCTIONS.values()} == set(part.LAYERS)
    assert {layer for layer, _ in EVERY} | {"fault"} == set(part.FOLDERS)
    assert FAULTS


def test_every_signal_has_one_writer_or_is_a_condition():
    assert {signal.writer for signal in (*HIDDEN, *SIGNALS)} == {*PORTS, ""}
    unwritten = [signal.name for signal in SIGNALS if not signal.writer]
    assert unwritten == [*CONDITIONS, "reeled"]  # the loop writes what winches do


@pytest.mark.parametrize(("layer", "name"), EVERY, ids=IDS)
class TestEveryPart:
    """Of whatever layer."""

    @pytest.fixture(autouse=True)
    def _installed(self, layer, name):
        if message := part.find(layer, name).missing():
            pytest.skip(message)

    def test_is_a_documented_part_of_its_layer(self, layer, name):
        found = part.find(layer, name)
        assert issubclass(found, part.Part)
        assert found.layer == layer
        assert found.__doc__
        described = meanings(found)
        for field in found.model_fields:
            assert described.get(field), f"{field} has no docstring"

    @needs_jit
    def test_kernel_has_the_signature_of_its_layer(self, layer, name):
        found = part.find(layer, name)
        if found.needs:
            pytest.skip("a plain Python kernel")
        for function, wanted in SIGNATURES[layer].items():
            assert getattr(found, function).nopython_signatures == [wanted]

    @pytest.mark.parametrize("n", [1, 2, 4, 11])
    def test_params_and_memory_are_vectors(self, layer, name, n):
        settings, team = part.find(layer, name)(), Team.uniform(n)
        start = Start(
            np.zeros(3), np.zeros(3), np.tile([0.0, 0.0, -1.0], (n, 1)), np.eye(4)[[0] * n]
        )
        vectors = [settings.params(team), settings.memory(team)]
        if layer == "plant":
            vectors.append(settings.initial(team, start))
            assert vectors[2].shape == vectors[1].shape
        for vector in vectors:
            assert isinstance(vector, np.ndarray)
            assert vector.dtype == np.float64
            assert vector.ndim == 1
            assert vector.flags.c_contiguous
            assert np.isfinite(vector).all()
        assert settings.memory(team) is not settings.memory(team)
        # A vector may be refilled between two calls, so its length depends on the team alone.
        assert settings.params(Team.uniform(n, load_mass=0.5)).shape == vectors[0].shape

    def test_refuses_unknown_settings_and_numbers_that_are_not_finite(self, layer, name):
        found = part.find(layer, name)
        with pytest.raises(SettingError, match="no_such_setting: unknown key"):
            found(no_such_setting=1.0)
        for field, info in found.model_fields.items():
            if info.annotation is float:
                with pytest.raises(SettingError, match=f"^{field}: must be a finite number"):
                    found(**{field: float("nan")})

    def test_settings_survive_a_mission_file(self, layer, name):
        mission = mission_with(layer, name)
        again = load_mission(mission.resolved())
        assert getattr(again, layer) == getattr(mission, layer)
        assert again.resolved() == mission.resolved()
        kinds = {**again.kinds, **again.list_kinds}
        assert kinds[layer] == ([name] if layer in part.LISTS else name)

    def test_flies_with_its_defaults(self, layer, name):
        recording = Flight(mission_with(layer, name, **{"timing.duration": 0.3})).run()
        assert recording.outcome == "completed"
        error = np.linalg.norm(recording["load"][:, 0] - recording["reference"][:, 0], axis=1)
        if name != "external":  # nobody drives it here
            assert error.max() < 0.05

    @needs_jit
    def test_allocates_nothing_in_the_loop(self, layer, name):
        """The number of allocations of a stretch of flight does not depend on its length."""
        flight = Flight(mission_with(layer, name))
        assert flight.compiled or part.find(layer, name).needs
        if not flight.compiled:
            pytest.skip("a plain Python kernel")
        _nrt_python.memsys_enable_stats()
        flight.advance(0.1)

        def allocations(seconds):
            before = rtsys.get_allocation_stats().alloc
            flight.advance(seconds)
            return rtsys.get_allocation_stats().alloc - before

        assert allocations(0.01) == allocations(1.0)


@pytest.mark.parametrize("name", FAULTS)
class TestEveryFault:
    """What breaks in flight."""

    def test_is_documented_and_survives_a_mission_file(self, name):
        found = part.find("fault", name)
        assert found.layer == "fault"
        assert found.__doc__
        mission = mission_with("fault", name)
        assert load_mission(mission.resolved()).resolved() == mission.resolved()

    def test_changes_conditions_only_and_by_the_seed(self, name):
        settings, n = part.find("fault", name)(), 5
        resolved = [settings.resolve(np.random.default_rng(k), n, 8.0) for k in (0, 0, 1, 2, 3)]
        assert resolved[0] == resolved[1]
        assert len({str(each) for each in resolved}) > 1
        for change in (change for each in resolved for change in each):
            assert change.signal in CONDITIONS
            assert change.drone in (None, LOAD) or 0 <= change.drone < n
            assert change.at >= 0.0
        fixed = part.find("fault", name)(at=2.0, drone=3).resolve(np.random.default_rng(0), n, 8.0)
        assert min(change.at for change in fixed) == 2.0
        assert {change.drone for change in fixed} <= {3, None}

    def test_does_not_stop_the_flight(self, name):
        table = {"name": "test", "reference": {"kind": "hover"}, "timing": {"duration": 0.4}}
        table["fault"] = [{"kind": name, "at": 0.2, "drone": 1}]
        if name == "motor-degraded":
            table["actuation"] = {"kind": "motors"}
        recording = Flight(load_mission(table)).run()
        assert recording.outcome == "completed"
        assert len(recording.time) == 81


# ---------------------------------------------------------------- discovery


@pytest.mark.parametrize("layer", part.FOLDERS)
def test_unknown_name_lists_the_valid_ones_and_the_nearest(layer):
    valid = part.names(layer)
    misspelt = valid[0] + "x"
    with pytest.raises(UnknownNameError) as caught:
        part.find(layer, misspelt)
    text = str(caught.value)
    assert f"did you mean {valid[0]!r}?" in text
    for name in valid:
        assert name in text
    assert caught.value.valid == tuple(valid)


def test_unknown_layer():
    for call in (part.names, lambda layer: part.find(layer, "pid")):
        with pytest.raises(UnknownNameError, match="did you mean 'allocation'"):
            call("alocation")


def test_helpers_are_not_parts():
    for layer in part.FOLDERS:
        assert not {"base", "-fixed", "_fixed", "--init--"} & set(part.names(layer))


def test_names_do_not_compile_anything():
    code = (
        "import sys; from colift import part; [part.names(layer) for layer in part.LAYERS];"
        "print([m for m in sys.modules if m.endswith(('.sqp', '.manifold', '.rigid_cables'))])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


# ---------------------------------------------------------------- plain Python parts


def share_evenly(now, sees, params, memory, writes):
    """A ring about the vertical that leans by the force: equal cables, written without NumPy calls."""
    force, info = sees.force, writes.allocator_info
    tensions, directions = writes.desired_tensions, writes.desired_directions
    n = tensions.shape[0]
    memory[0] += 1.0
    for k in range(3):
        info[k] = 0.0
    for i in range(n):
        x = -params[0] * np.cos(2.0 * np.pi * i / n) - force[0] / (n * params[1])
        y = -params[0] * np.sin(2.0 * np.pi * i / n) - force[1] / (n * params[1])
        z = -force[2] / (n * params[1])
        size = np.sqrt(x * x + y * y + z * z)
        tensions[i] = size * params[1]
        directions[i, 0] = x / size
        directions[i, 1] = y / size
        directions[i, 2] = z / size
    info[4] = 0.0
    return 0


class Plain(allocation.AllocatorPart):
    """Plain Python."""

    kernel = share_evenly

    def params(self, team):
        return np.array([0.7, 0.55])

    def memory(self, team):
        return np.zeros(1)


@pytest.fixture
def twins(monkeypatch):
    """The same allocator in plain Python and compiled, registered for one test."""
    import numba

    class Compiled(Plain):
        """Compiled."""

        kernel = numba.njit(allocation.SIGNATURE, error_model="numpy")(share_evenly)

    monkeypatch.setattr(part, "_registered", dict(part._registered))
    part.register("twin-python", Plain)
    part.register("twin-compiled", Compiled)


@needs_jit
def test_a_plain_python_part_flies_the_same_loop(twins):
    assert {"twin-python", "twin-compiled", "sqp"} <= set(part.names("allocation"))
    runs = [
        colift.run("figure-eight", allocator=kind, timing__duration=0.3, timing__recording=0.001)
        for kind in ("twin-python", "twin-compiled")
    ]
    assert [run.compiled for run in runs] == [False, True]
    for name, values in runs[0].recording.arrays.items():
        if name != "allocator_time":
            np.testing.assert_allclose(values, runs[1].recording[name], rtol=0, atol=1e-9)
    assert np.ptp(runs[0].recording["positions"]) > 0.01
    assert runs[0].recording.outcome == runs[1].recording.outcome == "completed"


def test_registered_parts_may_be_used_by_missions(twins):
    mission = load_mission("hover", {"allocation.kind": "twin-python"})
    assert isinstance(mission.allocation, Plain)
    assert mission.resolved()["allocation"] == {"kind": "twin-python"}


def test_register_refuses_a_layer_that_does_not_exist():
    class Odd(part.Part):
        """Odd."""

        layer = "alocation"
        kernel = share_evenly

    with pytest.raises(UnknownNameError, match="did you mean 'allocation'"):
        part.register("odd", Odd)


def test_a_users_file_registers_its_parts(tmp_path, monkeypatch):
    monkeypatch.setattr(part, "_registered", dict(part._registered))
    path = tmp_path / "my_hover.py"
    path.write_text(
        "from colift.control.reference.base import ReferencePart\n"
        "def kernel(now, sees, params, memory, writes):\n"
        "    writes.reference[:] = 0.0\n"
        "    writes.reference[0, 2] = 2.0\n"
        "class MyHover(ReferencePart):\n"
        "    '''Two metres up.'''\n"
        "    kernel = kernel\n"
    )
    (found,) = part.load_file(path)
    assert part.find("reference", "my-hover") is found
    run = colift.run({"name": "x", "reference": {"kind": "my-hover"}, "timing": {"duration": 0.1}})
    assert not run.compiled
    np.testing.assert_allclose(run.recording["load"][:, 0], [[0.0, 0.0, 2.0]] * 21, atol=0.01)


@pytest.mark.parametrize("text", ["x = 1\n", None])
def test_a_users_file_without_a_part_is_an_error(tmp_path, text):
    path = tmp_path / "nothing.py"
    if text is not None:
        path.write_text(text)
    with pytest.raises(ColiftError, match=r"nothing\.py"):
        part.load_file(path)


# ---------------------------------------------------------------- without compilation

SHORT_FLIGHT = """
import sys, numpy, colift
run = colift.run("figure-eight", allocator=sys.argv[1], timing__duration=0.2, timing__recording=0.01)
arrays = {k: v for k, v in run.recording.arrays.items() if not k.startswith("allocator")}
numpy.savez(sys.argv[2], compiled=run.compiled, **arrays)
"""


# The SQP answers to its tolerance only, and differences of directions over 1 ms enter the body rates.
@pytest.mark.parametrize(("allocator", "tolerance"), [("ring", 1e-9), ("sqp", 1e-5)])
def test_the_loop_without_compilation_gives_the_same_numbers(tmp_path, allocator, tolerance):
    path = tmp_path / "plain.npz"
    subprocess.run(
        [sys.executable, "-c", SHORT_FLIGHT, allocator, str(path)],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        check=True,
    )
    compiled = colift.run(
        "figure-eight", allocator=allocator, timing__duration=0.2, timing__recording=0.01
    ).recording
    with np.load(path) as plain:
        assert not plain["compiled"]
        for name in set(plain) - {"compiled"}:
            np.testing.assert_allclose(
                plain[name], compiled[name], rtol=0, atol=tolerance, err_msg=name
            )
        assert len(plain.files) > 15
