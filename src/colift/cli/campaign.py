"""What the commands that run campaigns share: options, progress, exports."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn
from rich.progress import Progress as Bar

from colift.cli.base import (
    EXIT_ERROR,
    EXIT_FAILED,
    EXIT_INTERRUPTED,
    EXIT_LOST,
    check_out,
    err,
    out,
    show_files,
)

if TYPE_CHECKING:
    from colift.study.campaign.engine import Outcome, Progress
    from colift.study.campaign.plan import Case, Plan, Refused

FILE = "campaign.sqlite"
"""Name of the file of results in a command's folder."""

Seeds = Annotated[
    int,
    typer.Option(
        min=1, max=100_000,
        help="Flights of each case: the first starts as the mission says, others a little off.",
    ),
]  # fmt: skip
FirstSeed = Annotated[
    int,
    typer.Option(
        min=0, max=2**62,
        help="Seed of the first flight of each case; others follow. Results are worth most with seeds that no tuning saw.",
    ),
]  # fmt: skip
Workers = Annotated[
    int | None,
    typer.Option(min=1, max=1024, help="Processes on this machine.", show_default="one a core"),
]
Scheduler = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Fly on the workers of this Dask scheduler instead."),
]
Strict = Annotated[
    bool,
    typer.Option(
        "--strict",
        help="Exit code 3 if a flight lost the load or the team, 4 if one missed a criterion, 1 if one could not be set up.",
    ),
]  # fmt: skip
RetryFailed = Annotated[bool, typer.Option("--retry-failed", help="Fly again what failed before.")]
KeepRecordings = Annotated[
    bool, typer.Option("--recordings", help="Keep the recording of every new flight as well.")
]
Csv = Annotated[
    Path | None, typer.Option("--csv", metavar="FILE", help="Write one row a flight as CSV.")
]
Parquet = Annotated[
    Path | None,
    typer.Option("--parquet", metavar="FILE", help="Write one row a flight as Parquet."),
]


@contextmanager
def flights(title: str) -> Iterator[Callable[[Progress], None]]:
    """A bar of flights with the time they still take, on a terminal; silent elsewhere."""
    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(),
        TextColumn("{task.fields[left]}"),
    )  # fmt: skip
    with Bar(*columns, console=err, transient=True, disable=not err.is_terminal) as bar:
        task = bar.add_task(escape(title), total=None, left="")

        def show(now: Progress) -> None:
            left = f"about {duration(now.remaining)} left" if now.remaining > 0.0 else ""
            failed = f", {now.failed} failed" if now.failed else ""
            bar.update(task, completed=now.done, total=now.total, left=left + failed)

        yield show


def fly(
    title: str,
    planned: Plan,
    folder: Path,
    *,
    workers: int | None,
    scheduler: str | None,
    retry_failed: bool,
    recordings: bool = False,
) -> Outcome:
    """Fly what the folder does not hold yet, with a bar of flights; on Ctrl-C say how to go on."""
    from colift.study.campaign import engine

    check_out(folder, (FILE,))
    try:
        with flights(title) as advance:
            return engine.run(
                planned,
                engine.Options(
                    file=folder / FILE, workers=workers, scheduler=scheduler,
                    retry_failed=retry_failed, progress=advance,
                    recordings=folder / "recordings" if recordings else None,
                ),
            )  # fmt: skip
    except KeyboardInterrupt:
        kept, wanted = engine.kept(planned, folder / FILE)
        err.print(
            f"interrupted: {kept} of {wanted} flights are kept; the others are flown by\n"
            f"  {escape(resume_line(folder))}",
            highlight=False, soft_wrap=True,
        )  # fmt: skip
        raise typer.Exit(EXIT_INTERRUPTED) from None


def duration(seconds: float) -> str:
    """A time for people."""
    if seconds < 99.5:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5940 else f"{seconds / 3600:.1f} h"


def export(rows: Sequence[dict[str, Any]], csv: Path | None, parquet: Path | None) -> None:
    """Write the rows where the user asked for them."""
    from colift.study.campaign.store import write_csv, write_parquet

    if csv is not None:
        write_csv(list(rows), csv)
    if parquet is not None:
        write_parquet(list(rows), parquet)


def command_line() -> str:
    """The command as it was given."""
    return shlex.join(["colift", *sys.argv[1:]])


def resume_line(folder: Path) -> str:
    """The command that goes on with what it has begun in a folder."""
    given = any(word == "--out" or word.startswith("--out=") for word in sys.argv[1:])
    return command_line() if given else f"{command_line()} --out {shlex.quote(str(folder))}"


def say_refused(refused: Sequence[Refused]) -> None:
    """Say which cases are left out because they cannot be flown."""
    from colift.study.campaign.plan import problems

    if not refused:
        return
    err.print(f"{len(refused)} flights cannot be set up and are left out:", highlight=False)
    for problem in problems(refused):
        err.print(f"  {escape(str(problem))}", highlight=False, soft_wrap=True)


def in_order(
    cases: Sequence[Case], flown: Sequence[dict[str, Any]], refused: Sequence[Refused]
) -> list[dict[str, Any]]:
    """The rows of all cases, flown and refused, in the order of the cases, each once."""
    rows = [*flown, *(each.row for each in refused)]
    names = dict.fromkeys(name for case in cases for name in case.labels)

    def place(labels: Mapping[str, Any]) -> tuple[Any, ...]:
        return tuple(labels.get(name) for name in names)

    order = {place(case.labels): k for k, case in reversed(list(enumerate(cases)))}
    return sorted(rows, key=lambda row: order[place(row)])


def end(rows: Sequence[dict[str, Any]], strict: bool) -> None:
    """End the command with the exit code of its flights; what criteria say counts if ``strict``."""
    from colift.study.campaign.judge import fate

    fates = {fate(row) for row in rows}
    if "failed" in fates or (strict and "refused" in fates):
        raise typer.Exit(EXIT_ERROR)
    if strict and "lost" in fates:
        raise typer.Exit(EXIT_LOST)
    if strict and "missed" in fates:
        raise typer.Exit(EXIT_FAILED)


def told(outcome: Outcome) -> dict[str, Any]:
    """What was flown now, for JSON."""
    return {
        "flown": outcome.flown, "wall_time_s": outcome.wall_time, "workers": outcome.workers
    }  # fmt: skip


def show_end(outcome: Outcome, files: dict[str, Path]) -> None:
    """Say what was flown now, what failed and where everything is."""
    there = len({row["key"] for row in outcome.rows}) - outcome.flown
    known = f"; {there} were there already" if there else ""
    if outcome.flown:
        out.print(
            f"{outcome.flown} flights in {duration(outcome.wall_time)} on {outcome.workers} "
            f"worker{'s' * (outcome.workers != 1)}{known}."
        )
    else:
        out.print(f"All {there} flights were there already.")
    failed = [row for row in outcome.rows if row["status"] == "failed"]
    for row in failed[:5]:
        out.print(f"[red]failed[/red]: {escape(row['error'])}", highlight=False, soft_wrap=True)
    if len(failed) > 5:
        out.print(f"... and {len(failed) - 5} more; --retry-failed flies them again.")
    show_files(files)
