"""`colift safety`: attack the safe allocator."""

from __future__ import annotations

from typing import Annotated

import typer

from colift.cli.base import (
    Json,
    JsonFile,
    app,
    emit,
    loading,
    numbers,
    progress,
    save_json,
    show_tables,
)


@app.command()
def safety(
    sizes: Annotated[
        str, typer.Option(help="Numbers of drones, separated by commas.")
    ] = "2,3,4,6,8,12,16",
    cycles: Annotated[
        int, typer.Option(min=100, max=10_000_000, help="Cycles per team and family of forces.")
    ] = 20_000,
    quick: Annotated[bool, typer.Option(help="A tenth of it; for a first look.")] = False,
    file: JsonFile = None,
    as_json: Json = False,
) -> None:
    """Attack the safe allocator and fly it, beside the paper's allocator.

    Alone: smooth, noisy, stepping and adversarial forces; every answer is checked against every
    limit, and again with least distances in metres on unequal cables. In flight: from rest, with a drone below the load, fast, heavy, after losing a drone, for
    an hour. The table says where it holds and where not.
    """
    counts = numbers(sizes, 2, 64)
    with loading():
        from colift.study import safety as module
    with progress("Attacking and flying") as advance:
        result = module.show_all(
            counts, cycles // (10 if quick else 1), quick=quick, progress=advance
        )
    save_json(file, result)
    if as_json:
        emit(result)
        return
    show_tables(module.tables(result))
