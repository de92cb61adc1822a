"""Rotors that do at once what they are told."""

from __future__ import annotations

from colift.kernel.jit import kernel
from colift.world.actuation.base import SIGNATURE, ActuationPart


@kernel(SIGNATURE, counted=False)
def _act(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    thrusts, torques, motor_health = sees.thrusts, sees.torques, sees.motor_health
    applied_thrusts, applied_torques = writes.applied_thrusts, writes.applied_torques
    for i in range(thrusts.shape[0]):
        health = 0.25 * (
            motor_health[i, 0] + motor_health[i, 1] + motor_health[i, 2] + motor_health[i, 3]
        )
        applied_thrusts[i] = health * thrusts[i]
        for k in range(3):
            applied_torques[i, k] = health * torques[i, k]


class Ideal(ActuationPart):
    """No lag, no limits and no motors of their own: a mission in which one fails needs ``motors``; no settings."""

    kernel = _act
    has_motors = False
