"""`colift certify`: the file it writes, what a check finds, what is refused."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time

import pytest

import colift
from colift.record.assumptions import ASSUMPTIONS, Monitor
from colift.study.certify import certificate
from colift.study.certify.kept import file_beside
from colift.study.certify.space import Space
from terminal import colift as run

SHORT = ("--set", "timing.duration=1")
NOISY = ("--set", "sensing.kind=noisy", "--set", 'disturbance=[{kind="wind", speed=6.0}]')


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A certificate of a short hover in noise and wind, and how its command ended."""
    file = tmp_path_factory.mktemp("certified") / "certificate.json"
    done = run(
        "certify", "hover", *SHORT, *NOISY, "--bound", "0.2", "--vary", "truth.load_mass_factor=0.95:1.05",
        "--assume", "wind_mps=4", "--out", str(file), "--json",
    )  # fmt: skip
    return file, done


def test_a_hover_is_certified(made):
    file, done = made
    assert done.returncode == 0, done.stderr
    found = json.loads(file.read_text())
    assert found["result"] == "certified"
    assert found["failures"] == []
    assert found["interval"][1] < 0.2
    assert found["flights"] == 15  # the fewest that can
    assert found["worst"]["wind_mps"] == pytest.approx(3.0)
    assert 0.02 < found["worst"]["load_mass_error"] <= 0.05
    assert found["mission"]["timing"]["duration"] == 1.0
    assert "seed" not in found["mission"]


def test_a_check_flies_it_again(made, tmp_path):
    file, _ = made
    assert run("certify", "--check", str(file)).returncode == 0
    found = json.loads(file.read_text())
    found["worst"]["tension_N"] *= 1.01
    other = tmp_path / "other.json"
    other.write_text(json.dumps(found))
    done = run("certify", "--check", str(other))
    assert done.returncode == 4
    assert "tension_N" in done.stdout


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda c: c["mission"]["load"].update(mass=0.1), "digest"),
        (lambda c: c["vary"].clear(), "digest"),
        (lambda c: c.update(flights=1), "says other"),
        (lambda c: c["question"].update(bound=0.001), "says other"),
        (lambda c: c.update(format="colift certificate 9"), "must be 'colift certificate 1'"),
        (lambda c: c.pop("question"), "no whole certificate"),
    ],
)
def test_a_changed_certificate_is_refused(made, tmp_path, change, told):
    found = json.loads(made[0].read_text())
    change(found)
    other = tmp_path / "other.json"
    other.write_text(json.dumps(found))
    with pytest.raises(colift.ColiftError, match=f"other.json.*{told}"):
        certificate.read(other)


def test_flights_beyond_an_assumption_count_as_failed(tmp_path):
    file = tmp_path / "c.json"
    done = run(
        "certify", "hover", *SHORT, *NOISY, "--bound", "0.2", "--seeds", "40", "--assume", "wind_mps=2",
        "--out", str(file),
    )  # fmt: skip
    assert done.returncode == 4
    found = json.loads(file.read_text())
    assert found["result"] == "refuted"
    assert "assumed wind_mps <= 2, found 3" in found["failures"][0]["reason"]
    assert found["flights"] == len(found["failures"]) < 40


def test_an_audit_says_which_flight_is_beyond_what_is_certified(made, tmp_path):
    calm = colift.run("hover", timing__duration=1.0, sensing__kind="noisy", seed=1_000_003)
    storm = colift.run(
        "hover", timing__duration=1.0, overrides={"disturbance": [{"kind": "wind", "speed": 18.0}]}
    )
    names = [str(each.recording.save(tmp_path / f"{k}.h5")) for k, each in enumerate((calm, storm))]
    done = run("certify", "--check", str(made[0]), "--audit", names[1], "--json")
    assert done.returncode == 4
    told = json.loads(done.stdout)["differs"]
    assert any("wind_mps is 9 (beyond 4 at t = " in line for line in told)
    done = run("certify", "--check", str(made[0]), "--audit", names[0], "--json")
    assert not any("wind" in line for line in json.loads(done.stdout)["differs"])


def test_splitting_says_what_it_can_say(tmp_path):
    file = tmp_path / "c.json"
    done = run(
        "certify", "hover", *SHORT, "--set", 'disturbance=[{kind="dryden", speed=10.0}, {kind="drag", rotor_drag=0.02}]',
        "--set", "criteria.tracking_max_m.max=0.05", "--splitting", "--bound", "0.9", "--seeds", "6", "--particles", "16",
        "--block", "0.25", "--out", str(file),
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    found = json.loads(file.read_text())
    assert not found["exact"]
    assert "asymptotic" in found["statement"]
    assert len(found["estimates"]) == 6
    assert [each["seed"] for each in found["estimates"]] == list(range(1_000_000, 1_000_006))
    assert certificate.check(certificate.read(file)) == []


# ---------------------------------------------------------------- Ctrl-C


class Interrupting:
    """Told of each trial; Ctrl-C at one of them."""

    def __init__(self, at):
        self.at, self.done = at, 0

    def __call__(self, done, failed):
        self.done = done
        if done == self.at:
            raise KeyboardInterrupt


@pytest.mark.parametrize("method", ["direct", "splitting"])
def test_an_interrupted_certificate_goes_on_from_the_flights_that_are_done(method, tmp_path):
    space = Space.of("hover", {"timing.duration": 0.2, "criteria.tracking_max_m.max": 0.1})
    settings = {"method": method, "particles": 2, "block": 0.1}
    ask = certificate.Question(bound=0.2, most=20 if method == "direct" else 6, **settings)
    part = file_beside(tmp_path / "c.json")
    with pytest.raises(KeyboardInterrupt):
        certificate.certify(space, ask, workers=1, told=Interrupting(3), part=part)
    head, first, *rows = part.read_text().splitlines()
    assert len(rows) >= 2
    # The first one is told otherwise, the last one is cut off: who goes on believes the one, and flies the other again.
    first = json.loads(first)
    first[-1]["tension_N"] = 123.0
    part.write_text("\n".join([head, json.dumps(first), *rows])[:-5])
    again = certificate.certify(space, ask, workers=1, part=part)
    assert not part.exists()
    whole = certificate.certify(space, ask, workers=1)
    assert again["worst"].pop("tension_N") == 123.0 > whole["worst"].pop("tension_N")
    assert again == whole


def test_ctrl_c_says_how_to_go_on(tmp_path):
    """Only the same flights are gone on with; two processes do not write into one file."""
    file = tmp_path / "c.json"
    command = (
        "certify",
        "hover",
        "--set",
        "timing.duration=0.2",
        "--workers",
        "1",
        "--out",
        str(file),
    )
    process = subprocess.Popen(
        [sys.executable, "-m", "colift", *command, "--bound", "0.0001"], stderr=subprocess.PIPE, text=True
    )  # fmt: skip
    part = file_beside(file)
    while not part.exists() or part.read_text().count("\n") < 3:
        assert process.poll() is None
        time.sleep(0.05)
    other = run(*command)
    assert other.returncode == 1
    assert "another process is at this certificate" in other.stderr
    process.send_signal(signal.SIGINT)
    assert "the same command goes on from there" in process.communicate()[1]
    assert process.returncode == 130
    assert not file.exists()
    other = run(*command, "--set", "load.mass=0.2")
    assert other.returncode == 1
    assert "holds trials of another certificate (other digest)" in other.stderr
    done = run(*command, "--bound", "0.5")
    assert done.returncode == 0
    assert "goes on with the flights in" in done.stderr
    assert not part.exists()
    assert run("certify", "--check", str(file)).returncode == 0


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--vary", "truth.load_mass_factor=2:1"), "must be LOW:HIGH"),
        (("--vary", "truth.load_mass_factor=1"), "must be PATH=LOW:HIGH"),
        (("--vary", "truth.load_mas=1:2"), "load_mas"),
        (("--vary", "truth.load_mass_factor=-1:1"), "load_mass_factor"),
        (("--assume", "wind=3"), "no assumption named 'wind'; did you mean 'wind_mps'?"),
        (("--assume", "wind_mps=-3"), "must be above 0"),
        (("--set", "criteria.allocator_max_us.max=100"), "wall time"),
        (("--set", "seed=3"), "seed"),
        (("--bound", "0"), "bound"),
    ],
)
def test_what_cannot_be_certified_is_refused_by_name(options, told, tmp_path):
    file = tmp_path / "c.json"
    done = run("certify", "hover", *SHORT, *options, "--out", str(file))
    assert done.returncode in (1, 2)
    assert told in done.stderr
    assert list(tmp_path.iterdir()) == []


# ---------------------------------------------------------------- the monitor


def test_a_monitor_tells_when_a_limit_was_first_broken():
    flown = colift.run(
        "hover", timing__duration=2.0,
        overrides={"disturbance": [{"kind": "push", "force": [0.0, 0.3, 0.0], "at": 0.5, "duration": 0.5}]},
    ).recording  # fmt: skip
    monitor = Monitor({"disturbance_N": 0.2, "wind_mps": 1.0})
    monitor.look(flown)
    assert monitor.worst["disturbance_N"] == pytest.approx(0.3)
    assert monitor.broken == {"disturbance_N": pytest.approx(0.5, abs=0.006)}
    assert monitor.unseen() == []


def test_looking_at_stretches_finds_what_looking_at_all_does():
    from colift.flight.flight import Flight
    from colift.mission import load_mission

    flight = Flight(load_mission("real-world", {"timing.duration": 2.0}))
    parts, whole = Monitor(), Monitor()
    for k in range(4):
        flight.advance(0.5)
        parts.look(flight.recording(0.5 * k))
    whole.look(flight.recording())
    assert parts.worst == whole.worst
    assert {each.name for each in ASSUMPTIONS} <= {*whole.worst, "thrust_share"}


def test_seeds_repeat_what_they_draw_and_differ_from_each_other():
    space = Space.of("hover", {}, {"truth.load_mass_factor": (0.9, 1.1)})
    assert space.draw(5) == space.draw(5) != space.draw(6)
    drawn = [space.draw(k)["truth.load_mass_factor"] for k in range(1, 200)]
    assert 0.9 <= min(drawn) < 0.91
    assert 1.09 < max(drawn) <= 1.1
    assert space.mission_of(5).truth.load_mass_factor == space.draw(5)["truth.load_mass_factor"]
