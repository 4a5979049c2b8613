"""Signals: declaration, resolution of dimensions, binding."""

import numpy as np
import pytest

from aloft.runtime.language.errors import DeclarationError
from aloft.runtime.language.signals import Field, Signal


class Pose(Signal):
    """A pose."""

    position = Field(3, unit="m", frame="world", text="where")
    angles = Field("n_joints", unit="rad", text="joint angles")
    count = Field(dtype="int64", text="how many")


class LongPose(Pose):
    """A pose with more."""

    jacobian = Field(("n_feet", 3, "n_joints"), text="mixed units")


def test_fields_keep_the_order_of_declaration_through_inheritance() -> None:
    assert list(LongPose.fields) == ["position", "angles", "count", "jacobian"]
    assert list(Pose.fields) == ["position", "angles", "count"]


def test_dimensions_are_resolved_by_name() -> None:
    assert LongPose.fields["jacobian"].resolve({"n_feet": 2, "n_joints": 10}) == (2, 3, 10)
    with pytest.raises(KeyError, match="n_joints"):
        Pose.fields["angles"].resolve({})


def test_allocate_zeroes_with_the_declared_types() -> None:
    pose = Pose.allocate({"n_joints": 4})
    assert pose.angles.shape == (4,) and not pose.angles.any()
    assert pose.count.shape == () and pose.count.dtype == np.int64


def test_bind_copies_nothing() -> None:
    memory = np.zeros(3)
    pose = Pose.bind({"position": memory, "angles": np.zeros(1), "count": np.zeros((), np.int64)})
    pose.position[1] = 5.0
    assert memory.tolist() == [0.0, 5.0, 0.0]
    assert pose.position is memory


def test_a_field_is_written_into_and_never_replaced() -> None:
    pose = Pose.allocate({"n_joints": 2})
    view = pose.count
    pose.position += 1.0
    pose.count += 2
    assert pose.position.tolist() == [1.0, 1.0, 1.0] and pose.count is view and int(view) == 2
    with pytest.raises(
        AttributeError,
        match=r"Pose\.angles cannot be assigned: .* write into it, as in \.angles\[\.\.\.\] = value",
    ):
        pose.angles = np.ones(2)  # type: ignore[assignment]
    with pytest.raises(AttributeError, match="Pose has no field 'angels'; it has position, angles"):
        pose.angels = 1.0  # type: ignore[attr-defined]
    assert pose.angles.tolist() == [0.0, 0.0]


def test_unbound_field_says_so() -> None:
    with pytest.raises(AttributeError, match=r"Pose\.position is not bound to memory"):
        _ = Pose().position


def test_describe() -> None:
    assert Pose.fields["position"].describe() == "float64[3] m in world"
    assert Pose.fields["count"].describe() == "int64"
    assert LongPose.fields["jacobian"].describe() == "float64[n_feet, 3, n_joints]"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"dtype": "float32"}, "dtype 'float32' is not one of float64, int64, bool"),
        ({"shape": (3, 0)}, r"shape \(3, 0\) has a size below 1"),
    ],
)
def test_wrong_declarations(arguments: dict[str, object], message: str) -> None:
    with pytest.raises(DeclarationError, match=message):
        Field(**arguments)  # type: ignore[arg-type]
