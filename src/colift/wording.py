"""Validate plain data and arguments, and say in plain words what is wrong with them."""

from __future__ import annotations

import ast
import difflib
import inspect
import json
import re
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any, TypeVar, cast, dataclass_transform

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, ValidationError
from pydantic._internal._model_construction import ModelMetaclass
from pydantic_core import ErrorDetails

from colift.errors import Problem, SettingError

Model = TypeVar("Model", bound=BaseModel)


def parse(model: type[Model], table: Mapping[str, Any]) -> Model:
    """Validate plain data strictly: neither "1" nor true is a number."""
    return model.model_validate_json(json.dumps(table), strict=True)


def numbers(
    name: str,
    value: Any,
    shape: tuple[int, ...],
    *,
    above: float | None = None,
    least: float | None = None,
    below: float | None = None,
    finite: bool = True,
) -> NDArray[np.float64]:
    """An argument as an array of its own with this shape, each number within the bounds.

    Raises
    ------
    SettingError
        Otherwise; it names the argument.

    """
    try:
        found = np.array(value, dtype=float)
    except (TypeError, ValueError):
        what = f"must be numbers of shape {shape}" if shape else "must be a number"
        raise SettingError.of(name, shown(value), what) from None
    if found.shape != shape:
        what = f"must have shape {shape}" if shape else "must be a single number"
        raise SettingError.of(name, f"shape {found.shape}", what)
    bounds = [] if not finite else ["finite"]
    fits = np.isfinite(found) | (not finite)
    if above is not None:
        bounds.append(f"greater than {above:g}")
        fits &= found > above
    if least is not None:
        bounds.append(f"at least {least:g}")
        fits &= found >= least
    if below is not None:
        bounds.append(f"less than {below:g}")
        fits &= found < below
    if not fits.all():
        raise SettingError.of(name, shown(found.tolist()), f"must be {' and '.join(bounds)}")
    return found


def problems_of(
    error: ValidationError,
    model: type[BaseModel],
    table: Mapping[str, Any],
    prefix: str = "",
    further: Sequence[str] = (),
) -> list[Problem]:
    """One problem a place; of what a union's members say, the most specific.

    ``further`` keys may stand in the table beside the model's fields.
    """
    found: dict[str, Problem] = {}
    for details in error.errors(include_url=False):
        problem = _problem(details, model, table, prefix, further)
        earlier = found.get(problem.path)
        if earlier and not _is_short(details) and earlier.message != problem.message:
            problem = replace(problem, message=f"{earlier.message}, or {problem.message}")
        found[problem.path] = problem
    return [p for path, p in found.items() if not any(f.startswith(f"{path}.") for f in found)]


def meanings(model: type[BaseModel]) -> dict[str, str]:
    """What the docstrings below a model's fields say, by field; read from the sources when asked for."""
    found: dict[str, str] = {}
    for cls in reversed(model.__mro__):
        if cls is BaseModel or not issubclass(cls, BaseModel):
            continue
        (definition,) = ast.parse(textwrap.dedent(inspect.getsource(cls))).body
        assert isinstance(definition, ast.ClassDef)
        for field, below in pairwise(definition.body):
            match field, below:
                case (
                    ast.AnnAssign(target=ast.Name(id=name)),
                    ast.Expr(value=ast.Constant(value=str(text))),
                ):
                    found[name] = inspect.cleandoc(text)
    return {name: found[name] for name in model.model_fields if name in found}


_WORDS = {
    "model_type": "must be a table",
    "dict_type": "must be a table",
    "list_type": "must be a list",
    "tuple_type": "must be a list",
    "float_type": "must be a number",
    "int_type": "must be a whole number",
    "bool_type": "must be true or false",
    "string_type": "must be text",
    "too_long": "must have at most {max_length} values",
    "too_short": "must have at least {min_length} values",
    "missing": "is required",
}


def _problem(
    details: ErrorDetails,
    model: type[BaseModel],
    table: Mapping[str, Any],
    prefix: str,
    further: Sequence[str],
) -> Problem:
    location, value = _location(details["loc"], table), shown(details["input"])
    if details["type"] in ("extra_forbidden", "no_such_attribute"):
        value = ""
        valid = _valid_keys(model, location[:-1], further)
        near = difflib.get_close_matches(location[-1], valid, n=1, cutoff=0.5)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        message = f"unknown key{hint} (valid: {', '.join(valid)})"
    elif _is_short(details):
        message = f"must have at least {int(details['loc'][-1]) + 1} values"
    elif details["type"] in _WORDS:
        message = _WORDS[details["type"]].format(**details.get("ctx", {}))
        if details["type"] == "missing":
            location, value = [*location, str(details["loc"][-1])], ""
    else:
        message = details["msg"].removeprefix("Value error, ")
        message = re.sub("^[A-Z][a-z]+ should", "must", message)
    return Problem(".".join(([prefix] if prefix else []) + location), value, message)


def _is_short(details: ErrorDetails) -> bool:
    """Whether an item of a list of fixed length is missing; of several, the last tells the length."""
    return details["type"] == "missing" and isinstance(details["loc"][-1], int)


def _location(keys: Sequence[int | str], table: Any) -> list[str]:
    """The keys that are in the file; pydantic puts the names of union members between them."""
    found = []
    for key in keys:
        inside = isinstance(table, dict) and key in table
        if inside or (isinstance(table, list) and isinstance(key, int) and key < len(table)):
            table = table[key]
            found.append(str(key))
    return found


def shown(value: Any) -> str:
    """A value as a message quotes it."""
    text = repr(value)
    return text if len(text) <= 80 else text[:77] + "..."


def _valid_keys(
    model: type[BaseModel], location: Sequence[str], further: Sequence[str]
) -> list[str]:
    """Keys that may stand in the table at ``location``."""
    current: Any = model
    for key in location:
        field = current.model_fields.get(key) if hasattr(current, "model_fields") else None
        if field is None:
            continue
        annotation = field.annotation
        arguments = getattr(annotation, "__args__", ())
        current = next((a for a in arguments if hasattr(a, "model_fields")), annotation)
    return [*getattr(current, "model_fields", {}), *(further if not location else ())]


@dataclass_transform(kw_only_default=True, field_specifiers=(Field,))
class Refusing(ModelMetaclass):
    """Calling such a class with settings that it refuses raises an error of ours."""

    def __call__(cls, *args: Any, **settings: Any) -> Any:  # noqa: N805
        try:
            return super().__call__(*args, **settings)
        except ValidationError as error:
            raise SettingError(problems_of(error, cast(type[BaseModel], cls), settings)) from error
