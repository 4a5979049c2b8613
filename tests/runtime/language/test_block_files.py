"""Blocks are found in source files by what is written there."""

from pathlib import Path

from aloft.runtime.language.block_files import blocks_in_folder, blocks_in_packages, classes_in

SOURCE = '''
"""class Fake(Block): in a text is no class."""
from abc import abstractmethod
import aloft

class Base(aloft.Block):
    y = Output(Number)

class Whole(Base):
    def step(self): ...

class _Hidden(Whole): ...

class Late(
    Other["Number"],
    Generic[T],
):
    """Derives from a class of another file."""

class Unfinished(Base):
    @abstractmethod
    def emit(self): ...

class Common(Whole, ABC):
    """There is nothing to fill in, but it says that it is a base."""

class NoPort(aloft.Block):
    def step(self): ...

class Calls(KernelBlock):
    """Its step is the framework's."""
    y = Output(Number)

class Unrelated:
    y: "Output" = Output(Number)
    def step(self): ...
'''
OTHER = "class Other(Whole, Generic[T]):\n    u: Input[Number] = Input(Number)\n"


def test_classes(tmp_path: Path) -> None:
    (tmp_path / "a.py").write_text(SOURCE)
    found = {written.name: written for written in classes_in(tmp_path / "a.py")}
    assert list(found)[:2] == ["Base", "Whole"]
    assert found["Base"].has_ports and not found["Base"].has_machine
    assert found["Whole"].bases == ("Base",) and found["Whole"].has_machine
    assert found["Late"].bases == ("Other", "Generic")
    assert found["Common"].is_abstract and not found["Whole"].is_abstract
    assert found["Unfinished"].is_abstract and found["Unrelated"].has_ports


def test_a_file_that_is_no_python_has_none(tmp_path: Path) -> None:
    (tmp_path / "broken.py").write_text("class Broken(Block:\n")
    (tmp_path / "latin.py").write_bytes(b"class Gr\xf6sse(Block):\n    pass\n")
    assert classes_in(tmp_path / "broken.py") == ()
    assert classes_in(tmp_path / "latin.py") == ()
    assert classes_in(tmp_path / "missing.py") == ()


def test_blocks_of_packages(tmp_path: Path) -> None:
    for package, name, text in (("one", "a", SOURCE), ("two", "b", OTHER)):
        (tmp_path / package / "inner").mkdir(parents=True)
        (tmp_path / package / "inner" / f"{name}.py").write_text(text)
    found = blocks_in_packages({name: tmp_path / name for name in ("one", "two")})
    assert list(found) == ["one.Calls", "one.Late", "one.Whole", "two.Other"]
    assert found["two.Other"] == tmp_path / "two" / "inner" / "b.py"


def test_blocks_of_a_folder(tmp_path: Path) -> None:
    (tmp_path / "mine").mkdir()
    (tmp_path / ".venv").mkdir()
    for file in ("top.py", "mine/__init__.py", "mine/deep.py", ".venv/hidden.py"):
        (tmp_path / file).write_text("class Part(Block): ...\n")
    assert list(blocks_in_folder(tmp_path)) == ["top:Part", "mine:Part", "mine.deep:Part"]
