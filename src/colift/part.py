"""What all replaceable parts have in common, and how they are found by name.

A *part* is one implementation of one layer: a file in the layer's folder holding one class. The
class is its settings (a pydantic model: validated, named, documented) and knows how to turn them
into what a kernel wants: a parameter vector and a memory vector.
"""

from __future__ import annotations

import importlib
import importlib.util
import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Protocol, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, ValidationError

from colift import catalogue
from colift.catalogue import FOLDERS as FOLDERS
from colift.catalogue import LAYERS as LAYERS
from colift.catalogue import LISTS as LISTS
from colift.errors import ColiftError, SettingError, UnknownNameError
from colift.extras import install
from colift.kernel.layout import Layout
from colift.team import Team
from colift.wording import Refusing, problems_of

Vector = NDArray[np.float64]
Places = NDArray[np.int64]

KIND = ("kind",)
"""Key beside a part's settings in a mission's section."""


class Declared(Protocol):
    """What a mission says to the parts that are to control it, before there are any."""

    @property
    def timing(self) -> Any:
        """Duration, physics step and periods, s, and the declared delay."""
        ...

    @property
    def sensing(self) -> Any:
        """The part of this layer, as of the next one; None where it is not valid."""
        ...

    @property
    def actuation(self) -> Any: ...


@dataclass(frozen=True)
class Declaration:
    """What is said of a mission while its parts are being made."""

    timing: Any
    sensing: Any = None
    actuation: Any = None


class Setup(Declared, Protocol):
    """What a part may look at of the mission that it flies in, to warn before the flight."""

    @property
    def team(self) -> Team:
        """What the controllers are told of drones, cables and load."""
        ...

    @property
    def kinds(self) -> Mapping[str, str]:
        """Name of the part in each layer."""
        ...

    @property
    def true_team(self) -> Team:
        """The bodies as they are."""
        ...

    @property
    def events(self) -> Sequence[Any]:
        """Changes during the flight."""
        ...

    @property
    def allocation(self) -> Any:
        """The part of this layer."""
        ...

    @property
    def reference(self) -> Any:
        """The part of this layer."""
        ...

    @property
    def disturbance(self) -> Sequence[Any]:
        """Disturbances, all at once."""
        ...

    def first_drones(self) -> list[int]:
        """Numbers of the drones that fly from the start."""
        ...

    def start_directions(self) -> Vector:
        """Unit cable directions (k, 3) at t = 0 of the drones that fly from the start."""
        ...


class Part(BaseModel, metaclass=Refusing):
    """Settings of one implementation of one layer.

    A subclass declares its fields, names its ``kernel`` and packs the fields for it. Kernels may be
    compiled (:func:`colift.kernel.jit.kernel`, with the layer's signature) or plain Python functions.
    """

    model_config = ConfigDict(extra="forbid", validate_assignment=True, allow_inf_nan=False)

    layer: ClassVar[str]
    kernel: ClassVar[Callable[..., Any]]
    needs: ClassVar[tuple[str, str] | None] = None
    """Package beyond colift's own that the kernel calls, and the extra that it belongs to."""
    remembers: ClassVar[Layout] = Layout()
    """Names of the places in the kernel's memory; sizes that depend on the settings are filled in by :meth:`layout`."""
    per_drone: ClassVar[tuple[str, ...]] = ()
    """Settings that may be a list with one value per drone."""
    delays_declared: ClassVar[tuple[str, ...]] = ()
    """Settings that are the mission's ``timing.delay``, where it has one and does not give them themselves."""
    from_team: ClassVar[Mapping[str, float | None]] = {}
    """Settings that are the team's where they are None (:meth:`left_open`), and what they are where it does not know."""
    of_all: ClassVar[tuple[str, ...]] = ()
    """Of these, the ones that follow from all drones together, and so are others once one has left or joined."""

    def __setattr__(self, name: str, value: Any) -> None:
        try:
            super().__setattr__(name, value)
        except ValidationError as error:
            raise SettingError(problems_of(error, type(self), {name: value})) from error

    @classmethod
    def declared(cls, mission: Declared) -> dict[str, Any]:
        """Defaults that the mission declares in one place, by the name of the setting; they go before the part's own."""
        delay = mission.timing.delay
        return {} if delay is None else dict.fromkeys(cls.delays_declared, delay)

    def of(self, drones: Sequence[int]) -> Self:
        """Settings for the team of these drones: of values per drone, theirs; what was left to the team is left to this one."""
        lists = {
            name: [value[drone] for drone in drones]
            for name in self.per_drone
            if isinstance(value := getattr(self, name), list)
        }
        return (self.model_copy(update=lists) if lists else self).unsettled(self.of_all)

    def unsettled(self, names: Iterable[str]) -> Self:
        """The settings of which those of ``names`` that were not given are left to the team, again."""
        left = {name: None for name in names if name not in self.model_fields_set}
        if all(getattr(self, name) is None for name in left):
            return self
        copy = self.model_copy(update=left)
        copy.model_fields_set.difference_update(left)
        return copy

    def left_open(self, team: Team) -> dict[str, Vector]:
        """Of the settings in :attr:`from_team` what they are by the team's numbers (n,); not finite where unknown."""
        return {}

    def settled(self, name: str, team: Team) -> Vector:
        """A setting of :attr:`from_team` for each drone (n,): as given, else by the team's numbers, else its default."""
        given = getattr(self, name)
        if given is None:
            known, default = self.left_open(team)[name], self.from_team[name]
            return np.where(np.isfinite(known), known, math.inf if default is None else default)
        return np.array(np.broadcast_to(np.asarray(given, dtype=float), team.n))

    def filled(self, team: Team) -> Self:
        """The settings with what is left to the team filled in."""
        values = {
            name: self.settled(name, team) for name in self.from_team if getattr(self, name) is None
        }
        found = {
            name: float(value[0]) if np.all(value == value[0]) else value.tolist()
            for name, value in values.items()
            if np.isfinite(value).all()
        }
        if not found:
            return self
        copy = self.model_copy(update=found)
        copy.model_fields_set.difference_update(found)
        return copy

    def by_team(self, team: Team) -> list[str]:
        """Settings that were not given and that the team's numbers say."""
        known = self.left_open(team)
        return [
            name
            for name in self.from_team
            if name not in self.model_fields_set and np.isfinite(known[name]).all()
        ]

    def wrong_lengths(self, n: int) -> list[tuple[str, str]]:
        """Lists with one value per drone whose length is not the number of drones, as for :meth:`check`."""
        return [
            (name, f"{len(value)} values; must be one value or one for each of {n} drones")
            for name in self.per_drone
            if isinstance(value := getattr(self, name), list) and len(value) != n
        ]

    def params(self, team: Team) -> Vector:
        """Parameter vector of the kernel; constant between two calls of the kernel."""
        return np.zeros(0)

    def layout(self) -> Layout:
        """What :attr:`remembers` names, with the sizes that these settings ask for."""
        return self.remembers

    def memory(self, team: Team) -> Vector:
        """Memory vector of the kernel in its initial state (integrators, warm starts, scratch)."""
        return self.layout().zeros(team.n)

    def carry_over(self, old: Vector, fresh: Vector, places: Places) -> Vector:
        """Memory for the flight's next leg, after a drone has left or joined.

        ``old`` is the memory so far, ``fresh`` that of a start with the new team; ``places[i]`` is the
        place that drone i of the new team had in the old one, or -1. What :meth:`layout` names is kept; of other
        vectors those whose length does not depend on the number of drones.
        """
        layout = self.layout()
        if layout.size(1) > 0:
            return layout.carry_over(old, fresh, places)
        return old if fresh.size == old.size else fresh

    def call(
        self,
        team: Team,
        memory: Vector,
        *,
        params: Vector | None = None,
        step: int = 0,
        time: float = 0.0,
        dt: float = 1e-3,
        key: int = 0,
        **signals: Any,
    ) -> Any:
        """Call the kernel once, outside of any flight: to test a part by itself.

        Parameters
        ----------
        team : Team
            For the parameters and the sizes of the signals.
        memory : array
            What the kernel remembers; from :meth:`memory`.
        params : array, optional
            Instead of those for the team.
        step, time, dt, key
            What the kernel is told as :class:`colift.kernel.ports.Now`.
        **signals
            Those that the port of the layer names (:data:`colift.kernel.ports.PORTS`); contiguous arrays of floats that the
            kernel writes are written in place. What is not given has its initial value.

        Returns
        -------
        (writes, status)
            The named tuple of the signals that the kernel writes, and what it returned.

        """
        wired = self.wired(team, memory, params=params, key=key, **signals)
        return wired(int(step), float(time), float(dt))

    def wired(
        self,
        team: Team,
        memory: Vector,
        *,
        params: Vector | None = None,
        key: int = 0,
        **signals: Any,
    ) -> Callable[[int, float, float], Any]:
        """:meth:`call` for many calls on the same arrays: of (step, time, dt), each of which finds what the one before has written."""
        from colift.kernel.ports import PORTS

        port, own = PORTS[self.layer], self.params(team) if params is None else params
        found = port.signals(team.n, **signals)
        wire = port.wire(type(self).kernel, own, memory, found, key=int(key))
        return lambda step, time, dt: (wire.writes, port.invoke(wire, step, time, dt))

    @classmethod
    def missing(cls) -> str:
        """What is missing for the part to work and how to get it; empty when nothing is."""
        if cls.needs is None or importlib.util.find_spec(cls.needs[0]) is not None:
            return ""
        package, extra = cls.needs
        return f"needs the package {package}: {install(extra)}"

    def check(self, team: Team) -> list[tuple[str, str]]:
        """Problems that depend on the team, as ``(field, message)``; empty when all is well."""
        return self.wrong_lengths(team.n)

    def conflicts(self, team: Team) -> list[tuple[str, str]]:
        """Limits that this team cannot keep in flight, as for :meth:`check`; such a mission is refused too."""
        return []

    def warnings(self, mission: Setup) -> Iterable[tuple[str, str]]:
        """What is likely to go wrong with this part in a valid mission, as ``(field, message)``.

        The field is one of the part's own (or ``kind``); the message names the other one. Nothing is
        refused for it: it is told before the flight.
        """
        return []

    def check_timing(self, step: float, duration: float) -> list[tuple[str, str]]:
        """Problems with the physics step or the length of the flight (s), as for :meth:`check`."""
        return []


AnyPart = TypeVar("AnyPart", bound=Part)


def driven(part: type[AnyPart]) -> type[AnyPart]:
    """Give a part the kernel that does nothing: what its layer writes stays what :meth:`colift.flight.flight.Flight.act` set it to."""
    from colift.kernel.jit import kernel
    from colift.kernel.ports import PORTS, hold, hold_answer

    port = PORTS[part.layer]
    written = ", ".join(f"``{name}``" for name in port.writes)
    part.kernel = kernel(port.signature)(hold_answer if port.answers else hold)
    part.__doc__ = f"Stays what :meth:`colift.flight.flight.Flight.act` set it to: {written}."
    return part


def placed(path: str, field: str) -> str:
    """Path of a field that a part at ``path`` names: its own, or one of the drones by its whole path."""
    return field if field.startswith("drones.") else f"{path}.{field}"


def timing_problems(
    step: float, duration: float, periods: Mapping[str, float], delays: Mapping[str, float]
) -> list[tuple[str, str]]:
    """Periods that are no whole multiple of the physics step, and delays longer than the flight, by field."""
    found = []
    for field, period in periods.items():
        count = round(period / step)
        if count < 1 or abs(count * step - period) > 1e-9 * period:
            message = f"must be a whole multiple of timing.step = {step:g} s, not {period:g}"
            found.append((field, f"{message}; nearest {max(1, count) * step:g}"))
    for field, delay in delays.items():
        if delay >= duration:
            message = f"must be shorter than timing.duration = {duration:g} s, not {delay:g}"
            found.append((field, message))
    return found


_registered: dict[tuple[str, str], type[Part]] = {}


def register(kind: str, part: type[Part]) -> type[Part]:
    """Make ``part`` available to missions as ``kind = "<kind>"`` of its layer, in this process."""
    if part.layer not in FOLDERS:
        raise UnknownNameError("layer", part.layer, FOLDERS)
    _registered[part.layer, kind] = part
    return part


def load_file(path: str | Path) -> list[type[Part]]:
    """Import a user's Python file and register every part in it under the file's name."""
    path = Path(path)
    spec = importlib.util.spec_from_file_location(f"colift_user_{path.stem}", path)
    if spec is None or spec.loader is None or not path.is_file():
        raise ColiftError(f"{path}: not a Python file")
    module = importlib.util.module_from_spec(spec)
    sys.modules[module.__name__] = module  # by this name its kernels are found in the cache
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        raise ColiftError(f"{path}: {type(error).__name__}: {error}") from error
    parts = _parts_of(module, module.__name__)
    if not parts:
        raise ColiftError(f"{path}: holds no class that derives from a layer's base class")
    layers = [part.layer for part in parts]
    if len(set(layers)) < len(layers):
        raise ColiftError(
            f"{path}: holds more than one part of a layer; give each a file of its own"
        )
    return [register(path.stem.replace("_", "-"), part) for part in parts]


def names(layer: str) -> list[str]:
    """Names of all parts of a layer, without importing (and so compiling) them."""
    registered = {kind for (of, kind) in _registered if of == layer}
    return sorted({*catalogue.names(layer), *registered})


def home(layer: str) -> str:
    """The package that holds colift's own parts of a layer."""
    return f"colift.{catalogue.WINGS[layer]}.{layer}"


def answering(layer: str) -> list[str]:
    """Names of the parts that answer by themselves: all but the one that is driven from outside."""
    return [name for name in names(layer) if name != "external"]


def find(layer: str, kind: str) -> type[Part]:
    """The class behind ``kind`` in ``layer``: registered, our own file's, or another package's."""
    if (layer, kind) in _registered:
        return _registered[layer, kind]
    if kind in catalogue.own_names(layer):
        module = importlib.import_module(f"{home(layer)}.{kind.replace('-', '_')}")
        return _parts_of(module, module.__name__)[0]
    point = catalogue.plugged(layer).get(kind)
    if point is None:
        raise UnknownNameError(f"{layer} part", kind, names(layer))
    part = point.load()
    if not (isinstance(part, type) and issubclass(part, Part)):
        raise ColiftError(f"entry point {point.value!r} is not a colift part")
    return part


def make(layer: str, table: Mapping[str, Any], mission: Declared | None = None) -> Part:
    """The part that a mission's section describes: its ``kind`` and its settings, beside what the mission declares.

    Raises
    ------
    UnknownNameError
        For a kind that the layer does not have.
    SettingError
        For settings that the part refuses.

    """
    settings = dict(table)
    part = find(layer, str(settings.pop("kind", "")))
    known = {} if mission is None else part.declared(mission)
    try:
        return part(**{**known, **settings})
    except SettingError as error:
        raise error.within(layer) from error


def kind_of(part: type[Part]) -> str:
    """The name under which :func:`find` has a class."""
    for (layer, kind), registered in _registered.items():
        if layer == part.layer and registered is part:
            return kind
    if part.__module__.startswith(f"{home(part.layer)}."):
        return part.__module__.rpartition(".")[2].replace("_", "-")
    points = catalogue.plugged(part.layer).values()
    return next(point.name for point in points if point.load() is part)


def _parts_of(module: Any, name: str) -> list[type[Part]]:
    return [
        value
        for value in vars(module).values()
        if isinstance(value, type) and issubclass(value, Part) and value.__module__ == name
    ]
