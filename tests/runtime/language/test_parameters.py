"""Parameters: bounds, unknown keys and quantities with units."""

from typing import Literal

import pytest
from pydantic import ValidationError

from aloft.hal.simulated.parameters import SimulatorParameters
from aloft.planner.task.task import JumpTask
from aloft.runtime.language.parameters import (
    Parameters,
    is_live,
    live_parameter,
    parameter,
    unit_of,
)


class Push(Parameters):
    force: float = parameter(0.0, text="size", unit="N", ge=0)
    gain: list[float] = parameter([0.03, 0.04], text="per axis", unit="m", min_length=2)
    point: str = parameter("torso", text="a name is never read as a quantity")
    duration: float = parameter(text="required", unit="s", gt=0)


def test_quantities_are_converted_to_the_declared_unit() -> None:
    push = Push(force="0.07 kN", duration="10 ms", gain=["3 cm", 0.04])
    assert (push.force, push.duration) == (pytest.approx(70.0), pytest.approx(0.01))
    assert push.gain == pytest.approx([0.03, 0.04])


def test_every_error_is_reported_at_its_place() -> None:
    with pytest.raises(ValidationError) as error:
        Push.model_validate({"force": -1, "gain": [1], "forse": 2})
    found = {(e["loc"], e["type"]) for e in error.value.errors()}
    assert found == {
        (("force",), "greater_than_equal"),
        (("gain",), "too_short"),
        (("forse",), "extra_forbidden"),
        (("duration",), "missing"),
    }


@pytest.mark.parametrize("value", ["70 m", "fast", "nan", "inf"])
def test_a_wrong_quantity_is_an_error(value: str) -> None:
    with pytest.raises(ValidationError):
        Push(force=value, duration=1)


def test_values_cannot_be_changed_and_defaults_are_not_shared() -> None:
    first, second = Push(duration=1), Push(duration=1)
    assert first.gain == second.gain and first.gain is not second.gain
    with pytest.raises(ValidationError):
        first.force = 3.0


def test_live_parameters_are_marked() -> None:
    class Tuned(Parameters):
        gain: float = live_parameter(1.0, text="a factor", unit="m")
        size: int = parameter(1, text="fixed")

    fields = Tuned.model_fields
    assert is_live(fields["gain"]) and not is_live(fields["size"])
    assert unit_of(fields["gain"]) == "m" and unit_of(fields["size"]) == ""


def test_the_schema_carries_text_and_unit() -> None:
    schema = Push.model_json_schema()["properties"]["force"]
    assert schema["description"] == "size" and schema["unit"] == "N" and schema["minimum"] == 0


class Ground(Parameters):
    friction: list[float] | None = parameter([0.5, 1.0], text="drawn from", unit="1")
    law: Literal["none", "pyramid"] | None = parameter(None, text="a word called so is the word")
    name: str | None = parameter(None, text="so is a text")
    depth: float = parameter(1.0, text="always a number")


def test_none_stands_for_null() -> None:
    ground = Ground.model_validate({"friction": "none", "law": "none", "name": "none"})
    assert (ground.friction, ground.law, ground.name) == (None, "none", "none")
    with pytest.raises(ValidationError, match="depth"):
        Ground.model_validate({"depth": "none"})


@pytest.mark.parametrize("model", (SimulatorParameters, JumpTask))
def test_the_class_of_a_group_is_the_group_with_its_defaults(model: type[Parameters]) -> None:
    def groups(model: type[Parameters]) -> list[Parameters]:
        own = [info.default for info in model.model_fields.values()]
        found = [each for each in own if isinstance(each, Parameters)]
        return found + [inner for each in found for inner in groups(type(each))]

    assert len(groups(model)) > 1
    for group in groups(model):
        assert repr(type(group)()) == repr(group)
        assert type(group)() == group and not group.model_fields_set
