"""Pages of one file: no script, no request, dark and light, wide and narrow.

The page of a flight may show a replay, which is a page of its own beside it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import tomli_w

from colift.mission.criteria import METRICS
from colift.record.moments import KINDS, Moment
from colift.record.recording import Recording, atomic_path
from colift.record.verdict import Judgement, judge
from colift.show.report.marks import icon

if TYPE_CHECKING:
    from colift.flight.runner import Run
    from colift.show.report.render import Drawing

STYLE = """
:root{color-scheme:light dark;--ink:#1d2126;--soft:#5c6670;--back:#fbfbfa;--card:#fff;--rule:#e2e4e6;
--good:#1b7f4b;--warn:#a86400;--bad:#b3261e;--info:#0b62a8}
@media (prefers-color-scheme:dark){:root{--ink:#e6e8ea;--soft:#9aa4ad;--back:#15181b;--card:#1d2125;
--rule:#33393f;--good:#5fcf95;--warn:#f0b34a;--bad:#ff8a80;--info:#7cc4ff;--f-ffffff:var(--card)}
figure img{filter:invert(.88) hue-rotate(180deg)}}
*{box-sizing:border-box}
body{margin:0 auto;padding:2rem 1.25rem 4rem;max-width:52rem;background:var(--back);color:var(--ink);
font:1rem/1.55 system-ui,-apple-system,"Segoe UI",Roboto,"DejaVu Sans",sans-serif;
overflow-wrap:break-word}
h1{font-size:1.7rem;line-height:1.25;margin:0 0 .4rem}
h2{font-size:1.15rem;margin:2.6rem 0 .7rem}
h3{font-size:1rem;margin:1.6rem 0 .4rem}
p{margin:.5rem 0}
.soft,figcaption,th{color:var(--soft)}
.facts{display:flex;flex-wrap:wrap;gap:.35rem .5rem;padding:0;margin:1rem 0;list-style:none;
font-size:.85rem}
.facts li{border:1px solid var(--rule);border-radius:1rem;padding:.1rem .7rem}
.banner{border-left:.35rem solid var(--tone);background:var(--card);padding:.7rem 1rem;
border-radius:.25rem;margin:1.2rem 0;font-weight:600}
.banner p{margin:0}.banner ul{margin:.3rem 0 0;padding-left:1.2rem;font-weight:400}
.pass,.good{--tone:var(--good)}.warn{--tone:var(--warn)}.fail,.lost,.bad{--tone:var(--bad)}
.info{--tone:var(--info)}
.icon{width:.8em;height:.8em;fill:none;stroke:var(--tone);stroke-width:1.8;stroke-linecap:round;
stroke-linejoin:round;margin-right:.45em;overflow:visible}
.long{max-height:26rem;overflow-y:auto}
.scroll{overflow-x:auto}
table{border-collapse:collapse;width:100%;font-size:.92rem}
th{text-align:left;font-weight:600;font-size:.82rem}
th,td{padding:.4rem .9rem .4rem 0;border-bottom:1px solid var(--rule)}
td{vertical-align:top}
th:last-child,td:last-child{padding-right:0}
.number{text-align:right;font-variant-numeric:tabular-nums}
td.number,.name{white-space:nowrap}
th{vertical-align:bottom}
code,pre{font:.85em/1.5 ui-monospace,SFMono-Regular,Menlo,"DejaVu Sans Mono",monospace}
td code{color:var(--soft)}
figure{margin:0 0 2.2rem}
figure .scroll{background:var(--card);border:1px solid var(--rule);border-radius:.4rem;padding:.5rem}
iframe{display:block;width:100%;aspect-ratio:16/10;min-height:30rem;border:1px solid var(--rule);
border-radius:.4rem}
figure svg[role=img]:not(.icon),figure img{display:block;width:100%;height:auto;min-width:30rem}
figure svg[role=img]:not(.icon){fill:var(--f-000000,#000)}
figcaption{font-size:.9rem;margin-top:.5rem}
figcaption b{color:var(--ink)}
details{border:1px solid var(--rule);border-radius:.4rem;background:var(--card);padding:.6rem 1rem;
margin:.6rem 0}
summary{cursor:pointer;font-weight:600}
pre{overflow-x:auto;margin:.7rem 0 .2rem}
.legend{display:none;flex-wrap:wrap;gap:.1rem .9rem;margin:0;padding:0 .2rem;list-style:none;
font-size:.8rem}
.legend svg:not(.icon){width:1.6rem;height:.7rem;margin-right:.35rem;fill:none;
stroke-width:2.2}
@media (max-width:40rem){figure svg[role=img]:not(.icon){min-width:0;overflow:visible}
figure .scroll{padding:.3rem .6rem .3rem .8rem}
figure svg text{font-size:13px!important}figure svg[aria-label="Path"] text{font-size:11px!important}
figure svg [id*="-ylabel_"]{transform:translateX(-9px)}figure svg [id*="-legend_"]{display:none}
.legend{display:flex}
body{padding:1.2rem .9rem 3rem}h1{font-size:1.4rem}
.many thead{display:none}.many tr{display:grid;grid-template-columns:1fr 1fr;padding:.5rem 0;
border-bottom:1px solid var(--rule)}.many td{border:0;padding:.1rem 0;text-align:left;min-width:0}
.many td:first-child,.many td:last-child{grid-column:1/-1}.many td:first-child{font-weight:600}
.many .number::before{content:attr(data-name) " ";color:var(--soft)}}
@media print{body{max-width:none}figure{break-inside:avoid}}
"""


def page(title: str, body: str) -> str:
    """A whole document in the common style; ``title`` is text, ``body`` is HTML."""
    from colift.show.report.render import dark_colours

    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}{dark_colours()}\n</style>\n</head>\n"
        f"<body>\n{body}\n</body>\n</html>\n"
    )


def table(header: Sequence[str], rows: Iterable[Sequence[str]], numbers: Sequence[int] = ()) -> str:
    """A table; ``header`` is text, cells are HTML; columns listed in ``numbers`` align right.

    On a narrow screen the cells of a row of more than three columns stand below each other.
    """
    look = ['class="number"' if k in numbers else "" for k in range(len(header))]
    cells = [f'{c} data-name="{escape(t)}"' if c else c for c, t in zip(look, header, strict=True)]
    head = "".join(f"<th {c}>{escape(t)}</th>" for c, t in zip(look, header, strict=True))
    body = "\n".join(
        "<tr>" + "".join(f"<td {c}>{t}</td>" for c, t in zip(cells, row, strict=True)) + "</tr>"
        for row in rows
    )
    kind = ' class="many"' if len(header) > 3 else ""
    text = f"<table{kind}>\n<thead><tr>{head}</tr></thead>\n<tbody>\n{body}\n</tbody>\n</table>"
    return f'<div class="scroll">{text}</div>'.replace("<th >", "<th>").replace("<td >", "<td>")


def banner(level: str, said: Sequence[str]) -> str:
    """What stands out: a level of :data:`colift.record.verdict.LEVELS` with what is said first, the rest as a list."""
    first, *others = said or [""]
    head = f"{level[:1].upper()}{level[1:]}{': ' * bool(first)}{escape(first)}"
    listed = "".join(f"<li>{escape(each)}</li>" for each in others)
    return (
        f'<div class="banner {level}"><p>{head}</p>{f"<ul>{listed}</ul>" if listed else ""}</div>'
    )


def facts(values: Iterable[str]) -> str:
    """A line of short facts."""
    return '<ul class="facts">' + "".join(f"<li>{escape(v)}</li>" for v in values) + "</ul>"


def warnings_list(warnings: Sequence[str]) -> str:
    """What was warned of before the flight; nothing where nothing was."""
    items = "".join(f"<li>{escape(text)}</li>" for text in warnings)
    return f'<p class="soft">Warned before the flight:</p>\n<ul>{items}</ul>' if items else ""


def figure(drawing: Drawing) -> str:
    """A figure on a card with its caption."""
    return (
        f'<figure>\n<div class="scroll">{drawing.inline()}</div>\n'
        f"<figcaption><b>{escape(drawing.title)}.</b> {escape(drawing.caption)}</figcaption>\n</figure>"
    )


def frame(file: str) -> str:
    """The replay in a frame that runs its scripts and may do nothing else, and a link to it alone."""
    name = escape(file)
    return (
        f'<h2>Replay</h2>\n<iframe src="{name}" title="Replay in 3D" loading="lazy" '
        'sandbox="allow-scripts"></iframe>\n'
        f'<p class="soft">The frame shows <a href="{name}">{name}</a>, which must stand beside '
        "this page.</p>"
    )


def details(summary: str, text: str) -> str:
    """Preformatted text that opens on demand."""
    return f"<details><summary>{escape(summary)}</summary><pre>{escape(text)}</pre></details>"


def write_report(
    source: Run | Recording,
    folder: str | Path,
    *,
    metrics: Mapping[str, float],
    replay: Path | None = None,
) -> Path:
    """Write ``report.html`` and ``figures/<name>.png`` and ``.svg`` of one flight.

    Parameters
    ----------
    source : Run or Recording
        What was flown.
    folder : path
        Created if missing; files of the same name are replaced, each only by a whole one.
    metrics : mapping
        As from :func:`colift.record.metrics.compute`.
    replay : path, optional
        Page of the viewer in the same folder, shown in a frame.

    Returns
    -------
    Path
        The page; it needs no other file but ``replay``. Equal recordings give equal bytes.

    """
    from colift.show.report.figures import drawable
    from colift.show.report.render import draw

    recording = (source if isinstance(source, Recording) else source.recording).complete()
    folder = Path(folder)
    drawings = draw(drawable(recording), recording)
    for drawing in drawings:
        drawing.save(folder / "figures")
    target = folder / "report.html"
    with atomic_path(target) as temporary:
        text = report(recording, metrics, drawings, replay.name if replay else None)
        temporary.write_text(text, encoding="utf-8", newline="\n")
    return target


def report(
    recording: Recording,
    metrics: Mapping[str, float],
    drawings: Sequence[Drawing],
    replay: str | None = None,
) -> str:
    """The page of one flight; ``replay`` is the file beside it that replays the flight."""
    mission, verdict = recording.mission, judge(recording, metrics)
    versions = "\n".join(f"{name:9} {text}" for name, text in recording.versions.items())
    parts = [
        f"<header><h1>{escape(mission.name)}</h1>",
        f'<p class="soft">{escape(mission.description)}</p></header>',
        banner(verdict.level, verdict.said),
        facts(
            [
                f"{recording.n} drone{'s' * (recording.n != 1)}",
                f"load {mission.load.mass:g} kg",
                f"{mission.timing.duration:.4g} s",
                *_flown_by(recording),
                f"colift {recording.versions.get('colift', '?')}",
            ]
        ),
        warnings_list(recording.provenance.get("warnings", [])),
        criteria_table(verdict.judged),
        moments_table(recording.moments),
        "<h2>Numbers</h2>",
        metrics_table(metrics),
        frame(replay) if replay else "",
        "<h2>Figures</h2>",
        *map(figure, drawings),
        "<h2>Provenance</h2>",
        *_provenance(recording),
        details("Versions", versions),
    ]
    return page(f"{mission.name} - colift", "\n".join(part for part in parts if part))


def _flown_by(recording: Recording) -> list[str]:
    """Short facts on what flew."""
    mission = recording.mission
    if recording.source == "flight":
        return ["real flight", f"{len(recording.time)} rows"]
    named = (("reference", "reference"), ("allocator", "allocation"))
    return [
        *(f"{word} {mission.kinds[kind]}" for word, kind in named if kind in mission.kinds),
        f"seed {mission.seed}",
    ]


def _provenance(recording: Recording) -> list[str]:
    """Where the numbers come from: the mission and its parts, or the logs of a real flight."""
    mission = recording.mission
    resolved = tomli_w.dumps(mission.resolved())
    if recording.source == "flight":
        text = "Logs of a real flight. What they do not hold is unknown, and not shown."
        logs = tomli_w.dumps({k: v for k, v in recording.provenance.items() if v is not None})
        return [
            f'<p class="soft">{text}</p>',
            details("Logs, assumptions and what was inferred", logs),
            details("Team and timing", resolved),
        ]
    kinds = ", ".join(f"{layer} {kind}" for layer, kind in mission.kinds.items())
    return [
        f'<p class="soft">Parts: {escape(kinds)}. Seed {mission.seed}.</p>',
        details("Mission as flown, every default filled in (a valid mission file)", resolved),
    ]


def criteria_table(judged: Sequence[Judgement]) -> str:
    """Every criterion with a verdict in words; nothing where none applies."""
    if not judged:
        return ""
    rows = []
    for each in judged:
        word = "pass" if each.holds else "fail"
        mark = f'<b class="{word}" style="color:var(--tone)">{word}</b>'
        bound = each.bound if each.asked else f"{each.bound} (default)"
        name = f"<code>{escape(each.metric)}</code>"
        rows.append((name, f"{each.value:.4g}", escape(bound), mark))
    return "<h2>Criteria</h2>" + table(
        ("Quantity", "Value", "Bound", "Verdict"), rows, numbers=(1,)
    )


def moments_table(moments: Sequence[Moment]) -> str:
    """When what happened, each with the mark that it has in the figures; nothing where nothing did."""
    if not moments:
        return ""
    rows = [
        (f"{m.time:.2f} s", f"{icon(m.kind)}{escape(KINDS[m.kind])}", escape(m.text))
        for m in moments
    ]
    made = table(("Time", "Kind", "What"), rows, numbers=(0,))
    return "<h2>Moments</h2>" + (made if len(rows) <= 12 else f'<div class="long">{made}</div>')


def metrics_table(metrics: Mapping[str, float]) -> str:
    """Every metric with its meaning, value and unit; those without a value are only named."""
    rows, missing = [], []
    for metric in METRICS:
        if math.isnan(metrics.get(metric.name, 0.0)):
            missing.append(f"<code>{escape(metric.name)}</code>")
        elif metric.name in metrics:
            value, unit = quantity(metrics[metric.name], metric.unit)
            meaning = metric.meaning[:1].upper() + metric.meaning[1:]
            rows.append((f"{escape(meaning)}<br><code>{escape(metric.name)}</code>", value, unit))
    text = table(("Quantity", "Value", "Unit"), rows, numbers=(1,))
    if missing:
        text += f'<p class="soft">Not measured, or does not apply: {", ".join(missing)}.</p>'
    return text


def quantity(value: float, unit: str) -> tuple[str, str]:
    """A value and its unit for reading: lengths below a metre in cm, no unit for pure numbers."""
    if unit == "m" and abs(value) < 1.0:
        value, unit = 100.0 * value, "cm"
    return f"{value:.4g}", {"1": "", "us": "µs", "deg": "°"}.get(unit, unit)
