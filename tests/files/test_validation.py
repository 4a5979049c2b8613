"""What pydantic refuses of a file is told once, at its place, in the words of the file."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydantic import BaseModel, ConfigDict

from aloft.files.problems import Problems
from aloft.files.validation import names_at, read_model, with_unit
from aloft.runtime.language.parameters import Parameters, parameter


class Leg(Parameters):
    length: float = parameter(..., unit="m", gt=0, text="from hip to foot")
    side: str = parameter("left", text="of the body")


class Walker(BaseModel):
    model_config = ConfigDict(extra="forbid")

    name: str
    legs: tuple[Leg, ...] = ()
    gains: dict[str, float | tuple[float, float]] = {}


def heads(tmp_path: Path, text: str, *, may_be_empty: bool = False) -> list[str]:
    path = tmp_path / "walker.yaml"
    path.write_text(text)
    problems = Problems()
    read_model(path, Walker, problems, ("a walker", "name, legs"), may_be_empty=may_be_empty)
    report = problems.report("walker.yaml")
    return [
        f"{p.where.line}:{p.where.column} {p.code}: {p.message}"
        + "".join(f"; {label} {said}" for label, said in p.lines() if label in ("expected", "fix"))
        for p in report.problems
    ]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("name: a\nlegs: [{length: 0.3}]\n", []),
        (
            "name: a\nlegs: [{length: -1}]\n",
            ["2:17 bad-value: legs[0].length cannot be -1; expected more than 0 m"],
        ),
        (
            "nane: a\n",
            [
                "1:1 unknown-key: 'nane' is not a key of a walker; expected name, legs, gains; fix name: a"
            ],
        ),
        (
            "name: a\nlegs: [{lenght: 1}]\n",
            [
                (
                    "2:9 unknown-key: 'lenght' is not a key of legs[0]; expected length, side; "
                    "fix length: 1"
                )
            ],
        ),
        (
            "name: a\nlegs: [{}]\n",
            ["2:8 missing-key: legs[0].length is missing; expected a value; fix length: ..."],
        ),
        (
            "name: a\ngains: {knee: [1, x]}\n",
            ["2:19 bad-value: gains.knee[1] cannot be x; expected a number"],
        ),
        (
            "name: [\n",
            [
                (
                    "1:8 yaml: did not find expected node content; "
                    "fix close the bracket or quote, or add the missing colon or comma"
                )
            ],
        ),
    ],
)
def test_mistakes(tmp_path: Path, text: str, expected: list[str]) -> None:
    assert heads(tmp_path, text) == expected


def test_an_empty_file(tmp_path: Path) -> None:
    assert heads(tmp_path, "# nothing\n")[0].startswith("1:1 wrong-kind: a walker is a mapping")
    assert "name is missing" in heads(tmp_path, "# nothing\n", may_be_empty=True)[0]


def test_the_legal_keys_at_a_location() -> None:
    assert names_at(Walker, ()) == ("name", "legs", "gains")
    assert names_at(Walker, ("legs", 1)) == ("length", "side")
    assert names_at(Walker, ("gains", "knee")) == ()


def test_a_unit_is_said_once() -> None:
    assert with_unit("a number", "m") == "a number in m"
    assert with_unit("more than 0 m", "m") == "more than 0 m"
    assert with_unit("a mapping", "") == "a mapping" and with_unit("", "m") == ""
