"""`colift run`: fly a mission."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from colift.cli.base import (
    RUN_FILES,
    Json,
    Sets,
    With,
    app,
    check_out,
    emit,
    end_with,
    loading,
    new_folder,
    out,
    progress,
    show_verdict,
    show_warnings,
    write_results,
)


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
        from colift.mission.criteria import METRICS
        from colift.mission.warnings import warnings_of
        from colift.part import load_file

        for path in extra or []:
            load_file(path)
        overrides = parse_overrides(sets)
        loaded = colift.load_mission(
            mission, {**overrides, **({} if seed is None else {"seed": seed})}
        )
    warnings = warnings_of(loaded)
    show_warnings(warnings)
    with progress(f"Flying {loaded.name}") as advance:
        flown = colift.run(loaded, progress=advance)
    verdict = flown.verdict
    files: dict[str, Path] = {}
    unwritten = None
    try:
        write_results(flown, folder or new_folder(loaded.name), report=report, files=files)
    except OSError as error:  # what was flown is told all the same
        unwritten = error
    if as_json:
        emit(
            {
                "mission": loaded.name,
                "verdict": {"level": verdict.level, "reasons": verdict.reasons},
                "warnings": [str(each) for each in warnings],
                "outcome": flown.recording.outcome,
                "summary": verdict.sentence,
                "metrics": flown.metrics,
                "criteria": [asdict(each) for each in verdict.judged],
                "loop_time_s": flown.loop_time,
                "compiled": flown.compiled,
                "files": {name: str(path) for name, path in files.items()},
                **({"error": str(unwritten)} if unwritten else {}),
            }
        )
    else:
        table = Table(title=escape(loaded.name), title_justify="left")
        table.add_column("metric")
        table.add_column("value", justify="right")
        table.add_column("unit")
        table.add_column("meaning", style="dim")
        for metric in METRICS:
            value = f"{flown.metrics[metric.name]:.5g}"
            table.add_row(metric.name, value, metric.unit, metric.meaning)
        out.print(table)
        show_verdict(verdict)
        simulated = loaded.timing.duration
        how = "compiled" if flown.compiled else "interpreted, a part is plain Python"
        out.print(
            f"{simulated:g} s of flight in {flown.loop_time:.3f} s ({how}, "
            f"{simulated / flown.loop_time:.0f} times real time)."
        )
        for name, path in files.items():
            out.print(f"{name:>10}  {escape(str(path))}", highlight=False, soft_wrap=True)
    if unwritten:
        raise unwritten
    end_with(verdict)
