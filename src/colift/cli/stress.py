"""`colift stress`: one mission under everything that can go wrong."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from colift.cli.base import (
    Json,
    MissionName,
    Sets,
    With,
    app,
    emit,
    loading,
    new_folder,
    out,
    result_folder,
    save_json,
    several,
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
    told,
)

if TYPE_CHECKING:
    from colift.study.campaign.plan import Plan

Conditions = Annotated[
    str | None,
    typer.Option(
        metavar="A;B;...", help="Conditions, separated by semicolons.", show_default="all"
    ),
]
Allocators = Annotated[
    str | None,
    typer.Option(metavar="A,B,...", help="Allocators.", show_default="the mission's"),
]
Plants = Annotated[
    str | None, typer.Option(metavar="A,B,...", help="Plants.", show_default="the mission's")
]
Seeds = Annotated[
    int, typer.Option(min=1, max=10_000, help="Flights of each case; seed k breaks drone k.")
]
Replays = Annotated[
    int, typer.Option(min=0, max=1000, help="Most failing flights that get a replay.")
]
Names = Annotated[bool, typer.Option("--list", help="Name the conditions and end.")]


@app.command()
def stress(
    mission: MissionName = "real-world",
    conditions: Conditions = None,
    allocators: Allocators = None,
    plants: Plants = None,
    seeds: Seeds = 4,
    first_seed: FirstSeed = 0,
    sets: Sets = None,
    folder: Annotated[Path | None, result_folder("stress")] = None,
    replays: Replays = 12,
    strict: Strict = False,
    names: Names = False,
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
        cases = study.cases(
            mission, chosen, several(allocators), several(plants), flown_seeds, changes
        )
        planned = plan(cases, sources)
    target = folder or new_folder("stress")
    outcome = fly(
        "Stressing", planned, target, workers=workers, scheduler=scheduler,
        retry_failed=retry_failed,
    )  # fmt: skip
    rows = outcome.rows
    result = {
        "mission": mission, "command": command_line(), "seeds": [flown_seeds[0], flown_seeds[-1]],
        **_judge(rows), **told(outcome), "files": _write(planned, rows, target, replays),
    }  # fmt: skip
    save_json(target / "stress.json", result)
    export(rows, csv, parquet)
    if as_json:
        emit(result)
    else:
        _say(mission, rows, result)
        show_end(outcome, result["files"])
    end(rows, strict)


def _write(
    planned: Plan, rows: Sequence[dict[str, Any]], target: Path, replays: int
) -> dict[str, Path]:
    from colift.show.report.stress import write_stress

    missions = {job.key: job.mission for _, job in planned}
    page = write_stress(rows, missions, target, command=command_line(), replays=replays)
    return {"report": page, "results": target / FILE}


def _judge(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What passes and what fails, for JSON."""
    from colift.kernel.math.shares import interval
    from colift.study import stress as study
    from colift.study.campaign.judge import held

    return {
        "passed": sum(map(held, rows)),
        "flights": len(rows),
        "conditions": {
            condition: [
                {
                    "allocator": allocator, "plant": plant, "passed": cell.passed, "lost": cell.lost,
                    "flights": cell.flown, "interval": interval(cell.passed, cell.flown),
                    "worst_m": cell.worst_m, "least_deg": cell.least_deg, "slack_s": cell.slack_s,
                    "turned_deg": cell.turned_deg,
                }
                for (allocator, plant), cell in cells.items()
            ]
            for condition, cells in study.matrix(rows).items()
        },
        "failing": [
            {
                **{name: row[name] for name in ("condition", "allocator", "plant", "seed")},
                "level": row["level"],
                "reason": study.reason(row),
            }
            for row in rows
            if not held(row)
        ],
    }  # fmt: skip


def _say(mission: str, rows: Sequence[dict[str, Any]], result: dict[str, Any]) -> None:
    from colift.kernel.math.shares import text
    from colift.show.report.stress import matrix_tables

    show_tables(
        (f"{mission}, {title}", header, lines) for title, header, lines in matrix_tables(rows)
    )
    out.print(f"{text(result['passed'], result['flights'])} flights pass.", highlight=False)
