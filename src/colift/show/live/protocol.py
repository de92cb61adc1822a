"""What a page may say to the server; anything else is refused.

``docs/live.md`` has the whole protocol. What the server says is made in :mod:`colift.show.live.server`.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from colift.show.live.session import Session

VERSION = 1
MAX_BYTES = 16_384
"""Largest message that is read."""

Coordinate = Annotated[float, Field(ge=-1e3, le=1e3)]
Triple = tuple[Coordinate, Coordinate, Coordinate]
Name = Annotated[
    str, Field(min_length=1, max_length=64, pattern=r"^[a-z][a-z_]*(\.[a-z0-9][a-z0-9_]*)*$")
]
Kind = Annotated[str, Field(min_length=1, max_length=64)]


class Message(BaseModel):
    """Unknown keys, texts for numbers, and numbers that are not finite are errors."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False, frozen=True)


class Hello(Message):
    """Who is there; the first message."""

    type: Literal["hello"]
    token: Annotated[str, Field(max_length=256)] | None = None


class Ack(Message):
    """Rows up to this one have been shown."""

    type: Literal["ack"]
    seq: Annotated[int, Field(ge=0, le=2**53)]


class Command(Message):
    """Something that only the client that steers may ask for."""

    def perform(self, session: Session) -> None:
        """Do it, in the thread that flies."""
        raise NotImplementedError


class Set(Command):
    """Turn a knob."""

    type: Literal["set"]
    name: Name
    value: Annotated[float, Field(ge=-1e6, le=1e6)]

    def perform(self, session: Session) -> None:
        session.turn(self.name, self.value)


class Choose(Command):
    """Put another part in place."""

    type: Literal["choose"]
    name: Name
    value: Kind

    def perform(self, session: Session) -> None:
        session.choose(self.name, self.value)


class Simple(Command):
    """An action without further values."""

    type: Literal["do"]
    action: Literal["pause", "resume", "reset", "save"]

    def perform(self, session: Session) -> None:
        {
            "pause": session.pause,
            "resume": session.resume,
            "reset": session.reset,
            "save": session.save,
        }[self.action]()


class Push(Command):
    """A force on the load for a while."""

    type: Literal["do"]
    action: Literal["push"]
    force: Triple
    """World frame, N."""
    seconds: Annotated[float, Field(gt=0.0, le=60.0)]

    def perform(self, session: Session) -> None:
        session.push(self.force, self.seconds)


class Cut(Command):
    """Cut a cable; its drone leaves."""

    type: Literal["do"]
    action: Literal["cut"]
    drone: Annotated[int, Field(ge=0, le=1023)]

    def perform(self, session: Session) -> None:
        session.cut(self.drone)


class Target(Command):
    """Fly the load to a point."""

    type: Literal["do"]
    action: Literal["target"]
    position: Triple
    """World frame, m."""

    def perform(self, session: Session) -> None:
        session.target(self.position)


class Steer(Command):
    """Fly the load with this velocity, for a moment."""

    type: Literal["do"]
    action: Literal["steer"]
    velocity: Triple
    """World frame, m/s."""

    def perform(self, session: Session) -> None:
        session.steer(self.velocity)


_Do = Annotated[Simple | Push | Cut | Target | Steer, Field(discriminator="action")]
_Any = Annotated[Hello | Ack | Set | Choose | _Do, Field(discriminator="type")]
_ADAPTER: TypeAdapter[Message] = TypeAdapter(_Any)


def parse(text: str) -> Message:
    """The message in a text.

    Raises
    ------
    ValueError
        For anything that is not one (a pydantic ``ValidationError``).

    """
    return _ADAPTER.validate_json(text)
