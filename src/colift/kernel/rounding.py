"""Thresholds that are as small as they are because of rounding: float64 values, and beside them those for float32.

Compiled kernels take the float64 ones, by name. Who writes a kernel anew in single precision takes those of :data:`SINGLE`:
with the others nothing converges, or noise counts for a sign. Guards that only keep a division from zero do not depend on the
precision and are no such thresholds.
"""

from __future__ import annotations

DOWNWARD = 1e-12
"""``2 + 2 u_z`` of a unit vector u, below which it points straight down."""
NO_TURN = 1e-12
"""Sine of an angle, or rate (rad/s), below which nothing turns."""
NO_FORCE = 1e-12
"""Force that is none, N."""
FAINT = 1e-9
"""Force over the square root of the weight ``mu``, below which there is nothing to share."""
NO_TENSION = 1e-15
"""Tension over force, below which it has no direction."""
PUSHING = 1e-12
"""Negative tension over force, above which a cable would push."""
UNBALANCED = 1e-9
"""Error of the force balance over the force, above which the cables do not hold it."""
RANK = 1e-9
"""A cable whose part outside of the span of those before it is smaller adds no direction."""
LEAST_DAMPING = 1e-4
"""Floor of a Newton step's damping: dividing by less amplifies rounding, and the residual stalls near 1e-11."""
SETTLED = 1e-15
"""Step of a root over its size, from which on there is no better one."""
LEVEL = 1e-13
"""Growth of an objective over its size, up to which it has not grown."""
NO_THRUST = 1e-9
"""Thrust without a direction, N."""
WHOLE = 1e-9
"""Missing share of a control period, up to which it counts as whole."""
NO_TIME = 1e-12
"""Time that is none, s."""
BALANCED = 1e-10
"""Error of the force balance that counts as none, in shares of the load."""
REDUCED = 1e-8
"""Error of the balance in the answer, relative, above which force is missing."""
SURE = 1e-12
"""Margin of a limit from which on an interior-point iteration can start."""
ROOM = 1e-7
"""How much worse (cosine) a broken limit may get in one cycle where nothing gives it way."""
KEPT = 1e-12
"""A limit that is missed by no more than this is kept."""
NO_WORSE = 1e-6
"""Margin (cosine) of a limit up to which nothing may take of it, on the way back."""
PIVOT = 1e-10
"""Least pivot of a matrix that counts as positive definite."""
ON_THE_RIM = 1e-12
"""How far outside of a bound, relative, a multiplier still is on it."""
AT_THE_BOUND = 1e-9
"""How far inside of a bound, relative, a multiplier counts as at it."""

SINGLE = {
    "DOWNWARD": 3e-4,
    "NO_TURN": 1e-6,
    "NO_FORCE": 1e-6,
    "FAINT": 1e-5,
    "NO_TENSION": 1e-7,
    "PUSHING": 1e-6,
    "UNBALANCED": 1e-5,
    "RANK": 1e-4,
    "LEAST_DAMPING": 1e-2,
    "SETTLED": 1e-6,
    "LEVEL": 5e-5,
    "NO_THRUST": 1e-6,
    "WHOLE": 1e-4,
    "NO_TIME": 1e-8,
    "BALANCED": 2e-6,
    "REDUCED": 2e-5,
    "SURE": 1e-6,
    "ROOM": 5e-6,
    "KEPT": 1e-5,
    "NO_WORSE": 5e-6,
    "PIVOT": 1e-6,
    "ON_THE_RIM": 1e-6,
    "AT_THE_BOUND": 1e-5,
}
"""The values for float32, by name."""
