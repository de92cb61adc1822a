"""`colift compile`: compile beforehand."""

from __future__ import annotations

from typing import Annotated

import typer

from colift.cli.base import Json, With, app, console, emit, load_parts


@app.command(name="compile")
def compile_(
    mission: Annotated[
        str | None,
        typer.Argument(help="Name of a shipped mission or a TOML file: only what it needs."),
    ] = None,
    allocator: Annotated[
        str | None, typer.Option(help="Only what this allocator needs, in the mission or by hand.")
    ] = None,
    extra: With = None,
    as_json: Json = False,
) -> None:
    """Compile everything beforehand, once on this machine; what is compiled already is left as it is.

    Without it, each command compiles what it needs when it first needs it.

    [bold]Examples[/bold]

      colift compile
      colift compile paper-spiral --allocator safe
    """
    from colift.flight.compilation import warm

    load_parts(extra)
    where = console(stderr=True)
    if where.is_terminal:
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        columns = (BarColumn(), TextColumn("{task.percentage:>3.0f} %"), TimeElapsedColumn())
        with Progress(
            TextColumn("compiling"), *columns, TextColumn("{task.description}"),
            console=where, transient=True,
        ) as bar:  # fmt: skip
            task = bar.add_task("", total=1.0)
            done = warm(
                mission, allocator=allocator,
                progress=lambda share, kernel: bar.update(task, completed=share, description=kernel),
            )  # fmt: skip
    else:
        done = warm(mission, allocator=allocator)
    if as_json:
        emit({"compiled": list(done.compiled), "loaded": done.loaded, "seconds": done.seconds})
        return
    print(
        f"{len(done.compiled)} kernels compiled, {done.loaded} were there already, in {done.seconds:.1f} s."
    )
