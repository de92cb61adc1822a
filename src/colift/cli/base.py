"""What the commands share: the application, common options, progress, tables and result files."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from colift.cli._commands import Commands
from colift.errors import ColiftError

if TYPE_CHECKING:
    from rich.console import Console
    from rich.status import Status

    from colift.flight.flight import Progress as Report
    from colift.record.verdict import Verdict

EXIT_ERROR = 1
EXIT_USAGE = 2
EXIT_LOST = 3
EXIT_FAILED = 4
EXIT_INTERRUPTED = 130

app = typer.Typer(
    name="colift",
    cls=Commands,
    help="Several multirotors carry one load on cables: allocate, control, simulate, judge.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode="rich",
)


if TYPE_CHECKING:
    out: Console
    err: Console


@cache
def console(*, stderr: bool = False) -> Console:
    """Where text for people goes: standard output, or standard error; made when it is first needed."""
    from rich.console import Console

    return Console(stderr=stderr)


def __getattr__(name: str) -> Console:
    if name in ("out", "err"):
        return console(stderr=name == "err")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


MissionName = Annotated[
    str, typer.Argument(help="Name of a shipped mission (see `colift list`) or a TOML file.")
]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")]
JsonFile = Annotated[Path | None, typer.Option("--out", help="Write the JSON here as well.")]
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


def result_folder(name: str) -> Any:
    """The option ``--out`` of a command that makes ``runs/NAME-DATE-TIME`` where it is left out."""
    return typer.Option("--out", help="Result folder.", show_default=f"runs/{name}-DATE-TIME")


def load_parts(files: Iterable[Path] | None) -> None:
    """Register the parts of a user's files."""
    from colift.part import load_file

    for path in files or ():
        load_file(path)


def save_json(file: Path | None, result: Any) -> None:
    """Write a result where the user asked for it, whole or not at all."""
    if file is not None:
        from colift.record.recording import atomic_path

        with atomic_path(file) as temporary:
            temporary.write_text(json.dumps(plain(result), indent=2) + "\n")


RUN_FILES = ("recording.h5", "metrics.json", "mission.toml", "replay.html", "report.html")
"""What a result folder of `run` may hold, beside figures."""


def check_out(folder: Path | None, ours: Sequence[str]) -> None:
    """Refuse a result folder that holds what is not ours to replace.

    A folder that is missing, empty or holds one of the files that this command writes (``ours``) will do.

    Raises
    ------
    ColiftError
        With the option that chose it.

    """
    if folder is None or not folder.exists():
        return
    if not folder.is_dir():
        raise ColiftError(f"--out {folder}: is a file, not a folder")
    inside = {path.name for path in folder.iterdir()}
    if inside and inside.isdisjoint(ours):
        raise ColiftError(
            f"--out {folder}: is not empty and holds no results of this command ({ours[0]}); "
            "choose another folder"
        )


def write_results(
    flown: Any, folder: Path, *, report: bool, files: dict[str, Path] | None = None
) -> dict[str, Path]:
    """Recording, metrics, resolved mission and report of one run, each written atomically.

    What else an earlier run left in the folder goes once the recording is whole. ``files`` gets what is written, also
    if the next file fails.
    """
    import tomli_w

    from colift.record.recording import atomic_path

    files = {} if files is None else files
    files["recording"] = flown.recording.save(folder / RUN_FILES[0])
    for name in RUN_FILES[1:]:
        (folder / name).unlink(missing_ok=True)
    for name, file, text in (
        ("metrics", "metrics.json", json.dumps(plain(flown.metrics), indent=2) + "\n"),
        ("mission", "mission.toml", tomli_w.dumps(flown.mission.resolved())),
    ):
        with atomic_path(folder / file) as temporary:
            temporary.write_text(text, encoding="utf-8")
        files[name] = folder / file
    if report:
        from colift.show.report.html import write_report
        from colift.show.viewer.data import payload
        from colift.show.viewer.page import write_page

        label = flown.mission.kinds["allocation"]
        data = payload([flown.recording], [flown.metrics], [label])
        files["replay"] = write_page(folder / "replay.html", data)
        files["report"] = write_report(
            flown.recording, folder, metrics=flown.metrics, replay=files["replay"]
        )
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


def at_times(given: Iterable[str] | None, option: str) -> list[tuple[int, float]]:
    """Drones and times, s, given as DRONE@TIME."""
    found = []
    for text in given or ():
        drone, _, at = text.partition("@")
        try:
            found.append((int(drone), float(at)))
        except ValueError:
            raise typer.BadParameter(f"{option} {text}: must be DRONE@TIME, such as 2@4") from None
        if not (found[-1][0] >= 0 and 0.0 < found[-1][1] < 1e6):
            raise typer.BadParameter(f"{option} {text}: drones count from 0, times are above 0 s")
    return found


def several(text: str | None) -> list[str]:
    """A list of names, separated by commas."""
    return [name.strip() for name in text.split(",")] if text else []


def show_files(files: Mapping[str, Path]) -> None:
    """Say what was written where."""
    from rich.markup import escape

    for name, path in files.items():
        console().print(f"{name:>10}  {escape(str(path))}", highlight=False, soft_wrap=True)


def show_tables(tables: Iterable[tuple[str, list[str], list[list[str]]]]) -> None:
    """Print titled tables of text; the first and the last column may wrap, a unit goes below its name."""
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table

    for title, header, rows in tables:
        table = Table(title=title, title_justify="left", box=SIMPLE_HEAD, padding=(0, 0, 0, 1))
        for k, name in enumerate(header):
            edge = k in (0, len(header) - 1)
            widest = max(len(row[k]) for row in rows) if edge else None
            table.add_column(
                name.replace(" (", "\n("), justify="left" if edge else "right", no_wrap=not edge,
                min_width=widest and min(widest, 16),
            )  # fmt: skip
        for row in rows:
            table.add_row(*map(escape, row))
        console().print(table)


TONES = {"pass": "green", "warn": "yellow", "fail": "red", "lost": "bold red"}
"""Colours of the levels of a verdict."""


def show_verdict(verdict: Verdict) -> None:
    """Print the verdict and every criterion."""
    from rich.markup import escape

    tone, out = TONES[verdict.level], console()
    out.print(f"[{tone}]{escape(verdict.sentence)}[/{tone}]", highlight=False)
    for each in verdict.judged:
        mark = "[green]pass[/green]" if each.holds else "[red]FAIL[/red]"
        default = "" if each.asked else " (default)"
        said = escape(f"{each.metric} = {each.value:.4g}: {each.bound}{default}")
        out.print(f"{mark} {said}", highlight=False)


def end_with(verdict: Verdict) -> None:
    """End the command with the exit code of a verdict."""
    code = {"lost": EXIT_LOST, "fail": EXIT_FAILED}.get(verdict.level)
    if code is not None:
        raise typer.Exit(code)


def plain(value: Any) -> Any:
    """JSON-ready copy; a number that is not finite becomes null, a path its text."""
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def show_warnings(warnings: Iterable[object]) -> None:
    """Say what a mission's parts warn of, before it flies, where it disturbs no output."""
    for warning in warnings:
        console(stderr=True).print(
            f"warning: {warning}", style="yellow", markup=False, soft_wrap=True
        )


def show_notes(notes: Iterable[object]) -> None:
    """Say what was put in for what a mission leaves out, where it disturbs no output."""
    for note in notes:
        console(stderr=True).print(f"note: {note}", style="dim", markup=False, soft_wrap=True)


def emit(value: Any) -> None:
    """Print one JSON object on standard output."""
    print(json.dumps(plain(value), indent=2))


@contextmanager
def loading() -> Iterator[None]:
    """Say so when parts have to be compiled, and which, on a terminal."""
    from colift.kernel.jit import told_of_compilation

    with ExitStack() as stack:
        status: list[Status] = []

        def tell(kernel: str) -> None:
            if not status:
                where = console(stderr=True)
                where.print(
                    "Compiling, once on this machine (`colift compile` does it beforehand)."
                )
                status.append(stack.enter_context(where.status("compiling")))
            status[0].update(f"compiling {kernel}")

        stack.enter_context(told_of_compilation(tell))
        yield


@contextmanager
def progress(title: str) -> Iterator[Report]:
    """A progress bar on a terminal; silent elsewhere."""
    where = console(stderr=True)
    if not where.is_terminal:
        yield lambda _: None
        return
    from rich.markup import escape
    from rich.progress import (
        BarColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=where, transient=True) as bar:
        task = bar.add_task(escape(title), total=1.0)
        yield lambda fraction: bar.update(task, completed=fraction)


def new_folder(name: str, parent: Path = Path("runs")) -> Path:
    """Make ``PARENT/NAME-DATE-TIME``, numbered where flights of the same second would share it."""
    stem = f"{_slug(name)}-{datetime.now():%Y%m%d-%H%M%S}"
    folder, number = parent / stem, 1
    parent.mkdir(parents=True, exist_ok=True)
    while True:
        try:
            folder.mkdir()
            return folder
        except FileExistsError:
            number += 1
            folder = folder.with_name(f"{stem}-{number}")


def _slug(name: str) -> str:
    return "".join(c if c.isalnum() or c in "-_" else "-" for c in name)[:60]
