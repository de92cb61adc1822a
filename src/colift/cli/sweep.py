"""`colift sweep`: one mission over many values."""

from __future__ import annotations

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
    told,
)

if TYPE_CHECKING:
    from colift.show.report.campaign_figures import Swept

Over = Annotated[
    list[str],
    typer.Option(
        "--over",
        metavar="KEY=LOW:HIGH:COUNT[:log]",
        help="Field to sweep, or KEY=VALUE,VALUE,...; several of them make a grid.",
    ),
]


@app.command()
def sweep(
    mission: MissionName,
    over: Over,
    seeds: Seeds = 1,
    first_seed: FirstSeed = 0,
    sets: Sets = None,
    folder: Annotated[Path | None, result_folder("sweep")] = None,
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
    from colift.show.report.campaign import write_sweep
    from colift.show.report.campaign_figures import Swept

    rows = in_order(cases, outcome.rows, refused)
    swept = Swept(rows, overs)
    title = f"{mission} over {', '.join(o.path for o in overs)}"
    page = write_sweep(title, swept, target, command=command_line())
    files = {"report": page, "results": target / FILE}
    export(rows, csv, parquet)
    if as_json:
        begin = {"mission": mission, "seeds": seeds, "first_seed": first_seed}
        emit({**begin, **_judge(swept), **told(outcome), "files": files})
    else:
        _say(swept)
        show_end(outcome, files)
    end(rows, strict)


def _judge(swept: Swept) -> dict[str, Any]:
    """The numbers at each combination of values, for JSON."""
    from colift.kernel.math.shares import interval

    overs = swept.overs
    return {
        "over": {o.path: list(o.values) for o in overs},
        "points": [
            {
                "values": dict(zip((o.path for o in overs), point.values, strict=True)),
                "flights": point.flights, "fates": dict(point.fates), "held": point.held,
                "interval": interval(point.held, point.flights), "reasons": point.reasons,
                "metrics": {
                    name: dict(zip(("mean", "min", "max"), numbers, strict=True))
                    for name, numbers in point.spread.items()
                },
            }
            for point in swept.points
        ],
    }  # fmt: skip


def _say(swept: Swept) -> None:
    from colift.show.report.campaign import not_held, sweep_tables

    show_tables(sweep_tables(swept))
    for sentence in not_held(swept):
        out.print(f"- {escape(sentence)}", highlight=False, soft_wrap=True)
