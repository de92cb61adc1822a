"""`colift fly`: fly a mission by hand, in the browser."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.markup import escape

from colift.cli.base import (
    Json,
    MissionName,
    Sets,
    With,
    app,
    emit,
    err,
    load_parts,
    loading,
    new_folder,
    out,
    show_notes,
    show_warnings,
    write_results,
)

if TYPE_CHECKING:
    from colift.record.recording import Recording


@app.command()
def fly(
    mission: MissionName = "paper-spiral",
    sets: Sets = None,
    speed: Annotated[
        float, typer.Option(help="Simulated over real time.", min=0.01, max=100.0)
    ] = 1.0,
    port: Annotated[int, typer.Option(help="Port; 0 takes a free one.", min=0, max=65535)] = 0,
    host: Annotated[
        str, typer.Option(help="Address to serve on; another machine can reach any but this one.")
    ] = "127.0.0.1",
    folder: Annotated[Path, typer.Option("--out", help="Folder for what is saved.")] = Path("runs"),
    browser: Annotated[bool, typer.Option("--open/--no-open", help="Open the page.")] = True,
    save: Annotated[bool, typer.Option(help="Save the flight when it ends.")] = True,
    extra: With = None,
    as_json: Json = False,
) -> None:
    """Fly a mission in real time; steer, push and turn its knobs from a page in the browser.

    Ctrl-C ends it and saves the flight, which replays as it was flown.

    [bold]Examples[/bold]

      colift fly
      colift fly four-to-three --set allocation.mu=0.3
      colift fly hover --speed 2 --no-open
    """
    from colift.mission.load import parse_overrides

    with loading():
        from colift.mission import load_mission
        from colift.mission.warnings import notes_of, warnings_of
        from colift.show.live.run import fly_live

        load_parts(extra)
        loaded = load_mission(mission, parse_overrides(sets))

    show_notes(notes_of(loaded))
    show_warnings(warnings_of(loaded))

    def write(recording: Recording) -> Path:
        from colift.flight.runner import Run

        flown = Run(recording=recording, loop_time=0.0, compiled=True)
        target = new_folder(loaded.name, folder)
        return write_results(flown, target, report=False)["recording"]

    def opened(url: str) -> None:
        if as_json:
            emit({"mission": loaded.name, "url": url})
        else:
            out.print(f"Flying {escape(loaded.name)}: {url}", highlight=False, soft_wrap=True)
            out.print("Who opens this address steers; Ctrl-C ends the flight.")
        if browser:
            import webbrowser

            webbrowser.open(url)

    if host not in {"127.0.0.1", "localhost", "::1"}:
        err.print(
            f"[yellow]Other machines can reach {escape(host)}; what they and you send is not encrypted.[/yellow]"
        )
    ended = fly_live(loaded, write, speed=speed, host=host, port=port, opened=opened, save=save)
    for line in ended:
        err.print(escape(line), highlight=False, soft_wrap=True)
