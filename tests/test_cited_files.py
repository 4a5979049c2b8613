"""Files that comments, docstrings and pages cite are there, as far as a citation can be told apart.

What a command writes and what a user would write is cited, too, and is not there. So a path with
folders must exist where its first folder is one of the repository's, and a bare name in code where
it is that of a module or of a page.
"""

import ast
import io
import re
import tokenize
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

import aloft

ROOT = Path(aloft.__file__).parent
OUTPUT = {"build", "dist", "recordings", "results"}
"""Folders that commands write."""
EXAMPLES = {
    "tests/test_landing_1200_1400.py",
    "tests/test_landing_1200_1400.npz",
    "tasks/hop.yaml",
}
"""What ``aloft test --from`` writes in an example of docs/replay.md, and a task of a user's own."""
ENDINGS = "py|pyi|md|ya?ml|toml|json|txt|csv|svg|png|xml|urdf|npz"
PATH = re.compile(rf"(?<![\w./$~{{<>*:-])(?:[\w-]+/)*[\w-]+\.(?:{ENDINGS})(?![\w/*{{-])")
TEST = re.compile(r"\b([\w/]*test_\w+\.py)::(\w+)")


@cache
def there() -> frozenset[str]:
    """Every file of the repository, and every ending of its path that begins at a folder."""
    found = set()
    for top in ROOT.iterdir():
        if top.name.startswith(".") or top.name in OUTPUT:
            continue
        for file in [top, *top.rglob("*")]:
            parts = file.relative_to(ROOT).parts
            found |= {"/".join(parts[k:]) for k in range(len(parts))}
    return frozenset(found)


@cache
def folders() -> frozenset[str]:
    """The names of folders of which a path in a citation may begin with one."""
    return frozenset(name.split("/")[0] for name in there() if "/" in name)


def words_of(source: str) -> Iterator[str]:
    """The comments and docstrings of Python code, also those below attributes."""
    for token in tokenize.generate_tokens(io.StringIO(source).readline):
        if token.type == tokenize.COMMENT:
            yield token.string
    for node in ast.walk(ast.parse(source)):
        match node:
            case ast.Expr(value=ast.Constant(value=str(text))):
                yield text


def all_pages() -> list[Path]:
    """The pages of the core, the extensions and the lab."""
    folders = ("docs", "extensions", "lab")
    return [
        *ROOT.glob("*.md"),
        *(p for name in folders for p in sorted((ROOT / name).rglob("*.md"))),
    ]


def missing_in_code(source: str) -> list[str]:
    """The files that the comments and docstrings of Python code cite and that are not there."""
    if not missing(iter([source]), code=True):
        return []  # which is quicker than to parse all code
    return missing(words_of(source), code=True)


def missing(texts: Iterator[str], *, code: bool) -> list[str]:
    """The files that texts cite and that are not there."""
    cited = {path for text in texts for path in PATH.findall(text)}
    cited -= EXAMPLES | there()
    wrong = [path for path in cited if "/" in path and path.split("/")[0] in folders()]
    if code:
        wrong += [path for path in cited if "/" not in path and path.endswith((".py", ".md"))]
    return sorted(wrong)


@pytest.mark.parametrize(
    "folder", sorted({path.relative_to(ROOT).parts[0] for path in ROOT.glob("*/*.py")} - OUTPUT)
)
def test_files_that_code_cites_are_there(folder: str) -> None:
    wrong = {
        str(path.relative_to(ROOT)): names
        for path in [*(ROOT / folder).rglob("*.py"), *ROOT.glob("*.py")]
        if (names := missing_in_code(path.read_text()))
    }
    assert not wrong


def test_files_that_pages_cite_are_there() -> None:
    pages = [page for page in all_pages() if page.name != "CHANGELOG.md"]  # names what is gone, too
    assert len(pages) > 20
    wrong = {
        page.name: names
        for page in pages
        if (names := missing(iter([page.read_text()]), code=False))
    }
    assert not wrong


def test_tests_that_pages_cite_are_there() -> None:
    """A page proves a statement by a test's file and name."""
    cited = {
        (page.name, *found) for page in all_pages() for found in TEST.findall(page.read_text())
    }
    assert cited
    code = {
        path: path.read_text()
        for folder in ("tests", "extensions", "lab")
        for path in (ROOT / folder).rglob("test_*.py")
    }
    for page, file, name in sorted(cited):
        of = [text for path, text in code.items() if str(path).endswith(f"/{file}")]
        assert any(f"def {name}(" in text for text in of), f"{page}: {file}::{name}"


@pytest.mark.parametrize(
    ("source", "wrong"),
    [
        ('"""The order is that of DESIGN.md, section 3."""', ["DESIGN.md"]),
        ("x = 1  # as in runtime/running/chains.py", ["runtime/running/chains.py"]),
        ("# see executors.py", ["executors.py"]),
        ('"""See tests/graphs/no_such.yaml (wrong) and running/ticker.py."""',
         ["tests/graphs/no_such.yaml"]),
        ('class A:\n    x = 1\n    """As docs/nowhere.md says."""', ["docs/nowhere.md"]),
        ('"""Writes recordings/jump.rrd, results/a.json, FOLDER/b.yaml and mine.yaml."""', []),
        ('"""As in docs/compiled.md, ticker.py and https://x.org/docs/a.md."""', []),
        ('path = "docs/not_a_citation.md"', []),
    ],
)  # fmt: skip
def test_a_citation_is_recognised(source: str, wrong: list[str]) -> None:
    assert missing_in_code(source) == wrong
