"""What all nodes share: lifecycle, topics with their quality, the loop that runs one, and how it ends."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from types import MappingProxyType
from typing import Any

from colift.deploy.ros.parameters import Parameters, Setting
from colift.errors import MissingExtraError
from colift.extras import install
from colift.mission.mission import Mission
from colift.record.exchange.messages import filled, nanoseconds
from colift.record.exchange.topics import NAMESPACE, TOPICS, Quality, Topic

try:
    import rclpy
    from rcl_interfaces.msg import SetParametersResult
    from rclpy.duration import Duration
    from rclpy.executors import ExternalShutdownException
    from rclpy.experimental import EventsExecutor
    from rclpy.lifecycle import LifecycleNode, TransitionCallbackReturn
    from rclpy.parameter import Parameter
    from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy

    from colift.deploy.ros.nodes.declaring import declare
    from colift.deploy.ros.nodes.diagnosing import OK, Condition, Diagnostics
except ImportError as error:
    raise MissingExtraError(
        f"colift ros: needs ROS 2's rclpy and its messages, the extra ros ({error}); have a ROS 2 installation in "
        f"this Python's path, or run: {install('ros')}"
    ) from None

AGAIN = 0.2
"""Time after which what nobody answered is said again, s."""
SETTLE = 6.0
"""Longest time for what was said to reach all at the end, s."""
DEEP = 1000
"""Messages that wait in lock step for who is slow to take them: nobody may miss any."""
IDLE = 0.05
"""Longest time between two looks at what is due, s."""

Decode = Callable[[Any], Any]


@cache
def message_class(name: str) -> Any:
    """The class of rclpy's messages of a type such as ``nav_msgs/msg/Odometry``."""
    package, _, kind = name.split("/")
    return getattr(importlib.import_module(f"{package}.msg"), kind)


class TeamNode(LifecycleNode):  # type: ignore[misc]  # rclpy has no types for who does not have it
    """A node of a team.

    Attributes
    ----------
    mission : Mission
    parameters : Parameters
        Its parts' settings, as they are now.
    active : bool
        Whether it speaks.
    refused : int
        Messages that nobody flies by: numbers that are not finite, another frame.
    late : int
        Deadlines that a topic it hears has missed.
    zero : int
        Stamp of the mission's beginning, ns: 0 where time is simulated.

    """

    says: tuple[str, ...] = ()
    """Topics (:data:`~colift.record.exchange.topics.TOPICS`) that it publishes."""
    hears: Mapping[str, Decode] = MappingProxyType({})
    """Topics that it hears, and how each message is read."""

    hears_time = True
    """Whether its clock is the simulated one in lock step."""
    sections: tuple[str, ...] = ()
    """Sections of the mission whose settings are its parameters."""

    def __init__(self, name: str, mission: Mission, *, lock_step: bool) -> None:
        told = [Parameter("use_sim_time", value=True)] if lock_step and self.hears_time else []
        super().__init__(name, namespace=NAMESPACE, parameter_overrides=told)
        self.mission, self.n, self.lock_step = mission, mission.team.n, lock_step
        self.does: Any = None
        self.period = round(mission.timing.allocation * 1e9)
        self.active, self.over = False, False
        self.refused = self.late = self.zero = 0
        self._publishers_of: dict[str, list[Any]] = {}
        self._ears: list[Any] = []
        self.parameters = Parameters({s: getattr(mission, s) for s in self.sections}, mission.team)
        self.add_on_set_parameters_callback(self._set)
        declare(self, self.parameters.settings())
        self._diagnostics = Diagnostics(self)

    def _set(self, parameters: Sequence[Any]) -> Any:
        flight = None if self.does is None else self.does.flight
        why = self.parameters.change({each.name: each.value for each in parameters}, flight)
        return SetParametersResult(successful=not why, reason=why)

    def be_patient(self, seconds: float) -> None:
        """Have the parameter ``patience``."""
        words = "how long the allocator's answer is waited for in each cycle, s"
        declare(self, [Setting("patience", seconds, words, 0.0, 10.0, False, ">= 0, <= 10", True)])

    @property
    def patience(self) -> float:
        """How long the allocator's answer is waited for in each cycle, s."""
        return float(self.get_parameter("patience").value)

    def on_configure(self, state: Any) -> Any:
        """Make what the node does anew, and its topics."""
        self.prepare()
        if self.does is not None:
            self.parameters.put(self.does.flight, self.sections)
        for key in self.says:
            topic = TOPICS[key]
            try:
                made = message_class(topic.type)
            except ModuleNotFoundError as error:  # tf2_msgs comes with ROS, but not with its wheels
                self.get_logger().warning(f"{topic.name} is not published: {error}")
                self._publishers_of[key] = []
                continue
            self._publishers_of[key] = [
                self.create_publisher(made, name, self.quality(topic, past=self.lock_step))
                for name in topic.below(self.n)
            ]
        for key in self.hears:
            self._listen(key)
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state: Any) -> Any:
        self.active = True
        self.begin()
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state: Any) -> Any:
        self.active = False
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state: Any) -> Any:
        for publishers in self._publishers_of.values():
            for publisher in publishers:
                self.destroy_publisher(publisher)
        for ear in self._ears:
            self.destroy_subscription(ear)
        self._publishers_of, self._ears = {}, []
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state: Any) -> Any:
        self.active, self.over = False, True
        return TransitionCallbackReturn.SUCCESS

    def prepare(self) -> None:
        """Make what the node does (``does``), at its beginning."""

    def begin(self) -> None:
        """What is to be done on activation."""

    def heard(self, key: str, drone: int, at: int, found: Any) -> None:
        """A message of a topic, read, of a time (ns); ``drone`` is 0 for topics of the team."""

    def due(self, now: float) -> None:
        """Look at what is due at a time of the machine's clock, s."""

    def condition(self) -> Condition:
        """How it is."""
        return Condition(OK, "")

    def look(self, now: float) -> None:
        """What is due, also of the diagnostics; an inactive node tells no more than that."""
        if self.active:
            self.due(now)
        self._diagnostics.due(now)

    def say(self, key: str, fields: Mapping[str, Any], drone: int = 0) -> None:
        """Publish a message, where anybody hears it or may come to hear it."""
        topic = TOPICS[key]
        late = topic.quality.latched or self.lock_step
        if self._publishers_of[key] and (late or self.is_heard(key, drone)):
            made = message_class(topic.type)()
            self._publishers_of[key][drone].publish(filled(made, fields))

    def settle(self) -> None:
        """In lock step, before the end: wait until all have what was said, for a while."""
        end = time.monotonic() + SETTLE * self.lock_step
        for publishers in self._publishers_of.values():
            for publisher in publishers:
                left = end - time.monotonic()
                if left > 0.0 and rclpy.ok():
                    publisher.wait_for_all_acked(Duration(seconds=left))

    def is_heard(self, key: str, drone: int = 0) -> bool:
        """Whether anybody hears a topic."""
        publishers = self._publishers_of[key]
        return bool(publishers) and publishers[drone].get_subscription_count() > 0

    def quality(self, topic: Topic, *, past: bool = False) -> Any:
        """How a topic's messages travel; with what was said before, where the ``past`` is kept or asked for."""
        asked, seconds = topic.quality, self._seconds(topic)
        reliable = asked.reliable or self.lock_step
        profile = QoSProfile(
            depth=DEEP if self.lock_step else 10 if reliable else 1,
            reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
            durability=DurabilityPolicy.TRANSIENT_LOCAL
            if asked.latched or past
            else DurabilityPolicy.VOLATILE,
        )
        if not self.lock_step:  # there time waits for who is late
            profile = _timed(profile, asked, seconds)
        return profile

    def _seconds(self, topic: Topic) -> float:
        return float(getattr(self.mission.timing, topic.every, 0.0))

    def _listen(self, key: str) -> None:
        from rclpy.event_handler import SubscriptionEventCallbacks

        topic, decode = TOPICS[key], self.hears[key]
        made, quality = message_class(topic.type), self.quality(topic)

        def miss(event: Any) -> None:
            self.late += event.total_count_change

        events = SubscriptionEventCallbacks(
            deadline=miss if quality.deadline.nanoseconds > 0 and not self.lock_step else None
        )
        for drone, name in enumerate(topic.below(self.n)):

            def hear(message: Any, drone: int = drone) -> None:
                found = decode(message)
                if found is None:
                    self.refused += 1
                elif self.active:
                    self.heard(key, drone, nanoseconds(message.header.stamp) - self.zero, found)

            self._ears.append(
                self.create_subscription(made, name, hear, quality, event_callbacks=events)
            )


def _timed(profile: Any, asked: Quality, period: float) -> Any:
    if asked.deadline:
        profile.deadline = Duration(seconds=asked.deadline * period)
    if asked.lifespan:
        profile.lifespan = Duration(seconds=asked.lifespan * period)
    return profile


def run(
    make: Callable[[], TeamNode],
    *,
    arguments: Sequence[str] = (),
    activate: bool = True,
    ready: Callable[[], None] = lambda: None,
) -> TeamNode:
    """Make a node and run it until it is over, or somebody ends it: Ctrl-C, SIGTERM, its lifecycle.

    ``ready`` is called once it hears.
    """
    rclpy.init(args=["colift", *arguments])
    node = make()
    executor = EventsExecutor()  # a message costs it half of what the default one takes
    executor.add_node(node)
    try:
        if activate:
            node.trigger_configure()
            node.trigger_activate()
        ready()
        while rclpy.ok() and not node.over:
            executor.spin_once(timeout_sec=IDLE)
            node.look(time.monotonic())
        node.settle()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        executor.remove_node(node)
        node.destroy_node()
        rclpy.try_shutdown()
    return node
