"""`colift export`: controllers, teams and flights for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from colift.cli.base import (
    Json,
    Sets,
    With,
    app,
    check_out,
    emit,
    load_parts,
    loading,
    out,
    progress,
    several,
    show_notes,
)

OURS = ("colift.h", "colift_team.h")
OUR_APP = ("app-config",)

Kind = Literal["c", "crazyflie", "mjcf", "urdf", "sdf", "bag", "csv", "parquet", "rerun"]
FLIGHTS = {"bag": ".mcap", "csv": ".csv", "parquet": ".parquet", "rerun": ".rrd"}
"""What recordings become, and how the names of their files end."""


@app.command()
def export(
    kind: Annotated[
        Kind,
        typer.Argument(
            help="Of a mission: c, crazyflie, mjcf, urdf, sdf; of a recording: bag, csv, parquet, rerun.",
            metavar="FORMAT",
        ),
    ],
    source: Annotated[
        str,
        typer.Argument(
            help="Shipped mission or TOML file; or recording, or result folder of a run.",
            metavar="MISSION|FLIGHT",
        ),
    ] = "paper-spiral",
    target: Annotated[
        Path | None,
        typer.Option(
            "--out", help="Folder (c, crazyflie) or file to write.", show_default="in this folder"
        ),
    ] = None,
    float32: Annotated[bool, typer.Option("--float32", help="C in single precision.")] = False,
    embedded: Annotated[
        bool,
        typer.Option(
            "--embedded", help="C in single precision, with a bound on the work of a call."
        ),
    ] = False,
    part: Annotated[
        str | None,
        typer.Option(
            help="Layers as C, separated by commas, such as allocation or position_control.",
            show_default="all of the controllers'",
        ),
    ] = None,
    sets: Sets = None,
    extra: With = None,
    as_json: Json = False,
) -> None:
    """Write a mission's controllers as C99 (c) or as an app of the Crazyflie's firmware (crazyflie), its team as a model for other simulators, or a recording in another program's format.

    C is translated from the kernels that Python runs: no malloc, no globals. Its test calls each kernel along a flight and compares
    with Python's answers, bit for bit. What C would not do in the same way is refused, with file and line.

    [bold]Examples[/bold]

      colift export c --embedded --set allocation.kind=safe --part allocation --out allocator
      colift export c noisy-spiral --out controllers && make -C controllers check
      colift export crazyflie crazyflie-trio --out app
      colift export mjcf four-to-three --out team.xml
      colift export bag runs/hover-20260101-120000 --out hover.mcap
    """
    if kind != "c" and (float32 or embedded or part):
        raise typer.BadParameter(f"--float32, --embedded and --part are for c, not for {kind}")
    if kind in FLIGHTS:
        if sets or extra:
            raise typer.BadParameter(f"--set and --with are for missions; {kind} is of a recording")
        _flight(kind, Path(source), target, as_json=as_json)
    elif kind == "c":
        names = several(part)
        _c(
            source,
            target or Path("colift-c"),
            names,
            sets,
            extra,
            (float32, embedded),
            as_json=as_json,
        )
    elif kind == "crazyflie":
        _crazyflie(source, target or Path("colift-crazyflie"), sets, extra, as_json=as_json)
    else:
        _model(kind, source, target, sets, extra, as_json=as_json)


def _c(
    mission: str,
    folder: Path,
    part: list[str] | None,
    sets: Sets,
    extra: With,
    precision: tuple[bool, bool],
    *,
    as_json: bool,
) -> None:
    check_out(folder, OURS)
    from colift.deploy.c.layers import EMBEDDED, LAYERS, SINGLE, pinned

    float32, embedded = precision
    pinned()
    names = part or LAYERS
    if wrong := {*names} - {*LAYERS}:
        raise typer.BadParameter(f"--part {min(wrong)}: must be among {', '.join(LAYERS)}")
    with loading():
        from colift.deploy.c import export as module
        from colift.mission.load import load_mission, parse_overrides
        from colift.mission.warnings import notes_of

        load_parts(extra)
        loaded = load_mission(mission, parse_overrides(sets))
        show_notes(notes_of(loaded))
        if "allocation" in names and (float32 or embedded):
            loaded = module.profiled(loaded, EMBEDDED if embedded else SINGLE)
        files = module.files_of(loaded, names, single=float32 or embedded)
    module.write(files, folder)
    _tell_folder(folder, files, f"`make -C {folder} check`", as_json=as_json)


def _crazyflie(source: str, folder: Path, sets: Sets, extra: With, *, as_json: bool) -> None:
    check_out(folder, OUR_APP)
    with loading():
        from colift.deploy.c.crazyflie import files_of
        from colift.deploy.c.export import write
        from colift.mission.load import load_mission, parse_overrides
        from colift.mission.warnings import notes_of

        load_parts(extra)
        mission = load_mission(source, parse_overrides(sets))
        show_notes(notes_of(mission))
        files = files_of(mission)
    write(files, folder)
    command = f"`make -C {folder} CRAZYFLIE_BASE=path/to/crazyflie-firmware`"
    _tell_folder(folder, files, command, as_json=as_json)


def _tell_folder(folder: Path, files: dict[str, str], command: str, *, as_json: bool) -> None:
    """Say what was written, and what to do with it."""
    if as_json:
        emit({"folder": str(folder), "files": sorted(files)})
        return
    lines = sum(text.count("\n") for text in files.values())
    out.print(
        f"{folder}: {len(files)} files, {lines} lines; {command}", markup=False, soft_wrap=True
    )


def _model(
    kind: str, name: str, target: Path | None, sets: Sets, extra: With, *, as_json: bool
) -> None:
    with loading():
        from colift.deploy.models import FORMATS, model
        from colift.mission.load import load_mission, parse_overrides
        from colift.record.recording import atomic_path

        load_parts(extra)
        mission = load_mission(name, parse_overrides(sets))
        path = target or Path(f"{mission.name}{FORMATS[kind]}")
        with atomic_path(path) as temporary:
            temporary.write_text(model(mission, kind), encoding="utf-8")
    _tell([path], as_json=as_json)


def _flight(kind: str, source: Path, target: Path | None, *, as_json: bool) -> None:
    from colift.record.exchange import written
    from colift.record.recording import Recording

    recording = Recording.load(source)
    path = target or Path(f"{source.stem}{FLIGHTS[kind]}")
    with progress(f"Writing {path.name}") as advance:
        files = written(recording, kind, path, advance)
    _tell(files, as_json=as_json)


def _tell(paths: list[Path], *, as_json: bool) -> None:
    """Say what was written, and how large it is."""
    files = [each for path in paths for each in ([path] if path.is_file() else path.rglob("*"))]
    size = sum(each.stat().st_size for each in files)
    if as_json:
        emit({"files": [str(path) for path in paths], "bytes": size})
    else:
        for path in paths:
            out.print(str(path), highlight=False, markup=False, soft_wrap=True)
