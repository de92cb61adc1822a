"""The contract of the attitude-control layer: from wanted attitude to torque."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

import numpy as np

from colift.control.tuning import loop_growth
from colift.kernel.ports import PORTS
from colift.part import Part, Setup, Vector
from colift.team import Team

SIGNATURE = PORTS["attitude_control"].signature
"""Of ``kernel(now, sees, params, memory, writes)`` with the port of this layer (:data:`colift.kernel.ports.PORTS`).

Called at the layer's own period, ``now.dt``.
"""


class AttitudeControlPart(Part):
    """Base of all attitude controllers."""

    layer: ClassVar[str] = "attitude_control"
    gain_setting: ClassVar[str] = "kind"
    """Setting of the damping gain, for messages."""
    senses: ClassVar[tuple[str, ...]] = ("attitude", "rates")
    """The sensors (:data:`colift.world.sensing.base.SENSORS`) whose delay it suffers."""

    def gains(self, team: Team) -> tuple[Vector, Vector, Vector] | None:
        """Of each drone and body axis (n, 3), for small turns: ``tau = -K (Omega + rho q_e)``.

        ``K`` (N m s), what a robust term adds to it near zero, and ``rho`` (1/s); None where there is no such law.
        """
        return None

    def made_up_for(self) -> tuple[float, float]:
        """Delay and lag that the law predicts away, s."""
        return 0.0, 0.0

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        yield from self.unstable(mission)

    def unstable(self, mission: Setup) -> list[tuple[str, str]]:
        """Gains that sampling, delay and motors of the mission do not bear, or hardly, as for :meth:`warnings`.

        Judged with the true inertias; the worst axis of the worst drone stands for all.
        """
        return [warning for warning, _ in self._judged(mission)]

    def diverges(self, mission: Setup) -> list[str]:
        """Of these, with their fields, the ones of a loop that diverges in any case."""
        found = self._judged(mission)
        return [
            f"{self.layer}.{field}: {message}" for (field, message), certain in found if certain
        ]

    def _judged(self, mission: Setup) -> list[tuple[tuple[str, str], bool]]:
        found = self.gains(mission.team)
        if found is None:
            return []
        K, robust, rho = (np.asarray(each, dtype=float) for each in found)
        J = mission.true_team.inertias
        delays = mission.sensing.delays()
        known_delay, known_lag = self.made_up_for()
        delay = max(max(delays[sensor] for sensor in self.senses) - known_delay, 0.0)
        lag = mission.actuation.motor_lag()
        lag = 0.0 if abs(lag - known_lag) <= 0.5 * lag else lag
        dt = mission.timing.attitude_control

        def growth(extra: float, share: float) -> float:
            cases = {
                (share * (K[i, k] + extra * robust[i, k]), rho[i, k], J[i, k])
                for i in range(len(K))
                for k in range(3)
            }
            return max(
                loop_growth(*case, period=dt, delay=delay, lag=lag)
                for case in sorted(cases)[-MOST_CASES:]
            )

        ratio = K * dt / J
        i, k = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
        told = "" if np.allclose(J, mission.team.inertias) else " (truth.inertia_factor)"
        with_what = [f"timing.attitude_control = {dt:g} s"]
        with_what += [f"{1e3 * delay:g} ms of delay (sensing)"] * (delay > 0.0)
        with_what += [f"{1e3 * lag:g} ms of motor lag (actuation)"] * (lag > 0.0)
        facts = (
            f"K_d dt / J is {ratio[i, k]:.3g} (axis {'xyz'[k]} of drone {i}, inertia {J[i, k]:.4g} kg m^2{told}, "
            f"{', '.join(with_what)})"
        )
        field = self.gain_setting
        if growth(0.0, 1.0) > 1.0 + 1e-9:
            limit = (
                "above 2 it does so without any delay"
                if ratio[i, k] >= 2.0
                else "the gains are too high"
            )
            return [((field, f"{facts}: the attitude loop diverges; {limit}"), True)]
        if robust.any() and growth(1.0, 1.0) > 1.0 + 1e-9:
            return [
                (
                    (
                        field,
                        f"{facts}: the attitude trembles, with what the robust term adds near zero",
                    ),
                    False,
                )
            ]
        if growth(0.0, NEAR) > 1.0 + 1e-9:
            return [((field, f"{facts}: {NEAR:g} times the gain would diverge"), False)]
        return []


NEAR = 1.4
"""Gain margin below which a loop is warned of (3 dB)."""
MOST_CASES = 32
"""Most different drones and axes that are judged, those with the highest gains."""
