"""`colift bench`: all solvers on the same problems, timed and judged."""

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
    out,
    progress,
    save_json,
    show_tables,
)
from colift.threads import one_blas_thread


@app.command()
def bench(
    sizes: Annotated[
        str | None,
        typer.Option(help="Numbers of drones, separated by commas; default: 2 to 1024."),
    ] = None,
    quick: Annotated[
        bool, typer.Option(help="Fewer repetitions, up to 16 drones; for a smoke test.")
    ] = False,
    instructions: Annotated[
        bool, typer.Option(help="Count the instructions of a call as well (needs valgrind).")
    ] = False,
    env: Annotated[
        bool,
        typer.Option(
            "--env", help="Physics steps a second of the environments for learners, beside MuJoCo."
        ),
    ] = False,
    file: JsonFile = None,
    as_json: Json = False,
) -> None:
    """Time every solver that is installed on the same problems, and judge every answer alike.

    The paper's problem and the safe one, along a smooth and a noisy force. All take turns in one process;
    warm-up is excluded. One referee looks at the answers alone, so that a fast wrong answer shows.
    """
    counts = None if sizes is None else numbers(sizes, *((1, 64) if env else (2, 1024)))
    one_blas_thread()
    if env:
        _environments(counts, quick, file, as_json)
        return
    with loading():
        from colift.study import bench as benchmark
        from colift.study.bench.tables import notes, tables
    counts = counts or list(benchmark.QUICK_SIZES if quick else benchmark.SIZES)
    with progress("Timing") as advance:
        result = benchmark.run(
            counts, effort=benchmark.QUICK if quick else benchmark.FULL, instructions=instructions,
            progress=advance,
        )  # fmt: skip
    save_json(file, result)
    if as_json:
        emit(result)
        return
    show_tables(tables(result))
    for note in notes(result):
        out.print(note, highlight=False)


def _environments(counts: list[int] | None, quick: bool, file: JsonFile, as_json: bool) -> None:
    with loading():
        from colift.learn import throughput
    with progress("Flying") as advance:
        result = throughput.run(
            counts or throughput.SIZES, rounds=throughput.QUICK if quick else throughput.ROUNDS, progress=advance,
        )  # fmt: skip
    save_json(file, result)
    if as_json:
        emit(result)
        return
    show_tables(throughput.tables(result))
    gain = result["two_threads"]
    out.print(
        f"Two threads: {gain['wall']:.2f} times as fast as one (tells on idle cores only), "
        f"{gain['processor']:.2f} times the processor time.",
        highlight=False,
    )
