"""docs/replay.md is true: its commands print what it says."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

import aloft
from aloft.runtime.loading import LoadError
from aloft.runtime.loading.checking.parameters import adjust

from .cli.conftest import outcome

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "replay.md").read_text(encoding="utf-8")
SAMPLES = re.findall(r"^```text\n(.*?)^```", PAGE, re.MULTILINE | re.DOTALL)
Output = Callable[[str], str]


def sample(beginning: str) -> str:
    (found,) = [text for text in SAMPLES if text.startswith(beginning)]
    return found


def words(text: str) -> list[list[str]]:
    """The lines with something in them, whatever their margins."""
    return [line.split() for line in text.splitlines() if line.strip()]


@pytest.fixture(scope="module")
def output(tmp_path_factory: pytest.TempPathFactory) -> Output:
    """What a command of the page prints, in a folder with the recording of a jump."""
    folder = tmp_path_factory.mktemp("replay")
    (folder / "tests").mkdir()
    (folder / "graphs").symlink_to(ROOT / "graphs")

    def run(command: str) -> str:
        assert command in PAGE
        with pytest.MonkeyPatch.context() as patch:
            patch.chdir(folder)
            done = outcome(*command.split()[1:], columns=100)
        assert done.returncode == 0, done.stderr
        return done.stdout

    run("aloft run graphs/jump.yaml")
    return run


@pytest.mark.long
def test_a_replay_is_identical(output: Output) -> None:
    assert output("aloft replay recordings/jump.rrd --check") == sample("identical")


@pytest.mark.long
def test_another_parameter(output: Output) -> None:
    printed = output("aloft replay recordings/jump.rrd --set wbc.friction=0.6")
    (expected,) = [text for text in SAMPLES if "wbc.command" in text]
    assert words(printed)[: len(words(expected))] == words(expected)


@pytest.mark.long
def test_a_stretch_becomes_a_test(output: Output) -> None:
    printed = output("aloft test --recording recordings/jump.rrd --block landing --ticks 1200:1400")
    assert printed == sample("tests/test_landing")


def test_changes_of_parameters() -> None:
    graph = aloft.load("aloft:jump").checked
    assert f"landing.clearance {graph.block('landing').params.clearance} -> 0.8" in PAGE
    damping = graph.block("wbc").params.landing.torso_damping
    assert f"wbc.landing.torso_damping {list(damping)} -> " in PAGE


def test_a_value_that_is_refused() -> None:
    with aloft.load("aloft:jump").open() as run, pytest.raises(LoadError) as caught:
        adjust({"landing": run.block("landing")}, ["landing.clearance=-1"])
    report = sample("error: ")
    assert f"error: {caught.value}".startswith(report.rstrip("\n"))
