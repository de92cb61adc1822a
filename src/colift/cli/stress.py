"""`colift stress`: one mission under everything that can go wrong."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from colift.cli.base import (
    Json,
    Sets,
    With,
    app,
    emit,
    loading,
    new_folder,
    out,
    save_json,
    show_tables,
)
from colift.cli.campaign import (
    FILE,
    Csv,
    FirstSeed,
    Parquet,
    RetryFailed,
    Scheduler,
    Strict,
    Workers,
    command_line,
    end,
    export,
    fly,
    show_end,
)


@app.command()
def stress(
    mission: Annotated[
        str, typer.Argument(help="Name of a shipped mission (see `colift list`) or a TOML file.")
    ] = "real-world",
    conditions: Annotated[
        str | None,
        typer.Option(
            metavar="A;B;...", help="Conditions, separated by semicolons.", show_default="all"
        ),
    ] = None,
    allocators: Annotated[
        str | None,
        typer.Option(metavar="A,B,...", help="Allocators.", show_default="the mission's"),
    ] = None,
    plants: Annotated[
        str | None, typer.Option(metavar="A,B,...", help="Plants.", show_default="the mission's")
    ] = None,
    seeds: Annotated[
        int, typer.Option(min=1, max=10_000, help="Flights of each case; seed k breaks drone k.")
    ] = 4,
    first_seed: FirstSeed = 0,
    sets: Sets = None,
    folder: Annotated[
        Path | None,
        typer.Option("--out", help="Result folder.", show_default="runs/stress-DATE-TIME"),
    ] = None,
    replays: Annotated[
        int, typer.Option(min=0, max=1000, help="Most failing flights that get a replay.")
    ] = 12,
    strict: Strict = False,
    names: Annotated[bool, typer.Option("--list", help="Name the conditions and end.")] = False,
    extra: With = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    retry_failed: RetryFailed = False,
    csv: Csv = None,
    parquet: Parquet = None,
    as_json: Json = False,
) -> None:
    """Fly one mission under everything that can go wrong, against its criteria.

    Each condition replaces the mission's world: wind, delay, noise, wrong masses, faults; ideal rotors become real
    motors. A fault happens in noise and delay, or in the weather named behind it. What fails gets a mission file
    that flies it again and a replay, both linked in the report. With --out DIR of an earlier, perhaps interrupted
    campaign, only what is missing is flown.

    [bold]Examples[/bold]

      colift stress
      colift stress my-mission.toml --allocators safe,sqp --plants rigid-cables,slack-cables
      colift stress --conditions "wind;cable cut;cable cut in wind" --seeds 20
      colift stress --conditions "* in all, load +50 %"
    """
    from colift.mission.load import parse_overrides

    with loading():
        from colift.study import stress as study
        from colift.study.campaign.plan import Source, plan

        if names:
            for name in study.condition_names():
                out.print(escape(name), highlight=False)
            return
        sources = [Source.read(path) for path in extra or []]
        for source in sources:
            source.load()
        changes = parse_overrides(sets)
        chosen = study.expand(conditions) if conditions else study.condition_names()
        flown_seeds = range(first_seed, first_seed + seeds)
        planned = plan(
            study.cases(
                mission, chosen, _several(allocators), _several(plants), flown_seeds, changes
            ),
            sources,
        )  # fmt: skip
    target = folder or new_folder("stress")
    outcome = fly(
        "Stressing", planned, target, workers=workers, scheduler=scheduler,
        retry_failed=retry_failed,
    )  # fmt: skip
    from colift.kernel.math.shares import interval, text
    from colift.show.report.stress import matrix_tables, write_stress
    from colift.study.campaign.judge import held

    rows = outcome.rows
    missions = {job.key: job.mission for _, job in planned}
    files = {
        "report": write_stress(rows, missions, target, command=command_line(), replays=replays),
        "results": target / FILE,
    }
    passed = sum(map(held, rows))
    result = {
        "mission": mission,
        "command": command_line(),
        "seeds": [first_seed, first_seed + seeds - 1],
        "passed": passed,
        "flights": len(rows),
        "conditions": {
            condition: [
                {
                    "allocator": allocator, "plant": plant, "passed": cell.passed, "lost": cell.lost,
                    "flights": cell.flown, "interval": interval(cell.passed, cell.flown),
                    "worst_m": cell.worst_m, "least_deg": cell.least_deg, "slack_s": cell.slack_s,
                }
                for (allocator, plant), cell in cells.items()
            ]
            for condition, cells in study.matrix(rows).items()
        },
        "failing": [
            {**_labels(row), "level": row["level"], "reason": study.reason(row)}
            for row in rows
            if not held(row)
        ],
        "flown": outcome.flown,
        "wall_time_s": outcome.wall_time,
        "workers": outcome.workers,
        "files": {name: str(path) for name, path in files.items()},
    }  # fmt: skip
    save_json(target / "stress.json", result)
    export(rows, csv, parquet)
    if as_json:
        emit(result)
    else:
        show_tables(
            (f"{mission}, {title}", header, lines) for title, header, lines in matrix_tables(rows)
        )
        out.print(f"{text(passed, len(rows))} flights pass.", highlight=False)
        show_end(outcome, files)
    end(rows, strict)


def _several(text: str | None) -> list[str]:
    return text.split(",") if text else []


def _labels(row: Mapping[str, Any]) -> dict[str, Any]:
    return {name: row[name] for name in ("condition", "allocator", "plant", "seed")}
