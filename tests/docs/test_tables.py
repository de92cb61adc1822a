"""Every table of measured numbers in the pages is what the command named at its marks writes; none is pasted."""

from __future__ import annotations

import importlib
import json
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
FIGURES = DOCS / "figures"
PAGES = sorted([ROOT / "README.md", *DOCS.glob("*.md"), *DOCS.glob("theory/*.md")])
MARKED = re.compile(
    r"^<!-- (?P<name>[\w-]+): written by python docs/figures/(?P<script>\w+)\.py"
    r"(?: from (?P<json>\w+)\.json)? -->\n(?P<text>.*?)^<!-- end of (?P=name) -->$",
    re.MULTILINE | re.DOTALL,
)
WHOLE = {"performance.md": "performance"}
"""Pages that a script writes from their first line to their last."""
NOT_MEASURED = {
    ("world.md", "default"): "settings and where they come from",
    ("mission-reference.md", "level"): "exit codes",
    ("paper-to-code.md", "value"): "settings",
    ("objective.md", "$n$"): "proofs",
}
"""Tables with numbers that nobody measures: page and head of the first column."""

UNMEASURED: set[str] = set()
"""Scripts whose flights take long or want a quiet machine, not run since they write the pages themselves: what stands
at their marks is older, or empty. Once measured, a script leaves this set, or the tests fail."""

BLOCKS = {
    (os.path.relpath(page, DOCS), found["name"]): found
    for page in PAGES
    for found in MARKED.finditer(page.read_text(encoding="utf-8"))
}
STORED = sorted(
    {found["script"] for found in BLOCKS.values() if found["json"]} | {"errata", "vehicles"}
)
"""Scripts that write at once, from what they have stored or from closed forms."""


def tables(text: str) -> Iterator[list[list[str]]]:
    """Cells of every Markdown table outside of code."""
    plain = re.sub(r"^```.*?^```$", "", text, flags=re.MULTILINE | re.DOTALL)
    for lines in re.findall(r"(?:^\|.*\n)+", plain + "\n", re.MULTILINE):
        rows = [
            [cell.strip() for cell in line.strip("| ").split("|")] for line in lines.splitlines()
        ]
        yield [rows[0], *rows[2:]]


def numeric(cell: str) -> bool:
    """Whether a cell is a number, with units or several of them, but not a sentence."""
    return bool(re.match(r"[*~≤≥<>+−-]*\d", cell)) and len(cell) <= 40


def measured(table: list[list[str]]) -> bool:
    """Whether a good part of what stands behind the first column is numbers."""
    cells = [cell for row in table[1:] for cell in row[1:]]
    return sum(map(numeric, cells)) >= 0.3 * len(cells)


def test_the_scan_finds_pasted_tables() -> None:
    pasted = "| a | b |\n|---|---|\n| x | 1.2 cm, 47° |\n| y | lost |\n"
    assert [measured(table) for table in tables(pasted)] == [True]
    assert list(tables(f"```\n{pasted}```\n")) == []
    words = "| a | b |\n|---|---|\n| 1 | words with a 3 |\n"
    assert [measured(table) for table in tables(words)] == [False]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_no_measured_table_is_pasted(page: Path) -> None:
    if page.name in WHOLE:
        return
    text = MARKED.sub("", page.read_text(encoding="utf-8"))
    found = [t[0] for t in tables(text) if measured(t) and (page.name, t[0][0]) not in NOT_MEASURED]
    assert not found, f"{page.name}: written by hand: {found}"


def waiting(item: Any, script: str) -> Any:
    """The case of a test, expected to fail until its script has measured."""
    later = pytest.mark.xfail(strict=True, reason=f"to be measured: docs/figures/{script}.py --fly")
    return pytest.param(item, marks=[later] if script in UNMEASURED else [])


@pytest.mark.parametrize(
    "place", [waiting(place, found["script"]) for place, found in BLOCKS.items()], ids=":".join
)
def test_each_marked_part_has_its_script_and_its_numbers(place: tuple[str, str]) -> None:
    found = BLOCKS[place]
    script = (FIGURES / f"{found['script']}.py").read_text(encoding="utf-8")
    page, name = place
    assert re.search(rf'fill\(\s*"{re.escape(page)}",\s*(\w+|"{name}"),', script)
    if found["json"]:
        stored = FIGURES / f"{found['json']}.json"
        assert stored.is_file(), f"not measured yet: python docs/figures/{found['script']}.py --fly"
        json.loads(stored.read_text(encoding="utf-8"))
    assert found["text"].strip(), "nothing is written here yet"


def test_all_marks_are_closed() -> None:
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        assert text.count(": written by python") == len(MARKED.findall(text)), page.name


@pytest.mark.parametrize("script", [waiting(script, script) for script in STORED])
def test_the_pages_are_what_their_scripts_write(
    script: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    written: dict[tuple[str, str], str] = {}
    monkeypatch.syspath_prepend(FIGURES)
    monkeypatch.setattr(sys, "argv", [f"{script}.py"])
    pages = importlib.import_module("pages")
    monkeypatch.setattr(
        pages, "fill", lambda page, name, text: written.update({(page, name): text})
    )
    sys.modules.pop(script, None)
    importlib.import_module(script).main()
    sys.modules.pop(script, None)
    assert set(written) == {place for place, found in BLOCKS.items() if found["script"] == script}
    for place, text in written.items():
        assert BLOCKS[place]["text"].strip() == text.strip(), place


def test_the_page_on_speed_is_what_its_script_writes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(FIGURES)
    performance = importlib.import_module("performance")
    results = (
        json.loads((FIGURES / f"{name}.json").read_text()) for name in performance.MEASUREMENTS
    )
    assert performance.page(*results) == (DOCS / "performance.md").read_text(encoding="utf-8")
