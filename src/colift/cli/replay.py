"""`colift replay`: look at recordings in the browser."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from colift.cli.base import Json, app, emit, new_folder, out

MOST = 3
"""Most recordings side by side."""


@app.command()
def replay(
    recordings: Annotated[
        list[Path],
        typer.Argument(
            help=f"A recording or the result folder of a run; up to {MOST} are seen side by side."
        ),
    ],
    html: Annotated[
        Path | None,
        typer.Option(
            "--html", help="Write the page here and do not open it.", show_default="runs/"
        ),
    ] = None,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the page.")] = True,
    as_json: Json = False,
) -> None:
    """Replay recordings in 3D with their plots, in the browser; several run side by side, in step.

    The page is one file that needs no network and can be mailed.

    [bold]Examples[/bold]

      colift replay runs/hover-20260101-120000/recording.h5
      colift replay paper.h5 safe.h5 --html paper-and-safe.html
    """
    if len(recordings) > MOST:
        raise typer.BadParameter(f"at most {MOST} recordings fit side by side")
    from colift.show.viewer.data import load_payload
    from colift.show.viewer.page import write_page

    data = load_payload(recordings)
    path = write_page(html or new_folder("replay") / "replay.html", data)
    if as_json:
        emit({"page": str(path), "bytes": path.stat().st_size})
    else:
        out.print(escape(str(path)), highlight=False, soft_wrap=True)
    if show and html is None and not as_json:
        webbrowser.open(path.resolve().as_uri())
