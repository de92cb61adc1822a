"""Parameters of a node, with descriptors."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException

from colift.deploy.ros.parameters import Setting
from colift.errors import SettingError


def declare(node: Any, settings: Iterable[Setting]) -> None:
    """Declare them; values that ROS was given at the start are checked as later ones are.

    Raises
    ------
    SettingError
        For one of those that is refused.

    """
    for each in settings:
        try:
            node.declare_parameter(each.name, each.value, _descriptor(each))
        except (InvalidParameterValueException, InvalidParameterTypeException) as error:
            raise SettingError.of(
                each.name, "", f"{error} ({each.words or type(each.value).__name__})"
            ) from None


def _descriptor(each: Setting) -> Any:
    found = ParameterDescriptor(
        description=" ".join(each.meaning.split()),
        additional_constraints=each.words,
        dynamic_typing=not each.fixed,
    )
    if each.low is not None and each.high is not None:
        if each.whole:
            found.integer_range = [
                IntegerRange(from_value=int(each.low), to_value=int(each.high), step=1)
            ]
        else:
            found.floating_point_range = [
                FloatingPointRange(from_value=float(each.low), to_value=float(each.high))
            ]
    return found
