"""Draw the flat family of optima: ``python docs/figures/flat_family.py`` writes two SVG files here.

n = 4, hover of the paper's load (W = 2.207 N). Along a closed-form path of global optima the objective
stays the same to the last digits, while the smallest angle between two cables falls from the regular
ring's to zero (mu = 0.15) or to ``arccos(a - 1)``. Every point that is drawn is checked.
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib import pyplot as plt

from colift.control.allocation.sqp import Sqp
from colift.team.geometry import pairwise_angles

WEIGHT = 0.225 * 9.81
MUS = (0.15, 0.75, 1.35)


def alignment(mu, force, n=4):
    """The root ``a`` of ``mu a^2 (3 a - n) = force^2``; at most n."""
    roots = np.roots([3 * mu, -n * mu, 0.0, -(force**2)])
    return min(n, float(roots[np.abs(roots.imag) < 1e-9].real.max()))


def member(y1, a):
    """Directions (4, 3) of the optimum in which cables 1 and 2 are ``2 arcsin(y1)`` apart.

    Cables ``(x1, +-y1, -z1)`` and ``(-x2, +-y2, -z2)``. ``M = diag(b, b, a)`` asks for y1^2 + y2^2 = b/2
    and for a triangle with sides 1 - y1^2, 1 - y2^2 and (a - b)/2, whose angles are twice the tilts.
    """
    b = 0.5 * (4 - a)
    y2 = np.sqrt(0.5 * b - y1**2)
    r1, r2, base = 1 - y1**2, 1 - y2**2, 0.5 * (a - b)
    tilt1 = 0.5 * np.arccos(np.clip((r1**2 + base**2 - r2**2) / (2 * r1 * base), -1, 1))
    tilt2 = 0.5 * np.arccos(np.clip((r2**2 + base**2 - r1**2) / (2 * r2 * base), -1, 1))
    x1, z1 = np.sqrt(r1) * np.sin(tilt1), np.sqrt(r1) * np.cos(tilt1)
    x2, z2 = np.sqrt(r2) * np.sin(tilt2), np.sqrt(r2) * np.cos(tilt2)
    return np.array([[x1, y1, -z1], [x1, -y1, -z1], [-x2, y2, -z2], [-x2, -y2, -z2]])


def family(mu, count=400):
    """Path from the ring to its end: share of the way, directions, tensions, objectives."""
    a = alignment(mu, WEIGHT)
    ring, end = np.sqrt((4 - a) / 8), np.sqrt(max(0.0, 1 - a / 2))
    share = np.linspace(0, 1, count)
    directions = np.array([member(y1, a) for y1 in ring + share * (end - ring)])
    tensions = -WEIGHT / a * directions[:, :, 2]
    cost = Sqp(mu=mu).objective
    objective = np.array([cost(T, alpha) for T, alpha in zip(tensions, directions, strict=True)])
    balance = np.einsum("kn,knj->kj", tensions, directions) + np.array([0, 0, WEIGHT])
    assert np.abs(balance).max() < 1e-12
    assert tensions.min() > -1e-12
    assert np.abs(np.linalg.norm(directions, axis=2) - 1).max() < 1e-12
    assert np.ptp(objective) < 1e-13
    b = 0.5 * (4 - a)
    best = WEIGHT**2 / (2 * a) + 0.5 * mu * (a**2 + 2 * b**2 - 4)
    assert np.abs(objective - best).max() < 1e-13
    return share, directions, tensions, objective


def draw(ink, path):
    mpl.rcParams.update(
        {
            "svg.hashsalt": "colift", "svg.fonttype": "path", "font.size": 9, "text.color": ink,
            "axes.edgecolor": ink, "axes.labelcolor": ink, "xtick.color": ink, "ytick.color": ink,
            "axes.spines.top": False, "axes.spines.right": False,
        }
    )  # fmt: skip
    figure = plt.figure(figsize=(8.4, 5.6), layout="constrained")
    grid = figure.add_gridspec(2, 6, height_ratios=[1.25, 1.0])
    angle, tension = figure.add_subplot(grid[0, :3]), figure.add_subplot(grid[0, 3:])
    colours = ("#3b82c4", "#d9822b", "#3a9d6b")
    for mu, colour in zip(MUS, colours, strict=True):
        share, directions, tensions, objective = family(mu)
        smallest = np.degrees(pairwise_angles(directions).min(axis=1))
        label = f"μ = {mu}: J = {objective[0]:.4f} N² ± {0.5 * np.ptp(objective):.0e}"
        angle.plot(share, smallest, color=colour, label=label)
        tension.plot(share, tensions[:, 0], color=colour, label=f"μ = {mu}, cables 1 and 2")
        tension.plot(share, tensions[:, 2], color=colour, ls="--", label="cables 3 and 4")
    angle.set(xlabel="way along the family", ylabel="smallest angle, deg", ylim=(-1, 84))
    angle.legend(fontsize=7.5, frameon=False, loc="upper right")
    angle.set_title("Smallest angle between two cables", fontsize=9)
    tension.set(xlabel="way along the family", ylabel="tension, N", ylim=(-0.03, 1.75))
    tension.set_title("Tensions", fontsize=9)
    tension.legend(fontsize=7.5, frameon=False, ncols=2, loc="upper left")
    _, directions, _, _ = family(0.15)
    for k, (at, title) in enumerate(
        ((0, "regular ring"), (300, "on the way"), (399, "coincident"))
    ):
        top = figure.add_subplot(grid[1, 2 * k : 2 * k + 2], aspect="equal")
        drones = -directions[at][:, :2]
        for i, (x, y) in enumerate(drones):
            top.plot([0, x], [0, y], color=ink, lw=0.8)
            top.plot(x, y, "o", color=colours[0] if i < 2 else ink, ms=7, alpha=0.8)
        top.plot(0, 0, "s", color=ink, ms=6)
        smallest = np.degrees(pairwise_angles(directions[at]).min())
        top.set_title(f"μ = 0.15, {title}: {smallest:.1f}°", fontsize=9)
        top.set(xlim=(-0.8, 0.8), ylim=(-0.66, 0.66), xticks=[], yticks=[])
        top.set_xlabel("seen from above", fontsize=8)
    figure.savefig(path, transparent=True, metadata={"Date": None})
    plt.close(figure)


if __name__ == "__main__":
    here = Path(__file__).parent
    draw("#222222", here / "flat_family_light.svg")
    draw("#dddddd", here / "flat_family_dark.svg")
    for mu in MUS:
        _, directions, tensions, objective = family(mu)
        angles = np.degrees(pairwise_angles(directions).min(axis=1))
        print(
            f"mu = {mu:<4}  smallest angle {angles[0]:.2f} -> {angles[-1]:.2f} deg, "
            f"tensions {tensions[-1].min():.3f} to {tensions[-1].max():.3f} N at the end, "
            f"J = {objective[0]:.6f} N^2, spread {np.ptp(objective):.0e}"
        )
