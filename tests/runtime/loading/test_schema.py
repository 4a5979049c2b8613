"""The JSON Schema for editors: it takes what loads, and refuses what an editor should mark."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft7Validator

from aloft.files.document import read_file, read_value
from aloft.files.nodes import plain
from aloft.files.problems import Problems
from aloft.runtime.loading.schema import graph_schema, schema_text

ROOT = Path(__file__).parents[3]
NO_GRAPHS = {ROOT / "graphs" / name for name in ("tasks", "studies", "hardware")}
SHIPPED = sorted(p for p in (ROOT / "graphs").rglob("*.yaml") if p.parent not in NO_GRAPHS)


@pytest.fixture(scope="module")
def validator() -> Draft7Validator:
    schema = graph_schema()
    Draft7Validator.check_schema(schema)
    return Draft7Validator(schema)


def errors(validator: Draft7Validator, text: str) -> list[str]:
    data: Any = plain(read_value(text, "f", Problems()))  # type: ignore[arg-type]
    return sorted("/".join(map(str, e.absolute_path)) for e in validator.iter_errors(data))


@pytest.mark.parametrize("path", SHIPPED, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_shipped_graphs_are_valid(validator: Draft7Validator, path: Path) -> None:
    problems = Problems()
    tree = read_file(path, str(path), problems)
    assert tree is not None
    assert [e.message for e in validator.iter_errors(plain(tree))] == []


PAGES = sorted([*(ROOT / "docs").rglob("*.md"), ROOT / "README.md"])


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.relative_to(ROOT).as_posix())
def test_the_graphs_on_the_pages_are_valid(validator: Draft7Validator, page: Path) -> None:
    for text in re.findall(r"```yaml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        tree = read_value(text, "f", Problems())
        data: Any = None if tree is None else plain(tree)
        if isinstance(data, dict) and {"blocks", "wires"} & set(data):
            assert [e.message for e in validator.iter_errors(data)] == []


GOOD = """
rate: 500 Hz
duration: 4 s
_x: 3
clock: {kind: paced}
include: a.yaml
blocks:
  _t: {}
  wave: {use: blocks.SineWave, with: {frequency: 2 Hz, n: 3, phase: $phase}, rate: 250 Hz}
  gain: {use: blocks.Gain, with: {n: 3}, in: {u: {from: wave.y, delay: 1, initial: {value: 0}}}}
  mine: {use: my_module:Block, with: {anything: 1}, in: {whatever: left/leg.y}}
  leg: {use: leg.yaml, in: {x: inputs.x}}
  sum: {use: blocks.Sum, in: {a: {value: {value: 1.0}}}}
wires: {gain.u: wave.y}
set: {gain.gain: 3}
"""


def test_a_good_graph(validator: Draft7Validator) -> None:
    assert errors(validator, GOOD) == []


@pytest.mark.parametrize(
    ("text", "places"),
    [
        ("raet: 3", [""]),
        ("rate: -3", ["rate"]),
        ("clock: {kind: fast}", ["clock/kind"]),
        ("blocks: {a: {}}", ["blocks/a"]),
        ("blocks: {a: {use: blocks.Gian}}", ["blocks/a/use"]),
        ("blocks: {a: {use: blocks.Gain, with: {gian: 3}}}", ["blocks/a/with"]),
        ("blocks: {a: {use: blocks.Gain, with: {n: 0}}}", ["blocks/a/with/n"]),
        ("blocks: {a: {use: blocks.Gain, in: {v: b.y}}}", ["blocks/a/in"]),
        ("blocks: {a: {use: blocks.Gain, in: {u: by}}}", ["blocks/a/in/u"]),
        ("blocks: {a: {use: blocks.Gain, in: {u: {from: b.y, delay: 0}}}}", ["blocks/a/in/u"]),
        ("set: {gain: 3}", ["set"]),
    ],
)
def test_wrong_graphs(validator: Draft7Validator, text: str, places: list[str]) -> None:
    assert sorted(dict.fromkeys(errors(validator, text))) == places


def test_every_block_is_described(validator: Draft7Validator) -> None:
    schema = json.loads(schema_text())
    gain = schema["definitions"]["blocks.Gain"]
    assert gain["description"] == "The input times a constant: y = gain u."
    assert gain["properties"]["with"]["properties"]["gain"]["description"] == "the factor"
    assert (
        gain["properties"]["in"]["properties"]["u"]["description"] == "Vector: the vector to scale"
    )
    frequency = schema["definitions"]["blocks.SineWave"]["properties"]["with"]["properties"]
    assert frequency["frequency"]["description"] == "oscillations per second [Hz]"


@pytest.mark.parametrize(
    ("gain", "good"),
    [
        ("40", True),
        ('{"*": 40, "*_knee": 60 N m/rad}', True),
        ("40 N m/rad", True),
        ("[40, 40, 40, 40, 40]", False),
    ],
)
def test_values_per_joint_are_numbers_or_mappings_and_no_lists(
    validator: Draft7Validator, gain: str, good: bool
) -> None:
    text = f"rate: 500\nblocks:\n  pd: {{use: blocks.JointPD, with: {{flight_stiffness: {gain}}}}}"
    assert (errors(validator, text) == []) is good
