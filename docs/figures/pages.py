"""What the scripts that write parts of the pages share."""

import importlib.util
import json
import sys
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

DOCS = Path(__file__).parents[1]


def fill(page: str, name: str, text: str) -> None:
    """Put text between the marks ``<!-- NAME: ... -->`` and ``<!-- end of NAME -->`` of a page of the documentation."""
    path = DOCS / page
    before, found, rest = path.read_text(encoding="utf-8").partition(f"<!-- {name}:")
    mark, _, rest = rest.partition("-->\n")
    _, closed, after = rest.partition(f"<!-- end of {name} -->")
    if not found or not closed:
        raise SystemExit(f"{path}: no marks of {name}")
    whole = f"{before}{found}{mark}-->\n\n{text.strip()}\n\n{closed}{after}"
    path.write_text(whole, encoding="utf-8")


def table(header: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table in Markdown."""
    head = list(header)
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


@cache
def benchmark(name: str) -> Any:
    """A script of the folder ``benchmarks``, as a module."""
    spec = importlib.util.spec_from_file_location(
        f"{name}_benchmark", DOCS.parent / "benchmarks" / f"{name}.py"
    )
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def stored(script: str, measure: Callable[[], Any]) -> Any:
    """What is kept as JSON beside a script (its ``__file__``); with ``--fly`` it is measured first."""
    path = Path(script).with_suffix(".json")
    if "--fly" in sys.argv[1:]:
        path.write_text(json.dumps(measure(), indent=1, allow_nan=False) + "\n", encoding="utf-8")
    return json.loads(path.read_text(encoding="utf-8"))


def stored_parts(script: str, names: Iterable[str], measure: Callable[[list[str]], Any]) -> Any:
    """The same of a table of parts by name; ``--fly NAME ...`` measures those only and keeps the others."""
    known = list(names)
    asked = sys.argv[sys.argv.index("--fly") + 1 :] if "--fly" in sys.argv else []
    if wrong := [name for name in asked if name not in known]:
        raise SystemExit(f"--fly {wrong[0]}: must be among {', '.join(known)}")
    kept = json.loads(Path(script).with_suffix(".json").read_text("utf-8")) if asked else {}
    return stored(script, lambda: {**kept, **measure(asked or known)})
