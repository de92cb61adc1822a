"""The ROS 2 topics of a team: of the nodes (:mod:`colift.deploy.ros`) and of bags, in one table.

Standard messages only. Axes of ``world`` are east, north, up; those of a drone and of the load forward, left, up; quaternions
are xyzw, as in ROS. Names stand below a namespace, :data:`NAMESPACE` unless a node is started in another one.
"""

from __future__ import annotations

from dataclasses import dataclass

NAMESPACE = "/colift"
WORLD = "world"
LOAD = "load"
DIAGNOSTICS = "/diagnostics"


def drone(i: int) -> str:
    """Frame of a drone, and namespace of its topics."""
    return f"drone_{i}"


def cable(i: int) -> str:
    """Frame of a cable: in its end on the load, z along the cable to the drone."""
    return f"cable_{i}"


@dataclass(frozen=True)
class Quality:
    """How messages travel; times in periods of their topic, 0 for none."""

    reliable: bool
    """Whether what is lost is sent again."""
    latched: bool = False
    """Whether who comes later gets the last one."""
    deadline: float = 0.0
    """Longest time between two, after which the receiver counts a silence."""
    lifespan: float = 0.0
    """Age from which a message is not delivered any more."""

    def __str__(self) -> str:
        words = ["reliable" if self.reliable else "best effort", "latched"][: 1 + self.latched]
        words += [f"deadline {self.deadline:g} periods"] * bool(self.deadline)
        words += [f"lifespan {self.lifespan:g} periods"] * bool(self.lifespan)
        return ", ".join(words)


STREAM = Quality(reliable=False, deadline=5.0, lifespan=3.0)
"""What is new in every period: an old message is worth less than none. In lock step it is reliable, for there nobody may miss any."""
KEPT = Quality(reliable=True, latched=True)
"""What is said once."""
NEWS = Quality(reliable=True)


@dataclass(frozen=True)
class Topic:
    """One topic: what it holds, and how it travels."""

    name: str
    """Below the namespace; with ``{i}`` one for each drone; with a slash first as it is."""
    type: str
    writer: str
    """Node that publishes it; ``load side`` is the cascade, or the simulator where it flies without one."""
    holds: str
    unit: str
    frame: str
    quality: Quality
    every: str
    """Period in ``[timing]``, ``once``, or a time in s."""

    def below(self, n: int) -> list[str]:
        """Names for a team of n drones, in their order, below the namespace."""
        return [self.name.format(i=i) for i in range(n)] if "{i}" in self.name else [self.name]

    def names(self, n: int) -> list[str]:
        """The same with :data:`NAMESPACE`."""
        return [name if name.startswith("/") else f"{NAMESPACE}/{name}" for name in self.below(n)]


_ODOMETRY, _WRENCH = "nav_msgs/msg/Odometry", "geometry_msgs/msg/WrenchStamped"

TOPICS = {
    "load": Topic("load/odometry", _ODOMETRY, "simulator", "pose and twist of the load as estimated; a point load stands level", "m, m/s, rad/s", "pose: world; twist: load", STREAM, "position_control"),
    "drone": Topic("drone_{i}/odometry", _ODOMETRY, "simulator", "pose and twist of a drone as estimated", "m, m/s, rad/s", "pose: world; twist: drone_{i}", STREAM, "position_control"),
    "reference": Topic("load/reference", _ODOMETRY, "load side", "where the load should be", "m, m/s, rad/s", "pose: world; twist: load", STREAM, "load_control"),
    "acceleration": Topic("load/acceleration_command", "geometry_msgs/msg/AccelStamped", "load side", "wanted acceleration of the load", "m/s^2, rad/s^2", "linear: world; angular: load", STREAM, "load_control"),
    "wrench": Topic("load/wrench_command", _WRENCH, "load side", "wanted sum of the cables' forces on the load, and their moment about its centre of mass", "N, N m", "world", STREAM, "allocation"),
    "cable_command": Topic("drone_{i}/cable_command", _WRENCH, "allocator", "wanted force of this drone's cable on the load; torque is zero", "N", "world", STREAM, "allocation"),
    "cable": Topic("drone_{i}/cable", _WRENCH, "simulator", "force of this drone's cable on the load as it is; torque is zero", "N", "world", STREAM, "position_control"),
    "setpoint": Topic("drone_{i}/setpoint", "sensor_msgs/msg/Imu", "cascade", "what this drone's inertial sensors should read: attitude, rates, and along z thrust over mass", "1, rad/s, m/s^2", "drone_{i}", STREAM, "position_control"),
    "tf": Topic("/tf", "tf2_msgs/msg/TFMessage", "simulator", "frames load, drone_{i} and cable_{i}: in the cable's end on the load, z along the cable to the drone", "m", "world", NEWS, "position_control"),
    "description": Topic("robot_description", "std_msgs/msg/String", "simulator", "URDF of team and load", "-", "-", KEPT, "once"),
    "clock": Topic("/clock", "rosgraph_msgs/msg/Clock", "simulator", "simulated time", "s", "-", STREAM, "position_control"),
}  # fmt: skip
"""Every topic by a short name of ours."""
