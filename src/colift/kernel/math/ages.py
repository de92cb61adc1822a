"""Ages of samples and messages, s: whether there is a new one."""

from __future__ import annotations

from colift.kernel.jit import inline

TICK = 5e-6
"""Two samples are taken farther apart than this, s: half of the shortest physics step."""


@inline
def newer(memory, at, age, dt):  # type: ignore[no-untyped-def]
    """Whether what is ``age`` old is newer than what ``memory[at]`` has the age of, as it was ``dt`` ago; that is brought up to now.

    Who takes what is newer keeps its age there.
    """
    memory[at] += dt
    return age < memory[at] - TICK
