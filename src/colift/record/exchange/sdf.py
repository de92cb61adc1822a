"""Team and load as SDFormat, for Gazebo: the load, and on it as many rods with a ball joint at either end as it has cables, each with its drone.

A rod is a cable that is taut: it pulls, and pushes, and is never slack. Its mass is its drone's, of which it takes :data:`SHARE`, for
physics engines know no body without mass. Rods begin where cables point in the mission.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as Tree

import numpy as np

from colift.record.exchange.messages import Body, pointing
from colift.record.exchange.topics import LOAD, cable, drone
from colift.record.exchange.urdf import (  # fmt: skip
    ARM,
    CABLE,
    COLOURS,
    HEIGHT,
    THICK,
    numbers,
    radius_of,
    rotors_of,
)
from colift.team import Team
from colift.team.geometry import matrix_of

VERSION = "1.9"
SHARE = 0.01
"""Of a drone's mass, that of its rod."""

Array = np.ndarray


def sdf(team: Team, name: str, load: Body, drones: Sequence[Body]) -> str:
    """The model, under the name of its mission, with load and drones where they begin."""
    root = Tree.Element("sdf", version=VERSION)
    model = Tree.SubElement(root, "model", name=name, canonical_link=LOAD)
    _load(model, team, load)
    ends = np.zeros((team.n, 3)) if team.body is None else team.body.attachments
    for i, body in enumerate(drones):
        end = load.position + matrix_of(load.attitude) @ ends[i]
        _rod(model, team, i, end, body.position)
        _drone(model, team, i, body)
        _joint(model, f"hook_{i}", LOAD, cable(i), [0.0, 0.0, 0.0])
        # Where the rod ends, and so the drone's centre is, in the rod's frame.
        _joint(model, f"hang_{i}", cable(i), drone(i), [0.0, 0.0, float(np.linalg.norm(body.position - end))])  # fmt: skip
    Tree.indent(root)
    return Tree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _joint(model: Tree.Element, name: str, parent: str, child: str, at: Sequence[float]) -> None:
    joint = Tree.SubElement(model, "joint", name=name, type="ball")
    Tree.SubElement(joint, "parent").text = parent
    Tree.SubElement(joint, "child").text = child
    rod = child if parent == LOAD else parent
    Tree.SubElement(joint, "pose", relative_to=rod).text = numbers([*at, 0, 0, 0])


def _load(model: Tree.Element, team: Team, load: Body) -> None:
    link = _link(model, LOAD, load.position, load.attitude)
    if team.body is None:
        radius = radius_of(team)
        _inertial(link, team.load_mass, 0.4 * team.load_mass * radius**2 * np.eye(3))
        _shape(link, LOAD, "load", [0, 0, 0], "sphere", radius=numbers([radius]))
    else:
        body = team.body
        _inertial(link, team.load_mass, body.inertia, body.centre)
        _shape(link, LOAD, "load", [0, 0, 0], "box", size=numbers(np.maximum(body.size, THICK)))


def _rod(model: Tree.Element, team: Team, i: int, end: Array, place: Array) -> None:
    along = place - end
    length = float(np.linalg.norm(along))
    link = _link(model, cable(i), end, pointing(along))
    mass = SHARE * float(team.masses[i])
    across = mass * length**2 / 12.0
    spread = np.diag([across, across, 0.5 * mass * CABLE**2])
    _inertial(link, mass, spread, [0.0, 0.0, 0.5 * length])
    sizes = {"radius": numbers([CABLE]), "length": numbers([length])}
    _shape(link, cable(i), "cable", [0, 0, 0.5 * length], "cylinder", **sizes)


def _drone(model: Tree.Element, team: Team, i: int, body: Body) -> None:
    link = _link(model, drone(i), body.position, body.attitude)
    _inertial(link, (1.0 - SHARE) * float(team.masses[i]), np.diag(team.inertias[i]))
    arm, disc, places = rotors_of(team, i)
    hull = numbers([arm, 0.6 * arm, HEIGHT * arm / ARM])
    _shape(link, "hull", "hull", [0, 0, 0], "box", size=hull)
    for k, at in enumerate(places):
        sizes = {"radius": numbers([disc]), "length": numbers([THICK])}
        _shape(link, f"rotor_{k}", "rotor", at, "cylinder", **sizes)


def _link(model: Tree.Element, name: str, place: Array, attitude: Array) -> Tree.Element:
    link = Tree.SubElement(model, "link", name=name)
    Tree.SubElement(link, "pose").text = numbers([*place, *_angles(attitude)])
    return link


def _angles(attitude: Array) -> list[float]:
    """Roll, pitch and yaw, rad."""
    m = matrix_of(attitude)
    pitch = np.arctan2(-m[2, 0], np.hypot(m[0, 0], m[1, 0]))
    return [float(np.arctan2(m[2, 1], m[2, 2])), float(pitch), float(np.arctan2(m[1, 0], m[0, 0]))]


def _inertial(link: Tree.Element, mass: float, inertia: Array, centre: Sequence[float] | Array = (0, 0, 0)) -> None:  # fmt: skip
    inertial = Tree.SubElement(link, "inertial")
    Tree.SubElement(inertial, "pose").text = numbers([*centre, 0, 0, 0])
    Tree.SubElement(inertial, "mass").text = numbers([mass])
    element = Tree.SubElement(inertial, "inertia")
    for name, (j, k) in {"xx": (0, 0), "xy": (0, 1), "xz": (0, 2), "yy": (1, 1), "yz": (1, 2), "zz": (2, 2)}.items():  # fmt: skip
        Tree.SubElement(element, f"i{name}").text = numbers([inertia[j, k]])


def _shape(
    link: Tree.Element, name: str, colour: str, place: Sequence[float], kind: str, **sizes: str
) -> None:
    visual = Tree.SubElement(link, "visual", name=name)
    Tree.SubElement(visual, "pose").text = numbers([*place, 0, 0, 0])
    shape = Tree.SubElement(Tree.SubElement(visual, "geometry"), kind)
    for key, value in sizes.items():
        Tree.SubElement(shape, key).text = value
    material = Tree.SubElement(visual, "material")
    for key in ("ambient", "diffuse"):
        Tree.SubElement(material, key).text = numbers([*COLOURS[colour], 1.0])
