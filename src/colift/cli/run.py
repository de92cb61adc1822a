"""`colift run`: fly a mission."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape
from rich.table import Table

from colift.cli.base import (
    RUN_FILES,
    Json,
    MissionName,
    Sets,
    With,
    app,
    check_out,
    emit,
    end_with,
    load_parts,
    loading,
    new_folder,
    out,
    progress,
    result_folder,
    show_files,
    show_notes,
    show_verdict,
    show_warnings,
    write_results,
)

if TYPE_CHECKING:
    from colift.flight.runner import Run


@app.command()
def run(
    mission: MissionName = "paper-spiral",
    sets: Sets = None,
    seed: Annotated[int | None, typer.Option(help="Seed instead of the mission's.")] = None,
    folder: Annotated[Path | None, result_folder("MISSION")] = None,
    extra: With = None,
    report: Annotated[bool, typer.Option(help="Write the HTML report and its figures.")] = True,
    as_json: Json = False,
) -> None:
    """Fly a mission; print what happened; write recording, metrics and report.

    A folder given with --out must be empty, or hold an earlier run, which is replaced.
    Exit code 3 if the load or the team was lost, 4 if a criterion was missed: the mission's, or a default.

    [bold]Examples[/bold]

      colift run
      colift run figure-eight --set allocation.mu=0.75 --set timing.duration=60
      colift run my-mission.toml --out results/first --json
    """
    from colift.mission.load import parse_overrides

    check_out(folder, RUN_FILES)
    with loading():
        import colift
        from colift.mission.warnings import notes_of, warnings_of

        load_parts(extra)
        overrides = parse_overrides(sets)
        loaded = colift.load_mission(
            mission, {**overrides, **({} if seed is None else {"seed": seed})}
        )
    notes, warnings = notes_of(loaded), warnings_of(loaded)
    show_notes(notes)
    show_warnings(warnings)
    with progress(f"Flying {loaded.name}") as advance:
        flown = colift.run(loaded, progress=advance)
    deliver(flown, notes, warnings, folder, report=report, as_json=as_json)


def deliver(
    flown: Run,
    notes: Iterable[object],
    warnings: Iterable[object],
    folder: Path | None,
    *,
    report: bool,
    as_json: bool,
) -> None:
    """Write what was flown, say how it went, and end the command with the exit code of its verdict."""
    files: dict[str, Path] = {}
    unwritten = None
    try:
        write_results(flown, folder or new_folder(flown.mission.name), report=report, files=files)
    except OSError as error:  # what was flown is told all the same
        unwritten = error
    if as_json:
        _emit(flown, notes, warnings, files, unwritten)
    else:
        _say(flown, files)
    if unwritten:
        raise unwritten
    end_with(flown.verdict)


def _emit(
    flown: Run,
    notes: Iterable[object],
    warnings: Iterable[object],
    files: dict[str, Path],
    unwritten: OSError | None,
) -> None:
    verdict = flown.verdict
    emit(
        {
            "mission": flown.mission.name,
            "verdict": {"level": verdict.level, "reasons": verdict.reasons},
            "notes": [str(each) for each in notes],
            "warnings": [str(each) for each in warnings],
            "outcome": flown.recording.outcome,
            "summary": verdict.sentence,
            "metrics": flown.metrics,
            "criteria": [asdict(each) for each in verdict.judged],
            "loop_time_s": flown.loop_time,
            "compiled": flown.compiled,
            "files": files,
            **({"error": str(unwritten)} if unwritten else {}),
        }
    )


def _say(flown: Run, files: dict[str, Path]) -> None:
    from colift.mission.criteria import METRICS

    table = Table(title=escape(flown.mission.name), title_justify="left")
    table.add_column("metric")
    table.add_column("value", justify="right")
    table.add_column("unit")
    table.add_column("meaning", style="dim")
    for metric in METRICS:
        value = f"{flown.metrics[metric.name]:.5g}"
        table.add_row(metric.name, value, metric.unit, metric.meaning)
    out.print(table)
    show_verdict(flown.verdict)
    simulated = flown.mission.timing.duration
    pace = simulated / flown.loop_time
    how = "compiled" if flown.compiled else "interpreted, a part is plain Python"
    out.print(
        f"{simulated:g} s of flight in {flown.loop_time:.3f} s ({how}, "
        f"{round(pace, 0 if pace > 10.0 else 1):g} times real time)."
    )
    show_files(files)
