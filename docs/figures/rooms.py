"""What the rooms of ``src/colift`` import of each other: ``python docs/figures/rooms.py``.

Writes ``rooms.svg`` beside this file and the table of imports in ``where-things-live.md``, both from the imports that grimp,
the tool below import-linter, finds in the source. The floors are those of the first contract in ``pyproject.toml``.
"""

import tomllib
from collections.abc import Mapping
from itertools import product
from pathlib import Path
from typing import NamedTuple

import grimp
from pages import fill, table

from colift.catalogue import WINGS

SVG = Path(__file__).with_suffix(".svg")
PROJECT = Path(__file__).parents[2] / "pyproject.toml"

Imports = Mapping[str, frozenset[str]]
"""Of each room the rooms that it imports."""

SAYS = {
    "cli": "the commands, a file each",
    "show": "report, replay, live page",
    "study": "many flights, and what they tell",
    "flight": "the loop; one mission in the air",
    "record": "recordings, metrics, verdicts, real logs",
    "mission": "the mission file, checked and loaded",
    "control": "could run on a drone",
    "world": "is simulated",
    "part": "what all parts share",
    "catalogue": "names of all parts",
    "team": "drones, cables, load",
    "extras": "optional packages",
    "wording": "how refusals are said",
    "errors": "what is raised",
    "kernel": "signals, ports, compiling",
    "interrupts": "Ctrl-C",
    "threads": "of the BLAS",
}
"""A few words for each room."""

# Sizes in units of the drawing.
LEFT, WIDE, LANE = 52.0, 528.0, 16.0
GAP, LOW, LINE = 30.0, 50.0, 15.5
SPANS = {
    "control": (0.0, 0.49), "world": (0.51, 1.0), "extras": (0.0, 0.3), "team": (0.36, 0.66),
    "catalogue": (0.7, 1.0), "wording": (0.36, 0.66), "interrupts": (0.0, 0.3), "threads": (0.0, 0.3),
    "kernel": (0.32, 0.68), "errors": (0.7, 1.0),
}  # fmt: skip
"""Where a room begins and ends that does not fill its floor."""
STACKED = {"interrupts": 0, "threads": 1}
"""Rooms that stand one above the other on a floor."""


class Box(NamedTuple):
    """Where a room stands."""

    left: float
    top: float
    right: float
    bottom: float
    floor: int


def floors() -> list[list[str]]:
    """Rooms from the top to the bottom, as the contract has them."""
    contracts = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["tool"]["importlinter"]
    (layers,) = (each["layers"] for each in contracts["contracts"] if each["type"] == "layers")
    return [[name.strip().removeprefix("colift.") for name in each.split("|")] for each in layers]


def imports() -> Imports:
    """What each room imports, for types too, without the package's own front door."""
    graph = grimp.build_graph("colift", cache_dir=None)
    rooms = [room for floor in floors() for room in floor]
    known = {name.split(".")[1] for name in graph.modules if "." in name} - {"__main__"}
    if known != {*rooms}:
        raise SystemExit(f"not on a floor of pyproject.toml, or gone: {known ^ {*rooms}}")
    found: dict[str, set[str]] = {room: set() for room in rooms}
    for name in graph.modules:
        for other in graph.find_modules_directly_imported_by(name):
            ends = [each.partition(".")[2].partition(".")[0] for each in (name, other)]
            if ends[0] in found and ends[1] in found and ends[0] != ends[1]:
                found[ends[0]].add(ends[1])
    return {room: frozenset(found[room]) for room in rooms}


def direct(found: Imports) -> list[tuple[str, str]]:
    """Imports that do not follow from a chain of others."""

    def reached(room: str) -> set[str]:
        return set(found[room]).union(*(reached(other) for other in found[room]))

    return [
        (room, other)
        for room in found
        for other in found
        if other in found[room]
        and not any(other in reached(middle) for middle in found[room] - {other})
    ]


def layers_of(room: str) -> list[str]:
    """The layers of a wing; none of another room."""
    return [layer for layer, wing in WINGS.items() if wing == room]


def boxes() -> dict[str, Box]:
    """Where every room stands."""
    placed, top = {}, 10.0
    for floor, rooms in enumerate(floors()):
        stacks = max(STACKED.get(room, 0) for room in rooms)
        high = LOW + stacks * (LOW + 8.0)
        if layers := max(len(layers_of(room)) for room in rooms):
            high += LINE * layers + 6.0
        for room in rooms:
            begin, end = SPANS.get(room, (0.0, 1.0))
            above = top + STACKED.get(room, 0) * (LOW + 8.0)
            below = above + LOW if room in STACKED else top + high
            placed[room] = Box(LEFT + begin * WIDE, above, LEFT + end * WIDE, below, floor)
        top += high + GAP
    return placed


def route(start: Box, end: Box, others: list[Box], lane: float) -> str:
    """An arrow's path: straight down where nothing stands between, else by an elbow or a lane on the left."""
    left, right = max(start.left, end.left), min(start.right, end.right)
    between = [box for box in others if box.top >= start.bottom and box.bottom <= end.top]
    steps = [left + (right - left) * (0.5 + sign * k / 40) for k in range(19) for sign in (1, -1)]
    for room, x in product((14.0, 5.0), steps if right - left > 20.0 else ()):
        if all(x < box.left - room or x > box.right + room for box in between):
            return f"M{x:g} {start.bottom:g} V{end.top - 1:g}"
    if end.floor == start.floor + 1:
        a, b = (start.left + start.right) / 2, (end.left + end.right) / 2
        return f"M{a:g} {start.bottom:g} V{start.bottom + GAP / 2:g} H{b:g} V{end.top - 1:g}"
    a, b = (start.top + start.bottom) / 2, (end.top + end.bottom) / 2
    return f"M{start.left:g} {a:g} H{lane:g} V{b:g} H{end.left - 1:g}"


def drawing(found: Imports) -> str:
    """The whole SVG."""
    placed = boxes()
    shapes, lane = [], LEFT - LANE
    for room, other in direct(found):
        start, end = placed[room], placed[other]
        rest = [box for name, box in placed.items() if name not in (room, other)]
        path = route(start, end, rest, lane)
        lane -= LANE if path.count("H") == 2 else 0.0
        shapes.append(
            f'<path class="r-line" marker-end="url(#r-a)" d="{path}"><title>{room} imports {other}</title></path>'
        )
    for room, box in placed.items():
        middle = (box.left + box.right) / 2
        wing = layers_of(room)
        kind = "r-wing" if wing else "r-box"
        shapes.append(
            f'<rect class="{kind}" x="{box.left:g}" y="{box.top:g}" width="{box.right - box.left:g}"'
            f' height="{box.bottom - box.top:g}" rx="6"/>'
            f'<text class="r-t" x="{middle:g}" y="{box.top + 21:g}">{room}</text>'
            f'<text class="r-s" x="{middle:g}" y="{box.top + 40:g}">{SAYS[room]}</text>'
        )
        for k, layer in enumerate(wing):
            y = box.top + 62 + LINE * k
            shapes.append(f'<text class="r-f" x="{middle:g}" y="{y:g}">{layer}/</text>')
    size = f"{LEFT + WIDE + 10:g} {max(box.bottom for box in placed.values()) + 10:g}"
    return "\n".join([HEAD.replace("SIZE", size), *shapes, "</svg>", ""])


HEAD = """<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 SIZE" role="img" aria-label="Rooms of src/colift from top to bottom; arrows go from a room to those that it imports">
<style>
.r-box{fill:var(--color-background-secondary,#f8f9fb);stroke:currentColor;stroke-width:1.4}
.r-wing{fill:var(--color-background-secondary,#f8f9fb);stroke:var(--color-brand-primary,#2962ff);stroke-width:2.6}
.r-line{fill:none;stroke:currentColor;stroke-width:1.4}
.r-t{font:600 16px sans-serif;fill:currentColor;text-anchor:middle}
.r-s{font:14px sans-serif;fill:currentColor;text-anchor:middle;opacity:.9}
.r-f{font:13px monospace;fill:currentColor;text-anchor:middle;opacity:.9}
.r-head{fill:currentColor}
</style>
<defs><marker id="r-a" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" orient="auto"><path class="r-head" d="M0 1 L10 5 L0 9 z"/></marker></defs>"""


def listing(found: Imports) -> str:
    """The table of all imports."""
    rows = [
        [f"`{room}`", ", ".join(f"`{other}`" for other in found if other in found[room])]
        for room in found
        if found[room]
    ]
    alone = ", ".join(f"`{room}`" for room in found if not found[room])
    rows.append([alone, "nothing of ours"])
    return table(["room", "imports"], rows)


def main() -> None:
    """Write both."""
    found = imports()
    SVG.write_text(drawing(found), encoding="utf-8")
    fill("where-things-live.md", "imports", listing(found))


if __name__ == "__main__":
    main()
