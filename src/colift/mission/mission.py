"""A mission with its parts, which are imported for it: their kernels are compiled, or loaded, then."""

from __future__ import annotations

from typing import Any

import numpy as np
from pydantic import Field, SerializeAsAny

from colift.control.agents.base import AgentPart
from colift.control.allocation.base import AllocatorPart
from colift.control.attitude_control.base import AttitudeControlPart
from colift.control.detection.base import DetectionPart
from colift.control.estimation.base import EstimationPart
from colift.control.load_control.base import LoadControlPart
from colift.control.observation.base import ObservationPart
from colift.control.position_control.base import PositionControlPart
from colift.control.reference.base import ReferencePart
from colift.control.supervision.base import SupervisionPart
from colift.mission.schema import Described
from colift.part import LISTS, Part
from colift.world.actuation.base import ActuationPart
from colift.world.disturbance.base import DisturbancePart
from colift.world.fault.base import FaultPart
from colift.world.link.base import LinkPart
from colift.world.network.base import NetworkPart
from colift.world.plant.base import PlantPart
from colift.world.sensing.base import SensingPart


class Mission(Described):
    """A complete flight. Each layer's section names a part with ``kind`` and gives its settings."""

    @property
    def source(self) -> str:
        return "simulation"

    kinds: dict[str, str]
    """Name of the part in each layer."""
    list_kinds: dict[str, list[str]]
    """Names of the disturbances and faults, in their order."""
    sensing: SerializeAsAny[SensingPart]
    estimation: SerializeAsAny[EstimationPart]
    supervision: SerializeAsAny[SupervisionPart]
    reference: SerializeAsAny[ReferencePart]
    load_control: SerializeAsAny[LoadControlPart]
    allocation: SerializeAsAny[AllocatorPart]
    link: SerializeAsAny[LinkPart]
    network: SerializeAsAny[NetworkPart]
    agents: SerializeAsAny[AgentPart]
    observation: SerializeAsAny[ObservationPart]
    position_control: SerializeAsAny[PositionControlPart]
    attitude_control: SerializeAsAny[AttitudeControlPart]
    actuation: SerializeAsAny[ActuationPart]
    detection: SerializeAsAny[DetectionPart]
    plant: SerializeAsAny[PlantPart]
    disturbance: list[SerializeAsAny[DisturbancePart]] = Field(default_factory=list)
    """Disturbances, all at once."""
    fault: list[SerializeAsAny[FaultPart]] = Field(default_factory=list)
    """Faults to come."""

    def resolved(self) -> dict[str, Any]:
        """The whole mission with every default filled in, as plain data (a valid mission file).

        What follows from the team stands under ``derived``, by its path.
        """
        data = self.model_dump(mode="json", exclude={"kinds", "list_kinds"}, exclude_none=True)
        team, derived = self.team, {}

        def described(path: str, kind: str, settings: dict[str, Any], part: Part) -> dict[str, Any]:
            for name in part.by_team(team):
                if name in settings:
                    derived[f"{path}.{name}"] = settings.pop(name)
            return {"kind": kind, **settings}

        for name in self.drones.assumed:
            derived[f"drones.{name}"] = data["drones"].pop(name)
        for layer, kind in self.kinds.items():
            data[layer] = described(layer, kind, data[layer], getattr(self, layer))
        for name in LISTS:
            several = zip(self.list_kinds[name], data[name], getattr(self, name), strict=True)
            data[name] = [
                described(f"{name}.{i}", kind, settings, part)
                for i, (kind, settings, part) in enumerate(several)
            ]
        data["derived"] = derived
        if any(name.endswith(".toml") for name in np.atleast_1d(self.drones.vehicle or "")):
            del data["drones"]["vehicle"]  # the numbers stand there; the file may be gone by then
        return data
