"""The load report itself: its order, what it leaves out, counts, likeness and fixes."""

import pytest

from aloft.files.problems import (
    MOST_SHOWN,
    Code,
    LoadError,
    Position,
    Problem,
    Problems,
    fix_for_key,
    listing,
    nearest,
)


def at(line: int, column: int = 1) -> Position:
    return Position("graph.yaml", line, column)


def test_problems_are_sorted_by_place_and_kept_once() -> None:
    problems = Problems()
    for line, column in ((5, 1), (2, 9), (2, 3), (5, 1)):
        problems.add(Code.UNIT, "another unit", at(line, column))
    assert len(problems) == 3
    report = problems.report("graph.yaml")
    assert [(p.where.line, p.where.column) for p in report.problems] == [(2, 3), (2, 9), (5, 1)]
    assert report.headline() == "graph.yaml: 3 problems" and not report.ok
    assert Problems().report("g").headline() == "g: no problems"
    one = Problems()
    one.add(Code.UNIT, "x", at(1))
    assert one.report("g").headline() == "g: 1 problem"


def test_behind_a_syntax_error_its_place_has_no_other_problems() -> None:
    problems = Problems()
    problems.add(Code.MISSING_KEY, "no rate", at(1))
    problems.add(Code.YAML, "cannot be read", at(1))
    problems.add(Code.MISSING_KEY, "no blocks", at(2))
    codes = [problem.code for problem in problems.report("g").problems]
    assert codes == [Code.YAML, Code.MISSING_KEY]


@pytest.mark.parametrize("more", [-1, 0, 1, 7])
def test_of_many_problems_of_a_kind_the_first_are_printed(more: int) -> None:
    problems = Problems()
    for line in range(MOST_SHOWN + more):
        problems.add(Code.UNIT, "another unit", at(line + 1))
    problems.add(Code.FRAME, "another frame", at(1))
    report = problems.report("g")
    kept, lines = report.printed()
    assert len(kept) == 1 + min(MOST_SHOWN, MOST_SHOWN + more)
    assert lines == (
        [f"{more} more problems of the kind unit; --json has all of them"] if more > 0 else []
    )
    assert report.as_json()["count"] == len(report.problems) == MOST_SHOWN + more + 1
    assert report.rich().plain.rstrip() == report.text().replace("\n\n\n", "\n\n")
    assert str(LoadError(report)) == report.text()


def test_a_problem_as_text_and_plain_data() -> None:
    problem = Problem(
        Code.UNIT, "another unit", at(2, 5), at="r.m", other="s.m", other_where=at(4), expected="m",
        found="mm", nearest=("n", "o"), fix="a gain",
    )  # fmt: skip
    assert problem.text().splitlines() == [
        "graph.yaml:2:5: unit: another unit",
        "    at         r.m",
        "    other end  s.m at graph.yaml:4:1",
        "    expected   m",
        "    found      mm",
        "    nearest    n, o",
        "    fix        a gain",
    ]
    data = problem.as_json()
    assert (data["line"], data["column"], data["code"]) == (2, 5, "unit")
    assert data["other"] == {"path": "s.m", "file": "graph.yaml", "line": 4, "column": 1}
    plain = Problem(Code.UNIT, "x", at(1))
    assert plain.as_json()["other"] is None and plain.lines() == []
    assert Problem(Code.UNIT, "x", at(1), other_where=at(9)).lines() == [
        ("other end", "graph.yaml:9:1")
    ]


def test_legal_names_that_resemble_one() -> None:
    names = ["Saturation", "Gain", "gain", "Integrator", "Rain"]
    assert nearest("gian", names)[0] == "Gain"
    assert nearest("INTEGRATOR", names) == ("Integrator",)
    assert nearest("xyz", names) == ()
    assert len(nearest("ain", names, 1)) == 1


@pytest.mark.parametrize(("count", "text"), [(0, "none"), (1, "a0"), (3, "a0, a1, a2"),
                                             (4, "a0, a1, a2, ... (4 in all)")])  # fmt: skip
def test_names_in_one_line(count: int, text: str) -> None:
    assert listing((f"a{k}" for k in range(count)), limit=3) == text


def test_the_fix_of_a_misspelt_key() -> None:
    assert fix_for_key("raet", "500 Hz", at(3), "rate") == "rate: 500 Hz"
    assert fix_for_key("raet", "x" * 60, at(3), "rate") == f"rate: {'x' * 60}"
    assert fix_for_key("raet", "x" * 61, at(3), "rate") == "rate: ..."
    override = Position("blocks.a.with.raet=5", 0, 0)
    assert fix_for_key("raet", "5", override, "rate") == "blocks.a.with.rate=5"
    whole = Position("raet=5", 0, 0)
    assert fix_for_key("raet", "5", whole, "rate") == "raet=5"
