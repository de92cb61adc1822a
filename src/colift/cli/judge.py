"""`colift judge`: allocators on the forces of recorded flights."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.markup import escape

from colift.cli.base import (
    Json,
    With,
    app,
    check_out,
    emit,
    err,
    loading,
    new_folder,
    out,
    progress,
    save_json,
    show_tables,
)


@app.command()
def judge(
    flights: Annotated[
        list[Path],
        typer.Argument(metavar="FLIGHT...", help="Recordings, or logs that `import` reads."),
    ],
    allocators: Annotated[
        str | None,
        typer.Option(help="Names, separated by commas.", show_default="all that are installed"),
    ] = None,
    sets: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="ALLOCATOR.FIELD=VALUE",
            help="Change a setting of an allocator, in the size of the paper's team.",
        ),
    ] = None,
    extra: With = None,
    folder: Annotated[
        Path | None,
        typer.Option("--out", help="Result folder.", show_default="runs/judge-DATE-TIME"),
    ] = None,
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
    from colift.mission.load import parse_override

    check_out(folder, ("judgement.json",))
    for path in flights:  # said before anything is compiled
        if not path.exists():
            raise RecordingError(f"{path}: there is no such file")

    with loading():
        from colift.part import load_file
        from colift.study import judge as judgement

        for path in extra or []:
            load_file(path)
        wanted = [name.strip() for name in allocators.split(",")] if allocators else None
        kinds, skipped = judgement.choose(wanted)
        settings: dict[str, dict[str, Any]] = {}
        for text in sets or []:
            key, value = parse_override(text)
            kind, _, name = key.partition(".")
            if not name or kind not in kinds:
                raise typer.BadParameter(
                    f"{text!r}: must be ALLOCATOR.FIELD=VALUE with one of {', '.join(kinds)}"
                )
            settings.setdefault(kind, {})[name] = value
        recordings = [judgement.open_flight(path) for path in flights]
    for kind, why in skipped.items():
        err.print(f"left out: {kind} {why}", highlight=False, markup=False)
    judged = []
    with progress("Asking the allocators") as advance:
        for k, recording in enumerate(recordings):

            def tick(done: float, begin: int = k) -> None:
                advance((begin + done) / len(recordings))

            judged.append(judgement.judge(recording, kinds, settings, progress=tick))
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
        emit({**result, "files": {name: str(path) for name, path in files.items()}})
        return
    show_tables(judgement.tables(judged))
    out.print(judgement.NOTE, style="dim", highlight=False)
    for sentence in findings:
        out.print(escape(sentence), highlight=False)
    for name, path in files.items():
        out.print(f"{name:>10}  {escape(str(path))}", highlight=False, soft_wrap=True)
