"""Logs whose world is north-east-down and whose bodies are forward-right-down, as those of autopilots are."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from colift.record.importing.base import Array, Log


def upright(log: Log) -> Log:
    """From north-east-down, bodies forward-right-down, to east-north-up, bodies forward-left-up."""

    def world(values: Array) -> Array:
        return np.asarray(values[..., [1, 0, 2]] * [1.0, 1.0, -1.0])

    drones = {k: v if k in ("attitudes", "rates") else world(v) for k, v in log.drones.items()}
    drones["rates"] = log.drones["rates"] * [1.0, -1.0, -1.0]
    drones["attitudes"] = _attitude_up(log.drones["attitudes"])
    turned = None if log.load_attitude is None else _attitude_up(log.load_attitude)
    return replace(
        log,
        load=world(log.load),
        reference=world(log.reference),
        drones=drones,
        load_attitude=turned,
    )


def _attitude_up(attitudes: Array) -> Array:
    """Quaternions (..., 4) of bodies."""
    # R_up = N R F with N = [[0,1,0],[1,0,0],[0,0,-1]] (half a turn about x+y) and F = diag(1,-1,-1) (about x).
    w, x, y, z = np.moveaxis(attitudes, -1, 0)
    return np.asarray(math.sqrt(0.5) * np.stack([w + z, x + y, x - y, w - z], axis=-1))
