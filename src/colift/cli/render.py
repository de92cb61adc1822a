"""`colift render`: pictures and films of recordings."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated, Literal

import typer
from rich.markup import escape

from colift.cli.base import Json, app, emit, out, progress
from colift.cli.replay import MOST

Camera = Literal["orbit", "follow", "top", "side"]
Theme = Literal["light", "dark"]


@app.command()
def render(
    recordings: Annotated[
        list[Path], typer.Argument(help=f"One recording, or up to {MOST} side by side.")
    ],
    png: Annotated[Path | None, typer.Option("--png", help="Write one picture.")] = None,
    gif: Annotated[Path | None, typer.Option("--gif", help="Write a film as GIF.")] = None,
    mp4: Annotated[Path | None, typer.Option("--mp4", help="Write a film as MP4.")] = None,
    at: Annotated[float, typer.Option(help="Time of the picture, s.")] = 0.0,
    begin: Annotated[float, typer.Option("--from", help="Begin of the film, s.")] = 0.0,
    end: Annotated[
        float | None, typer.Option("--to", help="End of the film, s.", show_default="the flight's")
    ] = None,
    size: Annotated[str, typer.Option(metavar="WxH", help="Pixels, even numbers.")] = "1280x720",
    fps: Annotated[
        float, typer.Option(min=1.0, max=60.0, help="Pictures a second of the film.")
    ] = 25.0,
    speed: Annotated[
        float, typer.Option(min=0.01, max=100.0, help="Seconds of flight in a second of film.")
    ] = 1.0,
    camera: Annotated[Camera, typer.Option(help="View of the scene.")] = "orbit",
    theme: Annotated[Theme, typer.Option(help="Colours.")] = "light",
    as_json: Json = False,
) -> None:
    """Draw recordings for papers and slides: a picture, or a film; needs the extra `render` and a Chromium.

    [bold]Examples[/bold]

      colift render recording.h5 --png moment.png --at 8.2 --camera follow
      colift render paper.h5 safe.h5 --mp4 both.mp4 --from 7 --to 12 --speed 0.5
    """
    if len(recordings) > MOST:
        raise typer.BadParameter(f"at most {MOST} recordings fit side by side")
    if not (png or gif or mp4):
        raise typer.BadParameter("say what to write: --png, --gif or --mp4")
    for path, suffix in ((gif, ".gif"), (mp4, ".mp4"), (png, ".png")):
        if path is not None and path.suffix != suffix:
            raise typer.BadParameter(f"{path}: the name must end in {suffix}")
    from colift.show.viewer import render
    from colift.show.viewer.data import load_payload

    look = render.Look(_size(size), camera, theme)
    data = load_payload(recordings)
    last = max(flight["end"] for flight in data["flights"])
    if end is not None and not begin < end <= last:
        raise typer.BadParameter(f"--to must be after --from, and at most {last:g} s")
    written = []
    if png is not None:
        written.append(render.png(data, png, look, at))
    for path in (gif, mp4):
        if path is not None:
            with progress(f"Drawing {path.name}") as advance:
                written.append(
                    render.film(
                        data, path, look,
                        begin=begin, end=last if end is None else end,
                        rate=fps, speed=speed, progress=advance,
                    )
                )  # fmt: skip
    if as_json:
        emit({"files": [str(path) for path in written]})
    else:
        for path in written:
            out.print(escape(str(path)), highlight=False, soft_wrap=True)


def _size(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{2,4})x(\d{2,4})", text)
    width, height = map(int, match.groups()) if match else (0, 0)
    if not (width >= 64 and height >= 64 and width % 2 == height % 2 == 0):
        raise typer.BadParameter(
            f"--size {text!r}: two even numbers from 64 to 9998, e.g. 1280x720"
        )
    return width, height
