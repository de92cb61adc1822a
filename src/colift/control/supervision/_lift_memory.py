"""What a lift is told and remembers, and how it goes from one phase to the next."""

from __future__ import annotations

from colift.kernel.jit import inline
from colift.kernel.layout import Layout
from colift.kernel.phase import Phase

MOST_ROUNDS = 8
"""Most places where a load is set down in one flight."""
TRIES = 3.0
"""Setbacks after which a load is not hooked anew."""

PARAMS = Layout(
    team={
        "g": 1, "m_L": 1, "feel": 1, "learn": 1, "delay": 1, "lag": 1, "fly": 1, "rounds": 1,
        "aside": 1, "places": 2 * MOST_ROUNDS, "speed": 1, "touch": 1, "release": 1, "ground": 1,
        "sole": 1, "hook": 1, "climb": 1, "margin": 1, "rise": 1, "stiff": 1, "damp": 1, "clear": 1,
        "catch": 1, "patience": 1, "brake": 1, "fade": 1,
    },
    drone={"m": 1, "L": 1, "drag": 1},
)  # fmt: skip
"""``feel``: bandwidth of the observers, ``learn``: with which what they feel is made up for, 1/s; ``rounds``: how often the load is
lifted, ``fly``: time of the reference in each, s; ``aside``: whether it is set down at ``places``; speeds of the way (``speed``), of ``touch``-down and to ``hook``, m/s; time to ``climb``, s; ``sole``: height of
the load's place above the ground when it stands, m; ``margin``: height
from which on it goes down at the speed of touch-down, m; time in which the lift share would ``rise`` by 1, s; how a lifted load is held,
as accelerations of the load by the lift share: per height (``stiff``) and speed (``damp``); height
above the ground at which the reference begins at least (``clear``), m; speed at which a cable comes taut (``catch``), m/s; time after which
a phase on the ground that does not end is given up (``patience``), s; acceleration of the drones towards a load that has touched (``brake``), m/s^2, and the time constant of their
speed afterwards (``fade``), s."""
MEMORY = Layout(
    team={
        "started": 1, "phase": 1, "since": 1, "clock": 1, "place": 3, "ground": 1, "begin": 3,
        "goal": 3, "way": 1, "stage": 1, "share": 1, "rising": 1, "held": 3, "weighed": 1,
        "momentum": 1, "normal": 1, "normal_mean": 1, "normal_spread": 1, "signed": 1, "slow": 1,
        "count": 1, "pull": 3, "round": 1, "top": 1, "above": 1, "air": 3, "calm": 3, "again": 1,
        "setbacks": 1,
    },
    drone={
        "own": 3, "felt": 3, "thrust": 1, "bias": 3, "start": 3, "span": 3, "want": 1, "mean": 3,
        "spread": 1, "sign": 1, "hooked": 1, "length": 1, "down": 1, "out": 1,
    },
)  # fmt: skip
"""Of the team: ``phase``, ``since`` when; the ``round``, from 0; the ``clock``; ``place`` of the load on the ``ground``; the load's way from ``begin`` to ``goal``, its
time ``way`` and ``stage``; lift ``share``; force ``held`` on the load and ``weighed`` mass; height ``top`` at which it counted as lifted;
by how much the reference is flown ``above`` itself; observer of the vertical
``momentum`` and the ``normal`` force that it finds, mean and mean square of its noise; time for which a sign lasts (``signed``) and of
a ``slow`` descent; force per mass that all drones feel, now (``air``) and when they felt what is their mean (``calm``); whether the load is to
be hooked ``again``, and how often something went otherwise than planned (``setbacks``).
Of a drone: ``own`` momentum as far as explained and the force ``felt``; ``bias`` made up for; where it ``start``ed; ``span`` with derivatives
and the rate that it ``want``s; ``length`` of its cable as measured, less what is wound out, how far ``out`` that ends on the load; ``mean`` force, while slack or in flight, without its cable's."""
P, M = PARAMS.at, MEMORY.at

FLY, STAND, CLIMB, HOOK, TENSION, RISE = (
    float(Phase.FLY), float(Phase.STAND), float(Phase.CLIMB), float(Phase.HOOK),
    float(Phase.TENSION), float(Phase.RISE),
)  # fmt: skip
LOWER, TOUCH, UNLOAD, SLACKEN, RELEASE, LAND, DONE = (
    float(Phase.LOWER), float(Phase.TOUCH), float(Phase.UNLOAD), float(Phase.SLACKEN),
    float(Phase.RELEASE), float(Phase.LAND), float(Phase.DONE),
)  # fmt: skip


@inline
def go(memory, number, time):  # type: ignore[no-untyped-def]
    memory[M.phase] = number
    memory[M.since] = time
    memory[M.stage] = memory[M.signed] = memory[M.slow] = memory[M.count] = 0.0
    for k in range(3):
        memory[M.pull + k] = 0.0


@inline
def begin_to_hook(n, time, memory):  # type: ignore[no-untyped-def]
    go(memory, HOOK, time)
    memory[M.share] = memory[M.again] = 0.0
    for k in range(3):
        memory[M.held + k] = memory[M.calm + k] = 0.0
    for i in range(n):
        o = M.rows + M.width * i
        memory[o + M.hooked] = memory[o + M.sign] = memory[o + M.spread] = memory[o + M.want] = 0.0
        for k in range(3):
            memory[o + M.mean + k] = 0.0


@inline
def give_up(time, params, memory):  # type: ignore[no-untyped-def]
    """Slacken the cables of a load that cannot be lifted, for good."""
    memory[M.round] = params[P.rounds]
    memory[M.setbacks] += 1.0
    memory[M.again] = 0.0
    go(memory, UNLOAD, time)
    memory[M.rising] = memory[M.share]


@inline
def try_again(time, params, memory):  # type: ignore[no-untyped-def]
    """Slacken the cables and hook them anew, or give up after :data:`TRIES` times."""
    if memory[M.setbacks] >= TRIES:
        give_up(time, params, memory)
        return
    go(memory, UNLOAD, time)
    memory[M.rising] = memory[M.share]
    memory[M.setbacks] += 1.0
    memory[M.again] = 1.0
