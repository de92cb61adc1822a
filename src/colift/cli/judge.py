"""`colift judge`: allocators on the forces of recorded flights."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.markup import escape

from colift.cli.base import (
    Json,
    With,
    app,
    check_out,
    emit,
    err,
    load_parts,
    loading,
    new_folder,
    out,
    progress,
    result_folder,
    save_json,
    several,
    show_files,
    show_tables,
)

if TYPE_CHECKING:
    from colift.record.recording import Recording
    from colift.study.judge import Judged

Flights = Annotated[
    list[Path],
    typer.Argument(metavar="FLIGHT...", help="Recordings, or logs that `import` reads."),
]
Allocators = Annotated[
    str | None,
    typer.Option(help="Names, separated by commas.", show_default="all that are installed"),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="ALLOCATOR.FIELD=VALUE",
        help="Change a setting of an allocator, in the size of the paper's team.",
    ),
]


@app.command()
def judge(
    flights: Flights,
    allocators: Allocators = None,
    sets: Settings = None,
    extra: With = None,
    folder: Annotated[Path | None, result_folder("judge")] = None,
    report: Annotated[bool, typer.Option(help="Write the HTML page and its figures.")] = True,
    as_json: Json = False,
) -> None:
    """Ask allocators what they would have wanted in flights, beside what flew.

    The recorded force commands go through every allocator: smallest angle, tension, how fast the directions
    turn, what is left of the force, and time. Nothing is simulated.

    [bold]Examples[/bold]

      colift judge flight.h5
      colift judge *.csv --allocators safe,sqp,wahba-hoenig --set safe.min_angle_deg=35
    """
    import shlex

    from colift.errors import RecordingError

    check_out(folder, ("judgement.json",))
    for path in flights:  # said before anything is compiled
        if not path.exists():
            raise RecordingError(f"{path}: there is no such file")

    with loading():
        from colift.study import judge as judgement

        load_parts(extra)
        kinds, skipped = judgement.choose(several(allocators) or None)
        settings = _settings(sets or [], kinds)
        recordings = [judgement.open_flight(path) for path in flights]
    for kind, why in skipped.items():
        err.print(f"left out: {kind} {why}", highlight=False, markup=False)
    judged = _ask(recordings, kinds, settings)
    findings = judgement.findings(judged)
    result = {
        "flights": [flight.as_dict() for flight in judged],
        "findings": findings,
        "left_out": skipped,
    }
    target = folder or new_folder("judge")
    files = {"json": target / "judgement.json"}
    save_json(files["json"], result)
    if report:
        from colift.show.report.judgement import write_page

        command = ["colift", "judge", *(path.name for path in flights)]
        command += ["--allocators", allocators] if allocators else []
        command += [word for text in sets or [] for word in ("--set", text)]
        files["page"] = write_page(judged, skipped, target, shlex.join(command))
    if as_json:
        emit({**result, "files": files})
        return
    show_tables(judgement.tables(judged))
    out.print(judgement.NOTE, style="dim", highlight=False)
    for sentence in findings:
        out.print(escape(sentence), highlight=False)
    show_files(files)


def _settings(sets: Sequence[str], kinds: Collection[str]) -> dict[str, dict[str, Any]]:
    """Settings by allocator, from ``ALLOCATOR.FIELD=VALUE``."""
    from colift.mission.load import parse_override

    settings: dict[str, dict[str, Any]] = {}
    for text in sets:
        key, value = parse_override(text)
        kind, _, name = key.partition(".")
        if not name or kind not in kinds:
            raise typer.BadParameter(
                f"{text!r}: must be ALLOCATOR.FIELD=VALUE with one of {', '.join(kinds)}"
            )
        settings.setdefault(kind, {})[name] = value
    return settings


def _ask(
    recordings: Sequence[Recording],
    kinds: Sequence[str],
    settings: dict[str, dict[str, Any]],
) -> list[Judged]:
    """The judgement of each flight, with a bar of progress over all."""
    from colift.study.judge import judge

    judged = []
    with progress("Asking the allocators") as advance:
        for k, recording in enumerate(recordings):

            def tick(done: float, begin: int = k) -> None:
                advance((begin + done) / len(recordings))

            judged.append(judge(recording, kinds, settings, progress=tick))
    return judged
