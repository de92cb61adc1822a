"""The `colift` command. Each command imports what it needs, so that help is instant."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.table import Table

from colift.errors import ColiftError, MissionError, UnknownNameError

if TYPE_CHECKING:
    from colift.simulation.flight import Progress as Report

EXIT_ERROR = 1
EXIT_USAGE = 2
EXIT_DIVERGED = 3
EXIT_INTERRUPTED = 130

app = typer.Typer(
    name="colift",
    help="Several multirotors carry one load on cables: allocate, control, simulate, judge.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)
out = Console()
err = Console(stderr=True)

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
Sets = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change any field of the mission, e.g. allocation.mu=0.75.",
    ),
]
With = Annotated[
    list[Path] | None,
    typer.Option("--with", metavar="FILE", help="Python file with parts of your own to use."),
]


def _version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"colift {version('colift')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version.")
    ] = False,
) -> None:
    """Several multirotors carry one load on cables: allocate, control, simulate, judge."""


@app.command()
def run(
    mission: Annotated[
        str, typer.Argument(help="Name of a shipped mission (see `colift list`) or a TOML file.")
    ] = "paper-spiral",
    sets: Sets = None,
    seed: Annotated[int | None, typer.Option(help="Seed instead of the mission's.")] = None,
    folder: Annotated[
        Path | None,
        typer.Option("--out", help="Result folder.", show_default="runs/MISSION-DATE-TIME"),
    ] = None,
    extra: With = None,
    report: Annotated[bool, typer.Option(help="Write the HTML report and its figures.")] = True,
    as_json: Json = False,
) -> None:
    """Fly a mission; print what happened; write recording, metrics and report.

    [bold]Examples[/bold]

      colift run
      colift run figure-eight --set allocation.mu=0.75 --set timing.duration=60
      colift run my-mission.toml --out results/first --json
    """
    from colift.mission.load import parse_override

    with loading():
        import colift
        from colift import metrics
        from colift.part import load_file

        for path in extra or []:
            load_file(path)
        overrides = dict(parse_override(text) for text in sets or [])
        loaded = colift.load_mission(
            mission, {**overrides, **({} if seed is None else {"seed": seed})}
        )
    with progress(f"Flying {loaded.name}") as advance:
        flown = colift.run(loaded, progress=advance)
    target = folder or new_folder(loaded.name)
    files = write_results(flown, target, report=report)
    if as_json:
        emit(
            {
                "mission": loaded.name,
                "outcome": flown.recording.outcome,
                "summary": metrics.verdict(flown.recording, flown.metrics)[1],
                "metrics": flown.metrics,
                "loop_time_s": flown.loop_time,
                "compiled": flown.compiled,
                "files": {name: str(path) for name, path in files.items()},
            }
        )
    else:
        table = Table(
            title=escape(f"{loaded.name}: {flown.recording.outcome}"), title_justify="left"
        )
        table.add_column("metric")
        table.add_column("value", justify="right")
        table.add_column("unit")
        table.add_column("meaning", style="dim")
        for metric in metrics.all_metrics():
            value = f"{flown.metrics[metric.name]:.5g}"
            table.add_row(metric.name, value, metric.unit, metric.meaning)
        out.print(table)
        level, sentence = metrics.verdict(flown.recording, flown.metrics)
        colour = {"good": "green", "warn": "yellow", "bad": "red"}[level]
        out.print(f"[{colour}]{escape(sentence)}[/{colour}]")
        simulated = loaded.timing.duration
        how = "compiled" if flown.compiled else "interpreted, a part is plain Python"
        out.print(
            f"{simulated:g} s of flight in {flown.loop_time:.3f} s ({how}, "
            f"{simulated / flown.loop_time:.0f} times real time)."
        )
        for name, path in files.items():
            out.print(f"{name:>10}  {escape(str(path))}", highlight=False, soft_wrap=True)
    if flown.recording.outcome != "completed":
        raise typer.Exit(EXIT_DIVERGED)


@app.command()
def reproduce(
    folder: Annotated[
        Path | None,
        typer.Option("--out", help="Result folder.", show_default="runs/reproduce-DATE-TIME"),
    ] = None,
    report: Annotated[bool, typer.Option(help="Write the HTML page and its figures.")] = True,
    as_json: Json = False,
) -> None:
    """Fly everything in the paper and set our figures beside the printed ones.

    Each row ends in a verdict: reproduced, better, or differs because of a named reason. The
    paper's errata are each demonstrated by a flight or a computation.
    """
    with loading():
        from colift import reproduction
    with progress("Reproducing the paper") as advance:
        result = reproduction.reproduce(advance)
    target = folder or new_folder("reproduce")
    files = reproduction.write(result, target, report=report)
    if as_json:
        emit({**result.as_dict(), "files": {name: str(path) for name, path in files.items()}})
        return
    for section, rows in result.sections():
        table = Table(title=section, title_justify="left", show_lines=True)
        table.add_column("quantity", ratio=3)
        table.add_column("paper", justify="right")
        table.add_column("ours", justify="right")
        table.add_column("verdict", ratio=4)
        for row in rows:
            table.add_row(
                escape(row.quantity), row.paper_text, row.ours_text, escape(row.verdict_text)
            )
        out.print(table)
    for name, path in files.items():
        out.print(f"{name:>10}  {escape(str(path))}", highlight=False, soft_wrap=True)


@app.command()
def safety(
    sizes: Annotated[
        str, typer.Option(help="Numbers of drones, separated by commas.")
    ] = "2,3,4,6,8,12,16",
    cycles: Annotated[
        int, typer.Option(min=100, max=10_000_000, help="Cycles per team and family of forces.")
    ] = 20_000,
    quick: Annotated[bool, typer.Option(help="A tenth of it; for a first look.")] = False,
    file: Annotated[Path | None, typer.Option("--out", help="Write the JSON here as well.")] = None,
    as_json: Json = False,
) -> None:
    """Attack the safe allocator and fly it, beside the paper's allocator.

    Alone: smooth, noisy, stepping and adversarial forces; every answer is checked against every
    limit. In flight: from rest, with a drone below the load, fast, heavy, after losing a drone, for
    an hour. The table says where it holds and where not.
    """
    counts = numbers(sizes, 2, 64)
    with loading():
        from colift import safety as module
    with progress("Attacking and flying") as advance:
        result = module.show_all(
            counts, cycles // (10 if quick else 1), quick=quick, progress=advance
        )
    save_json(file, result)
    if as_json:
        emit(result)
        return
    show_tables(module.tables(result))


@app.command()
def feasibility(
    mission: Annotated[
        str, typer.Argument(help="Name of a shipped mission (see `colift list`) or a TOML file.")
    ],
    sets: Sets = None,
    as_json: Json = False,
) -> None:
    """Before a flight: can these drones hold this load within these limits, and how well.

    For a mission with the safe allocator, in hover. Exit code 1 if they cannot.
    """
    from colift.mission.load import parse_override

    with loading():
        import colift
        from colift.allocation._feasibility import SEARCHED
        from colift.allocation._feasibility import feasibility as judge
        from colift.allocation.safe import Safe

        loaded = colift.load_mission(mission, dict(parse_override(text) for text in sets or []))
    if not isinstance(loaded.allocation, Safe):
        raise ColiftError(
            f"{loaded.name}: its allocator {loaded.kinds['allocation']!r} has no limits to judge; "
            "try --set allocation.kind=safe"
        )
    found = judge(loaded.team, loaded.allocation)
    weight = loaded.team.load_mass * loaded.team.gravity
    widest = math.degrees(found.widest_angle)
    if as_json:
        emit(
            {
                "mission": loaded.name, "feasible": found.ok, "conflicts": list(found.conflicts),
                "weight_N": weight, "lightest_N": found.lightest, "heaviest_N": found.heaviest,
                "margin": found.margin, "widest_angle_deg": widest,
                "most_cables_found": found.most_cables[0], "most_cables_bound": found.most_cables[1],
                "tensions_N": found.tensions.tolist(),
            }
        )  # fmt: skip
    else:
        part, n = loaded.allocation, loaded.drones.count
        most, bound = found.most_cables
        allowed = f"{most} cables (found; never more than {bound})"
        if most >= SEARCHED:
            allowed = f"{most} cables or more"
        out.print(f"{escape(loaded.name)}: {n} drones, load of {weight:.4g} N (hover)")
        out.print(
            f"Within the limits the cables hold {found.lightest:.4g} to {found.heaviest:.4g} N: "
            f"{found.margin:.2f} times the load."
        )
        out.print(
            f"{n} cables within {part.max_cone_deg:g} deg of the vertical can be {widest:.1f} deg apart; "
            f"{part.min_angle_deg:g} deg are asked for, which allows {allowed}."
        )
        for conflict in found.conflicts:
            out.print(f"[red]conflict[/red]: {escape(conflict)}")
        out.print("feasible" if found.ok else "not feasible")
    if not found.ok:
        raise typer.Exit(EXIT_ERROR)


@app.command(name="list")
def list_(
    as_json: Json = False,
) -> None:
    """Name the shipped missions and the parts of every layer."""
    from colift.mission.load import mission_names, read_source
    from colift.part import LAYERS, names

    missions = {name: read_source(name)[1].get("description", "") for name in mission_names()}
    parts = {layer: names(layer) for layer in LAYERS}
    if as_json:
        emit({"missions": missions, "parts": parts})
        return
    table = Table(title="Missions (colift run NAME)", title_justify="left")
    table.add_column("name", no_wrap=True)
    table.add_column("what it shows")
    for name, text in missions.items():
        table.add_row(name, escape(text))
    out.print(table)
    table = Table(title="Parts (--set LAYER.kind=NAME)", title_justify="left")
    table.add_column("layer", no_wrap=True)
    table.add_column("names")
    for layer, kinds in parts.items():
        table.add_row(layer, ", ".join(kinds))
    out.print(table)


@app.command()
def bench(
    sizes: Annotated[
        str, typer.Option(help="Numbers of drones, separated by commas.")
    ] = "2,3,4,8,16,64,256,1024",
    quick: Annotated[bool, typer.Option(help="Fewer repetitions; for a smoke test.")] = False,
    file: Annotated[Path | None, typer.Option("--out", help="Write the JSON here as well.")] = None,
    as_json: Json = False,
) -> None:
    """Time the allocator and the closed loop on this machine; compare with SciPy's SLSQP.

    Warm-up is excluded; median, 99th percentile and worst of many calls are shown, with the
    iterations and the worst optimality residual, so that a fast wrong answer shows.
    """
    counts = numbers(sizes, 1, 1024)
    with loading():
        from colift import benchmark
    with progress("Timing") as advance:
        result = benchmark.run(counts, quick=quick, progress=advance)
    save_json(file, result)
    if as_json:
        emit(result)
    else:
        benchmark.show(result, out)


@app.command()
def latency(
    drones: Annotated[int, typer.Option(help="Number of drones.", min=2, max=64)] = 4,
    seconds: Annotated[
        float, typer.Option(help="Length of each of the six measurements, s.", min=1, max=3600)
    ] = 60.0,
    rate: Annotated[float, typer.Option(help="Calls per second.", min=10, max=10_000)] = 1000.0,
    others: Annotated[
        int | None, typer.Option(help="Busy processes meanwhile; default: one a core.", min=0)
    ] = None,
    realtime: Annotated[
        bool, typer.Option(help="Under the real-time scheduler (Linux, with the right to).")
    ] = False,
    file: Annotated[Path | None, typer.Option("--out", help="Write the JSON here as well.")] = None,
    as_json: Json = False,
) -> None:
    """Call the allocators on a clock while other processes use the machine.

    Tells late starts, Python's collector, the allocator's own time and preemption apart, from Python and
    from a compiled loop.
    """
    with loading():
        from colift import latency as module
    with progress("Waiting for ticks") as advance:
        result = module.run(
            n=drones, seconds=seconds, rate=rate, others=others, realtime=realtime,
            progress=advance,
        )  # fmt: skip
    save_json(file, result)
    if as_json:
        emit(result)
    else:
        show_tables(module.tables(result))


def save_json(file: Path | None, result: Any) -> None:
    """Write a result where the user asked for it, whole or not at all."""
    if file is not None:
        from colift.recording import atomic_path

        with atomic_path(file) as temporary:
            temporary.write_text(json.dumps(plain(result), indent=2) + "\n")


def write_results(flown: Any, folder: Path, *, report: bool) -> dict[str, Path]:
    """Recording, metrics, resolved mission and report of one run, each written atomically."""
    import tomli_w

    from colift.recording import atomic_path

    files = {"recording": flown.recording.save(folder / "recording.h5")}
    for name, text in (
        ("metrics", json.dumps(plain(flown.metrics), indent=2) + "\n"),
        ("mission", tomli_w.dumps(flown.mission.resolved())),
    ):
        files[name] = folder / ("metrics.json" if name == "metrics" else "mission.toml")
        with atomic_path(files[name]) as temporary:
            temporary.write_text(text, encoding="utf-8")
    if report:
        from colift.report.html import write_report

        files["report"] = write_report(flown.recording, folder, metrics=flown.metrics)
    return files


def numbers(text: str, least: int, most: int) -> list[int]:
    """A list of whole numbers, separated by commas."""
    try:
        found = [int(item) for item in text.split(",")]
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not a list of whole numbers") from None
    if any(not least <= n <= most for n in found):
        raise typer.BadParameter(f"each number of drones must be between {least} and {most}")
    return found


def show_tables(tables: Iterable[tuple[str, list[str], list[list[str]]]]) -> None:
    """Print titled tables of text; the first and the last column may wrap."""
    for title, header, rows in tables:
        table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 0, 0, 1))
        for k, name in enumerate(header):
            edge = k in (0, len(header) - 1)
            widest = max(len(row[k]) for row in rows) if edge else None
            table.add_column(
                name, justify="left" if edge else "right", no_wrap=not edge,
                min_width=widest and min(widest, 16),
            )  # fmt: skip
        for row in rows:
            table.add_row(*map(escape, row))
        out.print(table)


def plain(value: Any) -> Any:
    """JSON-ready copy; a number that is not finite becomes null."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def emit(value: Any) -> None:
    """Print one JSON object on standard output."""
    print(json.dumps(plain(value), indent=2))


@contextmanager
def loading() -> Iterator[None]:
    """Say so while compiled parts are loaded, which takes half a minute the first time."""
    from colift.jit import compiled_before

    if compiled_before():
        yield
        return
    err.print("First run on this machine: compiling (about half a minute, then cached).")
    with err.status("compiling"):
        yield


@contextmanager
def progress(title: str) -> Iterator[Report]:
    """A progress bar on a terminal; silent elsewhere."""
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=err, transient=True, disable=not err.is_terminal) as bar:
        task = bar.add_task(escape(title), total=1.0)
        yield lambda fraction: bar.update(task, completed=fraction)


def new_folder(name: str) -> Path:
    """Make ``runs/NAME-DATE-TIME``, numbered where flights of the same second would share it."""
    stem = f"{_slug(name)}-{datetime.now():%Y%m%d-%H%M%S}"
    folder, number = Path("runs") / stem, 1
    folder.parent.mkdir(exist_ok=True)
    while True:
        try:
            folder.mkdir()
            return folder
        except FileExistsError:
            number += 1
            folder = folder.with_name(f"{stem}-{number}")


def _slug(name: str) -> str:
    return "".join(c if c.isalnum() or c in "-_" else "-" for c in name)[:60]


def main() -> None:
    """Entry point: errors of ours become one clear message and an exit code."""
    try:
        app()
    except (MissionError, UnknownNameError) as error:
        err.print(f"[red]error[/red]: {escape(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(EXIT_USAGE)
    except ColiftError as error:
        err.print(f"[red]error[/red]: {escape(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(EXIT_ERROR)
    except OSError as error:
        if error.filename is None:
            raise
        err.print(f"[red]error[/red]: {escape(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(EXIT_ERROR)
    except KeyboardInterrupt:
        err.print("interrupted; nothing half-written was left")
        sys.exit(EXIT_INTERRUPTED)
