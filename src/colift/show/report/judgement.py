"""The page that sets allocators beside each other on the forces of flights."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from html import escape
from itertools import chain, cycle
from pathlib import Path

from matplotlib.figure import Figure

from colift.record.recording import atomic_path
from colift.show.report import html, panels, style
from colift.show.report.figures import Entry, register
from colift.show.report.render import draw
from colift.study import judge as judgement
from colift.study.judge import ACTUAL, ON_BOARD, QUANTITIES, Judged
from colift.study.reproduction import THRESHOLD_DEG

INTRODUCTION = (
    "The force that the load controller asked for in flight goes through every allocator. All see the same "
    "forces and start from the directions that the cables had. Nothing is simulated: the table says what "
    "each would have wanted, not how the flight would have gone on. “On board” is what the drones' own "
    "allocator wanted in flight, “actual” what the cables did; their tensions were not measured."
)

OVERALL: dict[str, Entry[Sequence[Judged]]] = {}
"""Every figure of all flights together, by name."""
SINGLE: dict[str, Entry[Judged]] = {}
"""Every figure of one flight, by name."""


def look(allocators: Sequence[str]) -> dict[str, dict[str, object]]:
    """Colour and line style of each allocator; what flew is black and grey."""
    own = [kind for kind in allocators if kind not in (ON_BOARD, ACTUAL)]
    fixed = {
        ON_BOARD: {"color": style.INK, "linestyle": "-"},
        ACTUAL: {"color": style.MUTED, "linestyle": "-"},
    }
    return {**fixed, **{kind: style.drone(k) for k, kind in enumerate(own)}}


@register(
    OVERALL,
    "Separation against tension",
    "Each mark is one flight: the smallest angle that an allocator wanted at any time, against the sum of the "
    "tensions it wanted, relative to the force. Up and to the left is better. The dashed line is 30 degrees.",
)
def separation(judged: Sequence[Judged]) -> Figure:
    sizes = sorted({j.n for j in judged})
    figure, axes = style.grid(columns=len(sizes), height=2.8, titles=True, legend_rows=2)
    looks = look(list(dict.fromkeys(a.allocator for j in judged for a in j.answers)))
    for panel, n in zip(axes, sizes, strict=True):
        for (kind, colours), marker in zip(looks.items(), cycle("osD^vPXhp<>"), strict=False):
            answers = [a for j in judged if j.n == n for a in j.answers if a.allocator == kind]
            if kind != ACTUAL and answers:
                panel.plot(
                    [a.numbers["tension_ratio"] for a in answers],
                    [a.numbers["min_angle_deg"] for a in answers],
                    marker, color=colours["color"], markersize=5.5, alpha=0.85,
                    markeredgecolor="white", markeredgewidth=0.5, label=kind,
                )  # fmt: skip
        panel.margins(x=0.06)
        panel.set_ylim(0.0, 80.0)
        panel.axhline(30.0, color=style.LIMIT, linestyle=(0, (5, 3)), linewidth=1.0)
        panel.set_title(f"{n} drones")
        panel.set_xlabel("mean sum of tensions / mean force")
    axes[0].set_ylabel("smallest angle (deg)")
    style.legend(figure, rows=2)
    return figure


@register(
    SINGLE,
    "Smallest angle over time",
    "Smallest angle between two cables that each allocator wanted; darkest what was wanted on board, "
    "palest what the cables did; the paper's 30 degrees dashed.",
)
def smallest(judged: Judged) -> Figure:
    figure, (axes,) = style.grid(height=2.2, legend_rows=2)
    for kind, lines in look([a.allocator for a in judged.answers]).items():
        answer = next(a for a in judged.answers if a.allocator == kind)
        panels.line(
            axes, answer.time, answer.smallest_angles, label=kind, linewidth=1.0,
            zorder=3.0 if kind in (ON_BOARD, ACTUAL) else 2.0, **lines,
        )  # fmt: skip
    axes.set_xlim(0.0, float(judged.answers[0].time[-1]))
    panels.least_angle(axes, THRESHOLD_DEG)
    axes.set_xlabel("time (s)")
    axes.set_ylabel("smallest angle (deg)")
    style.legend(figure, rows=2)
    return figure


def write_page(
    judged: Sequence[Judged], skipped: Mapping[str, str], folder: Path, command: str
) -> Path:
    """Write ``judgement.html`` (self-contained) and its figures; return the page's path."""
    overall = draw(OVERALL, judged)
    single = [
        draw({f"{name}-{k}": entry for name, entry in SINGLE.items()}, flight)
        for k, flight in enumerate(judged)
    ]
    for drawing in chain(overall, *single):
        drawing.save(folder / "figures")
    body = [
        "<header><h1>Allocators on recorded flights</h1>",
        f'<p class="soft">{escape(INTRODUCTION)}</p></header>',
        html.facts(
            [
                f"{len(judged)} flight{'s' * (len(judged) != 1)}",
                *(f"{k}: {why}" for k, why in skipped.items()),
            ]
        ),
        *(f"<p>{escape(sentence)}</p>" for sentence in judgement.findings(judged)),
        f'<p class="soft">Repeat with <code>{escape(command)}</code>.</p>',
    ]
    body += [_table(*table) for table in judgement.summary(judged)]
    body.append(f'<p class="soft">{escape(judgement.NOTE)}</p>')
    body += map(html.figure, overall)
    for flight, drawings in zip(judged, single, strict=True):
        body += [_table(*table) for table in judgement.flight_tables(flight)]
        body += map(html.figure, drawings)
    meanings = "\n".join(f"{name:24} {q.unit:6} {q.meaning}" for name, q in QUANTITIES.items())
    body.append(html.details("What the numbers mean", meanings))
    for flight in {j.n: j for j in judged}.values():
        settings = {a.allocator: dict(a.settings) for a in flight.answers if a.statuses}
        body.append(
            html.details(
                f"Settings for {flight.n} drones, at the paper's size",
                json.dumps(settings, indent=1),
            )
        )
    target = folder / "judgement.html"
    with atomic_path(target) as temporary:
        text = html.page("Allocators on recorded flights - colift", "\n".join(body))
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return target


def _table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    cells = [[escape(cell) for cell in row] for row in rows]
    numbers = [k for k in range(1, len(header)) if header[k] != "statuses"]
    return f"<h2>{escape(title)}</h2>" + html.table(header, cells, numbers=numbers)
