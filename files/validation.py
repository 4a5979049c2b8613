"""Reads files into pydantic models; reports what pydantic refuses in the words of the file, each
mistake once, at its place."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, TypeVar, Union, get_args, get_origin

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo

from ..runtime.language.errors import UnitError
from ..runtime.language.units import parse_quantity
from .document import read_file
from .nodes import Entry, ListNode, MapNode, Node, ScalarNode, plain, text_of
from .problems import Code, Position, Problems, fix_for_key, listing, nearest

Model = TypeVar("Model", bound=BaseModel)
Path_ = tuple[str | int, ...]

_KINDS: Mapping[str, str] = {
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "string": "text",
    "list": "a list",
    "tuple": "a list",
    "dict": "a mapping",
    "mapping": "a mapping",
    "model": "a mapping",
    "finite": "a finite number",
}
_BOUNDS = {
    "greater_than": ("gt", "more than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
}


def read_model(
    path: Path,
    model: type[Model],
    problems: Problems,
    kind_of_file: tuple[str, str],
    *,
    may_be_empty: bool = False,
) -> tuple[Model | None, MapNode | None]:
    """Return the model in a file, and the file's tree; ``None`` for what cannot be read, which is
    reported.

    ``kind_of_file`` holds two texts for messages: the name of such a file and some of its keys.
    """
    tree = read_file(path, str(path), problems, kind_of_file, may_be_empty=may_be_empty)
    if tree is None:
        return None, None
    try:
        return model.model_validate(plain(tree)), tree
    except ValidationError as error:
        for mistake in find_mistakes(error, model, tree):
            mistake.report(kind_of_file[0], problems)
    return None, tree


def explain(error: Mapping[str, Any], unit: str = "") -> tuple[str, str]:
    """Return what was expected where pydantic reports an error, and the reason if there is more to
    it."""
    kind = str(error["type"])
    context = error.get("ctx", {})
    if kind in _BOUNDS:
        key, words = _BOUNDS[kind]
        return f"{words} {context[key]:g} {unit}".strip(), ""
    if kind in ("too_short", "too_long"):
        few = kind == "too_short"
        limit = context["min_length" if few else "max_length"]
        return f"{'at least' if few else 'at most'} {limit} values", ""
    if "expected" in context:
        return str(context["expected"]), "" if kind in ("literal_error", "enum") else str(
            error["msg"]
        )
    if kind in ("value_error", "assertion_error"):
        return "", str(context.get("error", error["msg"]))
    if kind == "int_from_float":
        return "a whole number", ""
    word = _KINDS.get(kind.partition("_")[0])
    if word is None:
        return str(error["msg"]), ""
    if unit and isinstance(error.get("input"), str):
        try:
            parse_quantity(error["input"], unit)
        except UnitError as reason:
            return word, str(reason)
    return word, ""


def describe(error: Mapping[str, Any], model: type[BaseModel]) -> str:
    """One error of pydantic as a line: where it is, what is expected and what was found."""
    location, value = tuple(error["loc"]), error["input"]
    at = ".".join(map(str, location))
    if error["type"] == "missing":
        return f"{at}: is missing"
    if error["type"] == "extra_forbidden":
        near = nearest(str(location[-1]), names_at(model, location[:-1]), 1)
        return f"{at}: is not known" + (f"; the nearest is {near[0]}" if near else "")
    unit = unit_of(info_at(model, location))
    expected, reason = explain(error, unit)
    expected = with_unit(expected, unit)
    text = f"expected {expected}" if expected else reason
    return text if not at or isinstance(value, Mapping) else f"{at}: {text}, found {value!r}"


def with_unit(expected: str, unit: str) -> str:
    """Return the expectation with the unit, where its text does not contain the unit already."""
    if not unit or not expected or re.search(rf"(?<!\w){re.escape(unit)}(?!\w)", expected):
        return expected
    return f"{expected} in {unit}"


def unit_of(info: FieldInfo | None) -> str:
    """Return the unit that a field of a model was declared with, as text."""
    extra = info.json_schema_extra if info is not None else None
    return str(extra.get("unit", "")) if isinstance(extra, dict) else ""


def path_text(path: Sequence[str | int]) -> str:
    """``("tabs", 0, "plots")`` -> ``tabs[0].plots``."""
    text = "".join(f"[{key}]" if isinstance(key, int) else f".{key}" for key in path)
    return text.removeprefix(".")


def info_at(model: type[BaseModel], location: Sequence[str | int]) -> FieldInfo | None:
    """Return the field that a location lies in, or the innermost one that is known."""
    found: FieldInfo | None = None
    for depth, key in enumerate(location):
        for owner in _models_at(model, location[:depth]):
            found = owner.model_fields.get(str(key), found)
    return found


def names_at(model: type[BaseModel], location: Sequence[str | int]) -> tuple[str, ...]:
    """Return the keys that are legal in the mapping at a location."""
    names = [name for owner in _models_at(model, location) for name in owner.model_fields]
    return tuple(dict.fromkeys(names))


def _models_at(model: type[BaseModel], location: Sequence[str | int]) -> list[type[BaseModel]]:
    """Return the models that may stand at a location, which may also name members of unions."""
    types: list[Any] = [model]
    for key in location:
        types = _models(types)
        inner: list[Any] = []
        for each in types:
            if isinstance(each, type) and issubclass(each, BaseModel):
                info = each.model_fields.get(str(key))
                inner += [info.annotation] if info is not None else []
            else:
                inner += [arg for arg in get_args(each)[-1:] if arg is not Ellipsis]
                inner += [arg for arg in get_args(each)[:1] if get_args(each)[-1] is Ellipsis]
        types = inner or types  # a member of a union is no step in the file
    return [t for t in _models(types) if isinstance(t, type) and issubclass(t, BaseModel)]


def _models(types: Iterable[Any]) -> list[Any]:
    """Return the types with the members of unions in place of the unions."""
    found: list[Any] = []
    for each in types:
        if get_origin(each) is Annotated:
            found += _models(get_args(each)[:1])
            continue
        union = get_origin(each) in (Union, UnionType)
        found += _models(get_args(each)) if union else [each]
    return found


@dataclass
class Mistake:
    """All errors of pydantic about one place; there are several where the type is a union."""

    code: Code
    path: Path_
    where: Position
    node: Node | None
    """The wrong value; ``None`` where there is none, or it is the file as a whole."""
    key: str = ""
    """The key that is missing or unknown."""
    expected: list[str] = field(default_factory=list)
    reasons: list[str] = field(default_factory=list)
    nearest: tuple[str, ...] = ()
    fix: str = ""
    location: Path_ = ()
    """Location that pydantic reports, in which members of unions also appear."""
    kinds: list[str] = field(default_factory=list)
    """Pydantic's names for the errors."""

    @property
    def found(self) -> str:
        """The wrong value as YAML, cut off where it is long."""
        if self.code is Code.UNKNOWN_PARAMETER:
            return self.key
        if self.node is None:
            return ""
        text = text_of(plain(self.node))
        return text if len(text) <= 80 else f"{text[:77]}..."

    def report(self, what: str, problems: Problems) -> None:
        """Report the mistake in ``what``, such as ``a task``."""
        at, owner = path_text(self.path), path_text(self.path[:-1]) or what
        code = self.code
        if code is Code.MISSING_PARAMETER:
            code, message = Code.MISSING_KEY, f"{at} is missing"
        elif code is Code.UNKNOWN_PARAMETER:
            code, message = Code.UNKNOWN_KEY, f"{self.key!r} is not a key of {owner}"
        elif self.node is None:
            code, message = Code.BAD_VALUE, f"{what} contradicts itself"
        else:
            code, message = Code.BAD_VALUE, f"{at} cannot be {self.found}"
        if self.reasons:
            message = f"{message}: {'; '.join(self.reasons)}"
        problems.add(
            code,
            message,
            self.where,
            at=at,
            expected=" or ".join(self.expected),
            found=self.found,
            nearest=self.nearest,
            fix=self.fix,
        )


def find_mistakes(error: ValidationError, model: type[BaseModel], tree: MapNode) -> list[Mistake]:
    """Return the mistakes that pydantic found in a tree, each once and without its consequences."""
    found: dict[tuple[Code, Path_], Mistake] = {}
    for each in error.errors(include_url=False):
        mistake = _mistake(each, model, tree)
        known = found.setdefault((mistake.code, mistake.path), mistake)
        if known is not mistake:
            known.expected += [text for text in mistake.expected if text not in known.expected]
            known.reasons += [text for text in mistake.reasons if text not in known.reasons]
            known.kinds += mistake.kinds
            known.nearest, known.fix = known.nearest or mistake.nearest, known.fix or mistake.fix
    everything = list(found.values())
    return [
        m for m in everything if not _is_explained(m, everything) and not _is_meant(m, everything)
    ]


def _mistake(error: Any, model: type[BaseModel], tree: MapNode) -> Mistake:
    """One error of pydantic, at its place in the tree."""
    kind, location = str(error["type"]), tuple(error["loc"])
    path, node, entry = locate(tree, location)
    info = info_at(model, location)
    if kind == "missing":
        key = str(location[-1])
        fix = f"{key}: ..."
        return Mistake(
            Code.MISSING_PARAMETER, (*path, key), node.where, None, key, ["a value"], fix=fix,
            location=location,
        )  # fmt: skip
    if kind == "extra_forbidden" and entry is not None:
        legal = names_at(model, location[:-1])
        near = nearest(entry.key, legal)
        value = text_of(plain(entry.value))
        fix = f"remove {entry.key!r}"
        if near:
            fix = fix_for_key(entry.key, value, entry.key_where, near[0])
        return Mistake(
            Code.UNKNOWN_PARAMETER, path, entry.key_where, None, entry.key, [listing(legal)],
            nearest=near, fix=fix, location=location,
        )  # fmt: skip
    expected, reason = explain(error, unit_of(info))
    mistake = Mistake(
        Code.BAD_PARAMETER,
        path,
        node.where,
        node if path else None,
        location=location,
        kinds=[kind],
    )
    mistake.expected += [expected] if expected else []
    mistake.reasons += [reason] if reason else []
    if isinstance(node, ScalarNode) and isinstance(node.value, str):
        legal = tuple(word.strip("' ") for word in expected.replace(" or ", ",").split(","))
        mistake.nearest = nearest(node.value, [word for word in legal if word])
        if mistake.nearest and path:
            mistake.fix = f"{path[-1]}: {mistake.nearest[0]}"
    return mistake


def locate(root: MapNode, location: Sequence[str | int]) -> tuple[Path_, Node, Entry | None]:
    """Follow a location of pydantic as far as the file has it; such a location also names the
    members of unions, which are no keys of the file.

    Returns:
        The steps that the file has, the value there, and its entry if it is one of a mapping.
    """
    node: Node = root
    entry = None
    steps: list[str | int] = []
    for step in location:
        if isinstance(node, MapNode) and (found := node.get(str(step))) is not None:
            entry, node = found, found.value
            steps.append(str(step))
        elif isinstance(node, ListNode) and str(step).isdigit() and int(step) < len(node.items):
            node, entry = node.items[int(step)], None
            steps.append(int(step))
    return tuple(steps), node, entry


def location_of(root: MapNode, path: Sequence[str | int]) -> Position:
    """Return the place of the value at a path, or of the nearest thing that holds it."""
    return locate(root, path)[1].where


def _is_explained(mistake: Mistake, others: Iterable[Mistake]) -> bool:
    """Return whether a collection was refused only because of elements that other mistakes report.

    Where the type is a number or a mapping, pydantic reports the wrong element of a mapping, and
    also that the mapping is not a number; the latter adds nothing.
    """
    depth = len(mistake.path)
    return isinstance(mistake.node, (MapNode, ListNode)) and any(
        len(other.path) > depth and other.path[:depth] == mistake.path for other in others
    )


def _is_meant(mistake: Mistake, others: Iterable[Mistake]) -> bool:
    """Return whether a missing key is given under a misspelt name."""
    return mistake.code is Code.MISSING_PARAMETER and any(
        other.code is Code.UNKNOWN_PARAMETER
        and other.path[:-1] == mistake.path[:-1]
        and other.nearest[:1] == (mistake.key,)
        for other in others
    )
