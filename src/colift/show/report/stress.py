"""The page of a stress campaign: the matrix, and every flight that fails one click from its replay."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

import tomli_w

from colift.kernel.math import shares
from colift.mission.load import load_mission
from colift.record.recording import atomic_path
from colift.record.verdict import criteria_of
from colift.show.report import html
from colift.show.report.campaign import provenance
from colift.study.campaign.judge import fate, held
from colift.study.stress import Cell, Row, matrix, reason

Table = tuple[str, list[str], list[list[str]]]
"""Title, header and rows, as text."""


def matrix_tables(rows: Sequence[Row]) -> list[Table]:
    """One table an allocator and plant, a line a condition; before them, if there are several, one of shares."""
    cells = matrix(rows)
    places = list(dict.fromkeys(place for row in cells.values() for place in row))
    rigid = any(not math.isnan(cell.turned_deg) for row in cells.values() for cell in row.values())
    tables = [
        (
            ", ".join(place),
            [*COLUMNS, TURNED] if rigid else COLUMNS,
            [
                [condition, *cell_texts(row[place])][: None if rigid else -1]
                for condition, row in cells.items()
            ],
        )
        for place in places
    ]
    if len(places) > 1:
        header = ["condition", *(" ".join(place) for place in places)]
        lines = [
            [condition, *(shares.text(row[place].passed, row[place].flown) for place in places)]
            for condition, row in cells.items()
        ]
        tables.insert(0, (SHARES, header, lines))
    return tables


COLUMNS = ["condition", "passed (95 %)", "lost", "distance (cm)", "angle (deg)", "slack (s)"]
TURNED = "attitude (deg)"
"""Of rigid loads the last column."""
SHARES = "passed, with its 95 % interval"


def cell_texts(cell: Cell) -> list[str]:
    """A cell for people, as in :data:`COLUMNS`, and :data:`TURNED`."""
    return [
        shares.text(cell.passed, cell.flown),
        str(cell.lost),
        _number(100.0 * cell.worst_m, 1),
        _number(cell.least_deg, 0),
        _number(cell.slack_s, 2),
        _number(cell.turned_deg, 1),
    ]


def _number(value: float, digits: int) -> str:
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def write_stress(
    rows: Sequence[Row],
    missions: Mapping[str, Mapping[str, Any]],
    folder: Path,
    *,
    command: str,
    replays: int = 12,
) -> Path:
    """Write ``report.html``, and in ``failing/`` a mission file and, for the first few, a replay of each failure.

    Parameters
    ----------
    rows : sequence of mappings
        Every flight.
    missions : mapping
        The resolved mission of each key.
    folder : Path
        Created if missing.
    command : str
        What repeats the campaign.
    replays : int
        Most replays; those flights are flown again here.

    """
    failing = [row for row in rows if not held(row)]
    lost = sum(fate(row) in ("lost", "failed") for row in rows)
    tables = matrix_tables(rows)
    first = load_mission(missions[rows[0]["key"]])
    asked = {
        repr([m[name] for name in ("criteria", "allocation", "events")]): m
        for m in missions.values()
    }
    criteria = {
        f"{name} {bound}"
        for mission in asked.values()
        for name, bound in criteria_of(load_mission(mission)).items()
    }
    body = [
        f"<header><h1>{escape(first.name)} under stress</h1>",
        '<p class="soft">Each condition replaces the mission\'s world; the controllers are told of none of it.'
        "</p></header>",
        html.banner(
            "lost" if lost else "fail" if failing else "pass",
            [f"{shares.text(len(rows) - len(failing), len(rows))} flights pass."],
        ),
        html.facts([f"{len(tables[0][2])} conditions", f"{len(rows)} flights", *sorted(criteria)]),
        "<h2>Matrix</h2>",
        '<p class="soft">Flights that keep every criterion, with the exact 95 % interval of their share; flights that '
        "lose the load or the team; and of the others the largest distance of the load from its reference, the "
        "smallest angle between two cables, the longest time of slack, summed over the cables, and a rigid load's largest angle "
        "from its wanted attitude, in any.</p>",
        *(_matrix(*table) for table in tables),
        "<h2>Flights that fail</h2>",
        _failures(failing, missions, folder, replays),
        *provenance(command),
    ]
    target = folder / "report.html"
    with atomic_path(target) as temporary:
        text = html.page(f"{first.name} under stress - colift", "\n".join(body))
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return target


def _matrix(title: str, header: list[str], lines: list[list[str]]) -> str:
    marked = range(1, len(header)) if title == SHARES else (1,)
    cells = [
        [
            f"<b>{escape(text)}</b>" if k == 0 else _marked(text) if k in marked else escape(text)
            for k, text in enumerate(line)
        ]
        for line in lines
    ]
    return f"<h3>{escape(title)}</h3>" + html.table(header, cells, numbers=range(1, len(header)))


def _marked(text: str) -> str:
    passed, _, flown = text.partition(" ")[0].partition("/")
    level = "pass" if passed == flown else "fail" if passed == "0" else "warn"
    return f'<span class="{level}" style="color:var(--tone)">{escape(text)}</span>'


def _failures(
    failing: Sequence[Row], missions: Mapping[str, Mapping[str, Any]], folder: Path, replays: int
) -> str:
    if not failing:
        return '<p class="soft">None.</p>'
    lines = []
    for k, row in enumerate(failing):
        name, mission = f"failing/{k + 1:03d}", missions[row["key"]]
        with atomic_path(folder / f"{name}.toml") as temporary:
            temporary.write_text(tomli_w.dumps(mission), encoding="utf-8")
        links = f'<a href="{name}.toml">mission</a>'
        if k < replays and row["status"] == "flown":
            _write_replay(mission, str(row["allocator"]), folder / f"{name}.html")
            links = f'<a href="{name}.html">replay</a>, {links}'
        where = f"{row['allocator']}, {row['plant']}, seed {row['seed']}"
        lines.append((escape(str(row["condition"])), escape(where), escape(reason(row)), links))
    note = (
        f"The first {replays} have a replay. " if len(failing) > replays else ""
    ) + "A mission file flies again with: colift run FILE"
    return html.table(("Condition", "Flight", "Why", "See"), lines) + (
        f'<p class="soft">{escape(note)}</p>'
    )


def _write_replay(mission: Mapping[str, Any], label: str, path: Path) -> None:
    from colift.flight.runner import run
    from colift.show.viewer.data import payload
    from colift.show.viewer.page import write_page

    flown = run(mission)
    write_page(path, payload([flown.recording], [flown.metrics], [label]))
