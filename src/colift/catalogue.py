"""What there is, by name: layers, their parts, shipped missions, vehicles. Nothing is imported or compiled for it."""

from __future__ import annotations

import importlib.metadata
import importlib.resources
import os
import pkgutil
import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from colift.errors import MissionError, Problem, UnknownNameError, VehicleError

WINGS = {
    "sensing": "world",
    "estimation": "control",
    "supervision": "control",
    "reference": "control",
    "load_control": "control",
    "allocation": "control",
    "link": "world",
    "network": "world",
    "agents": "control",
    "observation": "control",
    "position_control": "control",
    "attitude_control": "control",
    "actuation": "world",
    "detection": "control",
    "plant": "world",
    "disturbance": "world",
    "fault": "world",
}
"""Every folder of parts, in the order of the block diagram, and the wing that it stands in.

A name here is the folder's, a mission section's and the suffix of a group of entry points.
"""

LISTS = ("disturbance", "fault")
"""Folders of which a mission may use several parts at once; its sections of this name are lists."""

FOLDERS = tuple(WINGS)
"""Every folder of parts."""

LAYERS = tuple(folder for folder in FOLDERS if folder not in LISTS)
"""The layers of the block diagram, of each of which a mission has one part."""

DEFAULT_KINDS = {
    "sensing": "ideal",
    "estimation": "predictor",
    "supervision": "none",
    "load_control": "balance",
    "allocation": "safe",
    "link": "ideal",
    "network": "perfect",
    "agents": "central",
    "observation": "momentum",
    "position_control": "formation",
    "attitude_control": "delay-aware",
    "actuation": "motors",
    "detection": "none",
    "plant": "slack-cables",
}
"""Parts of the layers that a mission need not name; but see :func:`default_kind`."""

FORMATION = {
    layer: DEFAULT_KINDS[layer] for layer in ("load_control", "observation", "position_control")
}
"""The cascade in which the load hangs on the formation that the drones hold: these go together."""

TRACKING = {
    "estimation": "none", "load_control": "pid", "observation": "none", "position_control": "pid",
    "attitude_control": "manifold", "actuation": "ideal",
}  # fmt: skip
"""The paper's cascade, in which the load's own controller brings it to its place, and the motors that it takes for granted."""

RIGID = "rigid"
"""Kind of a load of which place and attitude are wanted."""

TURNING = {**FORMATION, "load_control": "pose", "allocation": "safe-wrench"}
"""What flies a rigid load."""

UNNUMBERED = ("count", "cable_length")
"""What a mission may say of its drones and leave them the paper's."""

LEADING = "lift"
"""The supervisor that leads a team off the ground."""


def default_kind(layer: str, sections: Mapping[str, Any]) -> str | None:
    """The part of a layer that a mission with these sections does not name; None for a layer that must be named.

    Who asks for a load or position control of the paper's cascade gets the rest of it, too. So does, without asking, who says
    nothing of three drones or more that would make them others than the paper's, and starts in the air. Nothing is
    predicted where the sensors are ideal. Who starts on the ground is led from there.
    """

    def table(of: str) -> Mapping[str, Any]:
        section = sections.get(of)
        return section if isinstance(section, Mapping) else {}

    named = {of: table(of).get("kind") for of in (*FORMATION, "supervision", "sensing")}
    stands = table("start").get("on_ground") is True
    turns = table("load").get("kind") == RIGID
    asked = any(
        named[of] not in (None, FORMATION[of], TURNING[of])
        for of in (("position_control",) if turns else ("load_control", "position_control"))
    )
    formation = stands or turns or any(named[of] == own for of, own in FORMATION.items())
    drones = table("drones")
    count = drones.get("count", 4)
    papers = drones.keys() <= {*UNNUMBERED} and isinstance(count, int) and count >= 3
    tracking = asked or (papers and not formation and named["supervision"] != LEADING)
    if turns and layer in TURNING:
        return TURNING[layer]
    if layer in TRACKING and tracking:
        return TRACKING[layer]
    if layer == "estimation" and named["sensing"] in (None, DEFAULT_KINDS["sensing"]):
        return "none"
    if layer == "supervision" and stands and not tracking:
        return LEADING
    return DEFAULT_KINDS.get(layer)


VEHICLE = "vehicle"
"""Suffix of the group of entry points for drones that other packages bring."""


def own_names(layer: str) -> list[str]:
    """Names of the parts of a layer that colift brings."""
    if layer not in FOLDERS:
        raise UnknownNameError("layer", layer, FOLDERS)
    return sorted(
        module.name.replace("_", "-")
        for module in pkgutil.iter_modules([str(Path(__file__).parent / WINGS[layer] / layer)])
        if not (module.ispkg or module.name.startswith("_") or module.name == "base")
    )


def names(layer: str) -> list[str]:
    """Names of the parts of a layer that are installed: colift's and other packages'."""
    return sorted({*own_names(layer), *plugged(layer)})


def plugged(layer: str) -> dict[str, importlib.metadata.EntryPoint]:
    """Parts of other installed packages, by name."""
    return _plugged().get(layer, {})


@cache
def _plugged() -> dict[str, dict[str, importlib.metadata.EntryPoint]]:
    """By layer; looking through all installed packages takes a while, once."""
    points = importlib.metadata.entry_points()
    return {
        layer: {point.name: point for point in points.select(group=f"colift.{layer}")}
        for layer in (*FOLDERS, VEHICLE)
    }


def mission_names() -> list[str]:
    """Names of the shipped missions."""
    folder = importlib.resources.files("colift.mission.shipped")
    return sorted(
        f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")
    )


_VEHICLES = Path(__file__).parent / "team" / "vehicles"


def own_vehicle_names() -> list[str]:
    """Names of the drones whose numbers colift brings."""
    return sorted(file.stem for file in _VEHICLES.glob("*.toml"))


def vehicle_names() -> list[str]:
    """Names of the drones that are known by their numbers: colift's and other packages'."""
    return sorted({*own_vehicle_names(), *plugged(VEHICLE)})


def read_vehicle(source: str) -> dict[str, Any]:
    """The raw table of a drone: from a name, or from the path of a TOML file (whose name ends with .toml).

    Another package's entry point holds such a table, or the path of one.

    Raises
    ------
    UnknownNameError
        If it is neither.
    VehicleError
        If the file cannot be read or is not TOML.

    """
    path = Path(source)
    if path.suffix != ".toml":
        path = _VEHICLES / f"{source}.toml"
        if source not in own_vehicle_names():
            point = plugged(VEHICLE).get(source)
            if point is None:
                raise UnknownNameError("vehicle", source, vehicle_names())
            found = point.load()
            if isinstance(found, Mapping):
                return dict(found)
            path = Path(found)
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise VehicleError(f"{path}: cannot be read: {error}") from error
    except (ValueError, RecursionError) as error:
        raise VehicleError(f"{path}: is not valid TOML: {error}") from error


def read_source(source: str | Path) -> tuple[str, dict[str, Any]]:
    """The raw table of a mission and how to call its source in messages.

    ``source`` is the path of a TOML file or the name of a shipped mission.

    Raises
    ------
    UnknownNameError
        If it is neither.
    MissionError
        If the file cannot be read or is not TOML.

    """
    path = Path(source)
    if path.suffix == ".toml" or os.path.isfile(path):
        label = str(path)
        try:
            text = path.read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            raise MissionError(label, [Problem("file", "", f"cannot be read: {error}")]) from error
    else:
        if str(source) not in mission_names():
            raise UnknownNameError("mission", str(source), mission_names())
        label = f"{source}.toml (shipped)"
        text = (importlib.resources.files("colift.mission.shipped") / f"{source}.toml").read_text(
            "utf-8"
        )
    try:
        return label, tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise MissionError(label, [Problem("file", "", f"is not valid TOML: {error}")]) from error
