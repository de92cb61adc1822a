"""The pages of campaigns: allocators or agents compared, and one mission swept. Made from rows of results."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from colift.kernel.math import shares
from colift.mission.criteria import METRICS
from colift.record.recording import atomic_path, versions
from colift.show.report import html
from colift.show.report.campaign_figures import CONTEST, SWEEP, Swept
from colift.show.report.render import Drawing, draw
from colift.study.campaign import judge

Row = Mapping[str, Any]
Table = tuple[list[str], list[list[str]]]
"""Header and rows, as text."""


def contest_table(rows: Sequence[Row], criteria: Sequence[judge.Criterion]) -> Table:
    """One line an allocator, or a kind of agents: flights held and these criteria over them, means with their 95 % interval."""
    header = [judge.compared(rows), "held (95 %)", *(_title(criterion) for criterion in criteria)]
    lines = [
        [c.name, shares.text(c.held, c.flights), *(_value(c, criterion) for criterion in criteria)]
        for c in judge.contestants(rows)
    ]
    return header, lines


def _value(contestant: judge.Contestant, criterion: judge.Criterion) -> str:
    said = criterion.text(contestant.values[criterion.metric])
    if found := contestant.intervals.get(criterion.metric):
        said += " (" + "-".join(map(criterion.text, found)) + ")"
    return said


def _grouped_tables(rows: Sequence[Row], criteria: Sequence[judge.Criterion]) -> list[str]:
    found = []
    for group in judge.GROUPS:
        own = [criterion for criterion in criteria if criterion.group == group]
        found += [f"<h3>{escape(group)}</h3>", _html_table(*contest_table(rows, own))]
    return found


def _title(criterion: judge.Criterion) -> str:
    unit = "" if criterion.unit == "1" else f" ({criterion.unit})"
    return f"{criterion.title}{unit}"


def write_contest(
    rows: Sequence[Row],
    folder: Path,
    said: Sequence[str],
    *,
    command: str,
    notes: Sequence[str] = (),
) -> Path:
    """Write ``report.html`` and its figures.

    Parameters
    ----------
    rows : sequence of mappings
        As :mod:`colift.study.campaign.judge` reads them; those whose ``study`` is ``"spread"`` only go into the
        figure of separation against tension.
    folder : Path
        Created if missing.
    said : sequence of str
        The sentences on top, as from :func:`colift.study.campaign.judge.words`.
    command : str
        What repeats the comparison.
    notes : sequence of str
        Sentences on how the flights were made.

    """
    contest = [row for row in rows if row.get("study", "contest") == "contest"]
    criteria = judge.criteria_of(contest)
    field = judge.contestants(contest)
    who = COMPARED[judge.compared(contest)]
    missions = list(dict.fromkeys(str(row["mission"]) for row in contest))
    # Figures are of flights that were held, which here and there are none.
    loads = {judge.load_of(row) for row in contest if judge.held(row)}
    shown = {name: entry for name, entry in CONTEST.items() if loads & {*(entry.needs or loads)}}
    drawings = draw(shown, rows)
    body = [
        f"<header><h1>{who.capitalize()} compared</h1>",
        f'<p class="soft">{escape(" ".join(notes))}</p></header>',
        html.facts(
            [
                f"{len(field)} {who}",
                f"{len(missions)} mission{'s' * (len(missions) != 1)}",
                f"{len(contest)} flights",
                f"{sum(c.held for c in field)} held",
                f"{sum(c.missed for c in field)} missed a criterion",
                f"{sum(c.lost for c in field)} lost",
                f"{sum(c.failed + c.refused for c in field)} not flown",
            ]
        ),
        "<h2>In words</h2>",
        "<ul>" + "".join(f"<li>{escape(sentence)}</li>" for sentence in said) + "</ul>",
        "<h2>Over all flights</h2>",
        f'<p class="soft">{escape(_HELD)}</p>',
        *_grouped_tables(contest, criteria),
        "<h2>Figures</h2>",
        *(map(html.figure, drawings) if drawings else ['<p class="soft">No flight was held.</p>']),
        "<h2>Mission by mission</h2>",
    ]
    for mission in missions:
        own = [row for row in contest if row["mission"] == mission]
        body += [f"<h3>{escape(mission)}</h3>", _html_table(*contest_table(own, criteria))]
    body += ["<h2>How the numbers are made</h2>", _rules(criteria)]
    body += [*_failures(rows), *provenance(command)]
    return _write(folder, f"{who.capitalize()} compared", body, drawings)


COMPARED = {"allocator": "allocators", "agents": "kinds of agents"}
"""By column of the rows who is compared."""
_HELD = "Over the flights that were held: to the end, every criterion kept. The share of them has its exact 95 % interval, a mean that of the bootstrap over the seeds."


def _rules(criteria: Sequence[judge.Criterion]) -> str:
    """What each criterion is, how flights become one number, and what counts as a tie."""
    meanings = {metric.name: metric.meaning for metric in METRICS}
    rows = []
    for c in criteria:
        meaning = meanings[c.metric]
        level = c.rule() if c.ranked else "not ranked"
        rows.append([c.title, f"{meaning[:1].upper()}{meaning[1:]}", c.how, level])
    header = ("criterion", "in one flight", "over flights", "level with the first")
    return html.table(header, [[escape(text) for text in row] for row in rows])


def write_sweep(title: str, swept: Swept, folder: Path, *, command: str) -> Path:
    """Write ``report.html`` of a sweep and its figures."""
    drawings = draw(SWEEP, swept)
    body = [
        f"<header><h1>{escape(title)}</h1>",
        '<p class="soft">Over the seeds. Held are flights that keep every criterion, with the exact 95 % interval of '
        "their share; numbers are over those that lost neither load nor team.</p></header>",
        "<h2>Figures</h2>",
        *map(html.figure, drawings),
        "<h2>Numbers</h2>",
        *(f"<h3>{name}</h3>{_html_table(head, rows)}" for name, head, rows in sweep_tables(swept)),
        *_points(swept),
        *_failures(swept.rows),
        *provenance(command),
    ]
    return _write(folder, title, body, drawings)


def sweep_tables(swept: Swept) -> list[tuple[str, list[str], list[list[str]]]]:
    """Titled tables, one line a combination of values: mean, and where seeds differ least and largest."""
    leaves = [over.path.rpartition(".")[2] for over in swept.overs]
    paths = [over.path for over in swept.overs]
    units = {metric.name: metric.unit for metric in METRICS}
    heads = [f"{words} ({units[name]})" for name, words in swept.metrics.items()]
    names = leaves if len(set(leaves)) == len(leaves) else paths
    several = any(point.flights > 1 for point in swept.points)
    header = [*names, "held (95 %)" if several else "verdict", *heads]
    titles = ("Mean", "Least", "Largest") if several else ("Flights",)
    tables = []
    for k, title in enumerate(titles):
        lines = []
        for point in swept.points:
            values = [f"{v:g}" if isinstance(v, float) else str(v) for v in point.values]
            numbers = [_number(point.spread[name][k]) for name in swept.metrics]
            share = shares.text(point.held, point.flights) if several else point.level
            lines.append([*values, "refused" if point.refused else share, *numbers])
        tables.append((title, header, lines))
    return tables


def not_held(swept: Swept) -> list[str]:
    """A sentence for each combination of values of which a flight was not held: how many, and why."""
    said = []
    for point in swept.points:
        if point.held == point.flights:
            continue
        pairs = zip(swept.overs, point.values, strict=True)
        where = ", ".join(f"{over.path} {value}" for over, value in pairs)
        if point.refused:
            said.append(f"{where}: cannot be flown: {point.reasons[0]}")
            continue
        counts = ", ".join(f"{count} {fate}" for fate, count in point.fates.items())
        more = f" (and {len(point.reasons) - 1} more)" if len(point.reasons) > 1 else ""
        said.append(f"{where}: {counts}: {point.reasons[0]}{more}")
    return said


def _points(swept: Swept) -> list[str]:
    said = not_held(swept)
    if not said:
        return []
    lines = "".join(f"<li>{escape(sentence)}</li>" for sentence in said)
    return ["<h2>Not held</h2>", f"<ul>{lines}</ul>"]


def _number(value: float) -> str:
    return "-" if math.isnan(value) else f"{value:.4g}"


def _html_table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    cells = [
        [f'<span class="name">{escape(first)}</span>', *map(escape, rest)] for first, *rest in rows
    ]
    return html.table(header, cells, numbers=range(1, len(header)))


def _failures(rows: Sequence[Row]) -> list[str]:
    found = []
    for fate, words in (("failed", "ended in an error"), ("refused", "could not be set up")):
        those = [row for row in rows if judge.fate(row) == fate]
        lines = "\n".join(f"{_labels(row)}: {row['error']}" for row in those)
        found += [html.details(f"{len(those)} flights {words}", lines)] if those else []
    return ["<h2>Errors</h2>", *found] if found else []


def _labels(row: Row) -> str:
    """The columns before the facts, which are what the case was called."""
    names = list(row)
    return ", ".join(f"{name} {row[name]}" for name in names[: names.index("key")])


def provenance(command: str) -> list[str]:
    """How to repeat a campaign, and with which versions it was flown."""
    text = "\n".join(f"{name:9} {value}" for name, value in versions().items())
    return [
        "<h2>Provenance</h2>",
        f'<p class="soft">Repeated by <code>{escape(command)}</code>.</p>',
        html.details("Versions", text),
    ]


def _write(folder: Path, title: str, body: Sequence[str], drawings: Sequence[Drawing]) -> Path:
    for drawing in drawings:
        drawing.save(folder / "figures")
    target = folder / "report.html"
    with atomic_path(target) as temporary:
        text = html.page(f"{title} - colift", "\n".join(body))
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return target
