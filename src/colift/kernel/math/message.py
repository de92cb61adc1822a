"""Numbers in the bytes of a message: 16 bits with sign, low byte first."""

from __future__ import annotations

from colift.kernel.jit import inline

MOST = 32767
"""Largest number that fits; a larger one is sent as this, what is no number as 0."""


@inline
def put(message, at, value):  # type: ignore[no-untyped-def]
    """Write ``value``, rounded, into two bytes from ``at`` on."""
    number = 0
    if value == value:
        number = int(min(max(value, -MOST), MOST) + 32768.5) - 32768
    message[at] = number & 255
    message[at + 1] = (number >> 8) & 255


@inline
def get(message, at):  # type: ignore[no-untyped-def]
    """The number in two bytes from ``at`` on."""
    number = int(message[at]) | int(message[at + 1]) << 8
    return float(number - 65536 if number > MOST else number)
