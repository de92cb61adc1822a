"""`colift results`: look into a file of campaign results."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape

from colift.cli.base import Json, app, emit, out
from colift.cli.campaign import Csv, Parquet, export


@app.command()
def results(
    file: Annotated[Path, typer.Argument(help="A campaign.sqlite of `compare` or `sweep`.")],
    csv: Csv = None,
    parquet: Parquet = None,
    as_json: Json = False,
) -> None:
    """Count what a campaign's file holds, also while it runs; export it as CSV or Parquet."""
    from colift.study.campaign.store import Store

    with Store(file) as store:
        rows = store.rows()
    export(rows, csv, parquet)
    count = Counter(row["status"] for row in rows)
    errors = Counter(row["error"] for row in rows if row["status"] == "failed")
    if as_json:
        emit({"file": str(file), "cases": dict(count), "errors": dict(errors), "rows": rows})
        return
    told = ", ".join(f"{number} {status}" for status, number in sorted(count.items())) or "no cases"
    out.print(f"{escape(str(file))}: {told}", highlight=False)
    for error, number in errors.most_common(10):
        out.print(f"{number} x [red]{escape(error)}[/red]", highlight=False)
