"""Finding blocks by name, importing only what is used, and saying what is nearest."""

import sys
from collections.abc import Iterator
from importlib import metadata
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

import aloft
from aloft.blocks.general.arithmetic import Gain
from aloft.runtime.language import registry
from aloft.runtime.language.block import Block
from aloft.runtime.language.block_files import classes_in, files_of
from aloft.runtime.language.errors import AloftError, UnknownBlockError
from aloft.runtime.language.importing import BlockImportError, UnknownModuleError
from aloft.runtime.language.registry import (
    PACKAGES,
    all_blocks,
    block_name,
    find_block,
    known_names,
    nearest_names,
    snake_case,
)

BLOCK = """
from aloft.runtime.language.block import Block, Output
from aloft.blocks.general.vectors import Vector
class Mine(Block):
    y = Output(Vector)
    mark = "{mark}"
    def step(self): pass
"""


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("LandingHeuristic", "landing_heuristic"),
        ("JointPD", "joint_pd"),
        ("SineWave", "sine_wave"),
        ("Gain", "gain"),
        ("WBCTask2D", "wbc_task2_d"),
        ("IMUFilter", "imu_filter"),
    ],
)
def test_snake_case(name: str, file: str) -> None:
    assert snake_case(name) == file


def test_a_block_in_a_file_of_its_own_and_one_among_others() -> None:
    assert find_block("blocks.Gain") is Gain
    assert find_block("blocks.ContactDetector").__name__ == "ContactDetector"


@pytest.fixture
def nothing_found_yet() -> Iterator[None]:
    registry._own_module.cache_clear()
    yield
    registry._own_module.cache_clear()


def test_it_is_found_without_parsing_any_file(
    monkeypatch: pytest.MonkeyPatch, nothing_found_yet: None
) -> None:
    monkeypatch.setattr(registry, "_own_blocks", lambda: pytest.fail("all files are parsed"))
    assert find_block("blocks.Gain") is Gain


def test_what_a_search_finds_is_what_parsing_finds(nothing_found_yet: None) -> None:
    classes = {
        f"{package}.{written.name}"
        for package in PACKAGES
        for path in files_of(Path(aloft.__file__).parent / package)
        for written in classes_in(path)
    }
    found = {name for name in classes if is_there(name)}
    assert found == {name for name in known_names() if name in classes}
    assert {"blocks.LinearFilter", "blocks.LinearSystem", "hal.Robot"} <= classes - found


def is_there(name: str) -> bool:
    try:
        return bool(find_block(name))
    except AloftError:
        return False


def test_names_and_blocks_agree() -> None:
    blocks = all_blocks()
    assert tuple(blocks) == known_names()
    assert "blocks.Gain" in blocks
    for name, block_type in blocks.items():
        assert issubclass(block_type, Block)
        assert block_name(block_type) == name
        follows = (
            block_type.specialize.__func__ is not Block.specialize.__func__
        )  # from its parameters
        assert follows or block_type.inputs or block_type.outputs


def test_listing_names_imports_no_block(monkeypatch: pytest.MonkeyPatch) -> None:
    registry._own_blocks.cache_clear()
    monkeypatch.setattr(registry, "import_module", lambda name: pytest.fail(f"imported {name}"))
    assert "blocks.JointPD" in known_names()


def test_an_unknown_block() -> None:
    with pytest.raises(UnknownBlockError, match=r"there is no block called 'blocks\.Gian'"):
        find_block("blocks.Gian")
    assert nearest_names("blocks.Gian") == ("blocks.Gain",)
    assert nearest_names("Gain")[0] == "blocks.Gain"
    assert nearest_names("blocks.Gain")[0] == "blocks.Gain"
    assert nearest_names("xyzzy.Qwrtp") == ()


def test_a_users_own_file_beside_the_graph(tmp_path: Path) -> None:
    (tmp_path / "my_first_part.py").write_text(BLOCK.format(mark="first"))
    found = find_block("my_first_part:Mine", tmp_path)
    assert found.mark == "first"  # type: ignore[attr-defined]
    assert find_block("my_first_part:Mine", tmp_path) is found
    assert block_name(found) == "my_first_part:Mine"
    assert nearest_names("my_first_part:Mime", tmp_path) == ("my_first_part:Mine",)


def test_a_package_beside_the_graph(tmp_path: Path) -> None:
    package = tmp_path / "my_package" / "inner"
    package.mkdir(parents=True)
    (tmp_path / "my_package" / "__init__.py").touch()
    (package / "__init__.py").touch()
    (package / "module.py").write_text(BLOCK.format(mark="deep"))
    assert find_block("my_package.inner.module:Mine", tmp_path).mark == "deep"  # type: ignore[attr-defined]


def test_two_graphs_with_modules_of_the_same_name(tmp_path: Path) -> None:
    marks = []
    for name in ("here", "there"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "my_twin_part.py").write_text(BLOCK.format(mark=name))
        marks.append(find_block("my_twin_part:Mine", tmp_path / name).mark)  # type: ignore[attr-defined]
    assert marks == ["here", "there"]
    for name in ("here", "there"):  # errors name the module as the graph does
        with pytest.raises(UnknownBlockError, match=r"^module 'my_twin_part' has no class 'Mime'"):
            find_block("my_twin_part:Mime", tmp_path / name)


def test_a_module_of_another_graph_is_not_run_for_one_of_the_same_name(tmp_path: Path) -> None:
    (tmp_path / "good").mkdir()
    (tmp_path / "bad").mkdir()
    (tmp_path / "good" / "my_third_part.py").write_text(BLOCK.format(mark="good"))
    (tmp_path / "bad" / "my_third_part.py").write_text("raise ValueError('I ran')")
    with pytest.raises(BlockImportError):
        find_block("my_third_part:Mine", tmp_path / "bad")
    assert find_block("my_third_part:Mine", tmp_path / "good").mark == "good"  # type: ignore[attr-defined]


def test_a_file_beside_the_graph_hides_no_package_from_others(tmp_path: Path) -> None:
    (tmp_path / "json.py").write_text(BLOCK.format(mark="mine"))
    assert find_block("json:Mine", tmp_path).mark == "mine"  # type: ignore[attr-defined]
    assert hasattr(sys.modules["json"], "dumps")


@pytest.mark.parametrize(
    ("text", "message", "where"),
    [
        ("raise ValueError('no licence')", "ValueError: no licence", "broken.py:1"),
        ("import sys\nsys.exit(3)", "SystemExit: 3", "broken.py:2"),
        ("import not_installed_at_all", "ModuleNotFoundError: No module named", "broken.py:1"),
        ("class Mine(:", "SyntaxError: invalid syntax", "broken.py:1:12"),
        ("class Mine: pass", "broken:Mine is not a block", ""),
        ("Mine = 3", "broken:Mine is not a block", ""),
        (
            "from aloft.runtime.language.block import Block\nclass Mine(Block): pass",
            "Mine must define either step(), or emit() and update(); it defines none",
            "",
        ),
        (
            "from aloft.runtime.language.block import Block, Output\nclass Mine(Block):\n    y = Output(int)",
            "DeclarationError: a port carries a Signal type, not <class 'int'>",
            "ports.py:",
        ),
        (
            "import abc\nfrom aloft.runtime.language.block import Block\nclass Mine(Block, abc.ABC):\n"
            + "    @abc.abstractmethod\n    def step(self): ...",
            "broken:Mine is abstract",
            "",
        ),
    ],
)
def test_what_cannot_be_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, message: str, where: str
) -> None:
    (tmp_path / "broken.py").write_text(text)
    monkeypatch.delitem(sys.modules, "broken", raising=False)
    with pytest.raises(BlockImportError) as caught:
        find_block("broken:Mine", tmp_path)
    monkeypatch.delitem(sys.modules, "broken", raising=False)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
    assert where in caught.value.where


@pytest.mark.parametrize(
    "name", ["a b:C", ":C", "a:", "..x:C", "no_such_module:C", "json:NoSuchClass", "nodots", ""]
)
def test_what_is_not_there(name: str) -> None:
    with pytest.raises(UnknownBlockError):
        find_block(name)


def test_blocks_of_other_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    point = EntryPoint("theirs.Gain", "aloft.blocks.general.arithmetic:Gain", "aloft.blocks")
    monkeypatch.setattr(metadata, "entry_points", lambda group: [point])
    registry._entry_points.cache_clear()
    try:
        assert find_block("theirs.Gain") is Gain
        assert "theirs.Gain" in known_names()
        assert nearest_names("theirs.Gan")[0] == "theirs.Gain"
    finally:
        registry._entry_points.cache_clear()


def test_a_module_in_the_current_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From a project's root, a graph in a folder of its own may name the project's packages."""
    (tmp_path / "graphs").mkdir()
    (tmp_path / "my_cart").mkdir()
    (tmp_path / "my_cart" / "plant.py").write_text(BLOCK.format(mark="current"))
    with pytest.raises(UnknownModuleError):
        find_block("my_cart.plant:Mine", tmp_path / "graphs")
    monkeypatch.chdir(tmp_path)
    assert find_block("my_cart.plant:Mine", tmp_path / "graphs").mark == "current"  # type: ignore[attr-defined]


def test_a_file_beside_the_graph_wins_over_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "graphs").mkdir()
    (tmp_path / "my_fourth_part.py").write_text(BLOCK.format(mark="current"))
    (tmp_path / "graphs" / "my_fourth_part.py").write_text(BLOCK.format(mark="beside"))
    monkeypatch.chdir(tmp_path)
    assert find_block("my_fourth_part:Mine", tmp_path / "graphs").mark == "beside"  # type: ignore[attr-defined]


def test_what_is_proposed_for_a_block_of_ones_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert nearest_names("cartpole.plant:Plant", tmp_path) == ()  # not blocks.JumpPlan
    assert nearest_names("parts:JointPd", tmp_path) == ("blocks.JointPD",)
    (tmp_path / "cart").mkdir()
    (tmp_path / "cart" / "plant.py").write_text(BLOCK.replace("Mine", "Plant"))
    (tmp_path / "cart" / "broken.py").write_text("class Plant(Block:")
    assert nearest_names("cartpole.plant:Plant", tmp_path) == ("cart.plant:Plant",)
    assert nearest_names("Plant", tmp_path) == ("cart.plant:Plant",)
