"""`colift sweep`: one mission over many values."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

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
    show_tables,
)
from colift.cli.campaign import (
    FILE,
    Csv,
    FirstSeed,
    KeepRecordings,
    Parquet,
    RetryFailed,
    Scheduler,
    Seeds,
    Strict,
    Workers,
    command_line,
    end,
    export,
    fly,
    in_order,
    say_refused,
    show_end,
)


@app.command()
def sweep(
    mission: Annotated[
        str, typer.Argument(help="Name of a shipped mission (see `colift list`) or a TOML file.")
    ],
    over: Annotated[
        list[str],
        typer.Option(
            "--over",
            metavar="KEY=LOW:HIGH:COUNT[:log]",
            help="Field to sweep, or KEY=VALUE,VALUE,...; several of them make a grid.",
        ),
    ],
    seeds: Seeds = 1,
    first_seed: FirstSeed = 0,
    sets: Sets = None,
    folder: Annotated[
        Path | None,
        typer.Option("--out", help="Result folder.", show_default="runs/sweep-DATE-TIME"),
    ] = None,
    extra: With = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    retry_failed: RetryFailed = False,
    recordings: KeepRecordings = False,
    strict: Strict = False,
    csv: Csv = None,
    parquet: Parquet = None,
    as_json: Json = False,
) -> None:
    """Fly one mission over values of any of its fields, and over seeds; table, plots and all numbers.

    Every flight has the verdict that `colift run` would give it. Values that cannot be flown are shown and left out. With --out DIR of an earlier, perhaps interrupted sweep, only what is missing is flown.

    [bold]Examples[/bold]

      colift sweep paper-spiral --over allocation.mu=0.05:2:40 --seeds 20
      colift sweep hover --over load.mass=0.1:2:20:log --over allocation.kind=sqp,safe
    """  # fmt: skip
    from colift.mission.load import parse_overrides

    with loading():
        from colift.study import sweep as study
        from colift.study.campaign.plan import Source, sift

        sources = [Source.read(path) for path in extra or []]
        overs = [study.parse_over(text) for text in over]
        changes = parse_overrides(sets)
        flown_seeds = range(first_seed, first_seed + seeds)
        cases = study.cases(mission, overs, flown_seeds, changes)
        planned, refused = sift(cases, sources)
    say_refused(refused)
    target = folder or new_folder("sweep")
    outcome = fly(
        f"Sweeping {mission}", planned, target, workers=workers, scheduler=scheduler,
        retry_failed=retry_failed, recordings=recordings,
    )  # fmt: skip
    from colift.kernel.math.shares import interval
    from colift.show.report.campaign import not_held, sweep_tables, write_sweep
    from colift.show.report.campaign_figures import Swept

    rows = in_order(cases, outcome.rows, refused)
    swept = Swept(rows, overs)
    title = f"{mission} over {', '.join(o.path for o in overs)}"
    files = {
        "report": write_sweep(title, swept, target, command=command_line()),
        "results": target / FILE,
    }
    export(rows, csv, parquet)
    if as_json:
        emit(
            {
                "mission": mission,
                "over": {o.path: list(o.values) for o in overs},
                "seeds": seeds,
                "first_seed": first_seed,
                "points": [
                    {
                        "values": dict(zip((o.path for o in overs), point.values, strict=True)),
                        "flights": point.flights,
                        "fates": dict(point.fates),
                        "held": point.held,
                        "interval": interval(point.held, point.flights),
                        "reasons": point.reasons,
                        "metrics": {
                            name: dict(zip(("mean", "min", "max"), numbers, strict=True))
                            for name, numbers in point.spread.items()
                        },
                    }
                    for point in swept.points
                ],
                "flown": outcome.flown,
                "wall_time_s": outcome.wall_time,
                "files": {name: str(path) for name, path in files.items()},
            }
        )
    else:
        show_tables(sweep_tables(swept))
        for sentence in not_held(swept):
            out.print(f"- {escape(sentence)}", highlight=False, soft_wrap=True)
        show_end(outcome, files)
    end(rows, strict)
