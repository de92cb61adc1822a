"""What a Betaflight is told and tells: its settings, sticks and state in its conventions, thrust of its motor commands.

Its body axes are x forward, y left, z up as ours; its sticks count in microseconds. In angle mode roll and pitch sticks are
angles and the yaw stick is a rate.
"""

from __future__ import annotations

import math
import struct

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

ANGLE_LIMIT = 45.0
"""Tilt at full stick, degrees."""
YAW_LIMIT = 200.0
"""Yaw rate at full stick, degrees/s."""
YAW_GAIN = 2.0
"""Wanted yaw rate per error of yaw, 1/s: with more the yaw loop oscillates."""
CENTRE, SPAN = 1500, 500
"""Of a stick, µs."""
LOW, HIGH = 1000, 2000
"""Switch off and on; throttle closed and full."""
CHECK = 1050
"""Throttle stick up to which nothing is asked, µs: ``min_check``."""
LIFTS = 1052
"""Where its motors' commands begin to rise, with the rounding of its curve, µs (measured)."""
IDLE = 0.055
"""Command of a motor that is armed and asked for nothing: ``motor_idle``."""
CHANNELS = 16

REFERENCE_P, REFERENCE_I, REFERENCE_D = 220.0, 100.0, 180.0
"""Gains of the rate loops for a drone of ``REFERENCE`` rad/s² per motor command."""
REFERENCE = 120.0
"""Turning acceleration about a level axis per change of command of all four motors in hover, 1/s²."""
YAW_P, YAW_I = 200.0, 40.0
MOST = 250
"""Largest gain."""

MOTORS = (2, 1, 3, 0)
"""Of our motors (front left, rear left, rear right, front right) the places in its packet (front right, rear left, front left, rear right)."""

_STATE = struct.Struct("<18d")
_STICKS = struct.Struct(f"<d{CHANNELS}H")
PRESSURE = 101325.0

FIXED = (
    "feature -GPS",
    "feature -TELEMETRY",
    "aux 0 0 0 1700 2100 0 0",  # arm
    "aux 1 1 1 1700 2100 0 0",  # angle mode
    "set acc_calibration = 0,0,0,1",
    "set small_angle = 180",
    "set pwr_on_arm_grace = 0",
    "set runaway_takeoff_prevention = OFF",
    f"set min_check = {CHECK}",
    "set motor_idle = 550",
    "set rc_smoothing = OFF",
    "set simplified_gyro_filter = OFF",
    "set simplified_dterm_filter = OFF",
    "set gyro_lpf1_dyn_min_hz = 0",
    "set gyro_lpf1_static_hz = 250",
    "set gyro_lpf2_static_hz = 0",
    "set simplified_pids_mode = OFF",
    "set iterm_relax = OFF",
    "set anti_gravity_gain = 0",
    "set throttle_boost = 0",
    "set tpa_rate = 0",
    "set tpa_low_rate = 0",
    "set f_roll = 0",
    "set f_pitch = 0",
    "set f_yaw = 0",
    "set d_max_roll = 0",
    "set d_max_pitch = 0",
    "set angle_feedforward = 0",
    f"set angle_limit = {ANGLE_LIMIT:.0f}",
    "set angle_p_gain = 120",
    "set rates_type = ACTUAL",
    *(
        f"set {axis}_{name} = {rate / 10:.0f}"  # linear: the same rate at the centre and at full stick
        for axis, rate in (("roll", 600.0), ("pitch", 600.0), ("yaw", YAW_LIMIT))
        for name in ("rc_rate", "srate")
    ),
    *(f"set {axis}_expo = 0" for axis in ("roll", "pitch", "yaw")),
)
"""Lines of its command line for any drone: what helps a pilot's thumbs is off, for the sticks here are exact."""


def settings(turning: float) -> tuple[str, ...]:
    """Lines of its command line for a drone that turns with ``turning`` (1/s²) per motor command in hover."""
    scale = REFERENCE / turning
    gains = {"p": REFERENCE_P, "i": REFERENCE_I, "d": REFERENCE_D}
    tuned = {
        f"{name}_{axis}": min(max(round(scale * gain), 1), MOST)
        for name, gain in gains.items()
        for axis in ("roll", "pitch")
    } | {"p_yaw": YAW_P, "i_yaw": YAW_I, "d_yaw": 0}
    return (*FIXED, *(f"set {name} = {value:.0f}" for name, value in tuned.items()))


def state(attitude: Array, rates: Array, specific_force: Array) -> bytes:
    """Its packet of the state: attitude (wxyz), body rates (rad/s) and specific force (m/s², body).

    It turns the signs back itself: of y and z of the rates and the quaternion, and of the specific force. The time
    stays 0, so that it never takes the spacing of packets for the speed of its clock.
    """
    w, x, y, z = attitude
    p, q, r = rates
    return _STATE.pack(0.0, p, -q, -r, *(-specific_force), w, x, -y, -z, *(0.0,) * 6, PRESSURE)


def packet(sticks: Array, *, armed: bool) -> bytes:
    """Its packet of the sticks: roll, pitch, throttle and yaw (µs), and the switches."""
    roll, pitch, throttle, yaw = np.clip(np.rint(sticks), LOW, HIGH).astype(int).tolist()
    arm = HIGH if armed else LOW
    rest = (CENTRE,) * (CHANNELS - 6)
    return _STICKS.pack(0.0, roll, pitch, throttle, yaw, arm, HIGH, *rest)


def sticks(attitudes: Array, desired_attitudes: Array, commands: Array) -> Array:
    """Sticks (n, 4), µs, that turn drones to the thrust axes of ``desired_attitudes`` (n, 4), with motor commands (n,).

    With ``h`` the wanted thrust axis in the frame that is turned to the drone's own yaw: roll is ``-asin h_y``,
    pitch ``atan2(h_x, h_z)``. Pitch above the centre is nose down, yaw above it clockwise from above.
    """
    yaw = _yaw(attitudes)
    error = _yaw(desired_attitudes) - yaw
    error = np.arctan2(np.sin(error), np.cos(error))
    w, x, y, z = desired_attitudes.T
    h = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
    forward = np.cos(yaw) * h[0] + np.sin(yaw) * h[1]
    left = np.cos(yaw) * h[1] - np.sin(yaw) * h[0]
    roll = -np.arcsin(np.clip(left, -1.0, 1.0))
    pitch = np.arctan2(forward, h[2])
    angle, rate = math.radians(ANGLE_LIMIT), math.radians(YAW_LIMIT)
    throttle = LIFTS + (HIGH - CHECK) * (commands - IDLE) / (1.0 - IDLE)
    found = np.stack(
        [
            CENTRE + SPAN * roll / angle,
            CENTRE + SPAN * pitch / angle,
            throttle,
            CENTRE - SPAN * YAW_GAIN * error / rate,
        ],
        axis=1,
    )
    return np.asarray(np.clip(found, LOW, HIGH))


def _yaw(attitudes: Array) -> Array:
    w, x, y, z = attitudes.T
    return np.asarray(np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z)))


def thrusts(commands: Array, most: Array) -> Array:
    """Thrust of motors at commands from 0 to 1, N: speed goes with the command, thrust with its square."""
    return np.asarray(most * np.clip(commands, 0.0, 1.0) ** 2)


def command(thrusts: Array, most: Array) -> Array:
    """The command at which a motor has this thrust, N."""
    return np.sqrt(np.clip(thrusts / most, 0.0, 1.0))
