"""Massless elastic cables: one spring and damper each that only pulls (see :mod:`colift.world.plant._chain`)."""

from __future__ import annotations

from colift.world.plant._chain import ChainPart


class ElasticCables(ChainPart):
    """Massless cables that stretch, with damping, and do not push."""
