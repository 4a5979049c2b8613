"""The house stays as it was drawn: who may import whom, how long a file may be, what is not said.

Read from the syntax trees of all tracked Python files, so a rule also holds for code that no test
runs.
"""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from aloft.cli.verbs import CORE as VERBS
from aloft.runtime.language.extensions import own_extensions
from aloft.runtime.language.registry import find_block, known_names

ROOT = Path(__file__).parent.parent
CORE = (
    "processes", "files", "mathematics", "robots", "runtime", "planner", "blocks", "hal", "logs", "studies", "cli", "graphs",
)  # fmt: skip
"""The packages of the core, which import no extension and nothing of the lab."""
PACKAGES = (*CORE, "extensions", "lab")
ALLOWED: dict[str, tuple[str, ...]] = {
    "processes": (),
    "files": ("runtime/language/errors", "runtime/language/units"),
    "mathematics": ("processes", "files/cache"),
    "robots": ("files", "mathematics"),
    "runtime/language": ("files", "robots", "mathematics/compiling", "mathematics/kernel", "mathematics/arrays", "mathematics/elementary", "mathematics/ground_surface"),
    "runtime/running": (
        "processes", "runtime/language", "robots", "mathematics/compiling", "mathematics/kernel", "mathematics/arrays",
    ),
    "runtime/loading": (
        "files", "runtime/background", "runtime/language", "runtime/placement", "runtime/transports/registry", "robots",
    ),
    "runtime/background": ("processes", "runtime/language", "runtime/running", "robots", "mathematics/compiling"),
    "runtime/placement": ("runtime/language", "robots"),
    "runtime/transports": ("runtime/language", "runtime/placement", "robots"),
    "runtime/links": (
        "runtime/language", "runtime/loading", "runtime/running", "runtime/placement",
        "runtime/transports", "robots",
    ),
    "runtime/live": (
        "files", "runtime/language", "runtime/loading", "runtime/running",
        "runtime/placement", "runtime/links", "runtime/transports", "robots",
    ),
    "runtime/testing": (
        "runtime/language", "runtime/loading", "runtime/running", "runtime/placement",
        "runtime/links", "runtime/transports", "robots", "mathematics",
    ),
    "runtime": (
        "files", "runtime/language", "runtime/loading", "runtime/running", "runtime/placement",
        "runtime/links", "robots",
    ),
    "blocks/signals": ("runtime/language", "planner/task/phase"),
    "blocks": ("runtime/language",),  # finds one of its blocks by name
    "planner": (),
    "planner/task": ("files", "mathematics", "robots", "runtime/language", "runtime/loading"),
    "planner/models": ("planner/task", "mathematics", "robots"),
    "planner/problem": ("planner/task", "planner/models", "mathematics", "robots"),
    "planner/solving": (
        "processes", "files/cache", "planner/task", "planner/models", "planner/problem", "mathematics", "robots",
    ),
    "planner/checking": (
        "planner/task", "planner/models", "mathematics", "robots", "runtime/language",
    ),
    "planner/library": (
        "planner/task", "planner/models", "planner/problem", "planner/solving", "planner/checking",
        "files/cache", "mathematics", "robots", "runtime/language",
    ),
    "extensions/hopping/planner": (
        "planner/task", "planner/models", "planner/problem", "planner/solving", "planner/checking", "planner/library",
        "files/cache", "mathematics", "robots", "runtime/language",
    ),
    "planner/drawing": (
        "planner/task", "planner/models", "planner/checking", "planner/library", "mathematics/arrays", "robots",
    ),
    "blocks/general": ("blocks/signals", "files/pip_line", "mathematics", "robots", "runtime/language"),
    "blocks/estimation": ("blocks/signals", "mathematics", "robots", "runtime/language"),
    "blocks/control": ("files", "blocks/signals", "mathematics", "robots", "runtime/language"),
    "blocks/jumping": ("blocks/signals", "mathematics", "robots", "runtime/language", "planner"),
    "blocks/scoring": ("blocks/signals", "mathematics", "robots", "runtime/language"),
    "hal": ("processes", "files", "blocks/signals", "mathematics", "robots", "runtime/language"),
    "hal/log": ("hal", "files", "blocks/signals", "mathematics", "robots", "runtime/language", "logs/file"),
    "logs/file": ("files", "robots", "runtime/language", "runtime/running"),
    "logs/viewing": ("files", "logs/file", "hal/sensors", "mathematics", "robots", "runtime/language"),
    "logs/recording": (
        "processes", "logs/file", "logs/viewing", "mathematics", "robots", "runtime/language", "runtime/running",
        "runtime/placement", "runtime/links",
    ),
    "logs/replay": ("files", "blocks/signals", "logs/file", "logs/viewing", "robots", "runtime"),
    "logs/exporting": (
        "files/pip_line",
        "logs/file", "hal/sensors", "logs/viewing", "mathematics", "robots", "runtime/language",
    ),
    "logs": ("logs/file",),
    "studies": ("processes", "files", "mathematics", "robots", "runtime", "planner", "blocks", "hal", "logs"),
    "cli": CORE,
    **{f"extensions/{each.name}": (*CORE, "plotting", *(f"extensions/{name}" for name in each.needs)) for each in own_extensions().values() if each.name != "lab"},
    "extensions": (),
    "lab": PACKAGES,
    "graphs": (),
}  # fmt: skip
"""The rooms, and which rooms the files of each may import. The longest name that fits a file is its
room; a room may import itself. What is allowed is a room with all that lies in it."""
HEAVY = {
    "mujoco",
    "pinocchio",
    "qpsolvers",
    "daqp",
    "rerun",
    "scipy",
    "llvmlite",
    "pyarrow",
    "PIL",
    "zenoh",
    "matplotlib",
    "control",
}
LONGEST = 600
NESTING = (ast.stmt, ast.excepthandler, ast.match_case)
"""What a statement can stand in."""
ROOMS_BY_NAME = tuple(name for name in PACKAGES if name != "planner")


def files(folder: str) -> list[Path]:
    found = (ROOT / folder).rglob("*.py")
    outside = (
        {"__pycache__", "tests", "conftest.py", "demo", "pages"}  # programs outside of the package
        if folder.startswith(("extensions", "lab"))
        else {"__pycache__"}
    )
    return sorted(path for path in found if outside.isdisjoint(path.relative_to(ROOT).parts))


def project_files() -> list[Path]:
    """All of the project's own Python files."""
    own = [
        path for folder in (*PACKAGES, "tests", "docs", "scripts", "lab") for path in files(folder)
    ]
    return [*own, *sorted(ROOT.glob("*.py"))]


def module_of(path: Path) -> tuple[str, ...]:
    """``blocks/control/joint_pd.py`` -> ("blocks", "joint_pd")."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return parts[:-1] if parts[-1] == "__init__" else parts


@cache
def import_statements(path: Path) -> tuple[tuple[ast.Import | ast.ImportFrom, bool], ...]:
    """Every import statement of a file, and whether it is executed when the file is imported: those
    in functions and under ``if TYPE_CHECKING`` are not."""
    found: list[tuple[ast.Import | ast.ImportFrom, bool]] = []
    pending: list[tuple[ast.AST, bool]] = [(ast.parse(path.read_text(encoding="utf-8")), True)]
    while pending:
        node, at_import = pending.pop()
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) or (
            isinstance(node, ast.If) and "TYPE_CHECKING" in ast.dump(node.test)
        ):
            at_import = False
        pending += [
            (each, at_import) for each in ast.iter_child_nodes(node) if isinstance(each, NESTING)
        ]
        if isinstance(node, ast.Import | ast.ImportFrom):
            found.append((node, at_import))
    return tuple(found)


def imports(path: Path, *, only_at_import: bool = False) -> Iterator[tuple[str, ...]]:
    """The modules a file imports, relative ones resolved to the project's own names.

    With ``only_at_import`` those in functions and under ``if TYPE_CHECKING`` are left out.
    """
    package = path.relative_to(ROOT).parent.parts
    for node, at_import in import_statements(path):
        if only_at_import and not at_import:
            continue
        if isinstance(node, ast.Import):
            yield from (tuple(alias.name.split(".")) for alias in node.names)
        else:
            start = package[: len(package) - node.level + 1] if node.level else ()
            module = (*start, *(node.module.split(".") if node.module else ()))
            # `from . import x` names modules; `from .x import y` names what is in one
            names = [(*module, alias.name) for alias in node.names] if not node.module else [module]
            yield from names


def own(name: tuple[str, ...]) -> tuple[str, ...] | None:
    """An import as a project-relative name, or None when it is somebody else's."""
    if name[:1] == ("aloft",):
        name = name[1:]
    return name if name and name[0] in PACKAGES else None


def is_within(module: tuple[str, ...], room: str) -> bool:
    parts = tuple(room.split("/"))
    return module[: len(parts)] == parts


def room_of(module: tuple[str, ...]) -> str:
    """The room that a module lies in."""
    return max((room for room in ALLOWED if is_within(module, room)), key=len)


def test_every_file_has_a_room() -> None:
    folders = {path.parent for package in PACKAGES for path in files(package)}
    without = [
        str(folder.relative_to(ROOT))
        for folder in sorted(folders)
        if not any(is_within(folder.relative_to(ROOT).parts, room) for room in ALLOWED)
    ]
    assert not without, "say in ALLOWED what the room may import"


def test_the_core_imports_no_extension() -> None:
    wrong = [
        f"{path.relative_to(ROOT)} imports {'.'.join(target)}"
        for package in CORE
        for path in files(package)
        for name in imports(path)
        if (target := own(name)) is not None and target[0] in ("extensions", "lab")
    ]
    assert not wrong, "an extension provides it; see runtime/language/extensions.py"


@pytest.mark.parametrize("room", ALLOWED)
def test_imports_point_one_way(room: str) -> None:
    may = (room, *ALLOWED[room])
    wrong = [
        f"{path.relative_to(ROOT)} imports {'.'.join(target)}"
        for path in files(room)
        if room_of(module_of(path) if path.name != "__init__.py" else (*module_of(path), ""))
        == room
        for name in imports(path)
        if (target := own(name)) is not None
        and not any(is_within(target, allowed) for allowed in may)
    ]
    assert not wrong, f"{room} may import only {may}"


def test_no_circle_of_files() -> None:
    # also inside a room: two files that import each other are one file, or hide a third
    modules = {module_of(path): path for package in PACKAGES for path in files(package)}
    targets = {
        module: sorted(
            {
                target
                for name in imports(path)
                if (target := nearest_module(name, modules)) and target != module
            }
        )
        for module, path in modules.items()
    }
    finished: list[tuple[str, ...]] = []
    circles = []
    for start in targets:
        way: list[tuple[str, ...]] = []
        pending = [(start, False)]
        while pending:
            module, leaving = pending.pop()
            if leaving:
                finished.append(way.pop())
            elif module in way:
                circles.append(
                    " -> ".join("/".join(m) for m in [*way[way.index(module) :], module])
                )
            elif module not in finished:
                way.append(module)
                pending.append((module, True))
                pending += [(target, False) for target in targets[module]]
    assert not circles


def nearest_module(
    name: tuple[str, ...], modules: dict[tuple[str, ...], Path]
) -> tuple[str, ...] | None:
    """The module of ours that an import names: itself, or the one it is in."""
    target = own(name)
    while target and target not in modules:
        target = target[:-1]
    return target or None


def test_inside_the_package_imports_are_relative() -> None:
    # an absolute one would import a second copy of the package from a checkout of another name
    wrong = [
        str(path.relative_to(ROOT))
        for package in PACKAGES
        for path in files(package)
        if any(name[:1] == ("aloft",) or name[0] in ROOMS_BY_NAME for name in absolute(path))
    ]
    assert not wrong


def absolute(path: Path) -> Iterator[tuple[str, ...]]:
    for node, _ in import_statements(path):
        if isinstance(node, ast.Import):
            yield from (tuple(alias.name.split(".")) for alias in node.names)
        elif node.level == 0 and node.module:
            yield tuple(node.module.split("."))


def block_files() -> dict[tuple[str, ...], Path]:
    """The modules of aloft in which a block is declared."""
    found = {}
    for name in known_names():
        module = tuple(find_block(name).__module__.split(".")[1:])
        if name.partition(".")[0] in ("blocks", "hal", *own_extensions()):
            found[module] = ROOT.joinpath(*module).with_suffix(".py")
    return found


def test_no_block_imports_another_blocks_file() -> None:
    blocks = block_files()
    assert blocks, "no block was found: the rule below would check nothing"
    wrong = [
        f"{path.relative_to(ROOT)} imports {'.'.join(target)}"
        for path in blocks.values()
        for name in imports(path)
        if (target := own(name)) in blocks
    ]
    assert not wrong, "shared mathematics belongs in a module of its own"


def test_no_verb_imports_another_verb() -> None:
    verbs = {("cli", path.stem) for path in (ROOT / "cli").glob("*.py") if path.stem in VERBS}
    assert len(verbs) > 10, "the rule below would check nothing"
    wrong = [
        f"{path.relative_to(ROOT)} imports {'.'.join(target)}"
        for path in [*files("cli"), *files("extensions"), *files("lab")]
        for name in imports(path)
        if (target := own(name)) in verbs
    ]
    assert not wrong, "what verbs share belongs in cli/shared"


def test_blocks_can_be_imported_without_the_libraries_they_compute_with() -> None:
    # `aloft check` imports every block of a graph and must answer at once
    wrong = [
        f"{path.relative_to(ROOT)} imports {name[0]}"
        for package in PACKAGES
        for path in files(package)
        for name in imports(path, only_at_import=True)
        if name and name[0] in HEAVY
    ]
    assert not wrong, "import it inside setup() or the function that needs it"


def test_one_block_has_one_test_of_the_same_name() -> None:
    missing = [test for test in map(own_test, block_files()) if not (ROOT / test).is_file()]
    assert not missing


def own_test(module: tuple[str, ...]) -> Path:
    """The file of a module's tests; those of an extension lie in its own folder."""
    if module[0] == "extensions":
        own_folder, inner = Path(*module[:2], "tests"), module[2:]
    else:
        own_folder, inner = Path("tests"), module
    return own_folder.joinpath(*inner[:-1], f"test_{inner[-1]}.py")


def test_no_file_is_too_long() -> None:
    lengths = {p: len(p.read_text(encoding="utf-8").splitlines()) for p in project_files()}
    too_long = {str(p.relative_to(ROOT)): n for p, n in lengths.items() if n > LONGEST}
    assert not too_long, "two things live in it"


def texts() -> list[Path]:
    """All of the project's own text files."""
    found = project_files()
    for pattern in (
        "*.md",
        "*.toml",
        "Makefile",
        "graphs/**/*.yaml",
        "robots/**/*.yaml",
        "docs/**/*.md",
    ):
        found += sorted(ROOT.glob(pattern))
    return [*found, *sorted((ROOT / "scripts").glob("*.sh")), ROOT / ".ci" / "run"]


def test_no_file_knows_the_machine_it_was_written_on() -> None:
    # spelt in pieces, so that this file does not find itself
    forbidden = re.compile(
        "|".join(("/wo" + "rk/", "/ro" + "ot/", "/ho" + "me/[a-z]", "/far" + "m"))
    )
    wrong = [str(p.relative_to(ROOT)) for p in texts() if forbidden.search(p.read_text("utf-8"))]
    assert not wrong


def test_nothing_listens_beyond_the_loopback() -> None:
    forbidden = re.compile(
        "|".join((r"0\.0\." + r"0\.0", r"\[:" + r":\]", "serve_" + "grpc", "serve_" + "web"))
    )
    wrong = [str(p.relative_to(ROOT)) for p in texts() if forbidden.search(p.read_text("utf-8"))]
    assert not wrong


def test_the_types_of_arrays_are_named_once() -> None:
    again = re.compile(r"^(Array|Flags|Indices|Counts)\b.* = NDArray\[np\.", re.MULTILINE)
    found = [p for p in project_files() if again.search(p.read_text(encoding="utf-8"))]
    assert found == [ROOT / "mathematics" / "arrays.py"], "import it from mathematics/arrays.py"


def environment_reads(path: Path) -> Iterator[str]:
    """The environment variables that a file reads, as far as they are written out."""
    text = path.read_text("utf-8")
    if "environ" not in text and "getenv" not in text:
        return
    for node in ast.walk(ast.parse(text)):
        match node:
            case ast.Call(func=called, args=[ast.Constant(value=str(name)), *_]):
                if ast.unparse(called) in ("os.environ.get", "os.getenv"):
                    yield name
            case ast.Subscript(value=mapping, ctx=ast.Load()):
                if ast.unparse(mapping) == "os.environ":
                    yield ast.unparse(node.slice)


def test_hidden_configuration_is_refused() -> None:
    # a graph is data: no environment variable may change what it computes
    # where files are kept, and for which processor machine code is made, which has the same bytes
    # that of OpenBLAS is read to keep apart what was computed under another
    same_results = {"XDG_CACHE_HOME", "ALOFT_CPU_NAME", "ALOFT_CPU_FEATURES", "OPENBLAS_CORETYPE"}
    wrong = [
        f"{path.relative_to(ROOT)} reads {name}"
        for package in ("mathematics", "robots", "runtime", "planner", "blocks", "hal")
        for path in files(package)
        for name in environment_reads(path)
        if name not in same_results
    ]
    assert not wrong


def test_documents_that_the_code_names_are_there() -> None:
    for path in project_files():
        if (
            path.relative_to(ROOT).parts[0] in ("tests", "docs", "cli", "lab")
            or "tests" in path.parts
        ):
            continue  # command lines write pages whose names they say
        for name in re.findall(r"\b[\w/]+\.md\b", path.read_text(encoding="utf-8")):
            assert (ROOT / name).is_file(), f"{path.relative_to(ROOT)} names {name}"
