"""The leaderless team: cables stay apart whatever is lost, the force is agreed on, and everybody comes to an end."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest

import colift
from colift.control.agents import _message as message
from colift.control.agents import leaderless
from colift.control.agents.base import Status
from colift.flight.flight import Flight
from colift.kernel.signals import MESSAGE
from colift.mission import load_mission
from colift.mission.warnings import warnings_of
from colift.study import hostility

SOURCES = Path(leaderless.__file__).parent
FILES = ("_evidence", "_frame", "_message", "_pairs", "leaderless")
MUTANTS = {
    "adopts at once": ("_pairs", "good = keeps(memory, o, a, o + Q.r0, scratch, least)", "good = True"),
    "takes messages twice": ("leaderless", "if count <= memory[o + Q.count] or int", "if int"),
    "forgets what is acknowledged": (
        "_pairs", "    memory[o + Q.state] = OFFERED\n", "    memory[o + Q.state] = SETTLED\n    for k in range(3):\n        memory[o + Q.r0 + k] = memory[o + Q.r1 + k]\n",
    ),
    "reads no seal": ("leaderless", "if not message.is_sealed(", "if False and message.is_sealed("),
    "does not see a restart": ("leaderless", "if session != memory[o + Q.session]:", "if False:"),
    "moves among strangers": ("leaderless", "            return False\n    x, y, z = _push_in", "            pass\n    x, y, z = _push_in"),
}  # fmt: skip
"""File, what stands there, and what stands there in the mutant."""


def mutant(name: str, folder: Path) -> type[leaderless.Leaderless]:
    """The scheme with one line wrong, in a package of its own."""
    package = "mutant_" + name.replace(" ", "_")
    (folder / package).mkdir()
    file, old, new = MUTANTS[name]
    for each in FILES:
        text = (SOURCES / f"{each}.py").read_text()
        if each == file:
            assert text.count(old) == 1
            text = text.replace(old, new)
        text = text.replace("from colift.control.agents import _", f"from {package} import _")
        for inner in ("_message", "_pairs"):
            text = text.replace(f"from colift.control.agents.{inner}", f"from {package}.{inner}")
        (folder / package / f"{each}.py").write_text(text)
    (folder / package / "__init__.py").write_text("")
    sys.path.insert(0, str(folder))
    try:
        found: type[leaderless.Leaderless] = importlib.import_module(
            f"{package}.leaderless"
        ).Leaderless
    finally:
        sys.path.remove(str(folder))
    return found


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")
@pytest.mark.parametrize("n", [2, 3, 4, 8])
def test_cables_stay_apart_whatever_is_lost_and_all_agree_once_it_is_calm(n):
    for seed in range(4):
        judged = hostility.attack(n, seed, 8_000)
        assert judged.good, judged
        assert judged.error < 0.1, judged


@pytest.mark.filterwarnings("ignore:overflow", "ignore:invalid value")
@pytest.mark.slow
@pytest.mark.parametrize("name", MUTANTS)
def test_one_wrong_line_is_caught(name, tmp_path):
    made = mutant(name, tmp_path)
    assert any(not hostility.attack(4, seed, 8_000, made).good for seed in range(8))


VECTORS = (
    0x5B9F35A9, 0xB85A4727, 0x03A662FA, 0x04E7FE8A, 0x89466E2A, 0x69B6FAC5, 0x23FC6358, 0xC563CF8B,
)  # fmt: skip
"""Of HalfSipHash-2-4 with its authors' key, for 0 to 7 bytes."""
KEY = (0x03020100, 0x07060504)


@pytest.mark.parametrize("size", range(8))
def test_the_seal_is_that_of_its_authors(size):
    text = np.arange(MESSAGE, dtype=np.uint8)
    assert message.half_sip(text, size, 0, 0, *KEY) == VECTORS[size]
    if size >= 4:
        tail = int.from_bytes(bytes(range(size - 4, size)), "little")
        assert message.half_sip(text, size - 4, tail, 4, *KEY) == VECTORS[size]


def test_a_changed_bit_breaks_the_seal():
    rng = np.random.default_rng(1)
    text = rng.integers(0, 256, MESSAGE).astype(np.uint8)
    message.seal(text, 5, *KEY)
    assert message.is_sealed(text, 5, *KEY)
    assert not message.is_sealed(text, 6, *KEY)
    assert not message.is_sealed(text, 5, KEY[0], KEY[1] ^ 1)
    for bit in range(8 * MESSAGE):
        text[bit // 8] ^= 1 << bit % 8
        assert not message.is_sealed(text, 5, *KEY)
        text[bit // 8] ^= 1 << bit % 8


def test_every_code_is_a_direction_and_every_direction_has_a_near_one():
    rng = np.random.default_rng(2)
    for code in (0, 0xFFFFFF, 0xFFF, 0xFFF000, *rng.integers(0, 1 << 24, 2000).tolist()):
        assert np.linalg.norm(message.direction_of(code)) == pytest.approx(1.0, abs=1e-12)
    axes = [s * np.eye(3)[k] for k in range(3) for s in (1.0, -1.0)]
    for a in [*axes, *rng.standard_normal((2000, 3))]:
        a = a / np.linalg.norm(a)
        code = message.code_of(*a)
        assert 0 <= code < 1 << 24
        assert np.degrees(np.linalg.norm(a - message.direction_of(code))) < 0.5 * leaderless.CODE


def test_pairs_survive_a_message():
    text = np.zeros(MESSAGE, np.uint8)
    for fields in (
        (15, 7, 1, 7, 1, 15, 0xFFFFFF),
        (0, 0, 0, 0, 0, 0, 0),
        (3, 5, 0, 2, 1, 9, 0x123456),
    ):
        message.put_pair(text, message.PAIRS + message.PAIR, *fields)
        assert message.get_pair(text, message.PAIRS + message.PAIR) == fields
        assert (text[: message.PAIRS + message.PAIR] == 0).all()
        assert (text[message.SEAL :] == 0).all()


@pytest.mark.parametrize("own", [0, 5, 32767, 32768, 65535, 65536, 1_000_000])
def test_a_count_is_that_nearest_to_the_own(own):
    for count in range(max(own - 300, 0), own + 300, 7):
        assert message.count_near(count & 0xFFFF, own) == count


APART = {
    "agents.kind": "leaderless", "network": {"kind": "radio", "loss": 0.5, "jitter": 0.02},
    "sensing": {"kind": "noisy", "load_view": 0.02},
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "law"), [("paper-spiral", "pid"), ("real-world-adaptive", "adaptive")]
)
def test_load_controllers_that_see_the_load_in_different_places_do_not_drift_apart(name, law):
    mission = load_mission(name, {**APART, "allocation": {"kind": "safe"}})
    assert mission.kinds["load_control"] == law
    flight = Flight(mission)
    spreads = []
    for _ in range(4):
        flight.advance(10.0)
        assert flight.outcome == "completed"
        spreads.append(float(np.ptp(flight.bus.steady_wishes, axis=0).max()))
    weight = mission.team.load_mass * mission.team.gravity
    assert 0.0 < max(spreads) < 0.1 * weight
    assert spreads[-1] < 2.0 * spreads[0] + 0.01 * weight


def test_drones_leave_and_join_a_team_without_a_leader():
    flight = Flight(load_mission("real-world", APART))
    flight.advance(3.0)
    flight.lose([1])
    flight.advance(3.0)
    kept = flight.wires.load_control.memory.copy()
    assert kept.size == 3 * flight.parts["load_control"].memory(flight.mission.team).size
    flight.regroup([0, 1, 2, 3])
    assert (flight.wires.load_control.memory.reshape(4, -1)[[0, 2, 3]].ravel() == kept).all()
    flight.advance(3.0)
    assert flight.outcome == "completed"
    recording = flight.recording()
    away = np.linalg.norm(recording["load"][:, 0] - recording["reference"][:, 0], axis=1)
    assert away.max() < 0.4
    assert not (recording["agent_status"][-1].astype(int) & Status.HOLDING).any()


def test_what_stands_in_the_way_is_warned_of():
    near = {"agents.kind": "leaderless", "allocation": {"kind": "safe", "min_angle_deg": 26.0}}
    for settings, said in (
        (near, "leave 4 degrees"),
        ({"agents.kind": "leaderless"}, "no least angle"),
        ({**near, "allocation": {**near["allocation"], "max_rate": 0.5}}, "let the load swing"),
    ):
        warned = [str(each) for each in warnings_of(load_mission("paper-spiral", settings))]
        assert any("agents." in text and said in text for text in warned), warned
    quiet = {"agents.kind": "leaderless", "allocation": {"kind": "safe"}}
    assert not [
        each for each in warnings_of(load_mission("hover", quiet)) if "agents." in str(each)
    ]


IN_THE_AIR = ("cut-in-flight", "eight-to-seven", "from-rest", "one-drone-path", "point-to-point", "round-obstacles", "three-to-four", "two-drones")  # fmt: skip


SLOW = {"cut-in-flight": {"agents.max_rate": 0.5}}
"""Missions whose allocator is told that drones turn their cables slowly."""


@pytest.mark.parametrize("name", IN_THE_AIR)
def test_missions_of_all_kinds_fly_with_agents_as_with_one_allocator(name):
    agents = {"agents.kind": "leaderless", **SLOW.get(name, {})}
    flown = [colift.run(name, overrides=change) for change in ({}, agents)]
    central, agents = (run.metrics for run in flown)
    assert all(run.recording.outcome == "completed" for run in flown)
    assert agents["tracking_rms_m"] < 1.5 * central["tracking_rms_m"] + 1e-3
    if flown[0].mission.team.n > 1:
        assert agents["min_angle_deg"] > min(central["min_angle_deg"], 25.0) - 1.0
