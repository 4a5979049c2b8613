"""Random legal inputs for a block, from what its fields are called, shaped and allowed to be."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..block import Block
from ..signals import Field


def random_value(
    name: str, field: Field, shape: tuple[int, ...], rng: np.random.Generator
) -> NDArray[Any]:
    """A legal value of a field, all finite and of order one."""
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
    """Values for all inputs of a block, by input and field; its own examples win."""
    values: dict[str, dict[str, Any]] = {}
    for port, declared in block_type.inputs.items():
        values[port] = {
            name: random_value(name, field, field.resolve(dimensions), rng)
            for name, field in declared.signal.fields.items()
        }
    for port, fields in block_type.example_inputs(rng, dimensions).items():
        values[port].update(fields)
    return values
