"""Random legal inputs for a block, chosen by the name, shape and allowed values of each field."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Literal, get_args, get_origin

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, RootModel, ValidationError

from ..language.block import Block
from ..language.parameters import Parameters, is_live
from ..language.signals import Field


def random_value(
    name: str, field: Field, shape: tuple[int, ...], rng: np.random.Generator
) -> NDArray[Any]:
    """A random legal value of a field, whose elements are finite and of order one."""
    if field.dtype_name == "bool":
        return rng.random(shape) < 0.5
    if field.dtype_name == "int64":
        choices = [int(v) for v in field.values] if field.values is not None else [0, 1, 2]
        return np.asarray(rng.choice(choices, shape), np.int64)
    if "orientation" in name and shape[-1:] == (4,):
        return random_quaternion(shape[:-1], rng)
    if "rotation" in name and shape[-2:] == (3, 3):
        return random_rotation(shape[:-2], rng)
    return np.asarray(rng.uniform(-1.0, 1.0, shape))


def random_quaternion(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.float64]:
    """Unit quaternions x, y, z, w of moderate angles, (*shape, 4)."""
    value = np.asarray(rng.uniform(-0.3, 0.3, (*shape, 4)))
    value[..., 3] = 1.0
    return np.asarray(value / np.linalg.norm(value, axis=-1, keepdims=True))


def random_rotation(shape: tuple[int, ...], rng: np.random.Generator) -> NDArray[np.float64]:
    """Rotation matrices of moderate angles, (*shape, 3, 3)."""
    x, y, z, w = np.moveaxis(random_quaternion(shape, rng), -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def random_inputs(
    block_type: type[Block], dimensions: Mapping[str, int], rng: np.random.Generator
) -> dict[str, dict[str, Any]]:
    """Values for all inputs of a block, by input and field; the block's own examples win."""
    values: dict[str, dict[str, Any]] = {}
    for port, declared in block_type.inputs.items():
        values[port] = {
            name: random_value(name, field, field.resolve(dimensions), rng)
            for name, field in declared.signal.fields.items()
        }
    for port, fields in block_type.example_inputs(rng, dimensions).items():
        values[port].update(fields)
    return values


def live_changes(params: Parameters) -> Iterator[tuple[str, Parameters]]:
    """For every live parameter, and every value inside one, its path and a set of parameters in
    which it alone is changed to another legal value."""
    for name, info in type(params).model_fields.items():
        if is_live(info):
            for path, value in _peers(getattr(params, name), info.annotation):
                changed = _with(params, name, value)
                if changed is not None:
                    yield f"{name}{path}", changed


def _with(params: Any, name: str, value: Any) -> Any:
    """The model with one value replaced, or ``None`` if that is not legal or changes nothing."""
    data = {**params.model_dump(round_trip=True), name: value}
    try:
        changed = type(params).model_validate(data)
    except ValidationError:
        return None
    return changed if changed != params else None


def _peers(value: Any, annotation: Any) -> Iterator[tuple[str, Any]]:
    """Values that differ from ``value``, usually legal ones first, each with the path inside it."""
    if isinstance(value, RootModel):
        yield from _peers(value.root, None)
    elif isinstance(value, dict):
        yield "", {name: 0.75 * item + 0.01 for name, item in value.items()}
    elif isinstance(value, BaseModel):
        for name, info in type(value).model_fields.items():
            for path, other in _peers(getattr(value, name), info.annotation):
                changed = _with(value, name, other)
                if changed is not None:
                    yield f".{name}{path}", changed
    elif isinstance(value, bool):
        yield "", not value
    elif isinstance(value, int):
        yield "", value + 1
    elif isinstance(value, float):
        yield "", 0.75 * value if value else 0.02
    elif isinstance(value, (tuple, list)):
        yield "", [0.75 * item + 0.01 for item in value]
    elif get_origin(annotation) is Literal:
        yield from (("", other) for other in get_args(annotation) if other != value)
