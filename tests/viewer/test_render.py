"""Pictures and films: the right size, the same again, and clear words when something is missing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from flown import payload_of
from PIL import Image
from typer.testing import CliRunner

from colift.cli import app
from colift.errors import BrowserError
from colift.record.recording import Recording
from colift.show.viewer import browser as finding
from colift.show.viewer import render

run = CliRunner().invoke


@pytest.fixture(scope="module")
def file(spiral: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return spiral.save(tmp_path_factory.mktemp("flight") / "flight.h5")


def test_a_picture_has_its_size_and_repeats(
    chromium: None, spiral: Recording, tmp_path: Path
) -> None:
    look = render.Look((320, 240), "follow", "dark")
    data = payload_of(spiral)
    one = render.png(data, tmp_path / "one.png", look, 1.0)
    other = render.png(data, tmp_path / "other.png", look, 1.0)
    later = render.png(data, tmp_path / "later.png", look, 1.7)
    assert Image.open(one).size == (320, 240)
    assert one.read_bytes() == other.read_bytes() != later.read_bytes()


def test_a_film_has_its_pictures(chromium: None, file: Path, tmp_path: Path) -> None:
    pytest.importorskip("imageio_ffmpeg", reason="needs the extra render")
    gif, mp4 = tmp_path / "a.gif", tmp_path / "a.mp4"
    options = ["--to", "0.4", "--fps", "10", "--size", "160x120", "--json"]
    done = run(app, ["render", str(file), "--gif", str(gif), "--mp4", str(mp4), *options])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout) == {"files": [str(gif), str(mp4)]}
    with Image.open(gif) as film:
        assert (film.size, film.n_frames) == ((160, 120), 5)
    import imageio_ffmpeg

    frames, _ = imageio_ffmpeg.count_frames_and_secs(str(mp4))
    assert frames == 5


def test_a_missing_browser_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLIFT_BROWSER", "/no/such/browser")
    with pytest.raises(BrowserError, match="COLIFT_BROWSER names '/no/such/browser'"):
        finding.find_browser()
    monkeypatch.delenv("COLIFT_BROWSER")
    monkeypatch.setattr(finding.shutil, "which", lambda _: None)
    with pytest.raises(BrowserError, match="apt-get install chromium"):
        finding.find_browser()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ([], "say what to write"),
        (["--png", "a.jpg"], "must end in .png"),
        (["--png", "a.png", "--size", "101x100"], "two even numbers"),
        (["--mp4", "a.mp4", "--to", "99"], "at most 2 s"),
    ],
)
def test_mistakes_are_named(file: Path, options: list[str], words: str) -> None:
    done = run(app, ["render", str(file), *options])
    assert done.exit_code == 2
    assert words in " ".join(done.output.replace("│", " ").split())


def test_replay_writes_a_page(file: Path, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    done = run(app, ["replay", str(file), str(file), "--html", str(page), "--json"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout) == {"page": str(page), "bytes": page.stat().st_size}
    assert page.read_text().startswith("<!doctype html>")


def test_replay_opens_the_page(file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("webbrowser.open", opened.append)
    assert run(app, ["replay", str(file)]).exit_code == 0
    assert len(opened) == 1
    assert opened[0].startswith("file://")
    assert run(app, ["replay", str(file), "--no-open"]).exit_code == 0
    assert len(opened) == 1


def test_replay_of_a_file_that_is_no_recording(tmp_path: Path) -> None:
    from colift.errors import RecordingError

    file = tmp_path / "a.h5"
    file.write_text("no")
    done = run(app, ["replay", str(file), "--no-open"])
    assert isinstance(done.exception, RecordingError)
