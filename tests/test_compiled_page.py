"""The page on compiled blocks: its files do what it says, and its errors are those that come."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import aloft

PAGE = Path(__file__).parents[1] / "docs" / "compiled.md"
TEXT = PAGE.read_text(encoding="utf-8")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """The files of the page."""
    files = re.findall(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```", TEXT, re.DOTALL)
    assert [name for name, _ in files] == ["my_pid.py", "pid.yaml", "test_my_pid.py"]
    for name, content in files:
        (tmp_path / name).write_text(content, encoding="utf-8")
    return tmp_path


def shell(folder: Path, *words: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", *words],
        cwd=folder,
        check=False,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.mark.long
def test_the_commands_of_the_page_run(folder: Path) -> None:
    (commands,) = re.findall(r"```sh\n(aloft run pid.yaml.*?)```", TEXT, re.DOTALL)
    for line in commands.splitlines():
        words = line.partition("#")[0].split()
        shell(folder, *words, *(["-q"] if words[0] == "pytest" else []))


def test_the_controller_is_fused_and_gives_the_same_bytes_in_python(folder: Path) -> None:
    graph = aloft.load(folder / "pid.yaml")
    fused, plain = graph.run(), graph.run(plain=True)
    assert fused.success and fused.run_hash == plain.run_hash
    assert set(fused.blocks) == {"wave", "pid"}


@pytest.mark.long
@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("step(e: Error, u: Torque", "step(e: Error, u: Error", "write u: Torque"),
        ("step(e: Error, ", "step(w, e: Error, ", "which is no port or state of it; there is e"),
        (
            "x.before[:] = e.value\n",
            "x.before[:] = x.before[::-1]\n",
            "is written while another part of it is read",
        ),
        ("x.before[:] = e.value\n", "x.before[:] = e.values\n", "Error has no field 'values'; it"),
    ],
)
def test_mistakes_are_refused_with_the_errors_of_the_page(
    folder: Path, old: str, new: str, text: str
) -> None:
    file = folder / "my_pid.py"
    code = file.read_text(encoding="utf-8")
    assert code.count(old) == 1
    file.write_text(code.replace(old, new), encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-m", "aloft", "run", "pid.yaml"],
        cwd=folder, check=False, capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert done.returncode != 0
    said = re.sub(r"\s+", " ", done.stdout + done.stderr)
    assert text in said, said
