"""Tables that are written by the package itself, so that the pages cannot go stale.

Directives: ``port-table``, ``signal-table``, ``recording-layout``, ``quantity-table``, ``metric-table``,
``field-table`` (fields of one section of a mission) ``part-tables`` (all parts of one layer) and ``learn-table`` (tasks of the environments) and
``assumption-table`` (what certificates watch).
"""

from __future__ import annotations

import re
from typing import Any, ClassVar

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from colift.catalogue import DEFAULT_KINDS
from colift.kernel.ports import PORTS
from colift.kernel.signals import CYCLE_SIGNALS, HIDDEN, OF_ONE, SIGNALS, Signal
from colift.learn.levels import LEVELS
from colift.learn.tasks import ENDS, TASKS, TERMS
from colift.mission import Mission, schema
from colift.mission.criteria import METRICS
from colift.part import FOLDERS, find, names
from colift.record.assumptions import ASSUMPTIONS
from colift.record.exchange.topics import TOPICS
from colift.team import Team
from colift.wording import meanings

GREEK = ("alpha", "beta", "gamma", "rho", "tau", "mu", "Omega", "omega", "lam")

# Symbol of each quantity that is not a signal: LaTeX, where it lives, shape, unit, frame. A name that
# the package does not know stops the build.
TEAM = (
    ("n", "n", "()", "1", "-"),
    ("m_L", "load_mass", "()", "kg", "-"),
    ("m_i", "masses", "(n,)", "kg", "-"),
    (r"J_i", "inertias", "(n, 3)", "kg m^2", "body"),
    ("L_i", "cable_lengths", "(n,)", "m", "-"),
    ("g", "gravity", "()", "m/s^2", "-z of the world"),
    (r"f_{i,\max}", "max_thrusts", "(n,)", "N", "-"),
    (r"a_i", "arms", "(n,)", "m", "-"),
)
GAINS = (
    (r"k_{pL}", "load_control", "pid", "k_p", "N/m", "world axes"),
    (r"k_{dL}", "load_control", "pid", "k_d", "N s/m", "world axes"),
    (r"k_{iL}", "load_control", "pid", "k_i", "N/(m s)", "world axes"),
    (r"\mu", "allocation", "sqp", "mu", "N^2", "-"),
    (r"k_{pi}", "position_control", "pid", "k_p", "N/m", "world axes"),
    (r"k_{di}", "position_control", "pid", "k_d", "N s/m", "world axes"),
    (r"k_{ii}", "position_control", "pid", "k_i", "N/(m s)", "world axes"),
    (r"\rho_i", "attitude_control", "manifold", "rho", "1/s", "body axes"),
    (r"K_{di}", "attitude_control", "manifold", "k_d", "N m s", "body axes"),
    (r"\beta_i", "attitude_control", "manifold", "beta", "N m", "body axes"),
    (r"\gamma_i", "attitude_control", "manifold", "gamma", "s", "body axes"),
)
# Same number, other unit word: what the field documents must agree with GAINS.
UNIT = re.compile(
    r"(?:^|, )((?:kg m\^2|m/s\^2|N/\(m s\)|N s/m|N m s|N\^2|N/m|N m|rad/s|kg|m/s|m s|1/s|degrees|rad|N|m|s))"
    r"(?=$|[ .;,(])"
)


def latex(symbol: str) -> str:
    """LaTeX of a signal's symbol such as ``alpha_dot_i``; empty for a signal without one."""
    if symbol in ("-", ""):
        return ""
    head, *rest = symbol.split("_")
    head = f"\\{head}" if head in GREEK else head
    if rest and rest[0] == "dot":
        head, rest = f"\\dot{{{head}}}", rest[1:]
    return f"{head}_{{{''.join(rest)}}}" if rest else head


def shape_text(signal: Signal, lead: str = "") -> str:
    sizes = ([lead] if lead else []) + [str(size) for size in signal.shape]
    return f"({sizes[0]},)" if len(sizes) == 1 else f"({', '.join(sizes)})"


def code(text: str) -> nodes.Node:
    return nodes.literal(text, text)


def math(text: str) -> nodes.Node:
    return nodes.math(text, text) if text else nodes.Text("-")


def cell(content: str | nodes.Node) -> nodes.entry:
    paragraph = nodes.paragraph()
    if isinstance(content, nodes.Node):
        paragraph += content
    else:  # double backticks and names of objects, as in docstrings, become code
        content = re.sub(r":\w+:`~?([\w.]+)`", r"``\1``", content)
        for k, piece in enumerate(re.split(r"``(.+?)``", content)):
            if piece:
                paragraph += code(piece) if k % 2 else nodes.Text(piece)
    entry = nodes.entry()
    entry += paragraph
    return entry


WIDTHS = {
    "symbol": 10, "name": 24, "shape": 11, "unit": 11, "frame": 11, "meaning": 40, "default": 14,
    "topic": 20, "message": 22, "from": 10, "holds": 34, "quality": 20, "period": 10,
    "quantity": 20, "field": 16, "layer": 14, "agent": 10, "sees": 44, "writes": 30, "type": 14, "range": 15, "data set": 30, "metric": 30,
    "task": 18, "what is wanted": 36, "time (s)": 8, "reach (m)": 8, "least height": 8, "term": 12, "what it is": 60, "end": 12, "when": 60,
    "level": 10, "numbers a drone": 12, "what they command": 60, **dict.fromkeys(TERMS, 8),
}  # fmt: skip


def table(head: list[str], rows: list[list[Any]]) -> nodes.table:
    """A docutils table; cells are text or nodes."""
    group = nodes.tgroup(cols=len(head))
    group += [nodes.colspec(colwidth=WIDTHS[name]) for name in head]
    for holder, lines in ((nodes.thead(), [head]), (nodes.tbody(), rows)):
        for line in lines:
            row = nodes.row()
            row += [cell(content) for content in line]
            holder += row
        group += holder
    result = nodes.table(classes=["colift"])
    result += group
    return result


class PortTable(SphinxDirective):
    """Which signals each layer sees and writes."""

    def run(self) -> list[nodes.Node]:
        rows = [
            [port.name.replace("_", " "), *map(self.names, (port.sees, port.writes))]
            for port in PORTS.values()
        ]
        return [table(["layer", "sees", "writes"], rows)]

    def names(self, signals: tuple[str, ...]) -> str:
        return ", ".join(f"``{name}``" for name in signals) or "-"


class SignalTable(SphinxDirective):
    """Symbol table of everything that flows between the layers; with ``agents``, of what one drone's agent sees and writes."""

    optional_arguments = 1

    def run(self) -> list[nodes.Node]:
        if self.arguments == ["agents"]:
            mine = [
                ["writes" if s.writer else "sees", code(s.name), code(shape_text(s)), s.meaning]
                for s in OF_ONE
            ]
            return [table(["agent", "name", "shape", "meaning"], mine)]
        rows = [
            [math(latex(s.symbol)), code(s.name), code(shape_text(s)), s.unit, s.frame, s.meaning]
            for s in (*SIGNALS, *CYCLE_SIGNALS)
        ]
        return [table(["symbol", "name", "shape", "unit", "frame", "meaning"], rows)]


class HiddenTable(SphinxDirective):
    """What flows between the layers without being recorded."""

    def run(self) -> list[nodes.Node]:
        rows = [[code(s.name), code(shape_text(s)), s.unit, s.frame, s.meaning] for s in HIDDEN]
        return [table(["name", "shape", "unit", "frame", "meaning"], rows)]


class QuantityTable(SphinxDirective):
    """Symbols of the team and of the gains: name in the API, unit, frame, default."""

    def run(self) -> list[nodes.Node]:
        team = Team.uniform(2)
        rows = []
        for symbol, name, shape, unit, frame in TEAM:
            value = getattr(team, name)  # stops the build when a name has gone
            actual = "()" if not hasattr(value, "shape") else str(value.shape).replace("2", "n")
            if actual != shape:
                raise self.error(f"Team.{name} has shape {actual}, the table says {shape}")
            rows.append([math(symbol), code(f"Team.{name}"), code(shape), unit, frame, "-"])
        for symbol, layer, kind, name, unit, frame in GAINS:
            part = find(layer, kind)
            field, meaning = part.model_fields[name], meanings(part).get(name, "")
            found = UNIT.search(meaning)
            if found is None or found.group(1) != unit:
                raise self.error(f"{layer}.{name}: unit {unit} is not in {meaning!r}")
            shape = "(3,)" if isinstance(field.default, tuple) else "()"
            text = shown(field.default)
            rows.append([math(symbol), code(f"{layer}.{name}"), code(shape), unit, frame, text])
        return [table(["symbol", "name", "shape", "unit", "frame", "default"], rows)]


class RecordingLayout(SphinxDirective):
    """Every data set of a recording."""

    def run(self) -> list[nodes.Node]:
        rows: list[list[Any]] = [
            [code("/time"), code("(rows,)"), "s", "-", "time of each row of ``/signals``"]
        ]
        rows += [
            [code(f"/signals/{s.name}"), code(shape_text(s, "rows")), s.unit, s.frame, s.meaning]
            for s in SIGNALS
        ]
        rows.append(
            [code("/allocator/time"), code("(cycles,)"), "s", "-", "time of each allocation"]
        )
        for s in CYCLE_SIGNALS:
            short = s.name.removeprefix("allocator_")
            name = "solve_time" if short == "time" else short
            text = shape_text(s, "cycles")
            rows.append([code(f"/allocator/{name}"), code(text), s.unit, s.frame, s.meaning])
        return [table(["data set", "shape", "unit", "frame", "meaning"], rows)]


class MetricTable(SphinxDirective):
    """Every metric of a flight."""

    def run(self) -> list[nodes.Node]:
        rows = [[code(m.name), m.unit, m.meaning] for m in METRICS]
        return [table(["metric", "unit", "meaning"], rows)]


def shown(value: Any) -> str:
    """A default as it stands in a mission file."""
    if isinstance(value, bool):
        return f"``{str(value).lower()}``"
    if isinstance(value, str):
        return f'``"{value}"``' if value else '``""``'
    if isinstance(value, list | tuple):
        inner = ", ".join(shown(item).strip("`") for item in value)
        return f"``[{inner}]``"
    if isinstance(value, float):
        return f"``{value:g}``" if value else "``0``"
    return f"``{value}``"


def kind_of(spec: dict[str, Any], defs: dict[str, Any]) -> str:
    """What a field holds, in words, from its JSON schema."""
    spec = resolve(spec, defs)
    members = spec.get("anyOf") or spec.get("oneOf")
    if members:
        words = [kind_of(m, defs) for m in members if resolve(m, defs).get("type") != "null"]
        return " or ".join(dict.fromkeys(words))
    if "enum" in spec:
        return ", ".join(f'``"{value}"``' for value in spec["enum"])
    if "const" in spec:
        return f'``"{spec["const"]}"``'
    words = {"number": "number", "integer": "whole number", "boolean": "true or false"}
    if spec.get("type") == "array":
        count = len(spec.get("prefixItems", ()))
        inner = spec["prefixItems"][0] if count else spec.get("items", {})
        word = kind_of(inner, defs)
        return (
            f"{count} {word}s"
            if count
            else f"list of {word}s"
            if word == "number"
            else f"list, each {word}"
        )
    return words.get(spec.get("type", ""), "text" if spec.get("type") == "string" else "any")


def range_of(spec: dict[str, Any], defs: dict[str, Any]) -> str:
    """Allowed range in words, from the JSON schema; of lists, of each entry."""
    spec = resolve(spec, defs)
    members = spec.get("anyOf") or spec.get("oneOf")
    if members:
        found = [range_of(member, defs) for member in members]
        return next((text for text in found if text != "-"), "-")
    if spec.get("type") == "array":
        inner = range_of((spec.get("prefixItems") or [spec.get("items", {})])[0], defs)
        each = inner if inner == "-" or inner.startswith("each") else f"each {inner}"
        low, high = spec.get("minItems"), spec.get("maxItems")
        if not spec.get("prefixItems") and (low or high):
            each = f"{low or 0} to {high or 'any'} entries" + ("" if each == "-" else f", {each}")
        return each
    parts = [
        f"{sign} " + ("2^63" if spec[key] == 2**63 else f"{spec[key]:g}")
        for key, sign in (
            ("exclusiveMinimum", ">"), ("minimum", "≥"), ("exclusiveMaximum", "<"), ("maximum", "≤"),
        )
        if key in spec
    ]  # fmt: skip
    if "maxLength" in spec:
        parts.append(f"{spec.get('minLength', 0)} to {spec['maxLength']} characters")
    if "pattern" in spec:
        pattern = re.sub(r"\\(.)|[\^$]", r"\1", spec["pattern"])
        parts.append(f"matches ``{pattern}``")
    return ", ".join(parts) or "-"


def resolve(spec: dict[str, Any], defs: dict[str, Any]) -> dict[str, Any]:
    return defs[spec["$ref"].rpartition("/")[2]] if "$ref" in spec else spec


def field_rows(model: Any, skip: tuple[str, ...] = ()) -> list[list[Any]]:
    """One row per field of a pydantic model."""
    described, texts = model.model_json_schema(), meanings(model)
    defs = described.get("$defs", {})
    rows: list[list[Any]] = []
    for name, field in model.model_fields.items():
        if name in skip:
            continue
        spec = described["properties"][name]
        text = texts.get(name, "")
        unit = UNIT.search(text)
        if unit and text.strip(" .") == unit.group(1):
            text = name.replace("_", " ")
        required = field.is_required()
        default = "required" if required else "-" if field.default is None else shown(field.default)
        rows.append(
            [
                code(name), kind_of(spec, defs), unit.group(1) if unit else "-", default,
                range_of(spec, defs), text,
            ]
        )  # fmt: skip
    return rows


FIELD_HEAD = ["field", "type", "unit", "default", "range", "meaning"]


class FieldTable(SphinxDirective):
    """Fields of one section of a mission; without an argument, the fields at the top."""

    optional_arguments = 1
    sections: ClassVar[dict[str, str]] = {
        "world": "World",
        "world.ground": "Ground",
        "world.obstacles": "Obstacle",
        "load": "Load",
        "drones": "Drones",
        "truth": "Truth",
        "start": "Start",
        "timing": "Timing",
        "events": "Event",
        "criteria": "Bound",
    }

    def run(self) -> list[nodes.Node]:
        if self.arguments:
            return [
                table(FIELD_HEAD, field_rows(getattr(schema, self.sections[self.arguments[0]])))
            ]
        plain = ("name", "description", "seed", "derived")
        known = {*plain, *self.sections, "kinds", "list_kinds", *FOLDERS}
        if missing := set(Mission.model_fields) - known:
            raise self.error(f"the mission has sections that this page lacks: {sorted(missing)}")
        skip = tuple(known - set(plain))
        return [table(FIELD_HEAD, field_rows(Mission, skip))]


FEW = 2
"""As many parts of a layer are found without a line of contents."""


def place(layer: str, kind: str) -> str:
    """Name of the place of a part on its page."""
    return f"{layer}-{kind}".replace("_", "-")


class PartTables(SphinxDirective):
    """All parts of one layer: what each is, and its settings."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        layer = self.arguments[0]
        out: list[nodes.Node] = []
        if len(names(layer)) > FEW:
            out.append(self.contents(layer))
        for kind in names(layer):
            part = find(layer, kind)
            note = " (default)" if DEFAULT_KINDS.get(layer) == kind else ""
            line = (part.__doc__ or "").strip().split("\n\n")[0].replace("\n", " ")
            paragraph = nodes.paragraph(ids=[place(layer, kind)])
            paragraph += [nodes.strong("", "", code(f'kind = "{kind}"')), nodes.Text(f"{note}: ")]
            paragraph += cell(re.sub(r"\s+", " ", line)).children[0].children
            out.append(paragraph)
            rows = field_rows(part)
            if rows:
                out.append(table(FIELD_HEAD, rows))
        return out

    def contents(self, layer: str) -> nodes.paragraph:
        """A line with a link to each part."""
        paragraph = nodes.paragraph("", "Parts: ")
        for number, kind in enumerate(names(layer)):
            paragraph += nodes.Text(", " if number else "")
            paragraph += nodes.reference("", kind, refid=place(layer, kind), internal=True)
        return paragraph


class TopicTable(SphinxDirective):
    """The topics of the ROS nodes: what they hold, and how it travels."""

    def run(self) -> list[nodes.Node]:
        every = TOPICS.values()
        what = [
            [code(t.name), code(t.type.replace("/msg/", "/")), t.writer, t.holds] for t in every
        ]
        how = [
            [code(t.name), t.unit, t.frame, str(t.quality), t.every.replace("_", " ")]
            for t in every
        ]
        return [
            table(["topic", "message", "from", "holds"], what),
            table(["topic", "unit", "frame", "quality", "period"], how),
        ]


class LearnTable(SphinxDirective):
    """What the environments are: ``tasks``, ``terms`` of the reward and their ``weights``, ``ends`` of an episode or ``levels`` of the action."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        return [getattr(self, self.arguments[0])()]

    def tasks(self) -> nodes.Node:
        head = ["task", "what is wanted", "time (s)", "reach (m)", "least height"]
        rows = [
            [
                code(f"colift/{name}-v0"), task.meaning, f"{task.mission['timing']['duration']:g}", f"{task.reach:g}",
                f"{task.least_height:g}",
            ]
            for name, task in TASKS.items()
        ]  # fmt: skip
        return table(head, rows)

    def weights(self) -> nodes.Node:
        rows = [
            [code(f"colift/{name}-v0"), *(f"{task.weights[term]:g}" for term in TERMS)]
            for name, task in TASKS.items()
        ]
        return table(["task", *TERMS], rows)

    def terms(self) -> nodes.Node:
        return table(["term", "what it is"], [[code(name), text] for name, text in TERMS.items()])

    def ends(self) -> nodes.Node:
        return table(["end", "when"], [[code(name), text] for name, text in ENDS.values()])

    def levels(self) -> nodes.Node:
        rows = [[code(name), str(level.width), level.meaning] for name, level in LEVELS.items()]
        return table(["level", "numbers a drone", "what they command"], rows)


class AssumptionTable(SphinxDirective):
    """What a monitor watches."""

    def run(self) -> list[nodes.Node]:
        head = ["quantity", "unit", "meaning"]
        return [table(head, [[code(each.name), each.unit, each.meaning] for each in ASSUMPTIONS])]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives."""
    app.add_directive("port-table", PortTable)
    app.add_directive("signal-table", SignalTable)
    app.add_directive("hidden-table", HiddenTable)
    app.add_directive("quantity-table", QuantityTable)
    app.add_directive("recording-layout", RecordingLayout)
    app.add_directive("metric-table", MetricTable)
    app.add_directive("field-table", FieldTable)
    app.add_directive("part-tables", PartTables)
    app.add_directive("topic-table", TopicTable)
    app.add_directive("learn-table", LearnTable)
    app.add_directive("assumption-table", AssumptionTable)
    # The pages follow the package, not only their own text: read them anew each time.
    app.connect("env-get-outdated", lambda _app, env, *_: sorted(env.found_docs))
    return {"version": "1", "parallel_read_safe": True}
