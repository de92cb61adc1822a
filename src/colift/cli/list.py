"""`colift list`: name missions, vehicles and parts."""

from __future__ import annotations

from colift.cli.base import Json, app, emit, out


@app.command(name="list")
def list_(
    as_json: Json = False,
) -> None:
    """Name the shipped missions, the vehicles and the parts of every layer."""
    from colift.catalogue import (
        FOLDERS,
        mission_names,
        names,
        read_source,
        read_vehicle,
        vehicle_names,
    )

    missions = {name: read_source(name)[1].get("description", "") for name in mission_names()}
    vehicles = {name: read_vehicle(name) for name in vehicle_names()}
    parts = {layer: names(layer) for layer in FOLDERS}
    if as_json:
        emit({"missions": missions, "vehicles": vehicles, "parts": parts})
        return
    from rich.markup import escape
    from rich.table import Table

    table = Table(title="Missions (colift run NAME)", title_justify="left")
    table.add_column("name", no_wrap=True)
    table.add_column("what it shows")
    for name, text in missions.items():
        table.add_row(name, escape(text))
    out.print(table)
    table = Table(title="Vehicles (--set drones.vehicle=NAME)", title_justify="left")
    table.add_column("name", no_wrap=True)
    table.add_column("kg", justify="right")
    table.add_column("N", justify="right")
    table.add_column("what it is")
    for name, numbers in vehicles.items():
        mass, thrust = (f"{numbers.get(key, '?')}" for key in ("mass", "max_thrust"))
        table.add_row(name, mass, thrust, escape(str(numbers.get("description", ""))))
    out.print(table)
    table = Table(title="Parts (--set LAYER.kind=NAME)", title_justify="left")
    table.add_column("layer", no_wrap=True)
    table.add_column("names")
    for layer, kinds in parts.items():
        table.add_row(layer, ", ".join(kinds))
    out.print(table)
