"""Team and load as MJCF, for MuJoCo: free bodies with motors, and tendons with an upper limit of their length for cables.

Each drone has four motors: its ``thrust`` along z, N, and its torques about x, y and z, N m. A load that is a point slides along the
axes of the world and does not turn. A cable pulls while it is as long as it can be; MuJoCo lets it stretch a little, by a limit that decays in
:data:`SOFTNESS`. Nothing collides, and there is no ground.
"""

from __future__ import annotations

from collections.abc import Sequence
from xml.etree import ElementTree as Tree

import numpy as np

from colift.record.exchange.messages import Body
from colift.record.exchange.topics import LOAD, cable, drone
from colift.record.exchange.urdf import ARM, COLOURS, HEIGHT, numbers, radius_of, rotors_of
from colift.team import Team

STEP = 0.001
"""MuJoCo's step, s."""
SOFTNESS = 0.002
"""Time constant of a cable's limit, s: two steps, the least that MuJoCo takes."""
IMPEDANCE = 0.999
"""Of that limit: the share of the acceleration that holding it exactly would need."""
MOTORS = {"thrust": 2, "roll": 3, "pitch": 4, "yaw": 5}
"""Each motor's place among force and torque."""


def mjcf(team: Team, name: str, load: Body, drones: Sequence[Body]) -> str:
    """The model, under the name of its mission, with load and drones where they begin."""
    root = Tree.Element("mujoco", model=name)
    option = {"timestep": f"{STEP:g}", "integrator": "RK4", "gravity": numbers([0.0, 0.0, -team.gravity])}  # fmt: skip
    Tree.SubElement(root, "option", option)
    visible = Tree.SubElement(root, "default")
    Tree.SubElement(visible, "geom", contype="0", conaffinity="0", mass="0")
    world = Tree.SubElement(root, "worldbody")
    Tree.SubElement(world, "light", pos="0 0 4", dir="0 0 -1", directional="true")
    _load(Tree.SubElement(world, "body", name=LOAD, pos=numbers(load.position)), team, load)
    tendons = Tree.SubElement(root, "tendon")
    motors = Tree.SubElement(root, "actuator")
    for i, body in enumerate(drones):
        _drone(world, team, i, body)
        limits = {
            "limited": "true", "range": numbers([0.0, team.cable_lengths[i]]), "solreflimit": numbers([SOFTNESS, 1.0]),
            "solimplimit": numbers([IMPEDANCE, IMPEDANCE, 1.0]), "rgba": numbers([*COLOURS["cable"], 1.0]), "width": "0.004",
        }  # fmt: skip
        spatial = Tree.SubElement(tendons, "spatial", {"name": cable(i), **limits})
        Tree.SubElement(spatial, "site", site=drone(i))
        Tree.SubElement(spatial, "site", site=f"end_{i}")
        for motor, place in MOTORS.items():
            gear = numbers(np.eye(6)[place])
            Tree.SubElement(motors, "motor", name=f"{drone(i)}_{motor}", site=drone(i), gear=gear)
    Tree.indent(root)
    return Tree.tostring(root, encoding="unicode") + "\n"


def _load(element: Tree.Element, team: Team, load: Body) -> None:
    body, mass = team.body, numbers([team.load_mass])
    if body is None:
        for axis, along in zip("xyz", np.eye(3), strict=True):
            Tree.SubElement(
                element, "joint", name=f"load_{axis}", type="slide", axis=numbers(along)
            )
        Tree.SubElement(element, "inertial", pos="0 0 0", mass=mass, diaginertia="1 1 1")
        shape = {"type": "sphere", "size": numbers([radius_of(team)])}
    else:
        element.set("quat", numbers(load.attitude))
        Tree.SubElement(element, "freejoint", name=LOAD)
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = body.inertia
        full = numbers([xx, yy, zz, xy, xz, yz])
        Tree.SubElement(element, "inertial", pos=numbers(body.centre), mass=mass, fullinertia=full)
        shape = {"type": "box", "size": numbers(0.5 * np.maximum(body.size, 0.01))}
    Tree.SubElement(element, "geom", {"rgba": numbers([*COLOURS["load"], 1.0]), **shape})
    ends = np.zeros((team.n, 3)) if body is None else body.attachments
    for i, end in enumerate(ends):
        Tree.SubElement(element, "site", name=f"end_{i}", pos=numbers(end), size="0.005")


def _drone(world: Tree.Element, team: Team, i: int, body: Body) -> None:
    place = {"pos": numbers(body.position), "quat": numbers(body.attitude)}
    element = Tree.SubElement(world, "body", {"name": drone(i), **place})
    Tree.SubElement(element, "freejoint", name=drone(i))
    inertia = {"mass": numbers([team.masses[i]]), "diaginertia": numbers(team.inertias[i])}
    Tree.SubElement(element, "inertial", {"pos": "0 0 0", **inertia})
    arm, disc, places = rotors_of(team, i)
    hull = numbers([0.5 * arm, 0.3 * arm, 0.5 * HEIGHT * arm / ARM])
    Tree.SubElement(element, "geom", type="box", size=hull, rgba=numbers([*COLOURS["hull"], 1.0]))
    for at in places:
        look = {"size": numbers([disc, 0.005]), "rgba": numbers([*COLOURS["rotor"], 0.6])}
        Tree.SubElement(element, "geom", {"type": "cylinder", "pos": numbers(at), **look})
    Tree.SubElement(element, "site", name=drone(i), size="0.005")
