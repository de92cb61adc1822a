"""`colift reproduce`: reproduce the paper's figures and numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.table import Table

from colift.cli.base import (
    Json,
    app,
    check_out,
    emit,
    loading,
    new_folder,
    out,
    progress,
    result_folder,
    show_files,
)


@app.command()
def reproduce(
    folder: Annotated[Path | None, result_folder("reproduce")] = None,
    report: Annotated[bool, typer.Option(help="Write the HTML page and its figures.")] = True,
    as_json: Json = False,
) -> None:
    """Fly everything in the paper and set our figures beside the printed ones.

    Each row ends in a verdict: reproduced, better, or differs because of a named reason. The
    paper's errata are each demonstrated by a flight or a computation.
    """
    check_out(folder, ("reproduction.json",))
    with loading():
        from colift.study import reproduction
    with progress("Reproducing the paper") as advance:
        result = reproduction.reproduce(advance)
    target = folder or new_folder("reproduce")
    files = {"table": reproduction.write(result, target)}
    if report:
        from colift.show.report.reproduction import write_page

        files["report"] = write_page(result, target)
    if as_json:
        emit({**result.as_dict(), "files": files})
        return
    for section, rows in result.sections():
        table = Table(title=section, title_justify="left", show_lines=True)
        table.add_column("quantity", ratio=3)
        table.add_column("paper", justify="right")
        table.add_column("ours", justify="right")
        table.add_column("verdict", ratio=4)
        for row in rows:
            table.add_row(
                escape(row.quantity), row.paper_text, row.ours_text, escape(row.verdict_text)
            )
        out.print(table)
    show_files(files)
