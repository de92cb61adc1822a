"""Figures and pages: everything draws, nothing leaks, equal recordings give equal bytes."""

from __future__ import annotations

import re
import tomllib
from dataclasses import replace
from html import unescape
from pathlib import Path

import numpy as np
import pytest

import colift
from colift.mission import load_mission, mission_names
from colift.record import metrics
from colift.record.moments import KINDS
from colift.record.recording import Recording
from colift.show.report import comparison, figures, html, marks, panels, render, style


def fly(mission: str = "paper-spiral", **settings: object) -> Recording:
    """Two seconds of a mission at the coarse recording rate that figures need."""
    loaded = load_mission(mission).resolved()
    early = {
        name: [item | {"at": 1.0 + 0.1 * k} for k, item in enumerate(loaded[name])]
        for name in ("events", "fault")
    }
    overrides = {"timing.duration": 2.0, **early, **settings}
    return colift.run(mission, overrides=overrides).recording


def spoil(recording: Recording, value: float, start: float = 1.0) -> Recording:
    """The same flight as if it had diverged at ``start``, s."""
    late = recording.time >= start
    arrays = {name: values.copy() for name, values in recording.arrays.items()}
    for name in ("load", "tensions", "directions", "positions", "desired_tensions"):
        arrays[name][late] = value
    return replace(recording, arrays=arrays, outcome=f"diverged before t = {start:g} s")


@pytest.fixture(scope="module")
def spiral() -> Recording:
    return fly()


@pytest.fixture(scope="module")
def written(spiral: Recording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    html.write_report(spiral, folder, metrics=metrics.compute(spiral))
    return folder


@pytest.mark.parametrize("mission", mission_names())
def test_every_figure_of_every_shipped_mission_draws(mission: str) -> None:
    recording = fly(mission)
    for name, entry in figures.FIGURES.items():
        assert len(render.png(entry.draw(recording))) > 8_000, name


@pytest.mark.parametrize("n", [1, 2, 5, 12, 64])
def test_any_number_of_drones_draws(n: int) -> None:
    recording = fly(**{"drones.count": n, "timing.duration": 0.2})
    for name, entry in figures.FIGURES.items():
        assert len(render.svg(entry.draw(recording), name, "")) > 8_000, name
    assert f"<li>{n} drone" in html.report(recording, metrics.compute(recording), [])


@pytest.mark.parametrize("value", [np.nan, -1e300])
def test_a_diverged_flight_is_drawn_up_to_where_it_broke(
    spiral: Recording, value: float, tmp_path: Path
) -> None:
    broken = spoil(spiral, value)
    assert panels.intact(broken).time[-1] == pytest.approx(1.0 - 0.005)
    with np.errstate(all="ignore"):
        numbers = metrics.compute(broken)
    page = html.write_report(broken, tmp_path, metrics=numbers).read_text()
    assert 'class="banner lost"' in page
    assert "Lost: diverged before t = 1 s" in page


def test_a_flight_that_breaks_at_once_still_draws(spiral: Recording) -> None:
    broken = spoil(spiral, np.nan, start=0.0)
    for entry in figures.FIGURES.values():
        render.png(entry.draw(broken))


def test_comparisons_draw(spiral: Recording) -> None:
    flights = {"<baseline> $a": spiral, "SQP": spiral, "broken": spoil(spiral, 1e12)}
    for drawing in render.draw(comparison.COMPARISONS, flights):
        assert drawing.svg.rstrip().endswith("</svg>")
        assert "&lt;baseline&gt; $a" in drawing.svg


def test_files_are_written(spiral: Recording, written: Path) -> None:
    assert (written / "report.html").stat().st_size > 50_000
    for name in figures.drawable(spiral):
        svg = (written / "figures" / f"{name}.svg").read_text()
        assert "<svg" in svg
        assert svg.rstrip().endswith("</svg>")
        assert 8_000 < len(svg) < render.LARGEST_SVG
        assert (written / "figures" / f"{name}.png").read_bytes().startswith(b"\x89PNG")
    assert not list(written.rglob(".*"))


def test_page_requests_nothing(written: Path) -> None:
    page = (written / "report.html").read_text()
    addresses = re.sub(r'xmlns(:\w+)?="[^"]*"', "", page)
    assert "//" not in re.sub(r"data:[^\"]*", "", addresses)
    assert "<script" not in page
    assert "<link" not in page
    assert "@import" not in page


def test_ids_are_unique_and_every_reference_resolves(written: Path) -> None:
    page = (written / "report.html").read_text()
    ids = re.findall(r'\bid="([^"]+)"', page)
    assert len(ids) == len(set(ids)) > 100
    wanted = re.findall(r'href="#([^"]+)"', page) + re.findall(r"url\(#([^)]+)\)", page)
    assert set(wanted) <= set(ids)


def test_equal_recordings_give_equal_bytes(
    spiral: Recording, written: Path, tmp_path: Path
) -> None:
    html.write_report(spiral, tmp_path, metrics=metrics.compute(spiral))
    for path in written.rglob("*.*"):
        assert path.read_bytes() == (tmp_path / path.relative_to(written)).read_bytes(), path.name


def test_recording_read_from_a_file_gives_the_same_page(spiral: Recording, tmp_path: Path) -> None:
    def page(recording: Recording) -> str:
        some = {"angles": figures.FIGURES["angles"]}
        return html.report(recording, metrics.compute(recording), render.draw(some, recording))

    assert page(Recording.load(spiral.save(tmp_path / "flight.h5"))) == page(spiral)


def test_text_of_a_mission_is_escaped() -> None:
    evil = '<script>alert("1")</script>'
    recording = fly(name=evil, description=evil + "&", **{"timing.duration": 0.1})
    page = html.report(recording, metrics.compute(recording), [])
    assert "<script" not in page
    assert "&lt;script&gt;" in page


def test_mission_in_the_page_is_a_valid_mission_file() -> None:
    mission = load_mission("payload-step", {"name": 'quotes " and \\ and é', "seed": 3})
    recording = replace(fly(**{"timing.duration": 0.1}), mission=mission)
    page = html.report(recording, {}, [])
    text = unescape(page.split("<pre>")[1].split("</pre>")[0])
    assert tomllib.loads(text) == mission.resolved()


def test_large_svg_is_shown_as_bitmap(spiral: Recording) -> None:
    entry = figures.FIGURES["tensions"]
    drawing = render.draw({"tensions": entry}, spiral)[0]
    huge = replace(drawing, svg=drawing.svg + " " * render.LARGEST_SVG)
    assert drawing.inline().startswith('<ul class="legend">')
    assert huge.inline().startswith('<img src="data:image/png;base64,')


@pytest.fixture(scope="module")
def cut() -> Recording:
    return fly("cut-in-flight")


def test_moments_are_in_the_table_and_in_the_figures(cut: Recording) -> None:
    drawings = render.draw({"tensions": figures.FIGURES["tensions"]}, cut)
    page = html.report(cut, metrics.compute(cut), drawings)
    section = page.split("<h2>Moments</h2>")[1].split("<h2>")[0]
    assert section.index("Cable of drone 0 cut") < section.index("Drone 0 is judged lost")
    assert section.count("<tr>") == 1 + len(cut.moments)
    kinds = {moment.kind for moment in cut.moments}
    assert {"fault", "departure"} <= kinds
    for kind in ("fault", "departure"):
        assert f">{KINDS[kind]}</text>" in drawings[0].svg
        assert f"{marks.icon(kind)}{KINDS[kind]}</li>" in drawings[0].legend


def test_a_line_stands_at_every_cause(cut: Recording) -> None:
    axes = figures.FIGURES["tensions"].draw(cut).axes[0]
    lines = [line.get_xdata()[0] for line in axes.lines if line.get_linestyle() == ":"]
    causes = [m.time for m in cut.moments if m.kind in ("fault", "departure")]
    assert len(causes) >= 2
    assert sorted(lines) == pytest.approx(causes)


def test_the_angle_that_the_mission_asks_for_is_drawn_and_no_other() -> None:
    def limits(**settings: object) -> list[float]:
        axes = figures.FIGURES["angles"].draw(fly(**settings)).axes[0]
        red = [line for line in axes.lines if line.get_color() == style.LIMIT]
        assert [line.get_label() for line in red] == [
            f"{line.get_ydata()[0]:g}° limit" for line in red
        ]
        return [line.get_ydata()[0] for line in red]

    safe = {"allocation.kind": "safe", "criteria": {}, "timing.duration": 0.1}
    assert limits(**safe, **{"allocation.min_angle_deg": 22.0}) == [22.0]
    assert limits(**{"criteria": {}, "timing.duration": 0.1}) == []


def test_thrust_and_tilt_are_drawn_as_flown(spiral: Recording) -> None:
    for name, values in (("thrust", spiral["applied_thrusts"]), ("tilt", metrics.tilts(spiral))):
        axes = figures.FIGURES[name].draw(spiral).axes[0]
        for drone in range(4):
            drawn = axes.lines[drone].get_ydata()
            assert drawn[0] == values[0, drone]
            assert drawn.max() == values[:, drone].max()
    assert metrics.tilts(spiral).max() == metrics.compute(spiral)["max_tilt_deg"]


def test_figures_of_a_page_follow_its_theme_and_files_do_not(cut: Recording, written: Path) -> None:
    for drawing in render.draw(figures.drawable(cut), cut):
        assert "var(" not in drawing.svg
        inline = drawing.inline()
        bare = set(re.findall(r"(?<!,)#[0-9a-f]{6}\b(?=[\s;\"])", inline))
        assert bare == set(), drawing.name
        assert re.sub(r"var\(--f-\w{6},(#\w{6})\)", r"\1", inline).endswith(
            drawing.svg[drawing.svg.index("<svg") :]
        )
    page = (written / "report.html").read_text()
    for light, dark in style.DARK.items():
        assert f"--f-{light[1:].lower()}:{dark.lower()};" in page


def test_colours_of_a_dark_page_stand_out_from_it() -> None:
    def luminance(colour: str) -> float:
        parts = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0
        linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    card = luminance("#1d2125")
    lines = [*style.PALETTE, *style.SERIES, *style.COMPONENTS, style.INK, style.LIMIT]
    for colour in lines:
        contrast = (luminance(style.DARK[colour]) + 0.05) / (card + 0.05)
        assert contrast >= 4.5, (colour, contrast)


def test_the_verdict_is_a_banner_with_its_reasons(spiral: Recording) -> None:
    missed = {**metrics.compute(spiral), "min_angle_deg": 12.0, "slack_time_s": 0.5}
    page = html.report(spiral, missed, [])
    banner = page.split('<div class="banner fail">')[1].split("</div>")[0]
    assert banner.startswith("<p>Fail: min_angle_deg is 12, not &gt;= 30</p>")
    assert banner.count("<li>") == 1  # slack


def test_decimation_keeps_extremes_ends_and_gaps() -> None:
    x = np.linspace(0.0, 1.0, 20_001)
    y = np.sin(40.0 * x)
    y[777], y[15_333] = 9.0, -7.0
    y[5_000:6_000] = np.nan
    dx, dy = panels.decimate(x, y, 1000)
    assert len(dx) <= 1000
    assert np.nanmax(dy) == 9.0
    assert np.nanmin(dy) == -7.0
    assert (dx[0], dx[-1]) == (x[0], x[-1])
    assert np.all(np.diff(dx) > 0)
    assert np.isnan(dy[(dx > 0.26) & (dx < 0.29)]).all()


def test_smallest_angle_is_that_of_the_metrics() -> None:
    recording = fly(**{"drones.count": 7, "timing.duration": 0.5})
    _, angle = panels.smallest_angle(recording)
    assert angle.min() == pytest.approx(metrics.compute(recording)["min_angle_deg"], abs=1e-6)


def test_every_drone_has_its_own_look() -> None:
    looks = {str(style.drone(i)) for i in range(64)}
    assert len(looks) == 64


def test_drawing_leaves_global_settings_alone(spiral: Recording) -> None:
    import matplotlib as mpl

    before = dict(mpl.rcParams)
    render.draw({"tensions": figures.FIGURES["tensions"]}, spiral)
    assert dict(mpl.rcParams) == before
