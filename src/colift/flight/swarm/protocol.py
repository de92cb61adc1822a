"""What goes over UDP on the loopback address; all numbers little-endian.

========= ================ ======= ==============================================================================
from      to               bytes   what
========= ================ ======= ==============================================================================
world     each agent       72      ``CLT1``, number of the cycle (uint64), load's place and velocity as this drone measures them and
                                   the force that it feels all cables do to the load (9 float32), tension and direction of its own
                                   cable (4), 0 (uint64)
agent     each other agent 30      its message, as on the radio (:mod:`colift.control.agents._message`)
agent     world            76      ``CLC1``, the cycle that it answers (uint64), its number, status and whom it hears (uint32 each), tension
                                   and direction (4 float64), wanted force (3 float32), 0 (uint64)
world     each agent       4       ``CLE1``: the end
========= ================ ======= ==============================================================================

Agents learn the ports of all from the command line. The world sends a cycle, an agent that gets it hears what has come in of the
others, decides, speaks to all, then answers. Whoever does not answer pulls no more.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

HOST = "127.0.0.1"
END = b"CLE1"
_TICK = struct.Struct("<4sQ13fQ")
_COMMAND = struct.Struct("<4sQ3I4d3fQ")


class Tick(NamedTuple):
    """What the world tells a drone in a cycle."""

    cycle: int
    load: tuple[float, ...]
    """Place (3) and velocity (3), m, m/s."""
    felt: tuple[float, ...]
    """Force of all cables on the load, N."""
    pull: tuple[float, ...]
    """Tension, N, and direction of its own cable."""


class Command(NamedTuple):
    """What a drone does in a cycle."""

    cycle: int
    number: int
    status: int
    hears: int
    """A bit for each number that was heard in this cycle."""
    tension: float
    direction: tuple[float, ...]
    wish: tuple[float, ...]


def pack_tick(tick: Tick) -> bytes:
    """Bytes of a tick."""
    return _TICK.pack(b"CLT1", tick.cycle, *tick.load, *tick.felt, *tick.pull, 0)


def tick_of(data: bytes) -> Tick | None:
    """The tick in these bytes; none in any others."""
    if len(data) != _TICK.size or data[:4] != b"CLT1":
        return None
    _, cycle, *values, _ = _TICK.unpack(data)
    return Tick(cycle, tuple(values[:6]), tuple(values[6:9]), tuple(values[9:13]))


def pack_command(command: Command) -> bytes:
    """Bytes of a command."""
    return _COMMAND.pack(
        b"CLC1", command.cycle, command.number, command.status, command.hears,
        command.tension, *command.direction, *command.wish, 0,
    )  # fmt: skip


def command_of(data: bytes) -> Command | None:
    """The command in these bytes; none in any others."""
    if len(data) != _COMMAND.size or data[:4] != b"CLC1":
        return None
    _, cycle, number, status, hears, tension, *values, _ = _COMMAND.unpack(data)
    return Command(cycle, number, status, hears, tension, tuple(values[:3]), tuple(values[3:6]))
