"""`colift export`: the controllers of a mission for machines without Python."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from colift.cli.base import (
    Json,
    Sets,
    With,
    app,
    check_out,
    emit,
    load_parts,
    loading,
    out,
    several,
    show_notes,
)

OURS = ("colift.h", "colift_team.h")


@app.command()
def export(
    language: Annotated[Literal["c"], typer.Argument(help="C99 is what there is.")],
    mission: Annotated[
        str, typer.Argument(help="Shipped mission or TOML file whose controllers and team to take.")
    ] = "paper-spiral",
    folder: Annotated[Path, typer.Option("--out", help="Where to write.")] = Path("colift-c"),
    float32: Annotated[bool, typer.Option("--float32", help="Single precision.")] = False,
    embedded: Annotated[
        bool,
        typer.Option("--embedded", help="Single precision, and a bound on the work of a call."),
    ] = False,
    part: Annotated[
        str | None,
        typer.Option(
            help="Layers, separated by commas, such as allocation or position_control.",
            show_default="all of the controllers'",
        ),
    ] = None,
    sets: Sets = None,
    extra: With = None,
    as_json: Json = False,
) -> None:
    """Write a mission's controllers as C99: kernels, constants of the team, an example and a test.

    Translated from the kernels that Python runs: no malloc, no globals. The test calls each kernel along a flight and compares
    with Python's answers, bit for bit. What C would not do in the same way is refused, with file and line.

    [bold]Examples[/bold]

      colift export c --set allocation.kind=safe --out allocator --part allocation
      colift export c --embedded --set allocation.kind=safe --part allocation
      colift export c noisy-spiral --out controllers && make -C controllers check
    """
    check_out(folder, OURS)
    from colift.deploy.c.layers import EMBEDDED, LAYERS, SINGLE, pinned

    pinned()
    names = several(part) or LAYERS
    if wrong := {*names} - {*LAYERS}:
        raise typer.BadParameter(f"--part {min(wrong)}: must be among {', '.join(LAYERS)}")
    with loading():
        from colift.deploy.c import export as module
        from colift.mission.load import load_mission, parse_overrides
        from colift.mission.warnings import notes_of

        load_parts(extra)
        loaded = load_mission(mission, parse_overrides(sets))
        show_notes(notes_of(loaded))
        if "allocation" in names and (float32 or embedded):
            loaded = module.profiled(loaded, EMBEDDED if embedded else SINGLE)
        files = module.files_of(loaded, names, single=float32 or embedded)
    written = module.write(files, folder)
    if as_json:
        emit({"folder": str(folder), "files": sorted(written)})
        return
    lines = sum(text.count("\n") for text in files.values())
    out.print(
        f"{folder}: {len(written)} files, {lines} lines of C; `make -C {folder} check`",
        markup=False,
        soft_wrap=True,
    )
