"""What goes into a page: the recording's own numbers, thinned, and its moments."""

from __future__ import annotations

import base64
import json
from dataclasses import replace
from typing import Any

import numpy as np
from flown import fly, payload_of

from colift.kernel.status import Status
from colift.record import metrics
from colift.record.moments import Moment, find_moments
from colift.record.recording import Recording
from colift.show.viewer.data import BUDGET, RATE, payload
from colift.show.viewer.page import live_page, replay_page


def unpack(packed: dict[str, Any], kind: str = "<f4") -> np.ndarray[Any, Any]:
    return np.frombuffer(base64.b64decode(packed["data"]), kind).reshape(packed["shape"])


def change(recording: Recording, **signals: Any) -> Recording:
    """The recording with some signals replaced: by functions of their values."""
    arrays = dict(recording.arrays)
    for name, function in signals.items():
        arrays[name] = function(arrays[name].copy())
    return replace(recording, arrays=arrays)


def test_rows_are_rows_of_the_recording(spiral: Recording) -> None:
    flight = payload_of(spiral)["flights"][0]
    time = unpack(flight["time"], "<f8")
    rows = np.searchsorted(spiral.time, time)
    assert np.array_equal(spiral.time[rows], time)
    assert (time[0], time[-1]) == (spiral.time[0], spiral.time[-1])
    for name, wanted in {
        "tensions": spiral["tensions"],
        "attitudes": spiral["attitudes"],
        "load": spiral["load"][:, 0],
        "external": spiral["external_forces"][:, -1],
    }.items():
        assert np.array_equal(unpack(flight["signals"][name]), wanted[rows].astype("<f4")), name


def test_rows_are_at_most_the_rate_and_keep_the_extremes(spiral: Recording) -> None:
    def spike(tensions: Any) -> Any:
        tensions[101, 2] = 50.0
        return tensions

    flight = payload_of(change(spiral, tensions=spike))["flights"][0]
    tensions = unpack(flight["signals"]["tensions"])
    assert len(tensions) <= RATE * spiral.time[-1] + 12
    assert tensions.max() == 50.0


def test_twenty_seconds_of_four_drones_stay_below_two_megabytes() -> None:
    flight = fly(**{"timing.duration": 20.0})
    assert len(replay_page(payload_of(flight))) < 1_300_000
    assert len(replay_page(payload_of(flight, flight, flight))) < 2_000_000


def test_many_drones_are_thinned_to_the_budget() -> None:
    flight = payload_of(fly(**{"drones.count": 24, "timing.duration": 15.0}))["flights"][0]
    rows, size = flight["time"]["shape"][0], len(json.dumps(flight["signals"]))
    assert 10.0 * 15.0 < rows < RATE * 15.0
    assert size < 1.15 * BUDGET


def test_solve_time_is_the_longest_and_status_the_worst_since_the_row_before(
    spiral: Recording,
) -> None:
    def once(values: Any) -> Any:
        values[777] = 5.0
        return values

    flight = payload_of(change(spiral, allocator_time=once, allocator_status=once))["flights"][0]
    time = unpack(flight["time"], "<f8")
    row = np.searchsorted(time, spiral.cycle_time[777])
    for name in ("solve_time", "status"):
        values = unpack(flight["signals"][name])
        assert values[row] == 5.0, name
        assert np.count_nonzero(values == 5.0) == 1, name


def test_uneven_times_and_unknown_signals_pass(spiral: Recording) -> None:
    rng = np.random.default_rng(3)
    rows = np.sort(rng.choice(len(spiral.time), 150, replace=False))
    known = {
        name: values[rows] for name, values in spiral.arrays.items() if "allocator" not in name
    }
    unknown = ("tensions", "attitudes", "thrusts", "slack_times", "desired_tensions")
    arrays = {
        **spiral.arrays,
        **known,
        **{name: np.full_like(known[name], np.nan) for name in unknown},
    }
    real = replace(
        spiral, time=spiral.time[rows], cycle_time=np.empty(0),
        arrays={k: v[:0] if "allocator" in k else v for k, v in arrays.items()},
    )  # fmt: skip
    data = payload([real], [{}], ["real"])
    json.dumps(data, allow_nan=False)
    signals = data["flights"][0]["signals"]
    assert np.isnan(unpack(signals["tensions"])).all()
    assert np.isnan(unpack(signals["solve_time"])).all()
    assert np.isfinite(unpack(signals["load"])).all()


def test_a_flight_of_one_row_passes(spiral: Recording) -> None:
    arrays = {k: v[:1] for k, v in spiral.arrays.items()}
    short = replace(spiral, time=spiral.time[:1], cycle_time=spiral.cycle_time[:1], arrays=arrays)
    assert payload([short], [{}], ["short"])["flights"][0]["time"]["shape"] == [1]


def test_the_moments_are_those_of_the_flight() -> None:
    flown = fly("four-to-three")
    events = payload_of(flown)["flights"][0]["events"]
    assert [Moment(**event) for event in events] == find_moments(flown)
    assert {"fault", "departure"} <= {event["kind"] for event in events}


def test_a_silent_cycle_is_silent_and_has_no_solve_time() -> None:
    silence = {"kind": "allocator-silent", "at": 1.0, "duration": 0.5}
    flown = fly(fault=[silence])
    flight = payload_of(flown)["flights"][0]
    time = unpack(flight["time"], "<f8")
    status, solve_time = (unpack(flight["signals"][name]) for name in ("status", "solve_time"))
    during = (time > 1.03) & (time < 1.49)
    assert (status[during] == Status.SILENT).all()
    assert np.isnan(solve_time[during]).all()
    assert (solve_time[time < 1.0] > 0.0).all()
    assert status[-1] == Status.CONVERGED


def test_the_page_allows_its_own_script_and_nothing_else(spiral: Recording) -> None:
    page = replay_page(payload_of(spiral))
    policy = page.split('http-equiv="Content-Security-Policy" content="')[1].split('"')[0]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == rules["connect-src"] == "'none'"
    assert rules["script-src"].startswith("'sha256-")
    assert "unsafe" not in policy
    assert page.count("</script>") == 2
    assert page.count("</style>") == 1


def test_the_live_page_has_no_inline_script_or_style() -> None:
    page = live_page()
    assert '<script src="/assets/viewer.js" defer></script>' in page
    assert "<style" not in page
    assert page.count("<script") == 1


def test_equal_recordings_give_equal_pages(spiral: Recording) -> None:
    assert replay_page(payload_of(spiral)) == replay_page(payload_of(spiral))


def test_numbers_of_the_page_are_the_metrics(spiral: Recording) -> None:
    shown = {m["name"]: m["value"] for m in payload_of(spiral)["flights"][0]["metrics"]}
    wanted = metrics.compute(spiral)
    assert shown == {k: v if np.isfinite(v) else None for k, v in wanted.items()}
