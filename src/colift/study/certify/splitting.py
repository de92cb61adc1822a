"""Probabilities of rare failures by adaptive multilevel splitting: whoever is far from failing dies, and who is nearer is copied.

Cerou and Guyader, "Adaptive multilevel splitting for rare event analysis", Stoch. Anal. Appl. 25, 2007. A system goes on in blocks, whose
randomness is drawn anew for each. In each turn all particles die whose highest level is no more than that of the lowest one. Each of them becomes a copy of one
that lives, up to the block in which that one was first above the level, and goes on from there on its own. With ties counted as here the estimate has no bias,
for any level function and any number of particles (Brehier, Gazeau, Goudenege, Lelievre and Rousset, "Unbiasedness of some generalized adaptive multilevel
splitting algorithms", Ann. Appl. Probab. 26, 2016, theorem 3.2): the weight times the share of particles that fail is a martingale from turn to turn.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

REACHED = 1.0
"""Level at which a failure begins."""


class System(Protocol):
    """What is split. A state must not change when another goes on from it."""

    blocks: int
    """From begin to end."""

    def begin(self, seed: int) -> Any:
        """A state at the begin."""

    def advance(self, state: Any, seed: int) -> tuple[Any, float]:
        """The state a block later, and the highest level in between; infinite where all is over."""

    def failed(self, state: Any) -> bool:
        """Whether what has ended in this state is a failure."""


class Estimate(NamedTuple):
    """One run: what the probability of a failure is taken to be, blocks that were flown, and turns."""

    probability: float
    blocks: int
    turns: int


@dataclass
class Path:
    """A particle: its states, the first one included, and the highest level up to each block's end."""

    states: list[Any]
    tops: list[float] = field(default_factory=list)
    failed: bool = False

    @property
    def top(self) -> float:
        """Highest level of all."""
        return self.tops[-1]


MOST_TURNS = 100_000
"""Bound on the turns of a run; at 32 particles the weight is below 1e-300 long before."""


def estimate(
    system: System,
    particles: int,
    seed: int,
    told: Callable[[float], None] = lambda _: None,
) -> Estimate:
    """Estimate the probability of a failure once, with 2 particles or more; ``told`` is called with the weight after each turn."""
    random, flown, weight = np.random.default_rng(seed), 0, 1.0

    def drawn() -> int:
        return int(random.integers(2**63))

    def go_on(path: Path) -> None:
        nonlocal flown
        while len(path.tops) < system.blocks and not (path.tops and math.isinf(path.top)):
            state, level = system.advance(path.states[-1], drawn())
            path.states.append(state)
            path.tops.append(max(level, path.tops[-1] if path.tops else -math.inf))
            flown += 1
        path.failed = system.failed(path.states[-1])

    paths = [Path([system.begin(drawn())]) for _ in range(particles)]
    for path in paths:
        go_on(path)
    turn = 0
    for turn in range(MOST_TURNS):  # noqa: B007  how many there were is told
        level = min(path.top for path in paths)
        alive = [path for path in paths if path.top > level]
        if level > REACHED or not alive:
            break
        dead = particles - len(alive)
        weight *= 1.0 - dead / particles
        parents = [alive[k] for k in random.integers(len(alive), size=dead)]
        paths = alive
        for parent in parents:
            at = next(k for k, top in enumerate(parent.tops) if top > level)
            path = Path(parent.states[: at + 2], parent.tops[: at + 1])
            go_on(path)
            paths = [*paths, path]
        told(weight)
    return Estimate(weight * sum(path.failed for path in paths) / particles, flown, turn)
