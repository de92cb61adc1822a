"""Write the tables of docs/errata.md, all closed forms: ``python docs/figures/errata.py``."""

import math

import numpy as np
from pages import fill, table

from colift.study import reproduction
from colift.team.geometry import pairwise_angles, ring

WEIGHT = reproduction.WEIGHT


def alignment(mu):
    """The root ``a`` of ``mu a^2 (3 a - 4) = W^2``."""
    roots = np.roots([3 * mu, -4 * mu, 0.0, -(WEIGHT**2)])
    return float(roots[np.abs(roots.imag) < 1e-9].real.max())


def main():
    integrals, rings = [], []
    for mu in reproduction.MUS:
        a = alignment(mu)
        printed, total = reproduction.J_T[mu], 10.0 * WEIGHT / math.sqrt(a / 4)
        integrals.append([f"{mu}", f"{printed}", f"{total:.1f}", f"{printed / total:.3f}"])
        cone = math.acos(math.sqrt(a / 4))
        neighbours = math.degrees(float(pairwise_angles(ring(4, cone)).min()))
        smallest = reproduction.MIN_ANGLE[mu]
        rings.append([f"{mu}", f"{smallest}°", f"{neighbours:.2f}°", f"{math.degrees(cone):.2f}°"])
    header = [r"$\mu$", "printed $J_T$", "hover optimum × 10 s", "printed ÷ optimum"]
    fill("errata.md", "integrals", table(header, integrals))
    header = [r"$\mu$", "printed minimum", "optimal ring, neighbours", "half-cone of that ring"]
    fill("errata.md", "rings", table(header, rings))


if __name__ == "__main__":
    main()
