"""One cycle of the safe allocator: from the last answer to the next, inside every limit.

The stages, each a function below: order the cables, set up each cable's limits, lead a
violated configuration back (:mod:`colift.control.allocation.limits.recovery`), list the near pairs, iterate.

Pairs. A direction turns by at most ``delta`` per cycle, so only pairs closer than ``min_angle + 2 delta``
can come too close in this cycle. Those within ``min_angle + reach`` are listed, and the weight of their
barrier fades to zero at that distance, so that nothing jumps when a pair enters or leaves. Where drones are to keep distances
(:mod:`colift.control.allocation.limits.distance`) ``min_angle`` is the widest angle that any pair keeps, and ellipsoids that may touch are
further rows.

This file imports only the compiler front end, names of places and thresholds.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from colift.control.allocation.limits import distance, newton, recovery
from colift.control.allocation.paper.newton import rotate
from colift.kernel.jit import inline
from colift.kernel.layout import Layout
from colift.kernel.rounding import BALANCED, KEPT, ROOM, SURE

PARAMS = Layout(
    team={
        "mu": 1, "mu_scaled": 1, "mu_force": 1, "sigma": 1, "kappa": 1, "kappa_rate": 1,
        "kappa_pair": 1, "min_angle": 1, "reach": 1, "max_rate": 1, "settling": 1, "turning": 1,
        "price": 1, "tolerance": 1, "iterations": 1, "limits": 1, "g": 1, "cone": 1, "tilt": 1,
        "total": 1, "equal": 1, "cos_angle": 1, "cos_edge": 1, "cos_cone": 1, "cos_tilt": 1, "tan_lean": 1,
        "capped": 1, "stacked": 1, "flat": 1,
    },
    drone={"weight": 1, "T_min": 1, "T_max": 1, "m": 1, "f_max": 1, "length": 1, "size": 1},
)  # fmt: skip
"""Tensions and the largest thrust in N. ``cos_edge`` is that of ``min_angle + reach``, ``tan_lean`` of ``LEVEL`` of the tilt.

The rest (n * n) is :attr:`colift.control.allocation.limits.distance.Apart.table`."""
P = PARAMS.at
LEVEL = 0.8
"""Part of the largest tilt that a drone needs at most for itself."""

MAX_TURN = 0.5
"""Largest turn of a direction in one cycle, rad, however long the cycle."""

A, OMEGA, T_MIN, T_MAX = newton.A, newton.OMEGA, newton.T_MIN, newton.T_MAX
COS_CONE, VERS_RATE, OWN = newton.COS_CONE, newton.VERS_RATE, newton.P
F_MAX, COS_TILT = newton.F_MAX, newton.COS_TILT

CONVERGED, ITERATION_LIMIT, FORCE_REDUCED = 0, 1, 2

TURN = 0.4
"""Largest turn of the formation in one cycle, in turns of the rate limit."""
JUMP = 0.2
"""Distance between force and direction followed, rad, from which on the formation waits."""
KEEP = 0.05
"""Part of its margin that every limit keeps in one step."""
Z_BAND = 10.0
"""Multipliers stay within this factor of kappa / g."""
PATIENCE = 6
"""Steps without the whole force, those at its price twice, after which nothing but force is asked for."""
FORCE = 0.5
"""Price of horizontal force then."""
VERTICAL_FIRST = 20.0
"""How much dearer vertical force is than horizontal force."""
FIRM = 1e-3
"""Barrier of every limit then."""
RATE_FIRM = 0.5
"""Barrier of the rate then, in the versine of the largest turn; no more than that of the others."""
SHARP = 0.03
"""Part that is left in the end of what holds on to the last directions."""
FAR = 10.0
"""How much more than barriers can be blamed for is missing where that is done."""
LEAN = 0.03
"""Part of the largest turn by which a formation leans then, lest it be stuck at a saddle."""
LEANING = 50.0
"""Cycles for which it does so after the wanted force has changed by more than ``CHANGE`` of it."""
CHANGE = 1e-3
SLIGHT = 1e-3
"""Largest part of the cost that is left then."""
DRIFT = 4.0
"""Of a residual, a step with the matrix of the step before leaves the relative change of the limits times this."""
CHEAP, CHEAP_OF_MANY = 2, 3
"""Steps with the matrix of the step before that cost no more than one with its own; of teams whose matrix is no square."""
RETRY = 0.5
"""Work of a step whose matrix had to be shifted and built again, in steps: it ends there."""
RETRIES = 8
"""Most step lengths tried in one iteration."""


class Task(NamedTuple):
    """What one cycle is asked: the wanted force and the weights, scaled, and when to stop."""

    fx: float
    fy: float
    fz: float
    mu: float
    rho: float
    kappa: float
    kappa_rate: float
    spread: float
    price: float
    """Of horizontal force that is missing."""
    yielding: bool
    """The last answer gave force up."""
    leaning: float
    """By how much the formation leans then, rad."""
    tolerance: float
    max_iterations: int


@inline
def sort_cables(n, directions, order):  # type: ignore[no-untyped-def]
    """Order the cables along the x axis, from the last cycle's order: neighbours get close numbers.

    Small teams keep their own order: their matrix is dense anyhow. Numbers of cables are kept as floats, which are exact.
    """
    total = 0.0
    for i in range(n):
        total += order[i]
    if total != n * (n - 1) // 2 or n <= 8:
        for i in range(n):
            order[i] = i
    if n <= 8:
        return
    for i in range(1, n):
        moving = int(order[i])
        key = directions[moving, 0]
        j = i - 1
        while j >= 0 and directions[int(order[j]), 0] > key:
            order[j + 1] = order[j]
            j -= 1
        order[j + 1] = moving


@inline
def turn_home(n, fx, fy, fz, W, follow, most, facing, work):  # type: ignore[no-untyped-def]
    """Turn the directions that the proximal term holds on to with the force, which is followed smoothly.

    ``facing`` (3,) is the direction followed so far, zero at the start; ``follow`` the share of the way to
    that of the force, ``most`` the largest turn, rad. Noise moves no cable, a manoeuvre turns the whole
    formation, and a jump is waited out: it may jump back. The barrier of the rate holds on to the last
    directions as strongly as the proximal term (``RATE_BARRIER``), and does not turn: twice the turn
    puts the middle of both where it should be.
    """
    data, homes, spare = work.data, work.w_new, work.dw
    x, y, z = fx / W, fy / W, fz / W
    ax, ay, az = facing[0], facing[1], facing[2]
    if ax * ax + ay * ay + az * az > 0.5:
        x, y, z = x - ax, y - ay, z - az
        size = math.sqrt(x * x + y * y + z * z)
        follow = min(follow, most / max(size, 1e-300)) / (1.0 + (size / JUMP) ** 4)
        x, y, z = ax + follow * x, ay + follow * y, az + follow * z
        norm = math.sqrt(x * x + y * y + z * z)
        if norm < 1e-3:
            return
        x, y, z = x / norm, y / norm, z / norm
        for i in range(n):
            for k in range(3):
                homes[3 * i + k] = data[newton.DATA * i + newton.HOME + k]
        for _ in range(2):
            rotate(n, ax, ay, az, x, y, z, homes, spare)
        for i in range(n):
            for k in range(3):
                data[newton.DATA * i + newton.HOME + k] = homes[3 * i + k]
    facing[0], facing[1], facing[2] = x, y, z


@inline
def set_up(  # type: ignore[no-untyped-def]
    n, order, W, unit, delta, acceleration, tensions, directions, params, start, apart, work
):
    """Limits of every cable in this cycle and a strictly feasible ``w``; whether one was relaxed."""
    data, T, alpha, w = work.data, work.T, work.alpha, work.w
    vers = 2.0 * math.sin(0.5 * delta) ** 2
    cos_cone = params[P.cos_cone]
    for i in range(n):
        at = int(order[i])
        x, y, z = directions[at, 0], directions[at, 1], directions[at, 2]
        norm = math.sqrt(x * x + y * y + z * z)
        if not (norm > 1e-9 and norm < 1e9):
            x, y, z, norm = 0.0, 0.0, -1.0, 1.0
        norm = 1.0 / norm
        start[3 * i] = x * norm
        start[3 * i + 1] = y * norm
        start[3 * i + 2] = z * norm
    for k in range(3 * n):
        alpha[k] = start[k]
    relaxed = False
    if recovery.is_broken(n, params[P.cos_angle], cos_cone, SURE, apart, start):
        relaxed = True
        recovery.lead_back(n, params[P.min_angle], params[P.cone], delta, start, apart, alpha)
    for i in range(n):
        d = newton.DATA * i
        p = P.rows + P.width * int(order[i])
        for k in range(3):
            data[d + k] = start[3 * i + k]
            data[d + newton.HOME + k] = alpha[3 * i + k]
        low = params[p + P.T_min] * unit
        high = params[p + P.T_max] * unit
        data[d + OMEGA] = params[p + P.weight]
        data[d + T_MIN] = low
        data[d + T_MAX] = high
        data[d + VERS_RATE] = vers
        # A cable outside the cone: no worse than half of the way that recovery gained.
        data[d + COS_CONE] = cos_cone
        if -alpha[3 * i + 2] - cos_cone <= SURE:
            middle = -0.5 * (alpha[3 * i + 2] + start[3 * i + 2])
            data[d + COS_CONE] = min(cos_cone, min(middle, -alpha[3 * i + 2] - ROOM))
        t = tensions[int(order[i])] * unit
        if not (t > 0.0 and t < 1e300):
            t = W / n
        room = 1e-3 * (high - low)
        low += room
        t = max(min(t, high - room), low)
        if params[P.limits] > 4.0:
            cos_tilt = params[P.cos_tilt]
            drone_limits(
                d,
                params[p + P.m] * unit,
                params[p + P.f_max] * unit,
                params[P.g],
                cos_tilt,
                params[P.tan_lean],
                acceleration,
                data,
            )
            px, py, pz = data[d + OWN], data[d + OWN + 1], data[d + OWN + 2]
            for k in range(8):
                x = px - t * alpha[3 * i]
                y = py - t * alpha[3 * i + 1]
                z = pz - t * alpha[3 * i + 2]
                thrust = math.sqrt(x * x + y * y + z * z)
                if data[d + F_MAX] - thrust > 1e-6 and z - cos_tilt * thrust > 1e-6:
                    break
                if k < 7:
                    t = low + 0.4 * (t - low) if k < 6 else low
                else:
                    # Even the least tension asks too much of this drone.
                    relaxed = True
                    data[d + F_MAX] = max(data[d + F_MAX], thrust * 1.001)
                    data[d + COS_TILT] = min(data[d + COS_TILT], z / thrust - 1e-3)
        T[i] = t
        for k in range(3):
            w[3 * i + k] = t * alpha[3 * i + k]
    return relaxed


@inline
def breaks_a_limit(n, order, unit, params, apart, work):  # type: ignore[no-untyped-def]
    """Whether an answer is outside of any limit that :func:`set_up` may have relaxed."""
    data, T, alpha = work.data, work.T, work.alpha
    cos_angle, cos_cone = params[P.cos_angle], params[P.cos_cone]
    if recovery.is_broken(n, cos_angle, cos_cone, -KEPT, apart, alpha):
        return True
    if params[P.limits] > 4.0:
        cos_tilt = params[P.cos_tilt]
        for i in range(n):
            d = newton.DATA * i
            x = data[d + OWN] - T[i] * alpha[3 * i]
            y = data[d + OWN + 1] - T[i] * alpha[3 * i + 1]
            z = data[d + OWN + 2] - T[i] * alpha[3 * i + 2]
            thrust = math.sqrt(x * x + y * y + z * z)
            most = params[P.rows + P.width * int(order[i]) + P.f_max] * unit
            if thrust > most * (1.0 + KEPT):
                return True
            if z < (cos_tilt - KEPT) * thrust:
                return True
    return False


@inline
def drone_limits(d, mass, thrust, gravity, cos_tilt, tan_lean, acceleration, data):  # type: ignore[no-untyped-def]
    """The thrust ``p`` that a drone needs for itself, brought within what it can do, and its limits.

    An acceleration that the drone cannot follow even without a cable gives way here.
    """
    ax, ay, az = acceleration[0], acceleration[1], acceleration[2]
    if not math.isfinite(ax + ay + az):
        ax, ay, az = 0.0, 0.0, 0.0
    x = mass * ax
    y = mass * ay
    z = min(max(mass * (az + gravity), 0.3 * mass * gravity), 0.8 * thrust)
    level = math.sqrt(x * x + y * y)
    most = z * tan_lean
    if level > most:
        x *= most / level
        y *= most / level
    size = math.sqrt(x * x + y * y + z * z)
    scale = 0.9 * thrust / size if size > 0.9 * thrust else 1.0
    data[d + OWN] = x * scale
    data[d + OWN + 1] = y * scale
    data[d + OWN + 2] = z * scale
    data[d + F_MAX] = thrust
    data[d + COS_TILT] = cos_tilt


@inline
def near_pairs(n, limit, edge, kappa, rho, start, apart, work):  # type: ignore[no-untyped-def]
    """List the pairs ``(i, j)``, ``j < i``, closer than where the cosine is ``edge``; their number.

    ``limit`` is that of the least angle, the widest of all pairs where each has its own.

    ``first[i]`` becomes the first neighbour of cable i, ``strong[i]`` the first in a strong pair: the envelope of the sparse matrix. A pair that
    is too close may not come closer than half of the way that recovery gained.
    """
    alpha, pairs, first = work.alpha, work.pairs, work.first
    strong, kappa_pair, cos_max = work.strong, work.kappa_pair, work.cos_max
    scale = 1.0 / (limit - edge)
    stiff = rho * newton.strength(n)
    wide = recovery.window(n, edge, alpha)
    m = 0
    begin = 0
    for i in range(n):
        x, y, z = alpha[3 * i], alpha[3 * i + 1], alpha[3 * i + 2]
        first[i] = strong[i] = i
        while x - alpha[3 * begin] > wide:
            begin += 1
        for j in range(begin, i):
            c = x * alpha[3 * j] + y * alpha[3 * j + 1] + z * alpha[3 * j + 2]
            if c > edge:
                if first[i] == i:
                    first[i] = j
                pairs[2 * m] = i
                pairs[2 * m + 1] = j
                most, slope, cause = limit, scale, distance.ANGLE
                if apart.capped:
                    most = distance.cap_of(n, i, j, apart)
                    slope = 1.0 / (most - edge)
                    cause = distance.cause_of(n, i, j, apart)
                fade = min((c - edge) * slope, 1.0)
                fade *= 2.0 - fade
                kappa_pair[m] = kappa * fade * fade
                cos_max[m] = most
                work.cause[m] = cause
                if most - c <= SURE:
                    old = start[3 * i] * start[3 * j] + start[3 * i + 1] * start[3 * j + 1]
                    old += start[3 * i + 2] * start[3 * j + 2]
                    cos_max[m] = max(most, max(0.5 * (old + c), c + ROOM))
                    kappa_pair[m] = min(kappa_pair[m], recovery.FIRM * (cos_max[m] - c))
                if strong[i] == i and newton.is_strong(c, cos_max[m] - c, kappa_pair[m], stiff):
                    strong[i] = j
                m += 1
    return m


@inline
def active_limits(n, limits, m, cause, z):  # type: ignore[no-untyped-def]
    """Bit k is set when a limit of kind k (a pair's: ``cause``) pushes with more than a tenth of a share."""
    bits = 0
    for i in range(n):
        for k in range(limits):
            if z[newton.LIMITS * i + k] > 0.1:
                bits |= 1 << k
    for k in range(m):
        if z[newton.LIMITS * n + k] > 0.1:
            bits |= int(cause[k])
    return float(bits)


@inline
def slight_cost(n, mu, rho, data):  # type: ignore[no-untyped-def]
    """Part of the cost at which no marginal cost of it, of any cable, comes near the price of force."""
    worst = max(2.0 * n * mu, rho * math.sqrt(2.0 * data[newton.VERS_RATE]))
    for i in range(n):
        worst = max(worst, data[newton.DATA * i + OMEGA] * data[newton.DATA * i + T_MAX])
    return min(SLIGHT, 0.1 * FORCE / worst)


@inline
def iterate(n, limits, caps, m, task, work, info):  # type: ignore[no-untyped-def]
    """Interior-point iteration from the strictly feasible ``w``; outcome, see the codes above.

    Two phases. In the first the objective is the whole cost, and force may be missing at a price.
    Where that does not balance the force soon, the second phase asks for the force only: the cost is
    made slight, and every barrier small against the price. As soon as the force is balanced the whole cost is
    back, and no price is high enough to give force up again: each step keeps the balance. Where much is
    missing, what holds on to the last directions shrinks in the end to the part ``SHARP``, so that the cables turn as
    far as their rate allows. ``yielding`` starts with the second phase, in which the formation leans by ``leaning`` rad.
    """
    fx, fy, fz, mu, rho, kappa, kappa_rate, spread = task[:8]
    price, yielding, leaning, tolerance, max_iterations = task[8:]
    data, kappa_pair, w, w_new = work.data, work.kappa_pair, work.w, work.w_new
    g, g_new, z, S, lam = work.g, work.g_new, work.z, work.S, work.lam
    newton.margins(n, limits, caps, m, work, w, g)
    spread_now = spread
    iterations = failed = 0
    waited = 0
    held = False
    sharp = False
    leant = False
    fresh = True
    bounded = False
    residual = math.inf
    balance = math.inf
    missing = 0.0
    outcome = ITERATION_LIMIT
    shift = 0.0
    attempts = 0
    s = 0.0
    drift = origin = math.inf
    again = False
    cost, mu_now, rho_now, kappa_now, rate_now = 1.0, mu, rho, kappa, kappa_rate
    bound_h, bound_v = price, price * VERTICAL_FIRST
    level = 1.0
    while True:
        rx, ry, rz = fx, fy, fz
        for i in range(n):
            rx += w[3 * i]
            ry += w[3 * i + 1]
            rz += w[3 * i + 2]
        balance = math.sqrt(rx * rx + ry * ry + rz * rz)
        if balance <= BALANCED and not held:
            held = True
            bound_h = bound_v = math.inf
            if yielding:
                yielding = False
                fresh = True
        elif not held and not yielding and waited >= PATIENCE:
            yielding = True
            fresh = True
        if fresh:
            # A phase begins: its weights, and multipliers as if this were the middle of its path.
            if leaning > 0.0 and yielding != leant:
                leant = yielding
                lean(n, leaning if leant else -leaning, data)
            if yielding:
                cost = slight_cost(n, mu, rho, data)
                mu_now, rho_now = cost * mu, cost * rho
                kappa_now, rate_now = FIRM, min(FIRM, RATE_FIRM * data[newton.VERS_RATE])
                bound_h, bound_v = FORCE * level, FORCE * VERTICAL_FIRST * level
                spread_next = FIRM
            else:
                cost, mu_now, rho_now, kappa_now, rate_now = 1.0, mu, rho, kappa, kappa_rate
                spread_next = spread
            newton.lay_out(n, yielding, work)
            ratio = spread_next / spread_now
            spread_now = spread_next
            for i in range(n):
                for k in range(limits):
                    weight = rate_now if k == newton.RATE else kappa_now
                    z[newton.LIMITS * i + k] = weight / g[newton.LIMITS * i + k]
            for k in range(m):
                kappa_pair[k] *= ratio
                z[newton.LIMITS * n + k] = kappa_pair[k] / g[newton.LIMITS * n + k]
        weights = newton.Weights(cost, mu_now, rho_now, kappa_now, rate_now)
        settled = held and not yielding and not fresh and iterations > 0
        # How much a step with the same matrix leaves: of barriers as of the change of their limits.
        left = min(DRIFT * drift, 1.0)
        # A full step leaves what it began with times that change, nearly.
        if settled and (again or origin * drift * after_cheap(n, left) <= tolerance):
            known = True
            residual = newton.gradient(n, limits, caps, m, weights, work)
            if residual <= tolerance:
                outcome = CONVERGED
                break
            if iterations + RETRY * failed >= max_iterations:
                break
            if again:
                left = residual / origin
            again = residual * after_cheap(n, left) <= tolerance and attempts == 0 and s == 1.0
        else:
            known = again = False
        if not again:
            newton.assemble(n, limits, caps, m, weights, work)
            if iterations > 0 and not known:
                residual = newton.stationarity(n, work)
                if not fresh and yielding and residual <= tolerance * level:
                    missing = bound_h * math.sqrt(rx * rx + ry * ry) + bound_v * abs(rz)
                    blamed = FIRM * (limits * n + m)
                    if missing <= blamed and level < 1e3:
                        level *= 10.0
                        bound_h, bound_v = FORCE * level, FORCE * VERTICAL_FIRST * level
                    elif not sharp and missing > FAR * blamed:
                        # The turn is to be used to the full where much force is given up.
                        sharp = True
                        rate_now *= SHARP
                        rho_now *= SHARP
                    else:
                        outcome = FORCE_REDUCED
                        break
                if settled and residual <= tolerance:
                    outcome = CONVERGED
                    break
                if iterations + RETRY * failed >= max_iterations:
                    break
            fresh = False
            if not newton.factor(n, shift, mu_now, work):
                # Not convex here: build again, with a larger shift.
                shift = max(1e-2, 30.0 * shift)
                attempts += 1
                failed += 1
                if attempts > 12 or iterations + RETRY * failed >= max_iterations:
                    break
                continue
            attempts = 0
            newton.reduced_system(n, rx, ry, rz, work)
        else:
            newton.next_right_side(n, rx, ry, rz, work)
        iterations += 1
        bounded = newton.multiplier(S, bound_h, bound_v, again)
        origin = newton.back_substitute(n, work)
        lam[0] = S[69]
        lam[1] = S[70]
        lam[2] = S[71]
        s = longest_step(n, limits, caps, m, work)
        for k in range(3 * n):
            w[k] = w_new[k]
        drift = 0.0
        for i in range(n):
            for k in range(limits):
                weight = rate_now if k == newton.RATE else kappa_now
                c = newton.LIMITS * i + k
                drift = max(drift, update_multiplier(c, weight, s, g, g_new, z))
        for k in range(m):
            c = newton.LIMITS * n + k
            drift = max(drift, update_multiplier(c, kappa_pair[k], s, g, g_new, z))
        waited += 2 if bounded else 1
        shift = 0.1 * shift if shift > 1e-2 else 0.0
        if s == 0.0:
            shift = max(1.0, 100.0 * shift)
    info[0] = iterations
    info[1] = residual
    info[4] = balance
    return outcome


@inline
def after_cheap(n, left):  # type: ignore[no-untyped-def]
    """What all steps that cost no more than a new matrix leave of a residual, of which each leaves the part ``left``."""
    if n <= newton.DENSE:
        return left**CHEAP
    return left**CHEAP_OF_MANY


@inline
def lean(n, turn, data):  # type: ignore[no-untyped-def]
    """Turn what the proximal term holds on to by a little, rad, each cable another way.

    A symmetric formation may be a saddle, which nothing symmetric ever leaves.
    """
    for i in range(n):
        home = newton.DATA * i + newton.HOME
        angle = 2.399963229728653 * i + 1.0
        data[home] += turn * math.cos(angle)
        data[home + 1] += turn * math.sin(angle)


@inline
def leaning_now(fx, fy, fz, W, delta, yielded, asked):  # type: ignore[no-untyped-def]
    """By how much to :func:`lean`, rad; ``yielded`` counts the cycles with this force that gave force up."""
    dx, dy, dz = fx - asked[0], fy - asked[1], fz - asked[2]
    asked[0], asked[1], asked[2] = fx, fy, fz
    if math.sqrt(dx * dx + dy * dy + dz * dz) > CHANGE * W:
        yielded[0] = 1.0
    return LEAN * delta if yielded[0] <= LEANING else 0.0


@inline
def longest_step(n, limits, caps, m, work):  # type: ignore[no-untyped-def]
    """Longest step, at most 1, that leaves every limit the part ``KEEP`` of its margin; 0 if none.

    Along a step most limits are concave, so that their secant gives a step that keeps them. Pairs and the least
    tension are not, but they are nearly linear within what the other limits allow. On return
    ``w_new``, ``T``, ``alpha`` and ``g_new`` belong to that step.
    """
    data, w, dw, w_new, g, g_new = work.data, work.w, work.dw, work.w_new, work.g, work.g_new
    s = 1.0
    for trial in range(RETRIES + 1):
        if trial == RETRIES:
            s = 0.0
            for k in range(3 * n):
                w_new[k] = w[k]
        else:
            for k in range(3 * n):
                w_new[k] = w[k] + s * dw[k]
        newton.margins(n, limits, caps, m, work, w_new, g_new)
        if s == 0.0:
            break
        ratio = 1.0
        for i in range(n):
            for kind in range(limits):
                k = newton.LIMITS * i + kind
                if g_new[k] >= KEEP * g[k]:
                    continue
                step = 0.99 * (1.0 - KEEP) * g[k] / (g[k] - g_new[k]) * s
                d = newton.DATA * i
                if kind == newton.RATE or (kind == newton.CONE and data[d + COS_CONE] > 0.0):
                    ux, uy, uz, c = 0.0, 0.0, -1.0, data[d + COS_CONE]
                    kept = KEEP * g[k]
                    if kind == newton.RATE:
                        ux, uy, uz = data[d], data[d + 1], data[d + 2]
                        c, kept = 1.0 - data[d + VERS_RATE] + kept, 0.0
                    x, y, z = w[3 * i], w[3 * i + 1], w[3 * i + 2]
                    dx, dy, dz = dw[3 * i], dw[3 * i + 1], dw[3 * i + 2]
                    step = 0.999 * cone_step(ux, uy, uz, c, kept, x, y, z, dx, dy, dz)
                ratio = min(ratio, step / s) if step < s else min(ratio, 0.5)
        if ratio == 1.0:
            for k in range(newton.LIMITS * n, newton.LIMITS * n + m):
                if not g_new[k] >= KEEP * g[k]:
                    ratio = min(ratio, 0.99 * (1.0 - KEEP) * g[k] / (g[k] - g_new[k]))
        if ratio == 1.0:
            break
        s *= ratio if ratio > 0.0 else 0.25
    return s


@inline
def cone_step(ux, uy, uz, c, kept, x, y, z, dx, dy, dz):  # type: ignore[no-untyped-def]
    """Longest step that leaves ``u.w - c |w|`` no less than ``kept``, of which there is more now.

    The smallest positive root of ``(u.(w + s dw) - kept)^2 = c^2 |w + s dw|^2``.
    """
    far = c * math.sqrt(x * x + y * y + z * z)
    near = ux * x + uy * y + uz * z - kept
    slope = ux * dx + uy * dy + uz * dz
    constant = (near - far) * (near + far)
    linear = near * slope - c * c * (x * dx + y * dy + z * dz)
    square = slope * slope - c * c * (dx * dx + dy * dy + dz * dz)
    root = math.sqrt(max(linear * linear - square * constant, 0.0)) - linear
    return constant / root if root > constant else 1.0


@inline
def update_multiplier(c, kappa, s, g, g_new, z):  # type: ignore[no-untyped-def]
    """Newton step of ``z g = kappa`` with the change of ``g`` that took place; safeguarded.

    Returns that change, relative.
    """
    new, multiplier = g_new[c], z[c]
    inverse = 1.0 / g[c]
    change = (new - g[c]) * inverse
    multiplier += s * (kappa * inverse - multiplier) - multiplier * change
    central = kappa / new
    z[c] = min(max(multiplier, central / Z_BAND), central * Z_BAND)
    g[c] = new
    return abs(change)
