"""Nobody observes: no external force is known of."""

from __future__ import annotations

from colift.control.observation.base import SIGNATURE, ObservationPart
from colift.kernel.jit import kernel
from colift.kernel.ports import hold


class Unobserved(ObservationPart):
    """Leaves all forces zero; no settings."""

    kernel = kernel(SIGNATURE)(hold)
