"""Extensions can be taken away, and come from other packages."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import aloft
from aloft.runtime.language import extensions
from aloft.runtime.language.extensions import (
    SERVICES,
    SHIPPED,
    ExtensionError,
    missing_extension,
    own_extensions,
    read_declaration,
)

ROOT = Path(aloft.__file__).parent
JUMP_HASH = "b17451f3d8c225c8437d3a0c6ec34667"
CHECK = """
import json, sys
from pathlib import Path
from aloft.runtime.loading import LoadError, checked_file
from aloft.runtime.loading.reading.files import shipped_graphs
wrong = {}
for address, path in shipped_graphs().items():
    try:
        checked_file(path)
    except LoadError as error:
        wrong[address] = str(error)
print(json.dumps([len(shipped_graphs()), wrong]))
"""


def without(name: str, folder: Path) -> Path:
    """A copy of the package without an extension; gives the folder that Python finds it in."""
    left_out = [
        ".git",
        ".venv",
        "tests",
        "docs",
        "recordings",
        "build",
        "results",
        "__pycache__",
        ".mypy_cache",
    ]
    package = shutil.copytree(ROOT, folder / "aloft", ignore=shutil.ignore_patterns(*left_out))
    shutil.rmtree(package / "lab" if name == "lab" else package / "extensions" / name)
    return folder


def run(folder: Path, *arguments: str, path: str = "") -> subprocess.CompletedProcess[str]:
    """Run Python in a folder, which or whose ``path`` has the package."""
    return subprocess.run(
        [sys.executable, *arguments],
        env=os.environ | {"PYTHONPATH": path or str(folder), "PYTHONDONTWRITEBYTECODE": "1"},
        cwd=folder, check=False, capture_output=True, text=True, timeout=300,
    )  # fmt: skip


def uses(name: str, path: Path) -> bool:
    """Whether a graph, or one that it includes, names a block or a graph of an extension."""
    text = path.read_text(encoding="utf-8")
    if f"{name}." in text or f"aloft:{name}/" in text:
        return True
    included = (yaml.safe_load(text) or {}).get("include", ())
    files = [path.parent / file for file in included if not file.startswith("aloft:")]
    return any(uses(name, file) for file in files if file.is_file())


@pytest.mark.long
@pytest.mark.parametrize("name", SHIPPED)
def test_without_an_extension_the_core_does_the_same(name: str, tmp_path: Path) -> None:
    folder = without(name, tmp_path)
    ran = run(folder, "-m", "aloft", "run", "aloft:jump", "--json", "--no-record")
    assert json.loads(ran.stdout)["run_hash"] == JUMP_HASH
    count, wrong = json.loads(run(folder, "-c", CHECK).stdout)
    assert count > 40
    named = [a for a in wrong if not uses(name, extensions_graph(folder / "aloft", a))]
    assert not named, wrong
    helped = run(folder, "-m", "aloft", "--help")
    assert helped.returncode == 0 and " run " in helped.stdout
    for verb in SHIPPED[name]:
        told = run(folder, "-m", "aloft", *verb.split())
        assert told.returncode == 2
        assert missing_extension(name, f"'aloft {verb}'") in " ".join(told.stderr.split())
    if name != "lab":
        (folder / "one.yaml").write_text(
            f"rate: 100 Hz\nblocks: {{x: {{use: {name}.Something}}}}\n"
        )
        told = run(folder, "-m", "aloft", "check", "one.yaml")
        assert told.returncode == 2
        assert f"is part of the extension {name!r}" in " ".join(told.stderr.split())


def extensions_graph(package: Path, address: str) -> Path:
    """The file of a shipped graph in a copy of the package."""
    name = address.removeprefix("aloft:")
    owner, _, inner = name.partition("/")
    if owner in SHIPPED:
        return package / "extensions" / owner / "graphs" / f"{inner}.yaml"
    return package / "graphs" / f"{name}.yaml"


def test_the_table_of_shipped_extensions_is_true() -> None:
    found = own_extensions()
    assert set(found) == set(SHIPPED)
    for name, each in found.items():
        assert set(each.verbs) == set(SHIPPED[name]), name
        assert set(each.provides) == {s for s, owner in SERVICES.items() if owner == name}, name
        assert (each.folder / each.page).is_file(), name
        assert each.summary and set(each.needs) <= set(SHIPPED), name


def test_what_a_declaration_names_is_there() -> None:
    for each in own_extensions().values():
        for target in (*each.verbs.values(), *each.provides.values()):
            assert each.load(target) is not None, target


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "verb = {}",
            "unknown key 'verb'; there is summary, page, extras, needs, verbs, help, provides",
        ),
        ("extras = 'x'", "extras: expected a list of texts, found 'x'"),
        ("verbs = {a = 1}", "verbs: expected a table of texts, found {'a': 1}"),
        ("summary", "extension.toml: "),
    ],
)
def test_a_wrong_declaration_is_refused(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "extension.toml").write_text(text)
    with pytest.raises(ExtensionError, match=r"extension\.toml") as caught:
        read_declaration("x", tmp_path, "x")
    assert said in str(caught.value)


@pytest.mark.long
def test_an_extension_comes_from_another_wheel(tmp_path: Path) -> None:
    package = tmp_path / "counting"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "extension.toml").write_text(
        'summary = "Counts"\n[verbs]\ncount = "verbs:count"\n"robot count" = "verbs:count"\n'
    )
    (package / "verbs.py").write_text(
        'def count() -> None:\n    """Count to three."""\n    print(1, 2, 3)\n'
    )
    (package / "blocks.py").write_text(
        "from aloft import Block, Output, Signal, Field\n\n\n"
        "class Ticks(Signal):\n    count: float = Field()\n\n\n"
        'class Ticker(Block):\n    """Counts ticks."""\n\n    ticks = Output(Ticks)\n\n'
        "    def step(self) -> None:\n        self.ticks.count = 1.0\n"
    )
    info = tmp_path / "counting-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: counting\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[aloft.extensions]\ncounting = counting\n")
    folder = f"{tmp_path}{os.pathsep}{ROOT.parent}"
    for verb in (["count"], ["robot", "count"]):
        told = run(tmp_path, "-m", "aloft", *verb, path=folder)
        assert (told.returncode, told.stdout) == (0, "1 2 3\n"), told.stderr
    (tmp_path / "one.yaml").write_text("rate: 100 Hz\nblocks: {x: {use: counting.Ticker}}\n")
    told = run(tmp_path, "-m", "aloft", "check", "one.yaml", path=folder)
    assert told.returncode == 0, told.stderr


def test_a_missing_service_names_its_extension(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(extensions, "own_extensions", dict)
    monkeypatch.setattr(extensions, "other_extensions", dict)
    with pytest.raises(ExtensionError, match="part of the extension 'studio'"):
        extensions.provided("diagram_svg")
