"""How soon an overloaded team gives all it can (docs/theory/safe.md): ``python docs/figures/overload.py [--fly]``.

From ``overload.json`` beside this file. With ``--fly`` it is measured first, some minutes. From hover the wanted force jumps
to 1.2 times what the cables can give, stays there for ten seconds, and comes back. Either a force in a random direction is
added to the weight, or the whole force points there, from hover and from an overload straight up. Half of the directions
are level, those of the other half lie anywhere above.
"""

import numpy as np
from pages import fill, stored, table

from colift.control.allocation.base import INFO_SIZE, Status
from colift.study import safety
from colift.team.geometry import pairwise_angles

SIZES = (2, 3, 4, 5, 6, 7, 8, 10, 12, 16, 20, 24)
DIRECTIONS = 20
"""Random ones for each team; a level one along each axis besides."""
SEED = 2711
BEYOND = 1.2
CYCLES = 1000
"""Of 10 ms, for which an overload lasts."""
SHARE = 0.01
"""Distance from the final force at which it counts as given."""
KINDS = {
    "level": "level, added to the weight",
    "mixed": "upwards and level, added",
    "whole": "the whole force",
    "after": "the same after an overload upwards",
}
TOLD = (int(Status.FORCE_REDUCED), int(Status.RECOVERING))


class Watched:
    """The allocator of ``colift safety`` for n drones, settled in hover; every answer is judged."""

    def __init__(self, n):
        team, self.safe = safety.problem(n)
        self.team, self.n = team, n
        self.weight = np.array([0.0, 0.0, team.load_mass * team.gravity])
        self.params = self.safe.params(team)
        self.broken, self.untold = -np.inf, 0

    def hover(self):
        cone, least = safety.CONES.get(self.n, 70.0), self.safe.min_angle_deg + 1.0
        start = safety.spread_formation(self.n, np.radians(cone), np.radians(least))
        self.memory, self.tensions = self.safe.memory(self.team), np.zeros(self.n)
        self.directions, self.info = np.ascontiguousarray(start), np.zeros(INFO_SIZE)
        self.given(self.weight, 200)

    def given(self, force, cycles):
        """Forces that the cables give (k, 3), N, while one is wanted, and what is missing (k,)."""
        return self.follow(np.tile(force, (cycles, 1)))

    def follow(self, wanted):
        n, out = self.n, np.zeros((len(wanted), 2 + 4 * self.n))
        first = self.directions.copy()
        safety._attack(
            type(self.safe).kernel, wanted, np.zeros_like(wanted), safety.PERIOD, self.params, self.memory,
            self.tensions, self.directions, self.info, out,
        )  # fmt: skip
        T, alpha = out[:, 2 : 2 + n], out[:, 2 + n :].reshape(-1, n, 3)
        given = -np.einsum("ki,kim->km", T, alpha)
        missing = np.linalg.norm(given - wanted, axis=1)
        chord = np.linalg.norm(alpha - np.concatenate([first[None], alpha[:-1]]), axis=2).max()
        safe = self.safe
        excess = (
            T.max() - safe.tension_max,
            safe.tension_min - T.min(),
            np.arccos(np.clip(-alpha[..., 2], -1.0, 1.0)).max() - np.radians(safe.max_cone_deg),
            np.radians(safe.min_angle_deg) - pairwise_angles(alpha).min(),
            2.0 * np.arcsin(min(0.5 * chord, 1.0)) - safe.max_rate * safety.PERIOD,
        )
        self.broken = max(self.broken, *map(float, excess))
        told = np.isin(out[:, 0], TOLD)
        self.untold += int(np.sum((missing > safety.BALANCE_TOLERANCE) & ~told))
        return given, missing


def settling(forces):
    """Cycles after which all forces are within 1 % of the last."""
    far = np.linalg.norm(forces - forces[-1], axis=1) > SHARE * np.linalg.norm(forces[-1])
    return int(np.flatnonzero(far)[-1]) + 2 if far.any() else 1


def directions(rng):
    """Unit vectors (k, 3): level along both axes, then alternately level and anywhere above."""
    turn = rng.uniform(0.0, 2.0 * np.pi, DIRECTIONS)
    rise = np.where(np.arange(DIRECTIONS) % 2 == 0, 0.0, rng.uniform(0.0, 0.5 * np.pi, DIRECTIONS))
    found = np.column_stack(
        [np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)]
    )
    return np.vstack([np.eye(3)[:2], found])


def measure(n, rng):
    """Cycles to settle of every kind and to balance hover again; the worst excess, and what was not told."""
    watched = Watched(n)
    found = {kind: [] for kind in KINDS} | {"back": []}
    up = 10.0 * n * np.array([0.0, 0.0, 1.0])
    for unit in directions(rng):
        # The most that can be added while the weight is held: asked for slowly.
        slow = np.linspace(0.0, 1.05 * n * watched.safe.tension_max, 1500)
        watched.hover()
        _, missing = watched.follow(watched.weight + slow[:, None] * unit)
        most = slow[np.flatnonzero(missing < safety.BALANCE_TOLERANCE)[-1]]
        watched.hover()
        forces, _ = watched.given(watched.weight + BEYOND * most * unit, CYCLES)
        found["level" if unit[2] == 0.0 else "mixed"].append(settling(forces))
        _, missing = watched.given(watched.weight, 200)
        found["back"].append(
            int(np.flatnonzero(np.append(True, missing > safety.BALANCE_TOLERANCE))[-1]) + 1
        )
        watched.hover()
        wanted = BEYOND * np.linalg.norm(watched.given(10.0 * n * unit, CYCLES)[0][-1]) * unit
        for kind, before in (("whole", watched.weight), ("after", up)):
            watched.hover()
            watched.given(before, CYCLES)
            found[kind].append(settling(watched.given(wanted, CYCLES)[0]))
    return {"n": n, **found, "broken_by": watched.broken, "untold": watched.untold}


def fly():
    rows = []
    for n in SIZES:
        rows.append(measure(n, np.random.default_rng([SEED, n])))
        print(n, {kind: max(rows[-1][kind]) for kind in (*KINDS, "back")}, flush=True)
    return {"seed": SEED, "dt": safety.PERIOD, "rows": rows}


def main():
    found = stored(__file__, fly)
    rows = []
    for each in found["rows"]:
        times = [found["dt"] * np.array(each[kind]) for kind in KINDS]
        cells = [f"{np.median(t):.2f} / {t.max():.2f}" for t in times]
        count, slow = sum(map(len, times)), sum(int(np.sum(t > 1.0)) for t in times)
        cells += [f"{slow} of {count}", str(max(each["back"]))]
        kept = each["broken_by"] <= 1e-6 and each["untold"] == 0
        rows.append([str(each["n"]), *cells, "yes" if kept else "NO"])
    header = [
        "n",
        *KINDS.values(),
        "more than 1 s",
        "back in hover, cycles",
        "limits kept, all told",
    ]
    fill("theory/safe.md", "overload", table(header, rows))


if __name__ == "__main__":
    main()
