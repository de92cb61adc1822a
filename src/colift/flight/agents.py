"""One cycle of a team without a leader: messages are carried, then each drone's agent decides.

An agent's kernel is called for one drone, with that drone's rows of the bus. Nothing of it runs in a flight whose allocator
decides for all.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

from numba.extending import register_jitable

from colift.kernel.ports import PORTS, Wire

Sees, Writes = PORTS["agents"].Sees, PORTS["agents"].Writes
Asked, Answers = PORTS["allocation"].Sees, PORTS["allocation"].Writes
Viewed, Wishes = PORTS["load_control"].Sees, PORTS["load_control"].Writes
_agree, carry, _plan, _control = (
    PORTS[name].invoke for name in ("agents", "network", "allocation", "load_control")
)

CENTRAL, TOLD, ALONE = 0, 1, 2
"""Who decides: one allocator; each drone, told who carries; each drone, which knows that of itself only."""

SIGNALS = (
    "force", "steady_force", "reference", "load_views", "viewed_load", "viewed_forces", "wishes", "steady_wishes", "plans", "felt_forces", "clock_errors", "members", "inboxes", "heard", "carrying", "evidences", "desired_tensions",
    "desired_directions", "outboxes", "views", "estimated_load", "agreed_forces", "asking", "asked_forces", "team_tensions", "team_directions",
    "agent_status", "received_tensions", "received_directions", "moment", "steady_moment", "wished_moments", "steady_moments",
    "reference_attitude", "estimated_load_attitude", "formation",
)  # fmt: skip
"""What a cycle takes and gives of the bus, beside what the network does."""


@register_jitable
def rows_of(bus, i):  # type: ignore[no-untyped-def]
    """What drone i sees and what it writes."""
    sees = Sees(
        bus.wishes[i], bus.steady_wishes[i], bus.wished_moments[i], bus.steady_moments[i], bus.plans[i], bus.reference_attitude,
        bus.estimated_load_attitude, bus.formation, bus.members[i : i + 1], bus.members, bus.inboxes[i], bus.heard[i],
        bus.evidences[i], bus.felt_forces[i], bus.estimated_load[1],
    )  # fmt: skip
    writes = Writes(
        bus.desired_tensions[i : i + 1], bus.desired_directions[i], bus.outboxes[i], bus.views[i],
        bus.asking[i : i + 1], bus.agreed_forces[i], bus.asked_forces[i], bus.team_tensions[i], bus.team_directions[i],
    )  # fmt: skip
    return sees, writes


@register_jitable
def wish(control, bus, step, time, dt):  # type: ignore[no-untyped-def]
    """Let each drone's load controller decide what it wants, from its own view of the load; force and moment of the bus are the means."""
    n, sees = bus.members.shape[0], control.sees
    width = control.memory.shape[0] // n
    for i in range(n):
        for k in range(3):
            bus.wishes[i, k], bus.steady_wishes[i, k] = bus.force[k], bus.steady_force[k]
            bus.wished_moments[i, k] = bus.moment[k]
            bus.steady_moments[i, k] = bus.steady_moment[k]
            bus.viewed_load[0, k] = sees.estimated_load[0, k] + bus.load_views[i, 0, k]
            bus.viewed_load[1, k] = sees.estimated_load[1, k]
            for m in range(n + 1):
                bus.viewed_forces[m, k] = sees.estimated_forces[m, k]
            bus.viewed_forces[n, k] += bus.load_views[i, 1, k]
            for m in range(4):
                bus.plans[i, m, k] = sees.reference[m, k]
        viewed = Viewed(
            bus.viewed_load, sees.estimated_load_attitude, sees.estimated_load_rates, sees.reference,
            sees.reference_attitude, sees.reference_rates, bus.viewed_forces, sees.standing,
            bus.agreed_forces[i],
        )  # fmt: skip
        wishes = Wishes(
            bus.wishes[i], bus.wished_moments[i], control.writes.learned_load, bus.steady_wishes[i],
            bus.steady_moments[i],
        )  # fmt: skip
        own = control.memory[width * i : width * (i + 1)]
        _control(
            Wire(control.kernel, control.key, control.params, own, viewed, wishes), step, time, dt
        )
    for k in range(3):
        force = steady = moment = lasting = 0.0
        for i in range(n):
            force += bus.wishes[i, k] / n
            steady += bus.steady_wishes[i, k] / n
            moment += bus.wished_moments[i, k] / n
            lasting += bus.steady_moments[i, k] / n
        bus.force[k], bus.steady_force[k] = force, steady
        bus.moment[k], bus.steady_moment[k] = moment, lasting


@register_jitable
def ask_for(allocation, bus, i, cycle, time, dt):  # type: ignore[no-untyped-def]
    """Let the allocator answer drone i's question, with a memory that is this drone's alone."""
    width = allocation.memory.shape[0] // bus.members.shape[0]
    own = allocation.memory[width * i : width * (i + 1)]
    sees = allocation.sees
    asked = Asked(
        bus.asked_forces[i], sees.moment, sees.reference, sees.reference_attitude, sees.reference_rates,
        sees.estimated_load_attitude, sees.nominal_forces, sees.formation,
    )  # fmt: skip
    answers = Answers(
        bus.team_tensions[i], bus.team_directions[i], allocation.writes.allocator_info
    )
    wire = Wire(allocation.kernel, allocation.key, allocation.params, own, asked, answers)
    return _plan(wire, cycle, time, dt)


@register_jitable
def decide_one(agents, allocation, bus, i, cycle, time, dt):  # type: ignore[no-untyped-def]
    """Let drone i decide by its own clock, and ask the allocator what it wants to know."""
    width = agents.memory.shape[0] // bus.members.shape[0]
    sees, writes = rows_of(bus, i)
    own = agents.memory[width * i : width * (i + 1)]
    wire = Wire(agents.kernel, agents.key, agents.params, own, sees, writes)
    ahead = int(bus.clock_errors[i])
    bus.agent_status[i] = _agree(wire, cycle + ahead, time + ahead * dt, dt)
    if bus.asking[i] != 0.0:
        ask_for(allocation, bus, i, cycle, time, bus.asking[i])
    bus.received_tensions[i] = bus.desired_tensions[i]
    for k in range(3):
        bus.received_directions[i, k] = bus.desired_directions[i, k]


@register_jitable
def decide(network, agents, allocation, bus, leaderless, cycle, time, dt):  # type: ignore[no-untyped-def]
    """Carry what the drones said in the last cycle; let each decide and fly what it decides at once.

    Who carries is told to all, or, where ``leaderless`` is :data:`ALONE`, each knows it of itself.
    """
    carry(network, cycle, time, dt)
    n = bus.members.shape[0]
    for i in range(n):
        for j in range(n):
            told = i == j or leaderless != ALONE
            bus.evidences[i, j] = bus.carrying[j] if told else 1.0
        decide_one(agents, allocation, bus, i, cycle, time, dt)


@register_jitable
def has_left(bus, leaderless, j):  # type: ignore[no-untyped-def]
    """Whether drone j carries no more, and all that do know it."""
    if bus.carrying[j] != 0.0:
        return False
    for i in range(bus.carrying.shape[0]):
        if leaderless == ALONE and bus.carrying[i] != 0.0 and bus.views[i, j] != 0.0:
            return False
    return True


def first_of(signals: dict[str, Any]) -> dict[str, Any]:
    """By name what the first drone's agent sees and writes: how the layer is wired until a cycle puts in another's."""
    sees, writes = rows_of(SimpleNamespace(**signals), 0)
    return {**sees._asdict(), **writes._asdict()}
