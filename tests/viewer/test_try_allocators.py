"""The page of the documentation on which the allocators run as WebAssembly: they are the sources', and answer as in Python."""

from __future__ import annotations

import importlib.util
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from colift.control.allocation.base import Allocator
from colift.control.allocation.safe import Safe
from colift.control.allocation.sqp import Sqp
from colift.deploy.c.machines import MACHINES
from colift.team import Team
from colift.team.geometry import ring

DOCS = Path(__file__).parents[2] / "docs"
DEFAULT = {
    "n": 4, "load_mass": 0.225, "mu": 0.15, "min_angle_deg": 30, "max_cone_deg": 75, "tension_min": 0.05,
    "tension_max": 5,
}  # fmt: skip


def _script(path: Path) -> Any:
    """A script of the documentation, as a module."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def made() -> Any:
    """What makes the WebAssembly."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(DOCS / "figures"))
        return _script(DOCS / "figures" / "try_allocators.py")


def test_the_webassembly_is_what_the_sources_give(made):
    found, files = json.loads(made.FILE.read_text()), made.sources()
    anew = "run python docs/figures/try_allocators.py"
    assert found["sources"] == made.digest(files), anew
    assert {key: found[key] for key in made.told()} == json.loads(json.dumps(made.told())), anew
    assert made.FILE.stat().st_size < 150_000
    if MACHINES["wasm"].missing() or made.compiler() != found["compiler"]:
        pytest.skip("needs the compiler with which the file was made")
    assert made.b64encode(made.compiled(files)).decode() == found["wasm"], anew


@pytest.mark.parametrize("kind", ["sqp", "safe"])
def test_memory_is_nothing_at_first_as_the_page_takes_it(made, kind):
    part, _ = made.PARTS[kind]
    assert not part.memory(Team.uniform(made.DRONES)).any()


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page's working part by itself."""
    file = tmp_path_factory.mktemp("try") / "try.html"
    head = '<!doctype html><meta charset="utf-8"><meta name="viewport" content="width=device-width"><body>'
    file.write_text(head + _script(DOCS / "_ext" / "colift_try.py").fragment(), encoding="utf-8")
    return file


@pytest.fixture
def page(browser: Any, page_file: Path, request: pytest.FixtureRequest) -> Any:
    """It opened; it may neither complain nor ask for anything."""
    width = getattr(request, "param", 390)
    context = browser.new_context(viewport={"width": width, "height": 844})
    opened, said, asked = context.new_page(), [], []
    opened.on("console", lambda message: said.append(message.text))
    opened.on("pageerror", lambda error: said.append(str(error)))
    opened.on("request", lambda request: asked.append(request.url))
    opened.goto(page_file.as_uri())
    opened.wait_for_selector("[data-ready]", state="attached")
    yield opened
    context.close()
    assert said == []
    assert asked == [page_file.as_uri()]


def _settings(rng: np.random.Generator) -> dict[str, float]:
    low = rng.uniform(0.01, 2.0)
    return {
        "n": int(rng.integers(2, 9)), "load_mass": rng.uniform(0.05, 1.0), "mu": rng.uniform(0.0, 2.0),
        "min_angle_deg": rng.uniform(5.0, 90.0), "max_cone_deg": rng.uniform(20.0, 85.0), "tension_min": low,
        "tension_max": low * rng.uniform(1.2, 6.0),
    }  # fmt: skip


def _parts(settings: dict[str, float]) -> tuple[dict[str, Any], Team]:
    given = dict(settings)
    team = Team.uniform(int(given.pop("n")), load_mass=given.pop("load_mass"))
    return {"sqp": Sqp(mu=given["mu"]), "safe": Safe(**given)}, team


PARAMS = "all => all.map(s => ['sqp', 'safe'].map(kind => [...tryAllocators.params[kind](s)]))"


def test_the_page_packs_parameters_as_python_does(page):
    rng = np.random.default_rng(5)
    settings = [_settings(rng) for _ in range(300)]
    for given, found in zip(settings, page.evaluate(PARAMS, settings), strict=True):
        parts, team = _parts(given)
        for kind, vector in zip(("sqp", "safe"), found, strict=True):
            wanted = parts[kind].params(team)
            np.testing.assert_allclose(vector, wanted, rtol=4e-16, atol=4e-16, err_msg=str(given))


ASK = """async ([settings, start, forces]) => {
    const both = await tryAllocators.make(settings, start);
    return ["sqp", "safe"].map(kind => forces.map(force => {
        both[kind].ask(force);
        return [both[kind].status, ...both[kind].tensions, ...both[kind].directions];
    }));
}"""


@pytest.mark.parametrize(("n", "limits"), [(2, {}), (3, {}), (4, {}), (4, {"tension_max": 0.9}), (8, {"min_angle_deg": 15})])  # fmt: skip
def test_the_page_answers_as_python_does(page, n, limits):
    settings = DEFAULT | {"n": n} | limits
    t = 0.05 * np.arange(30)[:, None]
    forces = 2.2 * np.hstack([0.3 * np.sin(t), 0.2 * np.cos(2.0 * t), 1.0 + 0.1 * np.sin(3.0 * t)])
    start, (parts, team) = ring(n, math.radians(35.0)), _parts(settings)
    given = page.evaluate(ASK, [settings, start.ravel().tolist(), forces.tolist()])
    for (kind, part), answers in zip(parts.items(), given, strict=True):
        allocator = Allocator(part, team)
        allocator.reset(start)
        for force, found in zip(forces, answers, strict=True):
            answer = allocator.allocate(force)
            wanted = [int(answer.status), *answer.tensions, *answer.directions.ravel()]
            np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-9, err_msg=kind)


@pytest.mark.parametrize("page", [390, 1280], indirect=True)
def test_nothing_sticks_out_with_most_drones_and_the_longest_words(page):
    page.locator("[name=n]").fill("8")
    page.locator("[name=min_angle_deg]").fill("90")  # no room
    page.locator("[data-kind=safe] dd", has_text="on their way back").wait_for()
    assert page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    wide = "[...document.querySelectorAll('#try *')].filter(e => e.getBoundingClientRect().right > innerWidth + 0.5).length"
    assert page.evaluate(wide) == 0


def test_the_force_can_be_dragged(page):
    pad = page.locator("[data-pad=top]")
    pad.click(position={"x": 120, "y": 90})
    wish = page.evaluate("tryAllocators.state().wish")
    assert wish[0] > 0.3
    assert wish[2] == 1.0
    pad.press("ArrowLeft")
    assert page.evaluate("tryAllocators.state().wish")[0] == pytest.approx(wish[0] - 0.05)
    page.locator("[data-do=level]").click()
    assert page.evaluate("tryAllocators.state().wish") == [0, 0, 1]
    page.locator("[name=tension_max]").fill("0.2")
    page.locator("[data-kind=safe] dd", has_text="force reduced").wait_for()


SPOTS = "canvas => tryAllocators.spots(canvas, tryAllocators.state().both.sqp)"
ANGLE = "Number.parseFloat(document.querySelector('[data-kind={}] dd').textContent)"


def test_a_cable_dragged_beside_another_stays_there_with_the_paper_only(page):
    canvas = page.locator("[data-kind=sqp] canvas")
    canvas.scroll_into_view_if_needed()
    box, (one, two, *_) = canvas.bounding_box(), canvas.evaluate(SPOTS)
    page.mouse.move(box["x"] + one[0], box["y"] + one[1])
    page.mouse.down()
    page.mouse.move(box["x"] + two[0] - 4, box["y"] + two[1], steps=8)
    page.mouse.up()
    page.wait_for_function(f"{ANGLE.format('sqp')} < 25.0 && {ANGLE.format('safe')} > 30.0")


def test_limits_that_cross_give_way(page):
    page.locator("[name=tension_min]").fill("2")
    page.locator("[name=tension_max]").fill("0.2")
    found = page.evaluate("tryAllocators.state().settings")
    assert 1.2 * found["tension_min"] <= found["tension_max"]
