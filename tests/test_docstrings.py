"""Docstrings name quantities or begin with verbs, and document only arguments that there are."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest

SCRIPT = Path(__file__).parent.parent / "lab" / "count_docstrings.py"
TEXT = '''
"""What a module is about."""

class Motor:
    """The drive of a joint.

    Args:
        gain, offset: of the current.
        wish: a name that went.
    """

    peak: float = 1.0
    """By how much it turns.

    And more.
    """
    low = 0.0
    """Least torque [N m]: what is below counts as zero."""

    def __init__(self, gain: float, offset: float) -> None: ...

    def turn(self, *angles: float, **more: float) -> None:
        """Turn, whatever comes.

        Args:
            *angles: in order [rad]; what follows
                more: is no name here.
            **more: (kept).

        Raises:
            lost: no argument, and no matter.
        """

class Made(Motor):
    """A motor.

    Args:
        anything: of the base, which is not looked at.
    """
'''


def script() -> ModuleType:
    spec = importlib.util.spec_from_file_location("script_count_docstrings", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module  # named tuples look their module up
    spec.loader.exec_module(module)
    return module


COUNT = script()
MOST_RELATIVE = 50


def test_what_is_counted() -> None:
    found = COUNT.docstrings("motor.py", TEXT)
    relative = [each for each in found if COUNT.is_relative(each.text)]
    assert [each.is_one_line for each in relative] == [True, False]
    assert [COUNT.first_line(each.text) for each in relative] == [
        "What a module is about.",
        "By how much it turns.",
    ]
    assert COUNT.stale_arguments(found) == ["motor.py:5: Args names 'wish', which is no argument"]


@pytest.mark.parametrize(
    "text",
    [
        "How far it turns [rad].", "Whether it turns.", "From which tick on it turns.", "To whom it goes.",
        "By axis, the torque.", "That it turns.", "The thing that turns.", "Those of the base.",
    ],
)  # fmt: skip
def test_a_relative_clause(text: str) -> None:
    assert COUNT.is_relative(text)


@pytest.mark.parametrize(
    "text",
    ["Angle from the base [rad].", "Tell whether it turns.", "The robot that turns.", "To do."],
)
def test_no_relative_clause(text: str) -> None:
    assert not COUNT.is_relative(text)


@pytest.fixture(scope="module")
def everything() -> list[object]:
    return [each for path, text in COUNT.tracked().items() for each in COUNT.docstrings(path, text)]


def test_few_docstrings_begin_with_a_relative_clause(everything: list[object]) -> None:
    relative = [each for each in everything if COUNT.is_relative(each.text)]
    assert len(everything) > 5000  # all files were read
    assert len(relative) <= MOST_RELATIVE, "\n".join(
        f"{each.place}: {COUNT.first_line(each.text)}" for each in relative
    )


def test_args_name_arguments(everything: list[object]) -> None:
    assert COUNT.stale_arguments(everything) == []
