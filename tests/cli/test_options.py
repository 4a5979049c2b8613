"""Groups of options: a verb takes one argument for each, and the command line has all their options."""

from dataclasses import dataclass
from inspect import signature
from typing import Annotated

import typer
from typer.testing import CliRunner

from aloft.cli.shared.options import expand_option_groups

FOUND: list[object] = []
"""What the verb was called with."""


@dataclass(frozen=True)
class Printing:
    as_json: Annotated[bool, typer.Option("--json", help="As JSON.")] = False
    width: Annotated[int, typer.Option(min=1)] = 80


@expand_option_groups
def show(
    name: Annotated[str, typer.Argument()],
    printing: Printing,
    times: Annotated[int, typer.Option()] = 1,
) -> None:
    """Show a thing."""
    FOUND.append((name, printing, times))


def call(*arguments: str) -> tuple[int, str]:
    app = typer.Typer()
    app.command()(show)
    result = CliRunner().invoke(app, arguments)
    return result.exit_code, result.output


def test_the_verb_gets_its_groups() -> None:
    FOUND.clear()
    assert call("x", "--json", "--times", "3")[0] == 0
    assert call("y", "--width", "20")[0] == 0
    assert [("x", Printing(as_json=True), 3), ("y", Printing(width=20), 1)] == FOUND


def test_options_stand_in_the_place_of_their_group() -> None:
    assert list(signature(show).parameters) == ["name", "as_json", "width", "times"]
    code, text = call("--help")
    assert code == 0 and text.index("--json") < text.index("--width") < text.index("--times")
    assert "Show a thing." in text and "As JSON." in text


def test_a_wrong_value_is_refused_as_ever() -> None:
    FOUND.clear()
    code, text = call("x", "--width", "0")
    assert code == 2 and "--width" in text and not FOUND
