"""``aloft steer`` takes commands from a file, and says what is wrong with one."""

from pathlib import Path

import pytest

from .conftest import run_for_json, run_here


@pytest.mark.long
def test_commands_of_a_file_are_followed(tmp_path: Path) -> None:
    file = tmp_path / "course.yaml"
    file.write_text("- {ahead: 10 cm, turn: 15 deg}\n")
    done = run_for_json("steer", "--commands", str(file), "--no-record")
    assert done["metrics"]["jumps"] == 1
    assert done["metrics"]["worst_place_error_m"] < 0.03


def test_what_is_no_list_of_commands_is_refused(tmp_path: Path) -> None:
    def reason(text: str | None) -> str:
        file = tmp_path / "course.yaml"
        file.unlink(missing_ok=True)
        if text is not None:
            file.write_text(text)
        return run_here("steer", "--commands", str(file), "--no-record", code=2).stderr

    assert "cannot read" in reason(None)
    assert "has no list of commands" in reason("ahead: 10 cm")
    assert "is no YAML" in reason("[{ahead: 1")
    wrong = reason("[{ahed: 10 cm}]")
    assert "ahed" in wrong and "ahead" in wrong
    assert "500 m" in reason("[{ahead: 500 m}]")


@pytest.mark.long
def test_without_a_terminal_it_asks_for_a_file() -> None:
    shown = run_here("steer", "--no-record", code=3).stderr
    assert "standard input is no terminal" in shown
    assert "--commands FILE" in shown
