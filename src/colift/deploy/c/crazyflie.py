"""A mission's controllers as an app of the Crazyflie's firmware: kernels in single precision, and the files of its build out of tree.

The app's task calls all layers but attitude control, at the period of position control; the stabilizer's calls that one. What the drones know of
each other travels between them, so that each can decide for all.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from colift.deploy.c import export
from colift.deploy.c.cascade import COURSE, LAYERS, Cascade
from colift.deploy.c.header import header_of
from colift.deploy.c.layers import EMBEDDED, FAST
from colift.deploy.c.templates import template
from colift.errors import ColiftError
from colift.flight.flight import Flight
from colift.kernel.rounding import SINGLE
from colift.part import kind_of

if TYPE_CHECKING:
    from colift.mission.mission import Mission

MILLISECOND = 1e-3
"""Period of the firmware's stabilizer, s."""
STEERING = (*COURSE, *LAYERS[:-1])
BUILD = ("Makefile", "Kbuild", "app-config", "README.md")


def files_of(mission: Mission) -> dict[str, str]:
    """Text of each file by its place in the folder.

    Raises
    ------
    ColiftError
        For what the app cannot do, naming the mission's field.

    """
    _check(mission)
    mission = export.profiled(mission, EMBEDDED)
    flight = Flight(mission)
    found = {each.name: each for each in export.layers_of(flight, (*COURSE, *LAYERS), single=True)}
    period = found["position_control"].period
    for name in COURSE:  # in flight once a step of physics; here as often as anything
        found[name] = replace(found[name], period=period)
    layers = list(found.values())
    parts: Any = (
        Cascade(mission, layers, STEERING, step=period, named=("colift_steering", "colift_steer")),
        Cascade(mission, layers, LAYERS[-1:], step=found["attitude_control"].period, named=("colift_turning", "colift_turn")),
    )  # fmt: skip
    sources = {f"{each.kernel.name}.c": each.kernel.file("colift.h") for each in layers}
    sources["colift.h"] = header_of([each.kernel for each in layers])
    sources["colift_team.h"], sources["colift_team.c"] = export.team_of(layers, len(flight.drones))
    for part in parts:
        sources |= part.files(example=False)
    sources["colift_app.c"] = template("crazyflie/colift_app.c", {})
    objects = sorted(name.replace(".c", ".o") for name in sources if name.endswith(".c"))
    lines = [f"ccflags-y += {' '.join(FAST)}", *(f"obj-y += {name}" for name in objects)]
    sources["Kbuild"] = "\n".join([*lines, ""])
    marks = {"MISSION": mission.name, "DRONES": str(len(flight.drones))}
    files = {name: template(f"crazyflie/{name}", marks) for name in BUILD}
    files["LICENSE"] = template("LICENSE", {})
    return files | {f"src/{name}": text for name, text in sources.items()}


def _check(mission: Mission) -> None:
    """Refuse what the app cannot do."""
    timing = mission.timing
    if mission.team.body is not None:
        raise ColiftError("load.kind: the app carries a point, not a rigid load")
    if type(mission.agents).decides:
        raise ColiftError("agents.kind: each drone's app decides for all, as one allocator does")
    if mission.events:
        raise ColiftError("events: the app flies one team with one set of parameters to the end")
    if kind_of(type(mission.estimation)) != "none":
        raise ColiftError(
            "estimation.kind: must be none, as the firmware has an estimator of its own"
        )
    for name in ("load_control", "allocation"):
        if getattr(timing, name) < timing.position_control:
            raise ColiftError(
                f"timing.{name}: must be {timing.position_control:g} s or more, as position control's"
            )
    for name in ("position_control", "attitude_control"):
        count = getattr(timing, name) / MILLISECOND
        if count < 1.0 - SINGLE["WHOLE"] or abs(count - round(count)) > SINGLE["WHOLE"]:
            raise ColiftError(
                f"timing.{name}: must be whole milliseconds, as the firmware's stabilizer"
            )
