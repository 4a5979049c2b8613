"""``blocks.RotateVector``: there and back."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

import aloft
from aloft.blocks.general.rotations import (
    EulerToQuaternion,
    MatrixToQuaternion,
    QuaternionProduct,
    QuaternionToEuler,
    QuaternionToMatrix,
    RotateVector,
)
from aloft.mathematics.rotations import between
from aloft.runtime.testing import BlockBench


@pytest.mark.parametrize(
    ("direction", "expected"), [("body to world", [0, 1, 2]), ("world to body", [0, -1, 2])]
)
def test_a_quarter_turn_about_z(direction: str, expected: list[float]) -> None:
    bench = BlockBench(RotateVector, {"direction": direction})
    bench.set("rotation", value=[0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)])
    bench.set("u", value=[1.0, 0.0, 2.0])
    bench.step()
    np.testing.assert_allclose(bench.get("y").value, expected, atol=1e-15)


@pytest.mark.parametrize("inverse", [False, True])
def test_product(inverse: bool) -> None:
    a, b = Rotation.from_rotvec([0.3, -0.2, 0.9]), Rotation.from_rotvec([-0.5, 0.1, 0.2])
    bench = BlockBench(QuaternionProduct, {"inverse": inverse})
    bench.set("a", value=a.as_quat())
    bench.set("b", value=b.as_quat())
    bench.step()
    expected = ((a.inv() if inverse else a) * b).as_matrix()
    found = Rotation.from_quat(bench.get("y").value).as_matrix()
    np.testing.assert_allclose(found, expected, atol=1e-14)


def test_it_is_scipys() -> None:
    rotation = Rotation.from_rotvec([0.3, -0.2, 0.9])
    bench = BlockBench(QuaternionToMatrix)
    bench.set("u", value=rotation.as_quat())
    bench.step()
    np.testing.assert_allclose(bench.get("y").value, rotation.as_matrix(), atol=1e-14)


def test_it_is_scipys_matrix_to_quaternion() -> None:
    rotation = Rotation.from_rotvec([0.3, -0.2, 0.9])
    bench = BlockBench(MatrixToQuaternion)
    bench.set("u", value=rotation.as_matrix())
    bench.step()
    np.testing.assert_allclose(bench.get("y").value, rotation.as_quat(), atol=1e-14)


def test_it_is_scipys_quaternion_to_euler() -> None:
    bench = BlockBench(QuaternionToEuler)
    bench.set("u", value=Rotation.from_euler("ZYX", [0.6, -0.4, 2.0]).as_quat())
    bench.step()
    np.testing.assert_allclose(bench.get("y").value, [2.0, -0.4, 0.6], atol=1e-14)


def test_yaw_is_about_z() -> None:
    bench = BlockBench(EulerToQuaternion)
    bench.set("u", value=[0.0, 0.0, 0.6])
    bench.step()
    expected = [0.0, 0.0, math.sin(0.3), math.cos(0.3)]
    np.testing.assert_allclose(bench.get("y").value, expected, atol=1e-15)


IDENTITY = [0.0, 0.0, 0.0, 1.0]
BEFORE = """
rate: 500 Hz
duration: 20 ms
blocks:
  angles: {use: blocks.Constant, with: {value: [0.2 rad, -0.1 rad, 1.0 rad]}}
  q: {use: blocks.EulerToQuaternion, in: {u: angles.y}}
  slow: {use: blocks.EulerToQuaternion, in: {u: angles.y}, rate: 100 Hz, offset: 3}
  error: {use: blocks.QuaternionProduct, with: {inverse: true}, in: {a: {from: q.y, delay: 2}, b: q.y}}
  part: {use: blocks.QuaternionProduct, in: {a: {from: q.y.value, delay: 1}, b: slow.y.value}}
  given: {use: blocks.QuaternionProduct, in: {a: {from: q.y, delay: 1, initial: {value: [1, 0, 0, 0]}}, b: slow.y}}
"""


def test_a_rotation_before_its_first_value_is_none() -> None:
    run = aloft.load(BEFORE).run()
    q = run.signal("q.y.value")[0]
    assert run.signal("slow.y.value")[:4] == pytest.approx(np.array([IDENTITY] * 3 + [q]))
    assert run.signal("error.y.value")[:3] == pytest.approx(np.array([q, q, IDENTITY]))
    assert run.signal("part.y.value")[:3] == pytest.approx(np.array([IDENTITY, q, q]))
    assert run.signal("given.y.value")[0] == pytest.approx([1.0, 0.0, 0.0, 0.0])


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 2**31), st.floats(0.0, 1.0))
def test_between_two_rotations_it_is_scipys(seed: int, share: float) -> None:
    ends = Rotation.random(2, rng=seed)
    expected = Slerp([0.0, 1.0], ends)(share)
    a, b = ends.as_quat()
    found = np.zeros(4)
    for sign in (1.0, -1.0):
        between(a, sign * b, share, found)
        assert (Rotation.from_quat(found) * expected.inv()).magnitude() < 1e-12
