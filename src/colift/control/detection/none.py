"""No detection: nobody notices a fault that is not announced."""

from __future__ import annotations

from colift.control.detection.base import SIGNATURE, DetectionPart
from colift.kernel.jit import kernel


@kernel(SIGNATURE)
def _trust(now, sees, params, memory, writes):  # type: ignore[no-untyped-def]
    pass


class Trusting(DetectionPart):
    """Every drone is taken to carry; no settings."""

    kernel = _trust
