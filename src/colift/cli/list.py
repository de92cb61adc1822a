"""`colift list`: name missions and parts."""

from __future__ import annotations

from colift.cli.base import Json, app, emit, out


@app.command(name="list")
def list_(
    as_json: Json = False,
) -> None:
    """Name the shipped missions and the parts of every layer."""
    from colift.catalogue import FOLDERS, mission_names, names, read_source

    missions = {name: read_source(name)[1].get("description", "") for name in mission_names()}
    parts = {layer: names(layer) for layer in FOLDERS}
    if as_json:
        emit({"missions": missions, "parts": parts})
        return
    from rich.markup import escape
    from rich.table import Table

    table = Table(title="Missions (colift run NAME)", title_justify="left")
    table.add_column("name", no_wrap=True)
    table.add_column("what it shows")
    for name, text in missions.items():
        table.add_row(name, escape(text))
    out.print(table)
    table = Table(title="Parts (--set LAYER.kind=NAME)", title_justify="left")
    table.add_column("layer", no_wrap=True)
    table.add_column("names")
    for layer, kinds in parts.items():
        table.add_row(layer, ", ".join(kinds))
    out.print(table)
