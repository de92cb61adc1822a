"""The same task for another number of drones: each cable bears what it bore before.

The optimal cone of the paper's objective follows from ``mu n^3 / F^2`` (n cables, F the force on the load). When load and team
grow together, F as n, it is kept by ``mu`` as 1/n.
"""

from __future__ import annotations

from typing import Literal

PAPER_DRONES = 4
PAPER_LOAD = 0.225
"""Of the paper's team: drones, and mass of their load, kg."""
PAPER_MU = 0.15
"""Weight of its alignment penalty, N^2."""

Kept = Literal["cone", "mu over squared weight"]


def scaled_load(n: int, load_mass: float = PAPER_LOAD, of: int = PAPER_DRONES) -> float:
    """Mass of the load, kg, with which each of n cables bears what each ``of`` so many bears of ``load_mass``."""
    return load_mass * n / of


def scaled_mu(
    n: int, mu: float = PAPER_MU, of: int = PAPER_DRONES, *, keep: Kept = "cone"
) -> float:
    """Weight of the alignment penalty, N^2, for n cables with a load as of :func:`scaled_load`.

    It keeps the optimal cone of ``of`` so many cables with ``mu``; or, on demand, its ratio to the squared weight of the load,
    which opens the cone as cables become more.
    """
    return mu * of / n if keep == "cone" else mu * (n / of) ** 2
