"""`colift latency`: call the allocators on a clock."""

from __future__ import annotations

from typing import Annotated

import typer

from colift.cli.base import Json, JsonFile, app, emit, loading, progress, save_json, show_tables


@app.command()
def latency(
    drones: Annotated[int, typer.Option(help="Number of drones.", min=2, max=64)] = 4,
    seconds: Annotated[
        float, typer.Option(help="Length of each of the six measurements, s.", min=1, max=3600)
    ] = 60.0,
    rate: Annotated[float, typer.Option(help="Calls per second.", min=10, max=10_000)] = 1000.0,
    others: Annotated[
        int | None, typer.Option(help="Busy processes meanwhile; default: one a core.", min=0)
    ] = None,
    realtime: Annotated[
        bool, typer.Option(help="Under the real-time scheduler (Linux, with the right to).")
    ] = False,
    file: JsonFile = None,
    as_json: Json = False,
) -> None:
    """Call the allocators on a clock while other processes use the machine.

    Tells late starts, Python's collector, the allocator's own time and preemption apart, from Python and
    from a compiled loop.
    """
    with loading():
        from colift.study import latency as module
    with progress("Waiting for ticks") as advance:
        result = module.run(
            n=drones, seconds=seconds, rate=rate, others=others, realtime=realtime,
            progress=advance,
        )  # fmt: skip
    save_json(file, result)
    if as_json:
        emit(result)
    else:
        show_tables(module.tables(result))
