"""First guesses: a path of the load by cost to go on a grid, and a formation along it that gives way to what stands beside."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from colift.kernel.jit import f8, i8, kernel, matrix, tensor, vector, void
from colift.plan.distances import along, distance
from colift.plan.flatness import direction
from colift.team.obstacles import BOX

Numbers = NDArray[np.float64]
BESIDE = 0.09
"""Distance of cables to obstacles in a guess, m: more than a team moves between two places of it, so that no pole jumps through a cable."""


@kernel(void(tensor, vector, f8, matrix, f8, f8))
def _costs(cost, corner, cell, obstacles, radius, room):  # type: ignore[no-untyped-def]
    """Multiply the cost of each cell of a grid by what its distance to obstacles asks: much below ``radius``, more than 1 below ``room``."""
    for a in range(cost.shape[0]):
        for b in range(cost.shape[1]):
            for c in range(cost.shape[2]):
                near = room
                for o in range(obstacles.shape[0]):
                    d, _, _, _ = distance(
                        obstacles[o],
                        corner[0] + a * cell,
                        corner[1] + b * cell,
                        corner[2] + c * cell,
                    )
                    near = min(near, d)
                lack = (room - near) / room
                cost[a, b, c] *= 1.0 + 2.0 * lack * lack + (1000.0 if near < radius else 0.0)


@kernel(i8(tensor, tensor, i8[::1], f8))
def _sweep(cost, go, goal, cell):  # type: ignore[no-untyped-def]
    """Cost to go from each cell to the goal, over 26 neighbours, by sweeps in the eight orders until none changes it."""
    A, B, C = cost.shape
    go[:] = 1e18
    go[goal[0], goal[1], goal[2]] = 0.0
    for sweep in range(64):
        changed = False
        for ai in range(A):
            a = ai if sweep & 1 == 0 else A - 1 - ai
            for bi in range(B):
                b = bi if sweep & 2 == 0 else B - 1 - bi
                for ci in range(C):
                    c = ci if sweep & 4 == 0 else C - 1 - ci
                    best = go[a, b, c]
                    for da in range(-1, 2):
                        for db in range(-1, 2):
                            for dc in range(-1, 2):
                                p, q, r = a + da, b + db, c + dc
                                if 0 <= p < A and 0 <= q < B and 0 <= r < C:
                                    way = cell * math.sqrt(da * da + db * db + dc * dc)
                                    best = min(
                                        best,
                                        go[p, q, r] + way * 0.5 * (cost[a, b, c] + cost[p, q, r]),
                                    )
                    if best < go[a, b, c] - 1e-12:
                        go[a, b, c] = best
                        changed = True
        if not changed:
            return sweep
    return 64


def path(
    start: Numbers,
    goal: Numbers,
    obstacles: Numbers,
    radius: float,
    room: float,
    rng: np.random.Generator,
    noise: float,
    count: int,
) -> Numbers:
    """Places (count, 3) of the load, equally far apart, on a cheap way round the obstacles; ``noise`` makes ways differ."""
    low, high = (
        np.minimum(start, goal) - [0.6, 0.9, 0.6],
        np.maximum(start, goal) + np.array([0.6, 0.9, 0.75]),
    )
    cell = max(0.15, float((high - low).max()) / 60.0)
    shape = np.ceil((high - low) / cell).astype(int) + 1
    cost = np.ones(tuple(shape))
    if noise > 0.0:
        coarse = rng.uniform(0.0, noise, tuple(shape // 3 + 1))
        for axis in range(3):
            coarse = np.repeat(coarse, 3, axis=axis)
        cost += coarse[: shape[0], : shape[1], : shape[2]]
    _costs(cost, low, cell, obstacles, radius, room)
    go = np.empty_like(cost)
    at = np.round((goal - low) / cell).astype(np.int64)
    _sweep(cost, go, at, cell)
    here = np.round((start - low) / cell).astype(int)
    between: list[Numbers] = []
    while go[tuple(here)] > 0.0 and len(between) < 500:
        box = tuple(slice(max(h - 1, 0), h + 2) for h in here)
        near = go[box]
        here = np.array(np.unravel_index(near.argmin(), near.shape)) + np.maximum(here - 1, 0)
        between.append(low + cell * here)
    line = np.array([start, *between[:-1], goal])
    far = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at_equal = np.linspace(0.0, far[-1], count)
    line = np.stack([np.interp(at_equal, far, line[:, c]) for c in range(3)], axis=1)
    for _ in range(3):
        line[1:-1] = 0.25 * line[:-2] + 0.5 * line[1:-1] + 0.25 * line[2:]
    return line


WIDE = 0.25
"""By which a stretched post is thicker along the path, m, so that the way out is the load's side."""


def one_sided(places: Numbers, obstacles: Numbers, far: float = 1.0) -> Numbers:
    """The obstacles, thin posts stretched by ``far``, m, away from the load's path: what has to pass them all on its side.

    Across a post the pushes before and behind it contradict each other, and no descent brings a cable round it.
    """
    out = obstacles.copy()
    for o in out:
        if o[4:6].max() + o[7] > 0.12 or o[6] < 0.4:
            continue
        lines = places[:, :2] - o[1:3]
        nearest = lines[np.hypot(*lines.T).argmin()]
        axis = int(np.abs(nearest).argmax())
        o[0] = BOX
        o[1 + axis] -= np.sign(nearest[axis]) * far / 2
        o[4 + axis] += far / 2
        o[5 - axis] += WIDE
    return out


@kernel(void(matrix, matrix, vector, matrix, f8, f8, f8, f8, i8))
def yield_to(places, pulls, L, obstacles, radius, apart, least, pull, rounds):  # type: ignore[no-untyped-def]
    """Let the pulls (count, 3 n) at each place of the load give way to obstacles and to each other; they stay balanced.

    Each violated distance moves what violates it by its depth (Macklin et al. 2016, position-based); places follow each other
    forth and back, so that a team files in before a gap and spreads out behind it. ``pull`` draws each place to the pulls that it began with.
    """
    count, n = places.shape[0], L.shape[0]
    f, u, A, r = np.zeros((n, 5, 3)), np.zeros((n, 1, 3)), np.zeros((n, 1, 3, 3)), np.zeros(1)
    home, move = pulls.copy(), np.zeros((n, 3))
    for turn in range(2):
        for step in range(1, count - 1):
            k = step if turn == 0 else count - 1 - step
            before = k - 1 if turn == 0 else k + 1
            for c in range(3 * n):
                carried = pulls[before, c] + home[k, c] - home[before, c]
                pulls[k, c] = carried if turn == 0 else 0.5 * (pulls[k, c] + carried)
            for _ in range(rounds):
                move[:] = 0.0
                for i in range(n):
                    for c in range(3):
                        f[i, 0, c] = pulls[k, 3 * i + c]
                    direction(f[i], 1, r, u[i], A[i])
                for i in range(n):
                    length = L[i]
                    vx, vy, vz = length * u[i, 0, 0], length * u[i, 0, 1], length * u[i, 0, 2]
                    for o in range(obstacles.shape[0]):
                        for which in range(2):
                            t, need = 1.0, radius
                            if which == 1:
                                t, need = (
                                    along(
                                        obstacles[o],
                                        places[k, 0],
                                        places[k, 1],
                                        places[k, 2],
                                        vx,
                                        vy,
                                        vz,
                                        BESIDE + 0.02,
                                    ),
                                    BESIDE,
                                )
                                if t < 0.1:
                                    continue
                            d, gx, gy, gz = distance(
                                obstacles[o],
                                places[k, 0] + t * vx,
                                places[k, 1] + t * vy,
                                places[k, 2] + t * vz,
                            )
                            if d < need:
                                e = 0.7 * (need - d) / t
                                move[i, 0] += e * gx
                                move[i, 1] += e * gy
                                move[i, 2] += e * gz
                    for j in range(i):
                        dx, dy, dz = (
                            vx - L[j] * u[j, 0, 0],
                            vy - L[j] * u[j, 0, 1],
                            vz - L[j] * u[j, 0, 2],
                        )
                        d = math.sqrt(dx * dx + dy * dy + dz * dz) + 1e-9
                        if d < apart:
                            e = 0.4 * (apart - d) / d
                            for c in range(3):
                                v = e * (dx if c == 0 else (dy if c == 1 else dz))
                                move[i, c] += v
                                move[j, c] -= v
                for c in range(3):
                    total = 0.0
                    for i in range(n):
                        size = math.sqrt(f[i, 0, 0] ** 2 + f[i, 0, 1] ** 2 + f[i, 0, 2] ** 2)
                        f[i, 0, c] += size / L[i] * move[i, c] + pull * (
                            home[k, 3 * i + c] - f[i, 0, c]
                        )
                        total += f[i, 0, c]
                    for i in range(n):
                        f[i, 0, c] += ((1.0 if c == 2 else 0.0) - total) / n
                for i in range(n):
                    size = math.sqrt(f[i, 0, 0] ** 2 + f[i, 0, 1] ** 2 + f[i, 0, 2] ** 2)
                    grow = max(least / (n * max(size, 1e-6)), 1.0)
                    for c in range(3):
                        pulls[k, 3 * i + c] = grow * f[i, 0, c]
