"""Write what docs/deploy.md says of our kernels beside C of a general solver, on a Cortex-M4F: the same problem, forces and precision.

python docs/figures/general.py [--fly]

From ``general.json`` beside this file, which ``--fly`` makes first (minutes); it needs the extra casadi and the Debian packages of the machine ``m4``
of ``colift.deploy.c.machines``. The general solver is CasADi's sequential quadratic programming with its dense active-set method qrqp, both as C that
CasADi writes for the problem: second derivatives exact and made convex, or by BFGS; numbers of single precision; started from the last answer and its multipliers.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import Any

from pages import fill, stored, table

os.environ["NUMBA_CPU_NAME"] = "generic"

import numpy as np

from colift.control.allocation.sqp import Sqp
from colift.deploy.c.asked import allocator, calls
from colift.deploy.c.kernels import Kernel
from colift.deploy.c.layers import SINGLE
from colift.deploy.c.machines import Driver

DRONES, CASES, CALLS = (3, 4), ("smooth", "noisy"), 200
FIRST = 700
SOLVERS = {
    "general": {"hessian_approximation": "exact", "convexify_strategy": "regularize"},
    "general, BFGS": {"hessian_approximation": "limited-memory"},
}
"""Where the general solver has its second derivatives from."""
TOLERANCE, STEPS = 3e-4, 50
"""Of the general solver, and its steps at most: the third setting that was tried, the first with which its answers are exact."""
INNER = 1e-5
"""Tolerance of its quadratic programs: their default is one of double precision, and never met."""
EXACT = 1e-3
"""Errors of balance and gradient over the force up to which an answer counts as exact."""


def problem(n: int, hessian: dict[str, str]) -> Any:
    """The paper's problem on n cables, in shares of the force; parameters: the unit force, and the weight of the angles."""
    import casadi

    T, alpha, p = casadi.SX.sym("T", n), casadi.SX.sym("alpha", 3, n), casadi.SX.sym("p", 4)
    pairs = [casadi.dot(alpha[:, i], alpha[:, j]) for i in range(n) for j in range(i)]
    norms = [casadi.dot(alpha[:, i], alpha[:, i]) - 1.0 for i in range(n)]
    nlp = {
        "x": casadi.vertcat(T, casadi.vec(alpha)),
        "p": p,
        "f": 0.5 * casadi.dot(T, T) + p[3] * sum(c**2 for c in pairs),
        "g": casadi.vertcat(casadi.mtimes(alpha, T) + p[:3], *norms),
    }
    quiet = {"print_iter": False, "print_header": False, "print_info": False, "error_on_fail": False, "constr_viol_tol": INNER, "dual_inf_tol": INNER}  # fmt: skip
    options = {
        "qpsol": "qrqp", "qpsol_options": quiet, "tol_pr": TOLERANCE, "tol_du": TOLERANCE, "max_iter": STEPS, "error_on_fail": False,
        "print_time": False, "print_header": False, "print_iteration": False, "print_status": False,
    }  # fmt: skip
    return casadi.nlpsol("general", "sqpmethod", nlp, options | hessian)


WRAPPER = """
int @NAME@(const colift_now *now, const colift_allocation_sees *sees, const float *params, float *memory, const colift_allocation_writes *writes)
{
    enum { N = @N@, X = 4 * N, G = 3 + N };
    static casadi_real x[X], lam_x[X], lam_g[G], found[X], p[4], low[X], high[X], zero[G], w[general_SZ_W];
    static casadi_int iw[general_SZ_IW];
    const casadi_real *arg[general_SZ_ARG] = {x, p, low, high, zero, zero, lam_x, lam_g};
    casadi_real *res[general_SZ_RES] = {found, 0, 0, lam_x, lam_g, 0};
    const float *F = sees->force, size = sqrtf(F[0] * F[0] + F[1] * F[1] + F[2] * F[2]);
    (void)now, (void)params, (void)memory;
    for (int i = 0; i < N; ++i) {
        x[i] = writes->desired_tensions[i] > 0.0f ? writes->desired_tensions[i] / size : 1.0f / N;
        for (int k = 0; k < 3; ++k) {
            x[N + 3 * i + k] = writes->desired_directions[3 * i + k];
        }
    }
    for (int k = 0; k < X; ++k) {
        low[k] = k < N ? 0.0f : -INFINITY;
        high[k] = INFINITY;
    }
    for (int k = 0; k < 3; ++k) {
        p[k] = F[k] / size;
    }
    p[3] = @MU@f / (size * size);
    const int status = general(arg, res, iw, w, 0);
    for (int i = 0; i < N; ++i) {
        writes->desired_tensions[i] = size * found[i];
        for (int k = 0; k < 3; ++k) {
            writes->desired_directions[3 * i + k] = found[N + 3 * i + k];
        }
    }
    return status;
}
"""


class General(Kernel):
    """The general solver behind the interface of an allocator's kernel."""

    def __init__(self, n: int, mu: float, hessian: dict[str, str]) -> None:
        super().__init__(Sqp, "sqp", single=True)
        self._made = n, mu, hessian

    def file(self, header: str) -> str:
        import casadi

        n, mu, hessian = self._made
        options = {"with_header": True, "casadi_real": "float", "with_export": False}
        with tempfile.TemporaryDirectory() as folder:
            made = casadi.CodeGenerator("general", options)
            made.add(problem(n, hessian))
            made.generate(f"{folder}/")
            sizes = [
                line
                for line in Path(folder, "general.h").read_text().splitlines()
                if "_SZ_" in line
            ]
            text = Path(folder, "general.c").read_text()
        marks = {"@NAME@": self.name, "@N@": str(n), "@MU@": repr(float(mu))}
        wrapper = WRAPPER
        for mark, value in marks.items():
            wrapper = wrapper.replace(mark, value)
        return "\n".join([f'#include "{header}"', text, *sizes, wrapper])


def optimality(asked: Any, answers: Any, mu: float) -> tuple[Any, Any]:
    """Of each answer, over the force: error of the balance, and what is left of the gradient along the constraints."""
    F, T, a = asked.forces, answers.tensions, answers.directions
    size = np.linalg.norm(F, axis=1)
    balance = np.linalg.norm((T[:, :, None] * a).sum(axis=1) + F, axis=1) / size
    left = []
    for k in range(len(F)):
        t, u, weight = T[k] / size[k], a[k], mu / size[k] ** 2
        sideways = np.eye(3) - u[:, :, None] * u[:, None, :]
        pull = 2.0 * weight * (np.einsum("ij,ik,jk->ij", np.ones((len(u),) * 2), u, u) @ u - u)
        rows = np.vstack([u, *(t[i] * sideways[i] for i in range(len(u)))])
        gradient = np.concatenate([t, *(sideways[i] @ pull[i] for i in range(len(u)))])
        multipliers = np.linalg.lstsq(rows, -gradient, rcond=None)[0]
        left.append(np.linalg.norm(gradient + rows @ multipliers))
    return balance, np.array(left)


def measured(title: str, kernel: Kernel, n: int, case: str) -> dict[str, Any]:
    """What the chip needs for these calls, and how exact the answers are."""
    part, team = allocator("sqp", n, **SINGLE["sqp"])
    asked = calls(part, team, case, CALLS, FIRST + n)
    mu = float(part.mu)
    with Driver(kernel, "m4", (n, asked.params.size, asked.memory.size)) as made:
        answers, code = made(asked), made.code()
    balance, left = optimality(asked, answers, mu)
    used = answers.instructions
    return {
        "solver": title, "drones": n, "case": case, "mean": float(used.mean()), "p99": float(np.quantile(used, 0.99)),
        "max": float(used.max()), "stack": answers.stack, "code": code, "balance": float(np.nanmedian(balance)),
        "left": float(np.nanmedian(left)), "exact": float(np.mean((balance < EXACT) & (left < EXACT))),
    }  # fmt: skip


def measure() -> list[dict[str, Any]]:
    found = []
    for n in DRONES:
        part, _ = allocator("sqp", n)
        solvers = {"`sqp`": Kernel(Sqp, "sqp", single=True)}
        solvers |= {title: General(n, part.mu, hessian) for title, hessian in SOLVERS.items()}
        for case in CASES:
            for title, kernel in solvers.items():
                found.append(measured(title, kernel, n, case))
                print(found[-1], flush=True)
    return found


def k(value: float) -> str:
    """Instructions in thousands or millions."""
    return f"{value / 1e6:.3g}\u00a0M" if value >= 999_500 else f"{value / 1000:.3g}\u00a0k"


def main() -> None:
    rows = [
        [
            f"{each['solver']}, n = {each['drones']}, {each['case']}", *(k(each[x]) for x in ("mean", "p99", "max")),
            str(each["stack"]), f"{each['code'] / 1000:.1f}\u00a0kB", f"{each['balance']:.0e}", f"{each['left']:.0e}", f"{100 * each['exact']:.4g}",
        ]
        for each in stored(__file__, measure)
    ]  # fmt: skip
    head = ["", "mean", "99 %", "most", "stack, B", "code", "balance", "gradient", "exact, %"]
    fill("deploy.md", "general", table(head, rows))


if __name__ == "__main__":
    main()
