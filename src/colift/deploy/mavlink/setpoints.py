"""What a vehicle is told: attitude and thrust, or where to be; by PX4's and ArduPilot's conventions.

Fields are those of MAVLink's messages, by name; packing them is the link's (:mod:`colift.deploy.mavlink.link`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from colift.deploy.mavlink import frames

LOCAL_NED = 1
"""MAV_FRAME_LOCAL_NED."""
NO_BODY_RATES = 1 | 2 | 4
"""Of an attitude target: the rates are not to be followed."""
NO_POSITION, NO_VELOCITY, NO_ACCELERATION = 1 | 2 | 4, 8 | 16 | 32, 64 | 128 | 256
NO_YAW, NO_YAW_RATE = 1024, 2048
"""Of a position target: what is not to be followed."""


@dataclass(frozen=True)
class Convention:
    """What one family of autopilots expects.

    Attributes
    ----------
    name : str
    autopilot : int
        What it calls itself in a heartbeat (MAV_AUTOPILOT).
    mode : sequence of float
        Parameters of MAV_CMD_DO_SET_MODE for off-board control.
    hold : sequence of float
        The same for holding its place by itself.
    custom_mode, hold_mode : int
        What its heartbeat says then.
    slowest : float
        Longest time between two set-points that it takes for a stream, s.
    silence : float
        Time without any after which it goes its own way, s.
    hover : float
        Thrust (0 to 1) at which it hovers by itself unless it says otherwise.

    """

    name: str
    autopilot: int
    mode: Sequence[float]
    hold: Sequence[float]
    custom_mode: int
    hold_mode: int
    slowest: float
    silence: float
    hover: float


CONVENTIONS = {
    # OFFBOARD and AUTO.LOITER; more than 2 Hz, for a second before it may be entered; COM_OF_LOSS_T; MPC_THR_HOVER.
    "px4": Convention(
        "PX4", 12, (1.0, 6.0, 0.0), (1.0, 4.0, 3.0), 6 << 16, 4 << 16 | 3 << 24, 0.5, 1.0, 0.5
    ),
    # GUIDED and LOITER; GUID_TIMEOUT; MOT_THST_HOVER. Thrust is one only with bit 3 of GUID_OPTIONS, a climb rate otherwise.
    "ardupilot": Convention("ArduPilot", 3, (1.0, 4.0, 0.0), (1.0, 5.0, 0.0), 4, 5, 0.5, 3.0, 0.35),
}
"""By name."""


def normalised(thrust: float, weight: float, hover: float) -> float:
    """A thrust (N) from 0 to 1, for an autopilot that hovers its own ``weight`` (N) at ``hover``."""
    return min(max(hover * thrust / weight, 0.0), 1.0)


def newtons(thrust: float, weight: float, hover: float) -> float:
    """What :func:`normalised` makes of thrusts, back to N."""
    return thrust * weight / hover


def attitude_target(time: float, attitude: ArrayLike, thrust: float) -> dict[str, Any]:
    """SET_ATTITUDE_TARGET: our attitude (wxyz) and a thrust from 0 to 1; rates are left to the vehicle."""
    return {
        "time_boot_ms": _milliseconds(time),
        "type_mask": NO_BODY_RATES,
        "q": frames.attitude(attitude).tolist(),
        "body_roll_rate": 0.0,
        "body_pitch_rate": 0.0,
        "body_yaw_rate": 0.0,
        "thrust": thrust,
    }


def position_target(
    time: float,
    yaw: float,
    position: ArrayLike | None = None,
    velocity: ArrayLike | None = None,
    acceleration: ArrayLike | None = None,
) -> dict[str, Any]:
    """SET_POSITION_TARGET_LOCAL_NED: what is given of place, velocity and acceleration in our world, and our heading (rad).

    The acceleration is that of the vehicle less what else than its thrust and gravity pulls on it: its cable.
    """
    masks = (
        (position, NO_POSITION),
        (velocity, NO_VELOCITY),
        (acceleration, NO_ACCELERATION),
    )
    mask = sum(bits for value, bits in masks if value is None)
    values = [frames.world(np.zeros(3) if value is None else value).tolist() for value, _ in masks]
    (x, y, z), (vx, vy, vz), (afx, afy, afz) = values
    return {
        "time_boot_ms": _milliseconds(time),
        "coordinate_frame": LOCAL_NED,
        "type_mask": mask | NO_YAW_RATE,
        "x": x, "y": y, "z": z, "vx": vx, "vy": vy, "vz": vz, "afx": afx, "afy": afy, "afz": afz,
        "yaw": frames.yaw(yaw),
        "yaw_rate": 0.0,
    }  # fmt: skip


def _milliseconds(time: float) -> int:
    return round(1e3 * time) % (1 << 32)
