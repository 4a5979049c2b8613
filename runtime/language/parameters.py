"""Parameters are the values that a graph may set on a block; pydantic checks and converts them.

A parameter with a unit may be written as a bare number in that unit, or as a text with any unit of
the same dimension: ``force: 70 N``, ``duration: 10 ms``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, get_args, get_origin

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.fields import FieldInfo

from ...files.validation import unit_of
from ...mathematics.compiling.kinds import ArrayKind, Kind
from .errors import UnitError
from .units import parse_quantity


def parameter(
    default: Any = ...,
    *,
    text: str,
    unit: str = "",
    ge: float | None = None,
    gt: float | None = None,
    le: float | None = None,
    lt: float | None = None,
    min_length: int | None = None,
    max_length: int | None = None,
    live: bool = False,
) -> Any:
    """Declare a parameter: its default, unit, bounds and text. Without a default it is required; the default of a group
    is its class.

    ``live`` parameters may be changed while the graph runs: the block reads them from
    ``self.params`` in every tick, or recomputes what depends on them in ``Block.prepare``.
    """
    extra: dict[str, Any] = {"unit": unit, **({"live": True} if live else {})}
    if default is not ... and isinstance(default, list):
        value = default
        return Field(
            default_factory=lambda: list(value), description=text, ge=ge, gt=gt, le=le, lt=lt,
            min_length=min_length, max_length=max_length, json_schema_extra=extra,
        )  # fmt: skip
    if isinstance(default, type) and issubclass(default, Parameters):
        # not validated: each group's validator takes 0.5 ms to make, and that of what it lies in is enough
        default = default.model_construct()
    return Field(
        default, description=text, ge=ge, gt=gt, le=le, lt=lt,
        min_length=min_length, max_length=max_length, json_schema_extra=extra,
        validate_default=default is not ...,
    )  # fmt: skip


live_parameter = partial(parameter, live=True)
"""Declare a parameter that may be changed while the graph runs: a gain, a weight, a threshold."""


def is_live(info: FieldInfo) -> bool:
    """Return whether a parameter was declared as one that may change while the graph runs."""
    extra = info.json_schema_extra
    return isinstance(extra, dict) and bool(extra.get("live", False))


def group_of(info: FieldInfo) -> type[Parameters] | None:
    """Return the model of a parameter that is a group of parameters, or may be left out as one."""
    kinds = [
        kind for kind in get_args(info.annotation) or (info.annotation,) if kind is not type(None)
    ]
    only = kinds[0] if len(kinds) == 1 else None
    return only if isinstance(only, type) and issubclass(only, Parameters) else None


@lru_cache(maxsize=1024)
def declared_fields(model: type[Parameters], prefix: str = "") -> tuple[tuple[str, FieldInfo], ...]:
    """Return the parameters of a model and of its groups, by path: ``sensors.imu.bandwidth``.

    A group that may be left out stands before what is in it.
    """
    found: list[tuple[str, FieldInfo]] = []
    for name, info in model.model_fields.items():
        group = group_of(info)
        if group is None or type(None) in get_args(info.annotation):
            found.append((f"{prefix}{name}", info))
        if group is not None:
            found += declared_fields(group, f"{prefix}{name}.")
    return tuple(found)


def given_values(params: Parameters, prefix: str = "") -> Iterator[tuple[str, Any, FieldInfo]]:
    """Yield the values of parameters and of the groups in them, by path, each with its declaration."""
    for name, info in type(params).model_fields.items():
        value = getattr(params, name)
        if isinstance(value, Parameters):
            yield from given_values(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value, info


def takes_none(info: FieldInfo) -> bool:
    """Return whether ``none`` stands for YAML's null: the parameter may be left out, and no word is
    called so."""
    kinds = get_args(info.annotation)
    words = [word for kind in kinds if get_origin(kind) is Literal for word in get_args(kind)]
    return type(None) in kinds and str not in kinds and "none" not in words


def _convert(value: Any, unit: str) -> Any:
    """``value`` with every text that starts with a number replaced by the number in ``unit``."""
    if isinstance(value, str):
        return parse_quantity(value, unit)
    if isinstance(value, Mapping):
        return {key: _convert(item, unit) for key, item in value.items()}
    if isinstance(value, Sequence) and not isinstance(value, bytes):
        return [_convert(item, unit) for item in value]
    return value


if TYPE_CHECKING:  # arrays in a kernel, what pydantic has read elsewhere
    ScalarOrVector: TypeAlias = Any
    Numbers: TypeAlias = Any
    TwoNumbers: TypeAlias = Any
    ThreeNumbers: TypeAlias = Any
else:
    ScalarOrVector = float | list[float]
    Numbers = list[float]
    TwoNumbers = tuple[float, float]
    ThreeNumbers = tuple[float, float, float]
"""``ScalarOrVector`` is one number for all elements of a vector, or a list with one number for each
of its ``n`` elements. A kernel sees a vector of ``n`` elements."""


_PLAIN: Mapping[str, Any] = {
    "float": float, "int": int, "bool": bool, "str": str, "float | None": float | None, "int | None": int | None,
    "tuple[float, float]": tuple[float, float],
}  # fmt: skip
"""The types of most parameters, by their annotations."""


class Parameters(BaseModel):
    """The base of every block's parameters: unknown keys are errors, values cannot be changed."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        # pydantic compiles each text of an annotation anew, which takes half of the time of a declaration
        written = vars(cls).get("__annotations__", {})
        written.update({name: _PLAIN[text] for name, text in written.items() if text in _PLAIN})

    @classmethod
    def kernel_kinds(cls) -> Mapping[str, Kind]:
        """Return the kind of each parameter in the equations of a kernel."""
        return parameter_kinds(cls)

    def own_unit(self, name: str) -> str:
        """Return the unit that the graph gives a parameter; empty where its declaration says all."""
        return ""

    @model_validator(mode="before")
    @classmethod
    def _read_values(cls, data: Any) -> Any:
        if not isinstance(data, dict):
            return data
        converted = dict(data)
        forms = _written_forms(cls)
        for name in data:
            unit, or_none = forms.get(name, ("", False))
            if or_none and converted[name] == "none":
                converted[name] = None
            if unit:
                with suppress(UnitError):  # stays a text, which pydantic then reports at its place
                    converted[name] = _convert(converted[name], unit)
        return converted


@lru_cache(maxsize=1024)
def _written_forms(params: type[Parameters]) -> Mapping[str, tuple[str, bool]]:
    """Return the unit of each parameter, and whether ``none`` may stand for its null."""
    return {n: (unit_of(info), takes_none(info)) for n, info in params.model_fields.items()}


@lru_cache(maxsize=1024)
def parameter_kinds(params: type[Parameters]) -> Mapping[str, Kind]:
    """Return the kind of each parameter for a kernel: numbers, vectors and matrices of numbers, and
    words."""
    scope = vars(sys.modules[params.__module__])
    return {
        name: kind
        for name, info in params.model_fields.items()
        if (kind := _parameter_kind(info.annotation, scope)) is not None
    }


def _parameter_kind(annotation: Any, scope: Mapping[str, Any]) -> Kind:
    if annotation in (float, int, bool):
        return ArrayKind((), annotation)
    if annotation == ScalarOrVector:
        return ArrayKind((None,))
    origin, inner = get_origin(annotation), get_args(annotation)
    if origin is Literal and all(isinstance(word, str) for word in inner):
        return ArrayKind((), int, inner)
    if origin is tuple and inner and inner[-1] is not Ellipsis:
        kinds = [_parameter_kind(_bare(each), scope) for each in inner]
        if all(isinstance(kind, ArrayKind) and not kind.shape for kind in kinds):
            return ArrayKind((len(inner),))
    if origin in (tuple, list) and inner:
        kind = _parameter_kind(_bare(inner[0]), scope)
        if isinstance(kind, ArrayKind) and not kind.words:
            return ArrayKind((None, *kind.shape), kind.element)
    return None


def _bare(annotation: Any) -> Any:
    """``float`` for ``Annotated[float, ...]``."""
    return get_args(annotation)[0] if hasattr(annotation, "__metadata__") else annotation
