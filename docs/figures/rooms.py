"""What the rooms of ``src/colift`` import of each other: ``python docs/figures/rooms.py``.

Writes ``rooms.svg`` beside this file and the table of imports in ``where-things-live.md``, both from the imports that grimp,
the tool below import-linter, finds in the source. The floors are those of the first contract in ``pyproject.toml``. Graphviz (``dot``, of
the Debian package graphviz) lays the drawing out.
"""

import html
import re
import subprocess
import tomllib
from collections.abc import Mapping
from pathlib import Path

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
    "deploy": "controllers as C, ROS 2 nodes",
    "learn": "environments for learners",
    "plan": "a team through obstacles",
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
    "lazy": "names on first use",
}
"""A few words for each room."""

SMALL = ("interrupts", "lazy", "threads")
"""Rooms that few others need: one below the other, although on one floor."""
SPINE = ("cli", "show", "study", "flight", "record", "mission")
"""Rooms that stand straight above each other."""

STYLE = """<style>
.node path{fill:var(--color-background-secondary,#f8f9fb);stroke:currentColor;stroke-width:1.4}
.wing path{stroke:var(--color-brand-primary,#2962ff);stroke-width:2.6}
.node text{fill:currentColor;font-family:sans-serif;font-size:14px}
.node text:first-of-type{font-weight:600;font-size:16px}
.wing text:nth-of-type(n+3){font-family:monospace;font-size:13px}
.edge path{stroke:currentColor;stroke-width:1.2}
.edge polygon{fill:currentColor;stroke:currentColor}
</style>"""
"""Colours of the page, light or dark."""


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


def dot(found: Imports) -> str:
    """The graph in the language of Graphviz: a rank for each floor."""
    lines = [
        "digraph rooms {",
        "graph [bgcolor=transparent, nodesep=0.2, ranksep=0.32, margin=0.05]",
        'node [shape=box, style=rounded, width=1.1, fontname="Helvetica,Arial,sans-serif", margin="0.16,0.07"]',
        "edge [arrowsize=0.7]",
    ]
    for rooms in floors():
        for room in rooms:
            layers = [f"{layer}/" for layer in layers_of(room)]
            kind = "wing" if layers else "room"
            text = "\\n".join([room, SAYS[room], *layers])
            group = SPINE if room in SPINE else SMALL if room in SMALL else (room,)
            lines.append(f'{room} [class={kind}, group={group[0]}, label="{text}"]')
        lines.append(f"{{rank=same {' '.join(room for room in rooms if room not in SMALL)}}}")
    lines += [f"{room} -> {other}" for room, other in direct(found)]
    lines.append(f"{' -> '.join(SMALL)} [style=invis]")
    return "\n".join([*lines, "}", ""])


def drawing(found: Imports) -> str:
    """The whole SVG, as wide as the page, laid out by Graphviz."""
    made = subprocess.run(
        ["dot", "-Tsvg"], input=dot(found), text=True, capture_output=True, check=True
    ).stdout
    (version,) = re.findall(r"graphviz version (\S+)", made)
    (box,) = re.findall(r'viewBox="([^"]*)"', made)
    body = made[made.index(">", made.index("<svg")) + 1 :]
    body = re.sub(r"<!--.*?-->\n", "", body, flags=re.DOTALL)
    return "\n".join([HEAD.format(version=version, box=box), STYLE, body.lstrip()])


def drawn(svg: str) -> list[tuple[str, str]]:
    """The arrows of a drawing."""
    titles = re.findall(r"<title>(.*?)</title>", svg)
    arrows = [html.unescape(title).split("->") for title in titles if "&gt;" in title]
    return [(room, other) for room, other in arrows]


HEAD = """<!-- laid out by Graphviz {version} -->
<svg xmlns="http://www.w3.org/2000/svg" viewBox="{box}" role="img" aria-label="Rooms of src/colift from top to bottom; arrows go from a room to those that it imports">"""


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
