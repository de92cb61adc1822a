"""Agents on the ground: given what each drone wants and knows, and a network, what they decide; no plant, no feedback.

A drone flies what it decides at once. So errors of the force are the scheme's alone, and millions of cycles are tried in minutes.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from colift.control.agents.base import AgentPart
from colift.control.agents.leaderless import MEMORY
from colift.control.allocation.base import AllocatorPart
from colift.control.allocation.limits.feasibility import widest_formation
from colift.control.allocation.safe import Safe
from colift.flight import agents
from colift.kernel.by_reference import named_signals, signals_type
from colift.kernel.jit import f8, i8, kernel, matrix, tensor, void
from colift.kernel.ports import PORTS, type_of
from colift.kernel.signals import make_bus
from colift.team import Team
from colift.team.geometry import Array, pairwise_angles, ring
from colift.team.scaling import scaled_load
from colift.world.link.base import LinkPart
from colift.world.network.base import NetworkPart

DT = 0.01
"""Cycle, s."""
RUNS, RESTARTS, STALLS = 0.0, 1.0, 2.0
"""What happens to an agent in a cycle: it decides; it forgets everything before; it neither decides nor speaks."""
Desk = named_signals("Desk", agents.SIGNALS, __name__)
Table = named_signals(
    "Table", ("force", "reference", "received_tensions", "received_directions"), __name__
)
_allocate, _transmit = PORTS["allocation"].invoke, PORTS["link"].invoke
SESSION = MEMORY.at.session
PULL, STATUS, WIDTH = 0, 4, 5
"""Of a drone's row of the outcome: tension and direction, status."""


@kernel(
    void(
        i8, f8, PORTS["network"].type, PORTS["agents"].type, PORTS["allocation"].type,
        signals_type(Desk, [type_of(name) for name in agents.SIGNALS]),
        tensor, tensor, tensor, matrix, tensor,
    ),
    counted=False,
)  # fmt: skip
def _rehearse(first, dt, network, agent, allocation, bus, wishes, steady, plans, events, out):  # type: ignore[no-untyped-def]
    n = bus.members.shape[0]
    width = agent.memory.shape[0] // n
    for row in range(wishes.shape[0]):
        cycle = first + row
        agents.carry(network, cycle, cycle * dt, dt)
        for k in range(3):
            bus.reference[2, k] = plans[row, 0, k]
        for i in range(n):
            for k in range(3):
                bus.wishes[i, k] = wishes[row, i, k]
                bus.steady_wishes[i, k] = steady[row, i, k]
                bus.plans[i, 2, k] = plans[row, i, k]
            if events[row, i] == RESTARTS and width > SESSION:
                session = agent.memory[width * i + SESSION]
                for m in range(width):
                    agent.memory[width * i + m] = 0.0
                agent.memory[width * i + SESSION] = session % 15.0 + 1.0
            if events[row, i] != STALLS:
                agents.decide_one(agent, allocation, bus, i, cycle, cycle * dt, dt)
            out[row, i, PULL] = bus.desired_tensions[i]
            out[row, i, STATUS] = bus.agent_status[i]
            for k in range(3):
                out[row, i, PULL + 1 + k] = bus.desired_directions[i, k]


@kernel(
    void(
        i8, f8, PORTS["allocation"].type, PORTS["link"].type,
        signals_type(Table, [type_of(name) for name in Table._fields]), matrix, matrix, tensor,
    ),
    counted=False,
)  # fmt: skip
def _command(first, dt, allocation, link, bus, forces, plans, out):  # type: ignore[no-untyped-def]
    for row in range(forces.shape[0]):
        cycle = first + row
        for k in range(3):
            bus.reference[2, k] = plans[row, k]
            bus.force[k] = forces[row, k]
        _allocate(allocation, cycle, cycle * dt, dt)
        _transmit(link, cycle, cycle * dt, dt)
        for i in range(bus.received_tensions.shape[0]):
            out[row, i, PULL] = bus.received_tensions[i]
            for k in range(3):
                out[row, i, PULL + 1 + k] = bus.received_directions[i, k]


class Asked(NamedTuple):
    """What drones want in each cycle, (rows, n, 3): force and its steady part, N, planned acceleration, m/s^2; and what happens, (rows, n)."""

    wishes: Array
    steady: Array
    plans: Array
    events: Array


class Rehearsal:
    """A team of agents on a network, from a wide formation on.

    Parameters
    ----------
    agent, network, allocation : Part
        The scheme, what carries its messages, and whom it asks for the formation.
    team : Team
        See :func:`team_of`.
    directions : array (n, 3)
        Of the cables at the start, unit vectors drone to load.
    key : int
        Of the network's random numbers.
    clock_errors : array (n,), optional
        Cycles by which clocks are ahead.

    """

    def __init__(
        self,
        agent: AgentPart,
        network: NetworkPart,
        team: Team,
        directions: Array,
        *,
        allocation: AllocatorPart | None = None,
        key: int = 1,
        clock_errors: Array | None = None,
    ) -> None:
        allocation = allocation or Safe()
        self.team, self.cycle = team, 0
        bus = make_bus(team.n)
        bus.members[:] = np.arange(team.n)
        bus.desired_directions[:] = directions
        bus.estimated_load[:] = np.nan  # there is none
        if clock_errors is not None:
            bus.clock_errors[:] = clock_errors
        signals: dict[str, Any] = bus._asdict()
        of_one = signals | agents.first_of(signals)
        parts = {
            "network": (network, signals),
            "agents": (agent, of_one),
            "allocation": (allocation, signals),
        }
        self._wires = []
        for name, (part, found) in parts.items():
            memory = np.tile(part.memory(team), team.n if name == "allocation" else 1)
            wire = PORTS[name].wire(type(part).kernel, part.params(team), memory, found, key=key)
            self._wires.append(wire.compiled())
        # Compiled wires hold addresses only.
        self._kernels = [type(part).kernel for part, _ in parts.values()]
        self._desk = Desk(*(signals[name] for name in agents.SIGNALS))

    @property
    def memory(self) -> Array:
        """What the agents remember, (n, width)."""
        found: Array = self._wires[1].memory.reshape(self.team.n, -1)
        return found

    def run(self, asked: Asked) -> Array:
        """What each drone decides in each cycle, (rows, n, 5); see :data:`PULL`."""
        out = np.zeros((len(asked.wishes), self.team.n, WIDTH))
        network, agent, allocation = self._wires
        _rehearse(self.cycle, DT, network, agent, allocation, self._desk, *asked, out)
        self.cycle += len(out)
        return out


def commanded(
    link: LinkPart,
    team: Team,
    directions: Array,
    asked: Asked,
    *,
    allocation: AllocatorPart | None = None,
    key: int = 1,
) -> Array:
    """What drones fly that one allocator tells over a radio: as :meth:`Rehearsal.run`, for the mean of their wishes."""
    allocation = allocation or Safe()
    bus = make_bus(team.n)
    bus.desired_directions[:] = bus.received_directions[:] = directions
    signals: dict[str, Any] = bus._asdict()
    wires = [
        PORTS[part.layer]
        .wire(type(part).kernel, part.params(team), part.memory(team), signals, key=key)
        .compiled()
        for part in (allocation, link)
    ]
    out = np.zeros((len(asked.wishes), team.n, WIDTH))
    plans = np.ascontiguousarray(asked.plans[:, 0])
    table = Table(*(signals[name] for name in Table._fields))
    allocate, transmit = wires
    _command(0, DT, allocate, transmit, table, asked.wishes.mean(axis=1), plans, out)
    return out


def team_of(n: int) -> Team:
    """The paper's drones with a load that grows with their number."""
    return Team.uniform(n, load_mass=scaled_load(n))


def formation_of(n: int, least_deg: float = 36.0) -> Array:
    """A formation (n, 3) whose cables are that far apart: the ring of 35 degrees or what is wide enough."""
    start = ring(n, np.radians(35.0))
    if np.degrees(pairwise_angles(start).min(initial=np.pi)) >= least_deg:
        return start
    return widest_formation(n, np.radians(70.0))[0]


def force_error(asked: Asked, out: Array) -> Array:
    """By how much the sum of the pulls misses the mean of the wishes, (rows,), N."""
    pulls = out[:, :, PULL, None] * out[:, :, PULL + 1 : STATUS]
    return np.asarray(np.linalg.norm(pulls.sum(axis=1) + asked.wishes.mean(axis=1), axis=1))


def least_angles(directions: Array) -> Array:
    """Least angle between two cables in each row of (rows, n, 3), rad; exact for small ones too."""
    n = directions.shape[1]
    i, j = np.triu_indices(n, k=1)
    a, b = directions[:, i], directions[:, j]
    chord = np.linalg.norm(a - b, axis=-1)
    return np.asarray((2.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0))).min(axis=1))
