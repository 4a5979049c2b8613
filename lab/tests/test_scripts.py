"""The scripts that weigh the package and change its operators, on small texts whose answer is known."""

import ast
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]


def script(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(f"script_{name}", ROOT / "lab" / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


MUTATE, WEIGH = script("mutate"), script("weigh")
FUNCTION = '''
def law(x: int | None, gain: float = -2.0) -> float:
    """Minus a * b < c."""
    if x is None and gain < 0:
        raise ValueError("a" + str(1 + 1))
    assert x is not None and x > 4
    y: list[float] = x[1:, -1]
    text = f"{1 + 2}" + "a"
    return max(
        y[0]  # a comment + another
        + gain / 3.0,
        0.0,
    )
'''


def test_what_can_be_changed_in_a_function() -> None:
    (function,) = MUTATE.outer_functions(ast.parse(FUNCTION))
    found = {(each.before, each.after) for each in MUTATE.changes_of(function, "law.py", FUNCTION)}
    assert found == {
        ("-", "+"), ("2.0", "-2.0"), ("is", "is not"), ("and", "or"), ("<", "<="), ("<", ">="),
        ("1", "2"), ("0", "1"), ("max", "min"), ("+", "-"), ("/", "*"), ("3.0", "-3.0"),
    }  # fmt: skip


def test_a_change_is_one_token_and_the_file_can_still_be_read() -> None:
    (function,) = MUTATE.outer_functions(ast.parse(FUNCTION))
    for change in MUTATE.changes_of(function, "law.py", FUNCTION):
        changed = change.applied(FUNCTION)
        ast.parse(changed)
        before, after = FUNCTION.splitlines(), changed.splitlines()
        different = [i for i, (a, b) in enumerate(zip(before, after, strict=True), 1) if a != b]
        assert different == [change.line]


def test_a_change_of_a_file_that_has_become_another_is_refused() -> None:
    change = MUTATE.Change("law.py", "law", 2, 0, "+", "-")
    assert change.applied(FUNCTION) is None


def test_the_same_seed_draws_the_same_changes() -> None:
    folder = "blocks/general"
    first, second = (MUTATE.draw([folder], 10, MUTATE.random.Random(3)) for _ in range(2))
    assert first == second and len(first) == 10
    assert first != MUTATE.draw([folder], 10, MUTATE.random.Random(4))
    for change in first:
        ast.parse(change.applied((ROOT / change.file).read_text("utf-8")))


SOURCES = {
    "a/one.py": """
from ..b.two import Told

class Memory(Signal):
    speed = Field("m/s")
    place = Field("m")

class Memory2(NamedTuple):
    speed: Array
    place: Array

class Other(NamedTuple):
    speed: Array
    weight: Array

@kernel
def step(x, y, z):
    x[0] = float(y[0]) + float(z[0])

def free(x):
    return float(x)
""",
    "b/two.py": "class Told:\n    pass\n\n\nclass Other(NamedTuple):\n    x: Array\n" + "\n" * 60,
    "tests/test_one.py": "class Told:\n    pass\n",
}


def test_what_the_package_weighs() -> None:
    total = WEIGH.weigh(WEIGH.parse(SOURCES))["total"]
    assert total.counts["files"] == 2
    assert total.counts["lines"] == sum(
        len(text.splitlines()) for name, text in SOURCES.items() if name[0] != "t"
    )
    assert total.places["short"] == ["a/one.py"]
    assert total.places["imported once"] == ["b/two.py"]
    assert total.counts["named tuples"] == 3
    assert [place.split()[-1] for place in total.places["restating"]] == ["Memory2"]
    assert total.counts["float()"] == 2
    assert [place.split()[-1] for place in total.places["vague classes"]] == ["Told"]
    assert [place.split(":")[0] for place in total.places["shared names"]] == ["Other"]
    assert WEIGH.widest({"total": total})[0] == (3, "a/one.py:17 step")


@pytest.mark.parametrize(("folder", "row"), [("lab/a", "lab"), ("extensions/x/a", "extensions/x")])
def test_what_is_beside_the_core_weighs_for_itself(folder: str, row: str) -> None:
    text = "from ..b.two import Told\n\n\nclass Told(NamedTuple):\n    x: int\n"
    beside = {f"{folder}/one.py": text, f"{folder}/tests/test_one.py": text}
    weights, core = WEIGH.weigh(WEIGH.parse(SOURCES | beside)), WEIGH.weigh(WEIGH.parse(SOURCES))
    assert weights.pop(row).counts["lines"] == 5
    assert weights.pop("all").counts["lines"] == core.pop("all").counts["lines"] + 5
    assert weights == core
