"""The leaderless team: cables stay apart whatever is lost, the force is agreed on, and everybody comes to an end."""

from __future__ import annotations

import importlib
import sys
from pathlib import Path

import pytest

from colift.control.agents import leaderless
from colift.study import hostility

SOURCES = Path(leaderless.__file__).parent
FILES = ("_evidence", "_frame", "_message", "_pairs", "leaderless")
MUTANTS = {
    "adopts at once": ("_pairs", "good = keeps(memory, a, o + Q.r0, scratch, least)", "good = True"),
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
@pytest.mark.parametrize("name", MUTANTS)
def test_one_wrong_line_is_caught(name, tmp_path):
    made = mutant(name, tmp_path)
    judged = [hostility.attack(4, seed, 8_000, made) for seed in range(8)]
    assert not all(each.good for each in judged)
