"""Is a probability below a bound? A test that may be looked at after every trial, and stopped whenever one likes.

A gambler who believes that the probability of a failure is ``q`` bets against one who says ``p``. After ``k`` failures
of ``n`` trials each unit of stake has become the likelihood ratio ``(q/p)^k ((1-q)/(1-p))^(n-k)``. Where ``q < p``, no bet gains on
average if the truth is ``p`` or more: a trial multiplies the stake by ``x q/p + (1-x)(1-q)/(1-p)`` on average, which falls with the true
``x`` and is 1 at ``x = p``. So the stake is a nonnegative supermartingale, and by Ville's inequality it ever reaches ``1/a`` with a probability of at most ``a``,
whatever rule says when to stop (Ville 1939; Robbins, "Statistical methods related to the law of the iterated logarithm", Ann. Math. Stat. 41, 1970;
Shafer et al., "Test martingales, Bayes factors and p-values", Stat. Sci. 26, 2011). A stake that is divided among several ``q`` is one too.
"""

from __future__ import annotations

import math

from colift.kernel.math.shares import beta

BELOW = ((0.0, 0.7), (0.1, 0.1), (0.3, 0.1), (0.6, 0.1))
"""Against "the bound or more": beliefs as parts of the bound, and what is staked on each. Without a failure the first decides soonest."""
ABOVE = ((0.95, 0.1), (0.8, 0.3), (0.6, 0.3), (0.4, 0.3))
"""Against "the bound or less": beliefs as powers of the bound."""
CLOSE = 1e-12
"""Where a search for an end of an interval ends."""


def evidence_below(failures: int, trials: int, bound: float) -> float:
    """Logarithm of what a unit of stake against "the probability is ``bound`` or more" has become."""
    return _stake(failures, trials, bound, [(part * bound, own) for part, own in BELOW])


def evidence_above(failures: int, trials: int, bound: float) -> float:
    """Logarithm of what a unit of stake against "the probability is ``bound`` or less" has become."""
    return _stake(failures, trials, bound, [(bound**power, own) for power, own in ABOVE])


def _stake(failures: int, trials: int, p: float, beliefs: list[tuple[float, float]]) -> float:
    parts = []
    for q, own in beliefs:
        if q == 0.0 and failures:
            continue  # that part is lost
        gained = failures * math.log(q / p) if failures else 0.0
        gained += (trials - failures) * (math.log1p(-q) - math.log1p(-p))
        parts.append(math.log(own) + gained)
    most = max(parts)
    return most + math.log(sum(math.exp(part - most) for part in parts))


def interval(failures: int, trials: int, confidence: float) -> tuple[float, float]:
    """The probabilities that nobody has lost against yet; each end holds with ``confidence``, after all trials at once."""
    enough = -math.log(1.0 - confidence)
    # Evidence below p grows with p, and evidence above p falls.
    high = _search(lambda p: evidence_below(failures, trials, p) >= enough)
    low = _search(lambda p: evidence_above(failures, trials, p) < enough)
    return (0.0 if failures == 0 else low), high


def _search(holds):  # type: ignore[no-untyped-def]
    """Least number between 0 and 1 from which on something holds."""
    low, high = 0.0, 1.0
    while high - low > CLOSE + 1e-9 * high:
        middle = 0.5 * (low + high)
        if holds(middle):
            high = middle
        else:
            low = middle
    return high


def student(level: float, freedom: int) -> float:
    """Where Student's distribution reaches a level above one half, by bisection."""
    low, high = 0.0, 1.0

    def reached(t: float) -> bool:
        return 1.0 - 0.5 * beta(0.5 * freedom, 0.5, freedom / (freedom + t * t)) >= level

    while not reached(high):
        low, high = high, 2.0 * high
    while high - low > 1e-12 * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if reached(middle) else (middle, high)
    return high
