"""`colift compare`: allocators, or teams with and without a leader, side by side."""

from __future__ import annotations

from collections.abc import Sequence
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
    result_folder,
    save_json,
    several,
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

Allocators = Annotated[
    str | None,
    typer.Option(metavar="A,B,...", help="Who takes part.", show_default="all installed"),
]
Agents = Annotated[
    bool,
    typer.Option(
        "--agents",
        help="Compare who decides: one allocator for all, or each drone; over the same radio.",
    ),
]
Schemes = Annotated[
    str | None,
    typer.Option(
        metavar="A,B,...", help="Which of these; as --agents.", show_default="all installed"
    ),
]
Missions = Annotated[
    str | None,
    typer.Option(metavar="M,N,...", help="Missions.", show_default="five of the shipped"),
]
Quick = Annotated[bool, typer.Option(help="Two missions of 4 s, one seed; a first look.")]
Spread = Annotated[
    bool, typer.Option(help="Sweep what each allocator spends on separation as well.")
]
AsInMission = Annotated[
    bool,
    typer.Option(
        "--as-in-mission", help="The allocator that a mission names keeps its settings there."
    ),
]


@app.command()
def compare(
    allocators: Allocators = None,
    agents: Agents = False,
    schemes: Schemes = None,
    missions: Missions = None,
    seeds: Seeds = 3,
    first_seed: FirstSeed = 0,
    quick: Quick = False,
    spread: Spread = True,
    as_in_mission: AsInMission = False,
    sets: Sets = None,
    folder: Annotated[Path | None, result_folder("compare")] = None,
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
    """Fly every allocator, or all that can take one's place, on the same missions; say who is best at what, and what separation costs.

    Each has its own default settings; --set safe.mu=0.3 changes that of one, --set allocation.mu=0.3 that of all. A
    flight is held if it keeps every criterion of its mission to the end. With --out DIR of an earlier, perhaps interrupted comparison, only what is missing is flown.

    [bold]Examples[/bold]

      colift compare
      colift compare --allocators sqp,safe --missions hover,my-mission.toml --seeds 10
      colift compare --with examples/my_allocator.py --quick
      colift compare --agents --set network.loss=0.5
    """
    from colift.mission.load import parse_overrides

    layer, wanted = _compared(allocators, agents, schemes)
    with loading():
        from colift.study import compare as study
        from colift.study.campaign.plan import Source, sift

        sources = [Source.read(path) for path in extra or []]
        chosen = several(missions) or study.usual_missions(layer, quick=quick)
        able, missing = study.contestants(
            several(wanted) or None, study.own_parts(sources, layer), layer, chosen
        )
        changes = parse_overrides(sets)
        if quick:
            seeds, changes = 1, {"timing.duration": 4.0, **changes}
        flown_seeds = range(first_seed, first_seed + seeds)
        cases = study.cases(
            able, chosen, flown_seeds, changes, spread=spread, as_in_mission=as_in_mission, layer=layer
        )  # fmt: skip
        planned, refused = sift(cases, sources)
    say_refused(refused)
    target = folder or new_folder("compare")
    outcome = fly(
        "Comparing", planned, target, workers=workers, scheduler=scheduler,
        retry_failed=retry_failed, recordings=recordings,
    )  # fmt: skip
    rows = in_order(cases, outcome.rows, refused)
    notes = study.protocol(chosen, flown_seeds, changes, as_in_mission=as_in_mission, layer=layer)
    result = {
        **_judge(rows, target, notes),
        "missions": list(chosen), "seeds": seeds, "first_seed": first_seed, "protocol": notes,
        "period_s": changes.get("timing.allocation", study.PERIOD), "not_installed": missing,
        **told(outcome),
    }  # fmt: skip
    save_json(target / "compare.json", result)
    export(rows, csv, parquet)
    _say(rows, result, outcome, as_json=as_json)
    end(rows, strict)


def _compared(allocators: str | None, agents: bool, schemes: str | None) -> tuple[str, str | None]:
    """The layer whose parts are compared, and which of them."""
    if not agents and schemes is None:
        return "allocation", allocators
    if allocators is not None:
        raise typer.BadParameter(
            "compares allocators; leave out --agents and --schemes", param_hint="--allocators"
        )
    return "agents", schemes


def _judge(rows: Sequence[dict[str, Any]], target: Path, notes: Sequence[str]) -> dict[str, Any]:
    """Who is best at what; the page that says so is written."""
    from colift.kernel.math.shares import interval
    from colift.show.report.campaign import COMPARED, write_contest
    from colift.study.campaign import judge
    from colift.study.compare import CONTEST

    contest = [row for row in rows if row["study"] == CONTEST]
    field = judge.contestants(contest)
    column = judge.compared(contest)
    words = judge.words(field, judge.criteria_of(contest), COMPARED[column])
    page = write_contest(rows, target, words, command=command_line(), notes=notes)
    return {
        {"allocator": "allocators"}.get(column, column): {
            c.name: {
                "flights": c.flights, "held": c.held, "interval": interval(c.held, c.flights),
                "missed": c.missed, "lost": c.lost, "failed": c.failed, "refused": c.refused,
                "values": dict(c.values), "intervals": dict(c.intervals),
            }
            for c in field
        },
        "words": words,
        "files": {"report": page, "results": target / FILE},
    }  # fmt: skip


def _say(
    rows: Sequence[dict[str, Any]], result: dict[str, Any], outcome: Any, *, as_json: bool
) -> None:
    if as_json:
        emit(result)
        return
    from colift.show.report.campaign import contest_table
    from colift.study.campaign import judge
    from colift.study.compare import CONTEST

    contest = [row for row in rows if row["study"] == CONTEST]
    criteria = judge.criteria_of(contest)
    show_tables(
        (title, *contest_table(contest, [c for c in criteria if c.group == title]))
        for title in judge.GROUPS
    )
    for sentence in result["words"]:
        out.print(f"- {escape(sentence)}", highlight=False)
    for sentence in result["not_installed"]:
        out.print(f"Not compared: {escape(sentence)}", highlight=False)
    show_end(outcome, result["files"])
