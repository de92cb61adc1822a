"""One drop and catch on every plant that catches: ``python docs/figures/catches.py`` writes the table of ``theory/plant.md``.

A reference that falls faster than gravity allows leaves all cables slack; then they catch the load. *Transmitted* is what
two neighbouring drones lose of their momentum along the cable, beyond thrust and weight, from the first catch until the
ends of the cable part no more.
"""

import numpy as np
from pages import fill, table

from colift.flight.flight import Flight
from colift.mission import load_mission
from colift.part import find, names
from colift.record import metrics

MISSION = {
    "name": "drop-and-catch",
    "start": {"cone_deg": 35.0},
    "timing": {"duration": 8.0, "recording": 0.001},
    "reference": {
        "kind": "waypoints", "points": [[0.0, 0.0, 8.0], [0.0, 0.0, 2.0]], "travel": 1.0, "hold": 2.0,
    },
    "allocation": {"kind": "safe", "min_angle_deg": 30.0},
    "position_control": {"kind": "feed-forward"},
}  # fmt: skip
BOUNCE = 20
"""Steps after the first catch in which its compression ends on every plant."""

HEADER = (
    "plant", "first catch, cables 0 / 1 (N s)", "transmitted (N s)", "largest of the flight (N s)",
    "peak tension (N)",
)  # fmt: skip

rows = []
for kind in names("plant"):
    if kind == "rigid-cables" or find("plant", kind).missing():
        continue
    r = Flight(load_mission(MISSION, {"plant.kind": kind})).run()
    team, dt = r.mission.true_team, r.time[1] - r.time[0]
    caught = r["catch_impulses"]
    first = int(np.flatnonzero(caught.max(axis=1) > 0.1)[0])
    span = slice(first - 3, first + BOUNCE)
    w, x, y, z = np.moveaxis(r["attitudes"][span], -1, 0)
    up = np.stack([2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)], axis=-1)
    free = r["applied_thrusts"][span, :, None] * up / team.masses[:, None] - [0, 0, team.gravity]
    alpha, velocity = r["directions"][span], r["velocities"][span]
    gained = np.diff(velocity, axis=0) - dt * free[:-1]
    pulled = team.masses * np.sum(gained * alpha[:-1], axis=2)
    parting = np.sum(alpha * (r["load"][span, 1][:, None] - velocity), axis=2)
    # Of the step in which the ends turn back, the share before they do.
    share = np.clip(parting[:-1] / np.maximum(parting[:-1] - parting[1:], 1e-12), 0.0, 1.0)
    if kind == "slack-cables":  # all at once
        share[:] = 1.0
    sent = np.sum(np.where(parting[:-1] > 0.0, share, 0.0) * pulled, axis=0)
    values, each = metrics.compute(r), caught[span].max(axis=0)
    rows.append(
        [
            f"`{kind}`",
            f"{each[0]:.3f} / {each[1]:.3f}",
            f"{sent[0]:.2f} / {sent[1]:.2f}",
            f"{values['max_catch_impulse_Ns']:.3f}",
            f"{values['peak_tension_N']:.3g}",
        ]
    )
fill("theory/plant.md", "catches", table(HEADER, rows))
