"""Random inputs are legal: unit quaternions, rotations, members of what a number stands for."""

import numpy as np

from aloft.blocks.signals import Phase
from aloft.runtime.language.signals import Field
from aloft.runtime.testing.examples import random_value


def draw(name: str, field: Field, shape: tuple[int, ...]) -> np.ndarray:
    return random_value(name, field, shape, np.random.default_rng(0))


def test_quaternions_have_unit_length() -> None:
    value = draw("base_orientation", Field((5, 4)), (5, 4))
    np.testing.assert_allclose(np.linalg.norm(value, axis=1), 1.0, atol=1e-15)


def test_rotations_are_rotations() -> None:
    value = draw("foot_rotation", Field((5, 3, 3)), (5, 3, 3))
    product = value @ value.transpose(0, 2, 1)
    np.testing.assert_allclose(product, np.broadcast_to(np.eye(3), (5, 3, 3)), atol=1e-15)
    np.testing.assert_allclose(np.linalg.det(value), 1.0, atol=1e-15)
    assert not np.allclose(value[0], value[1])


def test_whole_numbers_and_truth_values() -> None:
    phases = draw("phase", Field(100, dtype="int64", values=Phase), (100,))
    assert set(phases.tolist()) == {int(phase) for phase in Phase}
    assert phases.dtype == np.int64
    flags = draw("closed", Field(100, dtype="bool"), (100,))
    assert set(flags.tolist()) == {True, False}


def test_other_floats_are_of_order_one() -> None:
    value = draw("force", Field(100), (100,))
    assert np.abs(value).max() <= 1.0 and np.ptp(value) > 1.0
