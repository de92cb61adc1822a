"""Team and load as URDF, for what shows robots: bodies with masses and shapes, and the frames that ``/tf`` moves.

Every body hangs on ``world`` by a floating joint, as nothing but the motion itself says where it is. A cable's frame stands in its end on
the load, z along the cable.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from xml.etree import ElementTree as Tree

import numpy as np

from colift.record.exchange.topics import LOAD, WORLD, cable, drone
from colift.team import Team

ARM, DISC = 0.17, 0.1
"""From a drone's centre to a rotor's axis, and radius of a rotor, m, where they are not known."""
HEIGHT, THICK, CABLE = 0.06, 0.01, 0.004
"""Height of a drone's hull, of a rotor's disc, and radius of a cable, m."""
DENSITY = 1000.0
"""Of a load that is a point, as it is drawn: a ball of water, kg/m^3."""
COLOURS = {
    "load": (0.85, 0.55, 0.15),
    "hull": (0.2, 0.2, 0.25),
    "rotor": (0.3, 0.5, 0.8),
    "cable": (0.4, 0.4, 0.4),
}


def urdf(team: Team, name: str) -> str:
    """The description of a team under the name of its mission."""
    robot = Tree.Element("robot", name=name)
    for key, colour in COLOURS.items():
        material = Tree.SubElement(robot, "material", name=key)
        Tree.SubElement(material, "color", rgba=numbers([*colour, 1.0]))
    Tree.SubElement(robot, "link", name=WORLD)
    _load(robot, team)
    for i in range(team.n):
        _drone(robot, team, i)
    for i in range(team.n):
        length = float(team.cable_lengths[i])
        link = _link(robot, cable(i))
        _shape(link, "cable", [0, 0, 0.5 * length], "cylinder", radius=CABLE, length=length)
    Tree.indent(robot)
    return Tree.tostring(robot, encoding="unicode", xml_declaration=True) + "\n"


def _load(robot: Tree.Element, team: Team) -> None:
    link, body = _link(robot, LOAD), team.body
    if body is None:
        radius = radius_of(team)
        _inertial(link, team.load_mass, 0.4 * team.load_mass * radius**2 * np.eye(3))
        _shape(link, "load", [0, 0, 0], "sphere", radius=radius)
    else:
        _inertial(link, team.load_mass, body.inertia, body.centre)
        _shape(link, "load", [0, 0, 0], "box", size=np.maximum(body.size, THICK))


def _drone(robot: Tree.Element, team: Team, i: int) -> None:
    link = _link(robot, drone(i))
    _inertial(link, float(team.masses[i]), np.diag(team.inertias[i]))
    arm, disc, places = rotors_of(team, i)
    _shape(link, "hull", [0, 0, 0], "box", size=[arm, 0.6 * arm, HEIGHT * arm / ARM])
    for place in places:
        _shape(link, "rotor", place, "cylinder", radius=disc, length=THICK)


def _link(robot: Tree.Element, name: str) -> Tree.Element:
    """A link that floats in the world."""
    joint = Tree.SubElement(robot, "joint", name=f"{name}_floats", type="floating")
    Tree.SubElement(joint, "parent", link=WORLD)
    Tree.SubElement(joint, "child", link=name)
    return Tree.SubElement(robot, "link", name=name)


def _inertial(link: Tree.Element, mass: float, inertia: np.ndarray, centre: Sequence[float] | np.ndarray = (0, 0, 0)) -> None:  # fmt: skip
    inertial = Tree.SubElement(link, "inertial")
    Tree.SubElement(inertial, "origin", xyz=numbers(centre))
    Tree.SubElement(inertial, "mass", value=f"{mass:.9g}")
    places = {"ixx": (0, 0), "iyy": (1, 1), "izz": (2, 2), "ixy": (0, 1), "ixz": (0, 2), "iyz": (1, 2)}  # fmt: skip
    Tree.SubElement(inertial, "inertia", {k: f"{inertia[at]:.9g}" for k, at in places.items()})


def _shape(
    link: Tree.Element, material: str, place: Sequence[float], kind: str, **sizes: object
) -> None:
    visual = Tree.SubElement(link, "visual")
    Tree.SubElement(visual, "origin", xyz=numbers(place))
    given = {k: f"{v:.6g}" if isinstance(v, float) else numbers(v) for k, v in sizes.items()}  # type: ignore[arg-type]
    Tree.SubElement(Tree.SubElement(visual, "geometry"), kind, given)
    Tree.SubElement(visual, "material", name=material)


def numbers(values: Sequence[float] | np.ndarray) -> str:
    """Numbers with spaces between them, as models are written."""
    return " ".join(f"{float(value):.12g}" for value in values)


def radius_of(team: Team) -> float:
    """Of the ball as which a load that is a point is drawn, m."""
    return float((0.75 * team.load_mass / (math.pi * DENSITY)) ** (1.0 / 3.0))


def arm_of(team: Team, i: int) -> float:
    """From a drone's centre to a rotor's axis, m."""
    return float(team.arms[i]) if math.isfinite(team.arms[i]) else ARM


def rotors_of(team: Team, i: int) -> tuple[float, float, list[list[float]]]:
    """Of a drone its arm, a rotor's radius and the rotors' places, m."""
    arm = arm_of(team, i)
    disc = float(team.rotor_radii[i]) if math.isfinite(team.rotor_radii[i]) else DISC * arm / ARM
    count = int(team.rotors[i]) if math.isfinite(team.rotors[i]) else 4
    angles = [2.0 * math.pi * (k + 0.5) / count for k in range(count)]
    height = 0.5 * HEIGHT * arm / ARM
    return arm, disc, [[arm * math.cos(a), arm * math.sin(a), height] for a in angles]
