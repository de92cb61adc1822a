"""`colift export crazyflie`: the app lifts a load in a loop with the plant, gives up in time, and is code for the real drone."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from crazyflies import FORCE_TORQUE, HERE, PACKET, Crazyflies, built

from colift.kernel.phase import Phase

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")

WAITING, FLYING, GIVEN_UP = range(3)
TRIO = "crazyflie-trio"
ARM = ("arm-none-eabi-gcc", "-std=gnu11", "-O3", "-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-Wall", "-Wdouble-promotion", "-c")  # fmt: skip


def _export(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "colift", "export", "crazyflie", *arguments, "--out", str(folder)]  # fmt: skip
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def sources(tmp_path_factory):
    folder = tmp_path_factory.mktemp("crazyflie")
    made = _export(folder, TRIO)
    assert made.returncode == 0, made.stderr
    return folder / "src"


@pytest.fixture(scope="module")
def library(sources):
    return built(sources)


@pytest.fixture
def team(library, tmp_path):
    return Crazyflies(library, tmp_path, TRIO)


def _states(team):
    return [app.log("state") for app in team.apps]


@pytest.mark.slow
def test_three_take_off_lift_their_load_carry_it_and_land_though_they_hear_little(
    library, tmp_path
):
    team = Crazyflies(library, tmp_path, TRIO, loss=0.3)
    run = team.run()
    assert run.verdict.level == "pass", run.verdict.sentence
    assert run.metrics["lifted_m"] == pytest.approx(0.5, abs=0.02)
    assert run.recording["load"][-1, 0] == pytest.approx([0.6, 0.0, 0.0], abs=0.01)
    assert [app.log("phase") for app in team.apps] == [Phase.DONE] * 3
    assert _states(team) == [FLYING] * 3
    assert np.abs(run.recording["velocities"][-1]).max() < 1e-2


def test_nobody_flies_before_all_are_ready(team):
    team.apps[2].set("fly", 0)
    team.run(0.5)
    assert _states(team) == [WAITING] * 3
    assert team.modes == [0, 0, 0]  # the firmware's own controller
    team.fly()
    team.run(0.2)
    assert _states(team) == [FLYING] * 3
    assert team.modes == [FORCE_TORQUE] * 3


def test_who_is_not_where_the_mission_begins_holds_all_back(team):
    team.flight.bus.positions[1] += [0.4, 0.0, 0.0]
    team.apps[1].stabilize(0, np.concatenate([team.flight.bus.positions[1], np.zeros(3), [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 9.81], np.zeros(3)]))  # fmt: skip
    for _ in range(30):
        for i, app in enumerate(team.apps):
            app.track([0.0, 0.0, 0.0])
            app.cycle()
            team._carry(i, app.said())
    assert FLYING not in _states(team)


def test_without_the_load_the_firmware_holds_the_place(team):
    team.run(0.6)
    assert _states(team) == [FLYING] * 3
    for app in team.apps:
        app.track = lambda _: None  # the motion capture sees it no more
    before = team.flight.bus.positions[0, 0]
    team.run(0.4)
    assert _states(team) == [FLYING] * 3
    team.run(0.3)
    assert _states(team) == [GIVEN_UP] * 3
    state = np.concatenate([np.zeros(6), [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 9.81], np.zeros(3)])
    mode, _, torque = team.apps[0].stabilize(team.now, state)
    assert mode == 0
    assert torque[0] == pytest.approx(before, abs=0.1)  # the place that the stand-in was given
    team.fly(yes=False)
    team.run(0.05)
    assert _states(team) == [WAITING] * 3


def _packet(number=1, port=5, size=56, values=(0.0,) * 6 + (1.0,) + (0.0,) * 6):
    body = struct.pack("<BBH13f", number, 1, 1, *values)
    return bytes([size, 40, port]) + body.ljust(PACKET - 3, b"\0")


@pytest.mark.parametrize(
    "packet",
    [
        _packet(port=4), _packet(size=55), _packet(number=3), _packet(number=255), _packet(number=0),
        _packet(values=(float("nan"),) * 13), _packet(values=(0.0,) * 13),
    ],
    ids=["port", "size", "number", "255", "own", "nan", "attitude"],
)  # fmt: skip
def test_what_is_no_message_of_the_team_is_not_heard(team, packet):
    app = team.apps[0]
    app.hear(packet)
    team.step()
    app.cycle()
    assert app.log("silent") == 2


def test_a_message_of_the_team_is_heard(team):
    team.apps[0].hear(_packet())
    team.step()
    team.apps[0].cycle()
    assert team.apps[0].log("silent") == 1


def test_it_is_code_for_a_cortex_m4(sources, tmp_path):
    if shutil.which(ARM[0]) is None:
        pytest.skip("needs arm-none-eabi-gcc (gcc-arm-none-eabi)")
    objects = []
    for source in sorted(sources.glob("*.c")):
        made = tmp_path / f"{source.stem}.o"
        where = [f"-I{sources}", f"-I{HERE / 'firmware'}"]
        subprocess.run([*ARM, "-Werror", *where, str(source), "-o", str(made)], check=True)
        objects.append(str(made))
    told = subprocess.run(["arm-none-eabi-size", *objects], capture_output=True, text=True, check=True)  # fmt: skip
    sizes = np.array([line.split()[:3] for line in told.stdout.splitlines()[1:]], dtype=int)
    code, data, zero = sizes.sum(axis=0)
    assert code < 100_000  # of 1 MB
    assert data + zero < 12_000  # of 192 kB


def test_it_keeps_to_the_interface_of_the_real_firmware(sources, tmp_path):
    """CRAZYFLIE_FIRMWARE: a clone of bitcraze/crazyflie-firmware; FreeRTOS, a submodule of it, may be missing."""
    where = os.environ.get("CRAZYFLIE_FIRMWARE")
    if where is None or shutil.which(ARM[0]) is None:
        pytest.skip("needs CRAZYFLIE_FIRMWARE and arm-none-eabi-gcc")
    for name in ("FreeRTOS.h", "task.h"):
        shutil.copy(HERE / "firmware" / name, tmp_path)
    folders = [each for name in ("interface", "config") for each in Path(where, "src").rglob(name)]
    include = [f"-I{each}" for top in folders for each in (top, *filter(Path.is_dir, top.iterdir()))]  # fmt: skip
    app = str(sources / "colift_app.c")
    subprocess.run(
        [*ARM, "-DCONFIG_CONTROLLER_OOT=1", f"-I{sources}", f"-I{tmp_path}", *include, app, "-o", str(tmp_path / "app.o")], check=True
    )  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (["agile-box"], "load.kind: the app carries a point"),
        (["leaderless"], "agents.kind"),
        (["four-to-three"], "events"),
        (["hover", "--set", "allocation.kind=ring"], "allocation.kind: in single precision sqp and safe were tried"),
        (["hover", "--set", "timing.attitude_control=0.0005", "--set", "timing.step=0.0005"], "timing.attitude_control: must be whole milliseconds"),
    ],
)  # fmt: skip
def test_what_the_app_cannot_do_is_refused(tmp_path, arguments, why):
    made = _export(tmp_path / "out", *arguments)
    assert made.returncode != 0
    assert why in " ".join(made.stderr.split())
    assert not (tmp_path / "out").exists()
