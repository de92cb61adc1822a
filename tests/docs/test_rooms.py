"""The page on where things live shows the imports that there are, and every room and folder of the package."""

from __future__ import annotations

import importlib
import shutil
import tomllib
from pathlib import Path
from types import ModuleType

import pytest

from colift.catalogue import FOLDERS

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "where-things-live.md").read_text(encoding="utf-8")
SVG = (DOCS / "figures" / "rooms.svg").read_text(encoding="utf-8")
AGAIN = "out of date: python docs/figures/rooms.py"


@pytest.fixture
def rooms(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(DOCS / "figures")
    return importlib.import_module("rooms")


def test_drawing_and_table_are_the_imports_of_the_source(rooms: ModuleType) -> None:
    found = rooms.imports()
    assert sorted(rooms.drawn(SVG)) == sorted(rooms.direct(found)), AGAIN
    assert f"-->\n\n{rooms.listing(found)}\n\n<!-- end of imports -->" in PAGE, AGAIN


def test_the_drawing_is_laid_out_by_graphviz(rooms: ModuleType) -> None:
    if shutil.which("dot") is None:
        pytest.skip("needs Graphviz")
    made = rooms.drawing(rooms.imports())
    if made.splitlines()[0] != SVG.splitlines()[0]:
        pytest.skip("another version of Graphviz, which may lay out otherwise")
    assert made == SVG, AGAIN


def test_another_import_changes_drawing_and_table(rooms: ModuleType) -> None:
    found = rooms.imports()
    more = {**found, "extras": found["extras"] | {"kernel"}}
    assert rooms.dot(more) != rooms.dot(found)
    assert rooms.listing(more) != rooms.listing(found)


def test_what_is_drawn_leads_to_everything_that_is_imported(rooms: ModuleType) -> None:
    found = rooms.imports()
    drawn = rooms.direct(found)

    def reached(room: str) -> set[str]:
        return {room}.union(*(reached(other) for start, other in drawn if start == room))

    assert all(others < reached(room) for room, others in found.items())


def test_the_page_names_every_room_layer_and_contract(rooms: ModuleType) -> None:
    first = PAGE.partition("## What imports what")[0]
    for floor in rooms.floors():
        for room in floor:
            assert f"`{room}/`" in first or f"`{room}.py`" in first
    assert all(f">{layer}/<" in SVG for layer in FOLDERS)
    text = rooms.PROJECT.read_text(encoding="utf-8")
    contracts = tomllib.loads(text)["tool"]["importlinter"]["contracts"]
    for contract in contracts:
        assert f"| {contract['name']} |" in PAGE


def test_the_reference_of_missions_has_every_layer() -> None:
    text = (DOCS / "mission-reference.md").read_text(encoding="utf-8")
    for layer in FOLDERS:
        assert f"```{{part-tables}} {layer}\n" in text
        assert f"[{layer}](#{layer})" in text
