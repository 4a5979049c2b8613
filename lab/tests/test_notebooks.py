"""The notebooks of the gallery: made from its page, and every cell runs."""

import json
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def script(docs_script: Callable[[str], ModuleType]) -> ModuleType:
    return docs_script("notebooks")


@pytest.fixture(scope="module")
def made(script: ModuleType, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    return {path.stem: path for path in script.write(tmp_path_factory.mktemp("notebooks"))}


def test_each_section_is_a_notebook_with_its_text_graph_and_commands(made: dict[str, Path]) -> None:
    import nbformat

    assert len(made) == PAGE.count("\n## ") == 13
    for path in made.values():
        found = nbformat.read(path, as_version=4)
        nbformat.validate(found)
        assert found.cells[0].source.startswith("# ") and "](" not in found.cells[0].source
        assert sum(cell.cell_type == "code" for cell in found.cells) >= 2
        assert not any(cell.get("outputs") for cell in found.cells)


def test_commands_become_python_where_python_shows_more(script: ModuleType) -> None:
    def source(command: str) -> str:
        return str(script.cell_of(command)["source"])

    assert source("aloft run a.yaml --set b.c=2") == (
        "result = aloft.load('a.yaml', ['b.c=2']).run()\nresult"
    )
    assert source("aloft plot recordings/a.rrd b.y c.u") == "result.plot('b.y', 'c.u')"
    assert source("aloft run graphs/jump.yaml").startswith("result = aloft.load('aloft:jump')")
    assert source("aloft run a.yaml --seeds 0:3") == "!aloft run a.yaml --seeds 0:3"
    assert script.cell_of("aloft run a.yaml --machine b # x")["cell_type"] == "markdown"


def test_a_section_without_a_file_is_told(script: ModuleType) -> None:
    with pytest.raises(ValueError, match="the section 'Mine' lacks its file"):
        list(script.examples("# Gallery\n\n## Mine\n\nno file\n"))


NAMES = (
    "mass", "cart_pole", "swing_up", "arm", "quadrotor", "hop", "ball", "mass_two", "push", "ros2", "fmu", "urdf",
    "jump",
)  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("name", NAMES)
def test_every_cell_runs(made: dict[str, Path], name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    assert set(made) == set(NAMES)
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}:{Path('/usr/bin')}:/bin")
    path = made[name]
    import nbclient
    import nbformat

    found = nbformat.from_dict(json.loads(path.read_text()))
    cells = []
    for cell in found.cells:
        cells.append(cell)
        if cell.cell_type == "code" and cell.source.startswith("!"):
            cells.append(nbformat.v4.new_code_cell("assert _exit_code == 0"))
    found.cells = cells
    nbclient.NotebookClient(
        found, timeout=500, resources={"metadata": {"path": str(path.parent)}}
    ).execute()
    shown = [output for cell in found.cells for output in cell.get("outputs", ())]
    assert any(
        output.output_type in ("execute_result", "display_data", "stream") for output in shown
    )
