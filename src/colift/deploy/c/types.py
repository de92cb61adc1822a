"""What a value is in translated code: a number, a tuple, an array, a function."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

REAL, INT, BOOL, NOTHING = "real", "int", "bool", "nothing"
NUMBERS = (REAL, INT, BOOL)

Type = Any
"""One of the names above, or one of the classes below."""


@dataclass(frozen=True)
class Array:
    """An array of which C has the place of the first number.

    Attributes
    ----------
    inner : tuple of int
        All dimensions but the first.
    stride : int
        Numbers from one row to the next.
    const : bool
        Nobody may write there.
    length : int or str or None
        First dimension: a number, or how C computes it where the array is used; None if nobody needs to know.
    roots : set of str
        Parameters of the function, or fields of them, of which this is a part.

    """

    inner: tuple[int, ...] = ()
    stride: int = 1
    const: bool = False
    length: int | str | None = field(default=None, compare=False)
    roots: frozenset[str] = field(default=frozenset(), compare=False)

    @property
    def contiguous(self) -> bool:
        """Whether one row follows the other."""
        return self.stride == size(self.inner)

    def bare(self) -> Array:
        """What a function is told of an argument."""
        return replace(self, const=False, length=None, roots=frozenset())


@dataclass(frozen=True)
class Tuple:
    """Several values; with names where ``made`` is their class."""

    each: tuple[Type, ...]
    made: Any = None

    @property
    def uniform(self) -> bool:
        """Whether they are numbers of one kind, which may be looked up by a computed place."""
        return self.made is None and self.each[0] in NUMBERS and len(set(self.each)) == 1

    def names(self) -> tuple[str, ...]:
        """Of its fields in C."""
        if self.made is not None:
            return tuple(self.made._fields)
        return tuple(f"at{k}" for k in range(len(self.each)))


@dataclass(frozen=True)
class Function:
    """A helper that is handed to another."""

    made: Any


def size(dimensions: Iterable[int]) -> int:
    """Their product."""
    found = 1
    for each in dimensions:
        found *= each
    return found


def joined(one: Type, other: Type) -> Type | None:
    """The type of a variable that is now one, now the other; None where there is none."""
    if one == other:
        if isinstance(one, Array):
            length = one.length if one.length == other.length else None
            return replace(one, length=length, roots=one.roots | other.roots)
        if not isinstance(one, Tuple):
            return one
    if isinstance(one, str) and isinstance(other, str):
        return REAL if {one, other} == {REAL, INT} else None
    if isinstance(one, Array) and isinstance(other, Array):
        if (one.inner, one.stride) != (other.inner, other.stride):
            return None
        return joined(replace(one, const=True), replace(other, const=True))
    if isinstance(one, Tuple) and isinstance(other, Tuple):
        if (one.made, len(one.each)) != (other.made, len(other.each)):
            return None
        each = tuple(joined(a, b) for a, b in zip(one.each, other.each, strict=True))
        return None if None in each else Tuple(each, one.made)
    return None


def bare(kind: Type) -> Type:
    """What a function is told of an argument's type: whose it is, and how long, it is told otherwise."""
    if isinstance(kind, Array):
        return kind.bare()
    if isinstance(kind, Tuple):
        each = (replace(e, roots=frozenset()) if isinstance(e, Array) else e for e in kind.each)
        return Tuple(tuple(each), kind.made)
    return kind


def rooted(kind: Type, name: str, lengths: Mapping[str, int | str]) -> Type:
    """The type of a parameter inside of the function: its arrays are parts of it."""
    if isinstance(kind, Array):
        return replace(kind, length=f"{name}_length", roots=frozenset({name}))
    if isinstance(kind, Tuple) and kind.made is not None:
        each = (
            replace(e, length=lengths.get(f, e.length), roots=frozenset({f"{name}.{f}"}))
            if isinstance(e, Array)
            else e
            for f, e in zip(kind.made._fields, kind.each, strict=True)
        )
        return Tuple(tuple(each), kind.made)
    return kind
