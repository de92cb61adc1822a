"""Agents with a rigid load on the ground: given what each drone wants, and a network, what they pull; no plant, no feedback."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from colift.control.agents.base import AgentPart
from colift.flight import agents
from colift.kernel.ports import PORTS
from colift.kernel.signals import make_bus
from colift.study.rehearsal import DT
from colift.team import Body, Team
from colift.team.geometry import Array, matrix_of
from colift.team.load import box_inertia, usual_attachments
from colift.world.network.base import NetworkPart

SIZE = np.array([0.6, 0.4, 0.2])
"""Of the box, m."""


class Motion(NamedTuple):
    """What is wanted in each cycle: forces and moments of each drone, whole and steady (rows, n, 3), N, N m; acceleration (rows, 3), m/s^2, attitude (rows, 4)."""

    forces: Array
    steady: Array
    moments: Array
    lasting: Array
    acceleration: Array
    attitude: Array


def team_of(n: int) -> Team:
    """A box of 0.5 kg on its upper edges, drones of 0.5 kg on cables of 1 m."""
    body = Body(box_inertia(0.5, SIZE), usual_attachments(n, SIZE), size=SIZE)
    return replace(Team.uniform(n, load_mass=0.5, mass=0.5), body=body)


def turned(vectors: Array) -> Array:
    """Quaternions (rows, 4) of rotation vectors."""
    angle = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.hstack([np.cos(0.5 * angle), 0.5 * np.sinc(0.5 * angle / np.pi) * vectors])


def wanted(team: Team, rows: int, seed: int, spread: float = 0.0) -> Motion:
    """A circle flown at 2 m/s^2 by a load that leans and turns; what drones have learned differs by this share of the weight."""
    rng, n = np.random.default_rng([seed, team.n]), team.n
    t = np.arange(rows)[:, None] * DT
    ramp = np.clip(t / 2.0, 0.0, 1.0)
    acceleration = 2.0 * ramp * np.hstack([np.cos(2.0 * t), np.sin(2.0 * t), 0.0 * t])
    turn = ramp * np.hstack([0.17 * np.sin(1.3 * t), 0.17 * np.cos(1.1 * t), 0.8 * np.sin(t)])
    weight = team.load_mass * team.gravity
    force = team.load_mass * (acceleration + np.array([0.0, 0.0, team.gravity]))
    moment = 0.05 * ramp * np.hstack([np.sin(t), np.cos(t), np.sin(2.0 * t)])
    steady = force[:, None] + spread * weight * rng.standard_normal((n, 3))
    attitude = turned(turn)
    # As of a centre of mass that is elsewhere.
    own = 0.3 * spread * weight * rng.standard_normal((n, 3))
    lasting = np.array([own @ matrix_of(each).T for each in attitude])
    return Motion(steady, steady, moment[:, None] + lasting, lasting, acceleration, attitude)


def rehearse(
    agent: AgentPart,
    network: NetworkPart,
    team: Team,
    directions: Array,
    what: Motion,
    key: int = 1,
    meddle: Callable[[int, Any, Array], None] | None = None,
) -> tuple[Array, Array]:
    """Pulls ``T alpha`` of all cables (rows, n, 3), N, and status of each drone (rows, n).

    Parameters
    ----------
    agent, network : Part
        The scheme, and what carries its messages.
    team : Team
        With a rigid load, which is turned as is wanted.
    directions : array (n, 3)
        Of the cables at the start, unit vectors drone to load.
    what : Motion
        What is wanted.
    key : int
        Of the network's random numbers.
    meddle : callable, optional
        Called before each cycle with its number, the bus and what the agents remember (n, width), to change what it will.

    """
    bus = make_bus(team.n)
    bus.members[:] = np.arange(team.n)
    bus.desired_directions[:] = directions
    bus.estimated_load[:] = np.nan  # nobody sees how it moves
    signals: dict[str, Any] = bus._asdict()
    found = {"network": (network, signals), "agents": (agent, signals | agents.first_of(signals))}
    wires = {
        name: PORTS[name].wire(
            type(part).kernel, part.params(team), part.memory(team), seen, key=key
        )
        for name, (part, seen) in found.items()
    }
    pulls, status = np.zeros((len(what.forces), team.n, 3)), np.zeros((len(what.forces), team.n))
    for cycle in range(len(pulls)):
        agents.carry(wires["network"], cycle, cycle * DT, DT)
        bus.wishes[:], bus.steady_wishes[:] = what.forces[cycle], what.steady[cycle]
        bus.wished_moments[:], bus.steady_moments[:] = what.moments[cycle], what.lasting[cycle]
        bus.plans[:, 2] = what.acceleration[cycle]
        bus.reference_attitude[:] = bus.estimated_load_attitude[:] = what.attitude[cycle]
        if meddle is not None:
            meddle(cycle, bus, wires["agents"].memory.reshape(team.n, -1))
        for i in range(team.n):
            agents.decide_one(wires["agents"], None, bus, i, cycle, cycle * DT, DT)
        pulls[cycle] = bus.desired_tensions[:, None] * bus.desired_directions
        status[cycle] = bus.agent_status
    return pulls, status


def places(team: Team, attitude: Array) -> Array:
    """Where the cables end from the centre of mass (rows, n, 3), m."""
    return np.asarray(
        np.einsum("kij,nj->kni", np.array([matrix_of(q) for q in attitude]), team.levers)
    )


def missing(team: Team, what: Motion, pulls: Array) -> tuple[Array, Array]:
    """By how much force (N) and moment (N m) miss the mean of the wishes, (rows,)."""
    moments = np.cross(places(team, what.attitude), pulls).sum(axis=1) + what.moments.mean(axis=1)
    forces = pulls.sum(axis=1) + what.forces.mean(axis=1)
    return np.asarray(np.linalg.norm(forces, axis=1)), np.asarray(np.linalg.norm(moments, axis=1))


def distances(team: Team, what: Motion, pulls: Array) -> Array:
    """Least distance between two drones in each row, m."""
    along = pulls / np.maximum(np.linalg.norm(pulls, axis=2), 1e-12)[..., None]
    drones = places(team, what.attitude) - team.cable_lengths[:, None] * along
    i, j = np.triu_indices(team.n, k=1)
    return np.asarray(
        np.linalg.norm(drones[:, i] - drones[:, j], axis=2).min(axis=1, initial=np.inf)
    )
