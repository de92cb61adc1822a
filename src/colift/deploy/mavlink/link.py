"""MAVLink over UDP: a port, and what is known of the system that speaks there."""

from __future__ import annotations

import select
import socket
from typing import Any

import numpy as np
from numpy.typing import NDArray

from colift.deploy.mavlink import frames
from colift.deploy.mavlink.setpoints import Convention
from colift.errors import ColiftError, MissingExtraError
from colift.extras import install

Array = NDArray[np.float64]

try:
    from pymavlink.dialects.v20 import common as mavlink
except ImportError as error:
    raise MissingExtraError(f"MAVLink needs the package pymavlink: {install('mavlink')}") from error

__all__ = ["HOST", "LOAD", "STATION", "Line", "Tracked", "Vehicle", "mavlink"]

HOST = "127.0.0.1"
STATION, LOAD = 255, 200
"""Numbers of the system that controls, and of the one that tracks the load."""
MOST = 1000
"""Most datagrams that are read at once: who floods us does not stop us."""
BEAT = 1.0
"""Time between two heartbeats, s."""
AGAIN = 0.5
"""Time after which a command is repeated that has not shown, s."""


class Line:
    """A UDP port of ours. Answers go to where the last message came from, or to ``to`` from the beginning."""

    def __init__(
        self, host: str, port: int, system: int, to: tuple[str, int] | None = None
    ) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        try:
            self._socket.bind((host, port))
        except OSError as error:
            self._socket.close()
            raise ColiftError(f"UDP port {port} of {host}: {error.strerror}") from error
        self._to = to
        self.mav: Any = mavlink.MAVLink(self, srcSystem=system, srcComponent=1)
        self.mav.robust_parsing = True

    @property
    def address(self) -> tuple[str, int]:
        """Address and port that it has."""
        host, port = self._socket.getsockname()
        return str(host), int(port)

    def write(self, data: bytes) -> None:
        """Send bytes; a peer that is not there is found out by its silence."""
        if self._to is not None:
            try:
                self._socket.sendto(data, self._to)
            except OSError:
                return

    def received(self) -> list[Any]:
        """The messages that have come in."""
        found: list[Any] = []
        for _ in range(MOST):
            try:
                data, sender = self._socket.recvfrom(2048)
            except BlockingIOError:
                break
            except ConnectionError:  # what was sent before found nobody
                continue
            messages = self.mav.parse_buffer(data) or []
            good = [each for each in messages if each.get_type() != "BAD_DATA"]
            if good:
                self._to = sender
            found += good
        return found

    def wait(self, seconds: float) -> None:
        """Wait for a message, for so long at most."""
        select.select([self._socket], [], [], seconds)

    def close(self) -> None:
        """Close the port."""
        self._socket.close()


class Tracked:
    """A system that tells where it is, in our world and body axes.

    Attributes
    ----------
    position, velocity, attitude, rates : array
        As last told: m, m/s, wxyz, rad/s.
    placed, turned : float
        When it last told place and attitude, s; minus infinity if never.

    """

    def __init__(self, line: Line, system: int, title: str) -> None:
        self.line, self.system, self.title = line, system, title
        self.position, self.velocity = np.zeros(3), np.zeros(3)
        self.attitude, self.rates = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
        self.placed = self.turned = -np.inf

    def listen(self, now: float) -> None:
        """Take what has come in; what is not a number is left out."""
        for message in self.line.received():
            if message.get_srcSystem() == self.system:
                self._take(message, now)

    def _take(self, message: Any, now: float) -> None:
        kind = message.get_type()
        if kind == "LOCAL_POSITION_NED":
            told = frames.world(
                [[message.x, message.y, message.z], [message.vx, message.vy, message.vz]]
            )
            if np.isfinite(told).all():
                (self.position, self.velocity), self.placed = told, now
        elif kind == "ATTITUDE_QUATERNION":
            q = frames.attitude([message.q1, message.q2, message.q3, message.q4])
            rates = frames.body([message.rollspeed, message.pitchspeed, message.yawspeed])
            norm = float(np.linalg.norm(q))
            if np.isfinite(rates).all() and 0.5 < norm < 2.0:
                self.attitude, self.rates, self.turned = q / norm, rates, now

    def age(self, now: float) -> float:
        """Time since it last told where it is, s."""
        return now - self.placed


class Vehicle(Tracked):
    """A vehicle that is flown by set-points.

    Attributes
    ----------
    armed : bool
    obeys : bool
        Whether it is in the mode in which it follows set-points.

    """

    def __init__(self, line: Line, system: int, title: str, convention: Convention) -> None:
        super().__init__(line, system, title)
        self.convention = convention
        self.armed = self.obeys = False
        self._beat = self._asked = -np.inf

    def _take(self, message: Any, now: float) -> None:
        if message.get_type() == "HEARTBEAT":
            self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
            self.obeys = message.custom_mode == self.convention.custom_mode
        super()._take(message, now)

    def age(self, now: float) -> float:
        """Time since it last told all of where it is, s."""
        return now - min(self.placed, self.turned)

    def beat(self, now: float) -> None:
        """Say once a second that we are there."""
        if now - self._beat >= BEAT:
            self._beat = now
            self.line.mav.heartbeat_send(
                mavlink.MAV_TYPE_ONBOARD_CONTROLLER, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, mavlink.MAV_STATE_ACTIVE,
            )  # fmt: skip

    def say(self, target: dict[str, Any]) -> None:
        """Send a set-point: fields of SET_ATTITUDE_TARGET or, where it has a frame, of SET_POSITION_TARGET_LOCAL_NED."""
        send = (
            self.line.mav.set_position_target_local_ned_send
            if "coordinate_frame" in target
            else self.line.mav.set_attitude_target_send
        )
        send(target_system=self.system, target_component=1, **target)

    def tell(self, name: str, now: float, vector: Array) -> None:
        """Tell a vector of our world, so that the vehicle logs it."""
        north, east, down = frames.world(vector).tolist()
        self.line.mav.debug_vect_send(
            name.encode(), round(1e6 * now) % (1 << 64), north, east, down
        )

    def take_over(self, now: float) -> None:
        """Ask it to follow set-points and to arm, as long as it does not."""
        if now - self._asked < AGAIN:
            return
        self._asked = now
        if not self.obeys:
            self.command(mavlink.MAV_CMD_DO_SET_MODE, *self.convention.mode)
        elif not self.armed:
            self.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)

    def hand_back(self) -> None:
        """Ask it to hold its place by itself."""
        self.command(mavlink.MAV_CMD_DO_SET_MODE, *self.convention.hold)

    def command(self, number: int, *values: float) -> None:
        """Send a command with its first parameters."""
        rest = (0.0,) * (7 - len(values))
        self.line.mav.command_long_send(self.system, 1, number, 0, *values, *rest)
