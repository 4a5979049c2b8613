"""``export.Outside``: outputs that somebody sets, their types, and wrong declarations."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import aloft
from aloft.extensions.export.clib.cut import cut
from aloft.extensions.export.fmi.description import _unit
from aloft.extensions.export.fmi.outside import Outside
from aloft.runtime.language.units import BASE_UNITS, parse_unit
from aloft.runtime.loading import LoadError, checked_text
from aloft.runtime.testing import BlockBench


def test_outputs_hold_what_was_set() -> None:
    ports = {
        "y": {"value": {"shape": [2], "unit": "N", "start": [1.0, 2.0]}},
        "state": {"on": {"dtype": "bool"}, "count": {"dtype": "int64", "start": 7}},
    }
    with BlockBench(Outside, {"ports": ports}) as bench:
        bench.step()
        assert bench.get("y").value.tolist() == [1.0, 2.0]
        assert (bool(bench.get("state").on), int(bench.get("state").count)) == (False, 7)
        bench.set("kept_y", value=[3.0, 4.0])
        bench.set("kept_state", on=True)
        bench.step()
        assert bench.get("y").value.tolist() == [3.0, 4.0]
        assert bool(bench.get("state").on)


@pytest.mark.parametrize(
    ("field", "message"),
    [
        ({"unit": "furlong"}, "unknown symbol 'furlong'"),
        ({"dtype": "float16"}, "the dtype of y.value is not one of"),
        ({"size": 3}, "y.value has no 'size'"),
    ],
)
def test_wrong_fields_are_reported(field: dict[str, Any], message: str) -> None:
    text = f"rate: 100 Hz\nblocks:\n  a: {{use: export.Outside, with: {{ports: {{y: {{value: {field}}}}}}}}}\n"
    with pytest.raises(LoadError, match=message):
        checked_text(text, "graph.yaml")


def test_degrees_celsius_of_an_fmu_are_no_kelvin() -> None:
    powers = dict.fromkeys(BASE_UNITS, 0) | {"K": 1}
    celsius = _unit("degC", SimpleNamespace(factor=1.0, offset=273.15, **powers))
    kelvin = _unit("K", SimpleNamespace(factor=1.0, offset=0.0, **powers))
    assert celsius is not None and kelvin is not None
    assert kelvin.matches(parse_unit("K")) and not celsius.matches(kelvin)


def test_quaternions_from_outside_stay_quaternions(tmp_path: Path) -> None:
    (tmp_path / "part.yaml").write_text(
        "inputs: {turn: }\noutputs: {late: d.y}\n"
        "blocks:\n  d: {use: blocks.Delay, with: {samples: 2}, in: {u: inputs.turn}}\n"
    )
    (tmp_path / "graph.yaml").write_text(
        "rate: 100 Hz\nblocks:\n"
        "  angles: {use: blocks.Constant, with: {value: [0.2 rad, 0.1 rad, 1 rad]}}\n"
        "  q: {use: blocks.EulerToQuaternion, in: {u: angles.y}}\n"
        "  part: {use: part.yaml, in: {turn: q.y}}\n"
    )
    alone = aloft.load(cut(str(tmp_path / "graph.yaml"), "part").text)
    late = alone.run(duration=0.03).signal("part/d.y.value")
    assert late.tolist() == [[0.0, 0.0, 0.0, 1.0]] * 3
