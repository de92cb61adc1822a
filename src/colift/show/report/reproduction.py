"""The page that sets the paper beside our flights."""

from __future__ import annotations

from dataclasses import replace
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from colift.record.recording import atomic_path
from colift.show.report import html
from colift.show.report.comparison import COMPARISONS
from colift.show.report.figures import FIGURES
from colift.show.report.render import Drawing, draw

if TYPE_CHECKING:
    from colift.study.reproduction import Reproduction

INTRODUCTION = (
    "Every number, table and figure of the simulation study in Vazquez-Soqui, Oliva-Palomo, "
    "Mercado-Ravell and Castillo, “SQP-Based Cable-Tension Allocation for Multi-Drone Load "
    "Transport”, beside flights of colift. A verdict follows from the two numbers by a rule; "
    "where ours differs, the reason is named, and each command repeats its number."
)


def drawings(result: Reproduction) -> list[Drawing]:
    """The paper's result figures, in its order, drawn from our flights."""
    flights = {name: run.recording for name, run in result.flights.items()}
    nominal = flights["sqp-0.15"]
    patterns = {
        "lopsided baseline": flights["lopsided"],
        "35 degree ring baseline": flights["ring"],
        "SQP, mu = 0.15": nominal,
    }
    weights = {f"mu = {mu}": flights[f"sqp-{mu}"] for mu in ("0.15", "0.75", "1.35")}
    own = {drawing.name: drawing for drawing in draw(FIGURES, nominal)}
    sides = {d.name: d for d in draw({k: COMPARISONS[k] for k in ("tensions", "angles")}, patterns)}
    last = draw({"sensitivity": COMPARISONS["sensitivity"]}, weights)[0]
    chosen = (
        ("Figs. 3 and 4 (a)", own["path"]),
        ("Fig. 4 (b)", own["position_error"]),
        ("Fig. 5, baselines against SQP", sides["tensions"]),
        ("Fig. 6, baselines against SQP", sides["angles"]),
        ("Fig. 7", own["tension_tracking"]),
        ("Fig. 8", last),
        ("Solve times", own["allocator_time"]),
    )
    return [replace(drawing, title=f"{label}: {drawing.title}") for label, drawing in chosen]


def write_page(result: Reproduction, folder: Path) -> Path:
    """Write ``reproduction.html`` (self-contained) and its figures; return the page's path."""
    figures = drawings(result)
    for figure in figures:
        figure.save(folder / "figures")
    verdicts = result.as_dict()["verdicts"]
    body = [
        "<header><h1>The paper, reproduced</h1>",
        f'<p class="soft">{escape(INTRODUCTION)}</p></header>',
        html.facts(f"{count} {verdict}" for verdict, count in verdicts.items()),
    ]
    for section, rows in result.sections():
        body.append(f"<h2>{escape(section)}</h2>")
        cells = (
            (
                escape(row.quantity),
                escape(row.paper_text),
                escape(row.ours_text),
                f"<b>{row.verdict}</b>{escape(row.verdict_text.removeprefix(row.verdict))}"
                f"<br><code>{escape(row.command)}</code>",
            )
            for row in rows
        )
        header = ("quantity", "paper", "ours", "verdict, and the command that repeats our number")
        body.append(html.table(header, cells, numbers=(1, 2)))
    body.append("<h2>Figures</h2>")
    body.extend(map(html.figure, figures))
    target = folder / "reproduction.html"
    with atomic_path(target) as temporary:
        text = html.page("The paper, reproduced - colift", "\n".join(body))
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return target
