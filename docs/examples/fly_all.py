"""Fly every example of this folder and check what each promises: ``python docs/examples/fly_all.py``."""

from pathlib import Path

import numpy as np

import colift
from colift.control.allocation.base import Allocator
from colift.part import load_file

here = Path(__file__).parent
for name in ("my_allocator", "my_plain_allocator", "my_reference", "my_plant", "my_agent"):
    (part,) = load_file(here / f"{name}.py")
    if part.layer != "allocation":
        continue
    for n in (1, 2, 4, 16):
        answer = Allocator(part(), n).allocate([0.3, -0.2, 2.2])
        balance = answer.tensions @ answer.directions + [0.3, -0.2, 2.2]
        assert answer.status.ok
        assert np.abs(balance).max() < 1e-12, (name, n, balance)
        assert np.allclose(np.linalg.norm(answer.directions, axis=1), 1.0)
        assert np.allclose(answer.tensions * -answer.directions[:, 2], 2.2 / n)
    assert not Allocator(part(), 4).allocate([0.0, np.nan, 1.0]).status.ok

for allocator in ("my-allocator", "my-plain-allocator"):
    run = colift.run("paper-spiral", allocator=allocator, overrides={"timing.duration": 2.0})
    compiled = "compiled" if run.compiled else "interpreted"
    print(f"{allocator:20} {compiled:12} {run.loop_time:8.3f} s for 2 s of flight")
    assert run.compiled == (allocator == "my-allocator")
    assert run.metrics["tracking_rms_m"] < 0.01

run = colift.run(here / "my-mission.toml")
print(
    f"{'my-mission':20} {run.recording.outcome:12} RMS {run.metrics['tracking_rms_m'] * 100:.2f} cm"
)
assert run.compiled
assert run.recording.outcome == "completed"
assert run.metrics["tracking_rms_m"] < 0.05
assert run.metrics["slack_time_s"] == 0.0

run = colift.run("hover", overrides={"drones.count": 3, "agents.kind": "my-agent"})
print(
    f"{'my-agent':20} {run.recording.outcome:12} RMS {run.metrics['tracking_rms_m'] * 100:.2f} cm"
)
assert run.compiled
assert run.recording.outcome == "completed"
assert run.metrics["tracking_rms_m"] < 0.02
