"""`colift bench`: time the allocators and the closed loop."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from colift.cli.base import Json, app, emit, loading, numbers, out, progress, save_json


@app.command()
def bench(
    sizes: Annotated[
        str, typer.Option(help="Numbers of drones, separated by commas.")
    ] = "2,3,4,8,16,64,256,1024",
    quick: Annotated[bool, typer.Option(help="Fewer repetitions; for a smoke test.")] = False,
    file: Annotated[Path | None, typer.Option("--out", help="Write the JSON here as well.")] = None,
    as_json: Json = False,
) -> None:
    """Time the allocator and the closed loop on this machine; compare with SciPy's SLSQP.

    Warm-up is excluded; median, 99th percentile and worst of many calls are shown, with the
    iterations and the worst optimality residual, so that a fast wrong answer shows.
    """
    counts = numbers(sizes, 1, 1024)
    with loading():
        from colift import benchmark
    with progress("Timing") as advance:
        result = benchmark.run(counts, quick=quick, progress=advance)
    save_json(file, result)
    if as_json:
        emit(result)
    else:
        benchmark.show(result, out)
