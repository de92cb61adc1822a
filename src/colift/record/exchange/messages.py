"""Between numbers and messages, whoever's classes these are: those of rclpy and of rosbags have the same fields.

A message is written as a mapping of its fields that are not zero, nested as they are; :func:`filled` puts them into one of
rclpy's. What is read is None where a number is not finite or the frame is another one: nobody flies by such a message.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from colift.record.exchange.topics import LOAD, WORLD, cable, drone
from colift.team.geometry import zero_yaw_quaternion

Array = NDArray[np.float64]
Fields = dict[str, Any]


class Body(NamedTuple):
    """Motion of the load or of a drone."""

    position: Array
    """(3,) m, world."""
    velocity: Array
    """(3,) m/s, world."""
    attitude: Array
    """(4,) wxyz, body to world."""
    rates: Array
    """(3,) rad/s, body."""


class Setpoint(NamedTuple):
    """What a drone is told."""

    attitude: Array
    """(4,) wxyz, body to world."""
    rates: Array
    """(3,) rad/s, body."""
    specific_force: float
    """Thrust over mass, m/s^2."""


def nanoseconds(stamp: Any) -> int:
    """Of a message's stamp."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)


def stamp(at: int) -> Fields:
    """Of a time in ns."""
    return {"sec": at // 1_000_000_000, "nanosec": at % 1_000_000_000}


def _header(at: int, frame: str) -> Fields:
    return {"stamp": stamp(at), "frame_id": frame}


def _vector(values: Any) -> Fields:
    x, y, z = (float(value) for value in values)
    return {"x": x, "y": y, "z": z}


def _quaternion(wxyz: Any) -> Fields:
    w, x, y, z = (float(value) for value in wxyz)
    return {"x": x, "y": y, "z": z, "w": w}


def odometry(at: int, child: str, body: Body) -> Fields:
    """``nav_msgs/Odometry``, whose twist is in the body's own frame."""
    return {
        "header": _header(at, WORLD),
        "child_frame_id": child,
        "pose": {
            "pose": {
                "position": _vector(body.position),
                "orientation": _quaternion(body.attitude),
            }
        },
        "twist": {
            "twist": {
                "linear": _vector(rotated(body.attitude, body.velocity, back=True)),
                "angular": _vector(body.rates),
            }
        },
    }


def body_of(message: Any, frame: str = WORLD) -> Body | None:
    """The motion in a ``nav_msgs/Odometry``, in the frame of that name."""
    pose, twist = message.pose.pose, message.twist.twist
    position, linear, rates = xyz(pose.position), xyz(twist.linear), xyz(twist.angular)
    attitude = _unit(pose.orientation)
    if attitude is None or not (_stands(message, frame) and finite(position, linear, rates)):
        return None
    return Body(position, rotated(attitude, linear), attitude, rates)


def wrench(at: int, force: Any, moment: Any = (0.0, 0.0, 0.0)) -> Fields:
    """``geometry_msgs/WrenchStamped`` in the world's axes."""
    return {
        "header": _header(at, WORLD),
        "wrench": {"force": _vector(force), "torque": _vector(moment)},
    }


def wrench_of(message: Any) -> tuple[Array, Array] | None:
    """Force, N, and moment, N m, of a ``geometry_msgs/WrenchStamped``."""
    force, moment = xyz(message.wrench.force), xyz(message.wrench.torque)
    return (force, moment) if _stands(message) and finite(force, moment) else None


def acceleration(at: int, linear: Any, angular: Any) -> Fields:
    """``geometry_msgs/AccelStamped``."""
    return {
        "header": _header(at, WORLD),
        "accel": {"linear": _vector(linear), "angular": _vector(angular)},
    }


def acceleration_of(message: Any) -> tuple[Array, Array] | None:
    """Linear, m/s^2, and angular acceleration, rad/s^2, of a ``geometry_msgs/AccelStamped``."""
    linear, angular = xyz(message.accel.linear), xyz(message.accel.angular)
    return (linear, angular) if _stands(message) and finite(linear, angular) else None


def setpoint(at: int, frame: str, wanted: Setpoint) -> Fields:
    """``sensor_msgs/Imu``: what the drone's own should read."""
    return {
        "header": _header(at, frame),
        "orientation": _quaternion(wanted.attitude),
        "angular_velocity": _vector(wanted.rates),
        "linear_acceleration": {"x": 0.0, "y": 0.0, "z": float(wanted.specific_force)},
    }


def setpoint_of(message: Any) -> Setpoint | None:
    """The set-point in a ``sensor_msgs/Imu``."""
    rates, force = xyz(message.angular_velocity), xyz(message.linear_acceleration)
    attitude = _unit(message.orientation)
    if attitude is None or not finite(rates, force):
        return None
    return Setpoint(attitude, rates, float(force[2]))


def frames(at: int, load: Body, drones: Sequence[Body], ends: Array) -> list[Fields]:
    """``geometry_msgs/TransformStamped`` of the frames below the world's; ``ends`` (n, 3) of the cables, m."""
    poses = {LOAD: (load.position, load.attitude)}
    poses |= {drone(i): (body.position, body.attitude) for i, body in enumerate(drones)}
    for i, (body, end) in enumerate(zip(drones, ends, strict=True)):
        poses[cable(i)] = end, pointing(body.position - end)
    return [
        {
            "header": _header(at, WORLD),
            "child_frame_id": name,
            "transform": {"translation": _vector(place), "rotation": _quaternion(attitude)},
        }
        for name, (place, attitude) in poses.items()
        if finite(place, attitude)
    ]


def pointing(away: Array) -> Array:
    """An attitude, wxyz, whose z points along a vector; level for one without length."""
    length = float(np.linalg.norm(away))
    along = away / length if length > 1e-9 else np.array([0.0, 0.0, 1.0])
    return zero_yaw_quaternion(along) if along[2] > -0.999999 else np.array([0.0, 1.0, 0.0, 0.0])


def filled(message: Any, fields: Mapping[str, Any]) -> Any:
    """A message of rclpy with these fields."""
    for name, value in fields.items():
        if isinstance(value, Mapping):
            filled(getattr(message, name), value)
        else:
            setattr(message, name, value)
    return message


def xyz(vector: Any) -> Array:
    """A vector or point (3,)."""
    return np.array([vector.x, vector.y, vector.z])


def finite(*values: Array) -> bool:
    """Whether all are numbers."""
    return all(bool(np.isfinite(value).all()) for value in values)


def rotated(attitude: Any, vector: Any, *, back: bool = False) -> Array:
    """A vector (..., 3) from a body's frame into the world's by its attitude (..., 4) wxyz; ``back`` the other way."""
    w, v = np.asarray(attitude)[..., :1], np.asarray(attitude)[..., 1:]
    across = 2.0 * np.cross(-v if back else v, vector)
    return np.asarray(vector + w * across + np.cross(-v if back else v, across))


def _stands(message: Any, frame: str = WORLD) -> bool:
    return bool(message.header.frame_id == frame)


def _unit(quaternion: Any) -> Array | None:
    """Unit quaternion wxyz; None for one that is none."""
    found = np.array([quaternion.w, quaternion.x, quaternion.y, quaternion.z])
    length = float(np.linalg.norm(found))
    return found / length if abs(length - 1.0) < 0.1 else None


def shares(forces: Sequence[Array], before: Array) -> tuple[Array, Array]:
    """Tensions (n,), N, and directions (n, 3) from drone to load of the cables' forces on the load; without a force the direction before."""
    pulls = np.array(forces)
    tensions = np.linalg.norm(pulls, axis=1)
    taut = tensions > 1e-9
    directions = np.where(taut[:, None], -pulls / np.where(taut, tensions, 1.0)[:, None], before)
    return tensions, directions
