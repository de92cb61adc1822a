"""Search the flat family for its widest member: ``python docs/figures/widest.py`` (needs SciPy).

Among the optima for the paper's load, the smallest angle between two cables of the regular ring and of
the widest formation that a local search from random members finds.
"""

import numpy as np
from scipy.optimize import minimize

from colift.team.geometry import pairwise_angles, ring

WEIGHT, MU = 0.225 * 9.81, 0.15

for n in (3, 4, 5, 6, 8):
    roots = np.roots([3 * MU, -n * MU, 0.0, -(WEIGHT**2)])
    a = float(roots[np.abs(roots.imag) < 1e-9].real.max())
    matrix = np.diag([(n - a) / 2, (n - a) / 2, a])
    upper, pairs = np.triu_indices(3), np.triu_indices(n, 1)
    root = np.sqrt(matrix)

    def optimal(z, n=n, matrix=matrix, upper=upper):
        A = z[:-1].reshape(n, 3)
        return np.concatenate([(A.T @ A - matrix)[upper], np.sum(A[:-1] ** 2, axis=1) - 1])

    def spread(z, n=n, pairs=pairs):
        A = z[:-1].reshape(n, 3)
        return np.concatenate([z[-1] - (A @ A.T)[pairs], -A[:, 2]])

    rng, widest = np.random.default_rng(0), 0.0
    for _ in range(20):
        start = np.linalg.qr(rng.normal(size=(n, 3)))[0] @ root
        start *= -np.sign(start[:, 2:])
        found = minimize(
            lambda z: z[-1],
            np.append(start.ravel(), 1.0),
            constraints=[{"type": "eq", "fun": optimal}, {"type": "ineq", "fun": spread}],
            method="SLSQP",
            options={"maxiter": 400},
        )
        if np.abs(optimal(found.x)).max() < 1e-7:
            A = found.x[:-1].reshape(n, 3)
            widest = max(widest, float(np.degrees(pairwise_angles(A).min())))
    regular = np.degrees(pairwise_angles(ring(n, np.arccos(np.sqrt(a / n)))).min())
    print(f"n = {n}: regular ring {regular:.2f} deg, widest found {widest:.2f} deg")
