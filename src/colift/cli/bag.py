"""`colift bag`: recordings as bags of ROS 2."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from colift.cli.base import Json, app, emit, out, progress


@app.command()
def bag(
    recording: Annotated[
        Path, typer.Argument(help="Recording, or result folder of a run.", metavar="FLIGHT")
    ],
    target: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Bag to write: a folder, or a file that ends in .mcap.", show_default="FLIGHT.mcap, in this folder",
        ),
    ] = None,
    as_json: Json = False,
) -> None:  # fmt: skip
    """Write a recording as a bag of ROS 2, for Foxglove, PlotJuggler and ROS itself.

    MCAP with standard messages and their definitions; see docs/ros.md. Needs the extra `bags`, and no ROS.

    [bold]Examples[/bold]

      colift bag runs/hover-20260101-120000 --out hover.mcap
    """
    from colift.record.exchange.bag import write_bag
    from colift.record.recording import Recording

    found = Recording.load(recording)
    with progress("Writing the bag") as advance:
        path = write_bag(found, target or Path(f"{recording.stem}.mcap"), advance)
    size = sum(each.stat().st_size for each in ([path] if path.is_file() else path.rglob("*")))
    if as_json:
        emit({"file": path, "bytes": size, "rows": len(found.time), "drones": found.n})
    else:
        out.print(f"{path}: {size / 1e6:.1f} MB", highlight=False, markup=False, soft_wrap=True)
