"""The page of a stress campaign: the matrix, and every flight that fails one click from its replay."""

from __future__ import annotations

import math
from collections.abc import Sequence
from html import escape
from pathlib import Path

import tomli_w

from colift.campaign.stress import Cell, Verdict, matrix
from colift.recording import atomic_path
from colift.report import html
from colift.report.campaign import provenance

Table = tuple[str, list[str], list[list[str]]]
"""Title, header and rows, as text."""


def matrix_tables(found: Sequence[Verdict]) -> list[Table]:
    """One line a condition, one column an allocator, one table a plant; or a column a plant for one allocator."""
    cells = matrix(found)
    places = list(dict.fromkeys(place for row in cells.values() for place in row))
    allocators, plants = (list(dict.fromkeys(names)) for names in zip(*places, strict=True))
    if len(allocators) == 1:
        tables = {allocators[0]: {(allocators[0], plant): plant for plant in plants}}
    else:
        tables = {plant: {(name, plant): name for name in allocators} for plant in plants}
    return [
        (
            title,
            ["condition", *columns.values()],
            [
                [condition, *(cell_text(row[place]) for place in columns)]
                for condition, row in cells.items()
            ],
        )
        for title, columns in tables.items()
    ]


def cell_text(cell: Cell) -> str:
    """Passed of flown, and the worst numbers."""
    if math.isinf(cell.worst_m):
        return f"{cell.passed}/{cell.flown}, lost"
    return f"{cell.passed}/{cell.flown}, {100.0 * cell.worst_m:.1f} cm, {cell.least_deg:.0f}°"


def write_stress(
    found: Sequence[Verdict], folder: Path, *, command: str, replays: int = 12
) -> Path:
    """Write ``report.html``, and in ``failing/`` a mission file and, for the first few, a replay of each failure.

    Parameters
    ----------
    found : sequence of Verdict
        Every flight.
    folder : Path
        Created if missing.
    command : str
        What repeats the campaign.
    replays : int
        Most replays; those flights are flown again here.

    """
    failing = [verdict for verdict in found if not verdict.passed]
    tables = matrix_tables(found)
    criteria = {
        f"{name} {bound}" for verdict in found for name, bound in verdict.mission.criteria.items()
    }
    body = [
        f"<header><h1>{escape(found[0].mission.name)} under stress</h1>",
        '<p class="soft">Each condition replaces the mission\'s world; the controllers are told of none of it.'
        "</p></header>",
        html.banner(
            "warn" if failing else "pass",
            f"{len(found) - len(failing)} of {len(found)} flights pass.",
        ),
        html.facts([f"{len(tables[0][2])} conditions", f"{len(found)} flights", *sorted(criteria)]),
        "<h2>Matrix</h2>",
        '<p class="soft">Flights that pass, the largest distance of the load from its reference and the '
        "smallest angle between two cables in any of them.</p>",
        *(_matrix(*table) for table in tables),
        "<h2>Flights that fail</h2>",
        _failures(failing, folder, replays),
        *provenance(command),
    ]
    target = folder / "report.html"
    with atomic_path(target) as temporary:
        text = html.page(f"{found[0].mission.name} under stress - colift", "\n".join(body))
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return target


def _matrix(title: str, header: list[str], lines: list[list[str]]) -> str:
    cells = [[f"<b>{escape(first)}</b>", *map(_marked, rest)] for first, *rest in lines]
    return f"<h3>{escape(title)}</h3>" + html.table(header, cells)


def _marked(text: str) -> str:
    passed, _, flown = text.partition(",")[0].partition("/")
    level = "pass" if passed == flown else "fail" if passed == "0" else "warn"
    return f'<span class="{level}" style="color:var(--tone)">{escape(text)}</span>'


def _failures(failing: Sequence[Verdict], folder: Path, replays: int) -> str:
    if not failing:
        return '<p class="soft">None.</p>'
    rows = []
    for k, verdict in enumerate(failing):
        name = f"failing/{k + 1:03d}"
        with atomic_path(folder / f"{name}.toml") as temporary:
            temporary.write_text(tomli_w.dumps(verdict.mission.resolved()), encoding="utf-8")
        links = f'<a href="{name}.toml">mission</a>'
        if k < replays and verdict.judged:
            _write_replay(verdict, folder / f"{name}.html")
            links = f'<a href="{name}.html">replay</a>, {links}'
        row = verdict.row
        where = f"{row['allocator']}, {row['plant']}, seed {row['seed']}"
        rows.append((escape(str(row["condition"])), escape(where), escape(verdict.reason), links))
    note = (
        f"The first {replays} have a replay. " if len(failing) > replays else ""
    ) + "A mission file flies again with: colift run FILE"
    return html.table(("Condition", "Flight", "Why", "See"), rows) + (
        f'<p class="soft">{escape(note)}</p>'
    )


def _write_replay(verdict: Verdict, path: Path) -> None:
    from colift.runner import run
    from colift.viewer.data import payload
    from colift.viewer.page import write_page

    flown = run(verdict.mission)
    write_page(path, payload([flown.recording], [flown.metrics], [str(verdict.row["allocator"])]))
