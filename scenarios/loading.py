"""From a TOML file, or the name of one that ships, to a checked `Scenario`.

Every refusal names the key, the value and what is allowed.
"""

from __future__ import annotations

import difflib
import re
import tomllib
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ValidationError

from scenarios.models import Scenario

FOLDER = Path(__file__).parent


class ScenarioError(ValueError):
    """A scenario that cannot be flown, in one sentence a person can act on."""


def names() -> list[str]:
    """Names of the scenarios that ship, in alphabetical order."""
    return sorted(path.stem for path in FOLDER.glob("*.toml"))


def load(name_or_path: str | Path, *, overrides: Sequence[str] = ()) -> Scenario:
    """Load a scenario by name ("emergency") or path ("my/scenario.toml").

    overrides: "section.key=value" each, the value written as in TOML; a list's entry by its place: "fault.0.onset_s=5".
    Raises ScenarioError.
    """
    path = find(name_or_path)
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"{path}: cannot be read: {error}") from None
    return parse(text, source=path.name, overrides=overrides)


def find(name_or_path: str | Path) -> Path:
    """The file behind a shipped scenario's name or a path. Raises ScenarioError."""
    shipped = FOLDER / f"{name_or_path}.toml"
    if str(name_or_path) in names():
        return shipped
    path = Path(name_or_path)
    with suppress(OSError):  # too long a name, say
        if path.is_file():
            return path
    raise ScenarioError(
        f"no scenario {str(name_or_path)!r}: neither a file nor one of those that ship ({', '.join(names())})"
    )


def parse(text: str, *, source: str, overrides: Sequence[str] = ()) -> Scenario:
    """Build a scenario from the text of a TOML file; `source` is how errors call it. Raises ScenarioError."""
    try:
        tables = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"{source}: not valid TOML: {error}") from None
    return _built(tables, source=source, overrides=overrides)


def revised(scenario: Scenario, *, source: str, overrides: Sequence[str]) -> Scenario:
    """The same scenario with these keys changed, as `load` changes those of a file. Raises ScenarioError."""
    return _built(scenario.model_dump(mode="json"), source=source, overrides=overrides)


def _built(tables: dict[str, Any], *, source: str, overrides: Sequence[str]) -> Scenario:
    for override in overrides:
        _override(tables, override)
    try:
        return Scenario.model_validate(tables)
    except ValidationError as error:
        raise ScenarioError(f"{source}: {'; '.join(explain(error, tables))}") from None


def explain(error: ValidationError, tables: dict[str, Any], model: type[BaseModel] = Scenario) -> list[str]:
    """One clause for each thing wrong: the key, the value and what is allowed. model: of the whole file."""
    return [_clause(problem, tables, model) for problem in error.errors(include_url=False)]


def _clause(problem: Any, tables: dict[str, Any], model: type[BaseModel]) -> str:
    location = list(problem["loc"])
    if location[:1] == ["fault"] and len(location) > 2:
        del location[2]  # pydantic puts the kind of a union's member into the path; people did not type it
    key = ".".join(map(str, location))
    if problem["type"] == "extra_forbidden":
        allowed = _allowed_keys(tables, location[:-1], model)
        close = difflib.get_close_matches(str(location[-1]), allowed, n=1)
        hint = f"did you mean {close[0]}? " if close else ""
        return f"{key} = {problem['input']!r}: there is no such key; {hint}allowed here: {', '.join(allowed)}"
    if problem["type"] in ("missing", "union_tag_not_found"):
        key = key if problem["type"] == "missing" else f"{key}.kind"
        return f"{key}: this key is missing"
    if problem["type"] == "union_tag_invalid":
        context = problem["ctx"]
        return f"{key}.kind = {context['tag']!r}: allowed are {context['expected_tags']}"
    message = str(problem["msg"]).removeprefix("Value error, ").replace("Input should be", "must be")
    message = re.sub(
        r"a valid dictionary or (instance of \w+|object to extract fields from)", "a section of keys", message
    )
    message = message.replace("a valid tuple", "a list")
    if problem["type"] == "value_error":
        return f"{key}: {message}" if key else message
    return f"{key} = {problem['input']!r}: {message}"


def _allowed_keys(tables: dict[str, Any], location: Sequence[Any], model: type[BaseModel]) -> list[str]:
    """Keys of the model at this place of the file."""
    models: list[type[BaseModel]] = [model]
    value: Any = tables
    for part in location:
        value = value[part]
        if isinstance(part, str):
            models = list(_models_in(models[0].model_fields[part].annotation))
        elif isinstance(value, dict):
            models = [model for model in models if _is_of_kind(model, value.get("kind"))] or models
    return list(models[0].model_fields)


def _is_of_kind(model: type[BaseModel], kind: Any) -> bool:
    """Whether a member of a union is the one that a table's kind names."""
    field = model.model_fields.get("kind")
    return field is not None and kind in getattr(field.annotation, "__args__", ())


def _models_in(annotation: Any) -> Iterable[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for argument in getattr(annotation, "__args__", ()):
        yield from _models_in(argument)


def _override(tables: dict[str, Any], override: str) -> None:
    """Set one key of the file's tables from "section.key=value", in place."""
    dotted, equals, text = override.partition("=")
    parts = dotted.strip().split(".")
    if not equals or not all(parts):
        raise ScenarioError(f"--set {override}: must read section.key=value")
    value = _toml_value(text.strip())
    at: Any = tables
    for part in parts[:-1]:
        at = _descend(at, part, override)
    if isinstance(at, list):
        at[_index(at, parts[-1], override)] = value
    else:
        at[parts[-1]] = value


def _toml_value(text: str) -> Any:
    """A value as TOML writes it; a bare word is taken for a string."""
    try:
        return tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        return text


def _descend(at: Any, part: str, override: str) -> Any:
    if isinstance(at, list):
        return at[_index(at, part, override)]
    below = at.setdefault(part, {})
    if not isinstance(below, (dict, list)):
        raise ScenarioError(f"--set {override}: {part} is a value, not a section")
    return below


def _index(at: list[Any], part: str, override: str) -> int:
    if not part.isdecimal() or int(part) >= len(at):
        raise ScenarioError(f"--set {override}: {part!r} is no place in a list of {len(at)}; places count from 0")
    return int(part)
