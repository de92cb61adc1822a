"""The load's model: where the cables end on it. All else asks for these ends.

A load that is a point has one place for all of them, so they are equal rows.
"""

from __future__ import annotations

from colift.kernel.jit import inline


@inline
def ends_of(load, ends):  # type: ignore[no-untyped-def]
    """Fill ``ends`` (n, K, 3): places where the cables end and K - 1 derivatives, from those of the load (K or more, 3)."""
    for m in range(ends.shape[1]):
        x, y, z = load[m, 0], load[m, 1], load[m, 2]
        for i in range(ends.shape[0]):
            ends[i, m, 0], ends[i, m, 1], ends[i, m, 2] = x, y, z
