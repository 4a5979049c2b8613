"""Changes one operator of a random function and runs the tests of its file: do they notice?

    python lab/mutate.py --count 40 --seed 1 blocks robots planner/checking hal/bear runtime
    python lab/mutate.py --again report.json      the changes of a report that no test noticed

Each change is one token: ``+`` and ``-``, ``*`` and ``/``, ``<`` and ``<=``, ``and`` and ``or``,
``min`` and ``max``, the sign of a number, an index. Functions are drawn from the folders in turn, then
one change of the function. Left out are docstrings, annotations, strings, what is raised, and
``assert``, which the package has for the type checker.

The tests of ``blocks/control/dynamics.py`` are the test file that mirrors it
(``tests/blocks/control/test_dynamics.py``), then those that import it. Where there is neither, they are
the tests of the modules that import it. With ``--long`` the long tests of the mirroring file are run,
too, where the others notice nothing. What ``example_`` functions give is left out: any numbers will do
for the examples of the conformance test. Everything happens in a copy of the tracked files with a copy
of the user's caches, so neither the checkout nor the caches change.

A change that nothing notices may compute the same (``x * 1``, ``<`` at a bound that is never met); a
person has to look. The exit code is 0 whatever is found.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from itertools import pairwise
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "aloft"
MOST_TESTS = 6
"""Largest number of test files that are run for one change, the nearest first."""
ROOM_TESTS = {
    "runtime/loading/": "tests/graphs/test_wrong_graphs.py",
    "robots/validation/": "tests/robots/validation/test_find_faults.py",
    "blocks/general/": "tests/blocks/general/test_units.py",
}
"""Tests of a folder as a whole, which do not import its files."""

OPERATORS: dict[type[ast.AST], tuple[str, tuple[str, ...]]] = {
    ast.Add: ("+", ("-",)),
    ast.Sub: ("-", ("+",)),
    ast.Mult: ("*", ("/",)),
    ast.Div: ("/", ("*",)),
    ast.FloorDiv: ("//", ("*",)),
    ast.Mod: ("%", ("*",)),
    ast.Pow: ("**", ("*",)),
    ast.Lt: ("<", ("<=", ">=")),
    ast.LtE: ("<=", ("<", ">")),
    ast.Gt: (">", (">=", "<=")),
    ast.GtE: (">=", (">", "<")),
    ast.Eq: ("==", ("!=",)),
    ast.NotEq: ("!=", ("==",)),
    ast.Is: ("is", ("is not",)),
    ast.IsNot: ("is not", ("is",)),
    ast.In: ("in", ("not in",)),
    ast.NotIn: ("not in", ("in",)),
    ast.And: ("and", ("or",)),
    ast.Or: ("or", ("and",)),
    ast.USub: ("-", ("+",)),
    ast.Not: ("not", ("",)),
}
OPPOSITES = {
    "min": "max",
    "minimum": "maximum",
    "argmin": "argmax",
    "fmin": "fmax",
    "any": "all",
    "floor": "ceil",
    "sin": "cos",
}
OPPOSITES |= {second: first for first, second in OPPOSITES.items()}


@dataclass
class Change:
    """One token of a file and what stands there instead; line and column count from 1 and 0."""

    file: str
    function: str
    line: int
    column: int
    before: str
    after: str
    source: str = ""
    result: str = ""
    seconds: float = 0.0
    tests: list[str] = field(default_factory=list)

    def applied(self, text: str) -> str | None:
        """Return the text of the file with the change, or None where the file has become another."""
        lines = text.splitlines(keepends=True)
        if self.line > len(lines):
            return None
        content = lines[self.line - 1].encode()
        start, end = content[: self.column], content[self.column :]
        if not end.startswith(self.before.encode()):
            return None
        changed = start + self.after.encode() + end[len(self.before.encode()) :]
        lines[self.line - 1] = changed.decode()
        return "".join(lines)

    def __str__(self) -> str:
        place = f"{self.file}:{self.line} {self.function}"
        return (
            f"{self.result:<10} {place}: {self.before} -> {self.after or 'nothing'}   {self.source}"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("folders", nargs="*", help="where functions are drawn from, in turn")
    parser.add_argument("--count", type=int, default=40, help="how many changes are tried")
    parser.add_argument("--seed", type=int, default=0, help="of the random numbers")
    parser.add_argument(
        "--again", type=Path, metavar="REPORT", help="try what a report calls missed"
    )
    parser.add_argument("--long", action="store_true", help="also run tests that are marked long")
    parser.add_argument("--limit", type=float, default=600.0, help="for the tests of a change [s]")
    parser.add_argument(
        "--copy", type=Path, help="a folder for the copy, which stays for next time"
    )
    parser.add_argument("--json", action="store_true", help="print the report as JSON")
    arguments = parser.parse_args()
    if arguments.again:
        changes = [Change(**each) for each in json.loads(arguments.again.read_text("utf-8"))]
        changes = [each for each in changes if each.result == "missed"]
    else:
        changes = draw(arguments.folders, arguments.count, random.Random(arguments.seed))
    if not changes:
        parser.error("nothing to change: name folders with Python files, or a report")
    folder = arguments.copy or Path(tempfile.mkdtemp(prefix="mutate-"))
    try:
        copy = Copy(folder, arguments.limit, arguments.long)
        for change in changes:
            copy.try_out(change)
            print(change, f"[{change.seconds:.0f} s]", file=sys.stderr, flush=True)
    finally:
        if not arguments.copy:
            shutil.rmtree(folder, ignore_errors=True)
    caught = sum(each.result in ("caught", "too slow") for each in changes)
    print(f"{caught} of {len(changes)} caught", file=sys.stderr)
    if arguments.json:
        json.dump([asdict(each) for each in changes], sys.stdout, indent=1)
        print()


def draw(folders: list[str], count: int, numbers: random.Random) -> list[Change]:
    """Draw changes of random functions, from each folder in turn."""
    rooms = [functions_with_changes(folder) for folder in folders]
    drawn: list[Change] = []
    while len(drawn) < count and any(rooms):
        for room in rooms:
            if room and len(drawn) < count:
                changes = room.pop(numbers.randrange(len(room)))
                drawn.append(numbers.choice(changes))
    return drawn


def functions_with_changes(folder: str) -> list[list[Change]]:
    """Return for each function of a folder, or of one file, the changes that can be made to it."""
    start = ROOT / folder
    paths = [start] if start.is_file() else sorted(start.rglob("*.py"))
    found = []
    for path in paths:
        text = path.read_text("utf-8")
        name = path.relative_to(ROOT).as_posix()
        for function in outer_functions(ast.parse(text)):
            if changes := list(changes_of(function, name, text)):
                found.append(changes)
    return found


def outer_functions(tree: ast.Module) -> Iterator[ast.FunctionDef | ast.AsyncFunctionDef]:
    """Yield functions and methods, not those inside of others."""
    pending: list[ast.AST] = list(tree.body)
    while pending:
        node = pending.pop(0)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            if not node.name.startswith("example_"):
                yield node
        elif isinstance(node, ast.ClassDef | ast.If | ast.Try | ast.With):
            pending = [*node.body, *pending]


def changes_of(
    function: ast.FunctionDef | ast.AsyncFunctionDef, file: str, text: str
) -> Iterator[Change]:
    lines = text.splitlines()
    for node, is_index in executed(function):
        for line, column, before, afters in tokens_of(node, is_index, lines):
            for after in afters:
                yield Change(
                    file, function.name, line, column, before, after, lines[line - 1].strip()
                )


def executed(function: ast.FunctionDef | ast.AsyncFunctionDef) -> Iterator[tuple[ast.AST, bool]]:
    """Yield the nodes of a function that compute something, and whether each is part of an index."""
    defaults: list[ast.AST] = [*function.args.defaults, *filter(None, function.args.kw_defaults)]
    pending = [(each, False) for each in (*defaults, *function.body)]
    while pending:
        node, is_index = pending.pop(0)
        children: list[ast.AST]
        match node:
            case ast.Raise() | ast.Assert() | ast.JoinedStr():
                continue
            case ast.BinOp() if any(is_text(each) for each in (node.left, node.right)):
                continue
            case ast.AnnAssign():
                children = [node.value] if node.value else []
            case ast.FunctionDef() | ast.AsyncFunctionDef():
                children = [*node.args.defaults, *node.body]
            case ast.keyword(arg="axis"):
                continue  # of a matrix the axes 1 and -1 are the same
            case ast.Subscript():
                pending.append((node.slice, True))
                children = [node.value]
            case _:
                children = list(ast.iter_child_nodes(node))
        yield node, is_index
        stays_index = is_index and isinstance(node, ast.Tuple | ast.Slice | ast.UnaryOp | ast.BinOp)
        pending += [(each, stays_index) for each in children]


def is_text(node: ast.AST) -> bool:
    """Tell whether an operand of ``+`` or ``*`` joins sequences and is no number."""
    text = ast.JoinedStr | ast.List | ast.Tuple | ast.ListComp
    return isinstance(node, text) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)
    )


def tokens_of(
    node: ast.AST, is_index: bool, lines: list[str]
) -> Iterator[tuple[int, int, str, tuple[str, ...]]]:
    """Yield the tokens of a node that can be changed: line, column, the token, and its possible
    replacements."""
    match node:
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            yield from between(left, op, right, lines)
        case ast.BoolOp(op=op, values=values):
            for first, second in pairwise(values):
                yield from between(first, op, second, lines)
        case ast.Compare(left=left, ops=ops, comparators=others):
            for first, sign, second in zip([left, *others], ops, others, strict=False):
                yield from between(first, sign, second, lines)
        case ast.AugAssign(target=target, op=op, value=value) if type(op) in OPERATORS:
            yield from between(target, op, value, lines)
        case ast.UnaryOp(op=ast.USub() | ast.Not() as op):
            before, afters = OPERATORS[type(op)]
            yield node.lineno, node.col_offset, before, afters
        case ast.Constant(value=int() | float() as value) if not isinstance(value, bool):
            content = lines[node.lineno - 1].encode()
            written = content[node.col_offset : node.end_col_offset].decode()
            if is_index and isinstance(value, int):
                yield node.lineno, node.col_offset, written, (str(value + 1),)
            elif value != 0:
                yield node.lineno, node.col_offset, written, (f"-{written}",)
        case ast.Call(func=ast.Name(id=name) as called) if name in OPPOSITES:
            yield called.lineno, called.col_offset, name, (OPPOSITES[name],)
        case ast.Call(func=ast.Attribute(attr=name) as called) if name in OPPOSITES:
            column = (called.end_col_offset or 0) - len(name)
            yield called.end_lineno or called.lineno, column, name, (OPPOSITES[name],)


def between(
    first: ast.expr, op: ast.AST, second: ast.expr, lines: list[str]
) -> Iterator[tuple[int, int, str, tuple[str, ...]]]:
    """Yield the operator that stands between two operands, maybe lines further down."""
    token, afters = OPERATORS[type(op)]
    word = rf"(?<!\w){token}(?!\w)" if token[0].isalpha() else re.escape(token)
    line, column = first.end_lineno or first.lineno, first.end_col_offset or 0
    while line <= second.lineno:
        content = lines[line - 1].encode()
        end = second.col_offset if line == second.lineno else len(content)
        part = content[column:end].decode().split("#")[0]
        if found := re.search(word, part):
            yield line, column + len(part[: found.start()].encode()), token, afters
            return
        line, column = line + 1, 0


class Copy:
    """A copy of the tracked files, in which one file at a time has a change."""

    def __init__(self, folder: Path, limit: float, with_long: bool) -> None:
        self.folder = folder.resolve()
        self.limit, self.with_long = limit, with_long
        self.root = self.folder / PACKAGE
        self.durations: dict[tuple[str, str], float | None] = {}
        self.writes = 0
        self._copy_files()
        caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / PACKAGE
        if caches.is_dir() and not (self.folder / "cache").exists():
            shutil.copytree(caches, self.folder / "cache" / PACKAGE)
        self.tests = {
            path.relative_to(self.root).as_posix(): path.read_text("utf-8")
            for path in sorted((self.root / "tests").rglob("test_*.py"))
        }
        self.importers = importers_of(self.root)

    def _copy_files(self) -> None:
        command = ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
        listed = subprocess.run(
            command, cwd=ROOT, check=True, capture_output=True, text=True
        ).stdout
        names = {name for name in listed.split("\0") if name and (ROOT / name).is_file()}
        for path in self.root.rglob("*"):
            relative = path.relative_to(self.root)
            is_copied = path.is_file() and "__pycache__" not in relative.parts
            if is_copied and relative.as_posix() not in names:
                path.unlink()
        for name in sorted(names):
            target = self.root / name
            content = (ROOT / name).read_bytes()
            if not target.exists() or target.read_bytes() != content:
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(content)

    def try_out(self, change: Change) -> None:
        """Run the tests of a file with the change, and say what came of it.

        The result is ``caught``, ``too slow`` (the tests did not end in time, as in an endless loop),
        ``missed``, ``no test``, or ``gone`` where the file has become another since a report.
        """
        path = self.root / change.file
        text = path.read_text("utf-8") if path.exists() else ""
        changed = change.applied(text)
        change.tests, change.seconds = [], 0.0
        if changed is None:
            change.result = "gone"
            return
        change.result = "no test"
        start = time.monotonic()
        for test, mark in self.runs_for(change.file):
            if (usual := self.duration(test, mark)) is None:
                continue
            change.tests.append(test)
            self._write(path, changed)
            try:
                code = self._run(test, mark, min(self.limit, 60.0 + 5.0 * usual))
            finally:
                self._write(path, text)
            change.result = {0: "missed", None: "too slow"}.get(code, "caught")
            if change.result != "missed":
                break
        change.seconds = round(time.monotonic() - start, 1)

    def duration(self, test: str, mark: str) -> float | None:
        """Measure the duration of a test file without a change [s]; None where it fails or has no
        test."""
        if (test, mark) not in self.durations:
            start = time.monotonic()
            code = self._run(test, mark, self.limit)
            passed = code == 0
            self.durations[test, mark] = time.monotonic() - start if passed else None
            if code not in (0, 5):
                print(f"left out: {test} does not pass without a change", file=sys.stderr)
        return self.durations[test, mark]

    def runs_for(self, file: str) -> Iterator[tuple[str, str]]:
        """Test files of a file of the package, each with the mark of the tests to be run."""
        tests = self.tests_of(file)
        yield from ((test, "not long") for test in tests)
        if self.with_long and tests and "mark.long" in self.tests[tests[0]]:
            yield tests[0], "long"

    def tests_of(self, file: str) -> list[str]:
        """Return the test files of a file of the package, the one that mirrors it first."""
        found = self._own_tests(file)
        reached, latest = {file}, {file}
        while not found and latest:
            latest = {i for each in latest for i in self.importers.get(each, ())} - reached
            reached |= latest
            found = [test for each in sorted(latest) for test in self._own_tests(each)]
            found.sort(key=lambda test: -len(os.path.commonpath([test, f"tests/{file}"])))
        room = [test for folder, test in ROOM_TESTS.items() if file.startswith(folder)]
        return list(dict.fromkeys([*list(dict.fromkeys(found))[:MOST_TESTS], *room]))

    def _own_tests(self, file: str) -> list[str]:
        folder, _, name = file.removesuffix(".py").rpartition("/")
        mirror = f"tests/{folder}/test_{name}.py"
        top = f"tests/{folder.split('/')[0]}/"
        same_name = [
            test
            for test in self.tests
            if test.endswith(f"/test_{name}.py") and test.startswith(top)
        ]
        module = re.escape(f"{PACKAGE}.{file.removesuffix('.py').replace('/', '.')}")
        parent = re.escape(f"{PACKAGE}.{folder.replace('/', '.')}")
        pattern = rf"^\s*(from|import) {module}\b|^\s*from {parent} import [^\n]*\b{name}\b"
        importing = [
            test for test, text in self.tests.items() if re.search(pattern, text, re.MULTILINE)
        ]
        importing.sort(key=lambda test: -len(os.path.commonpath([test, mirror])))
        mirrors = [mirror] if mirror in self.tests else []
        return list(dict.fromkeys([*mirrors, *same_name, *importing]))

    def _write(self, path: Path, text: str) -> None:
        """Write a file with a time that no earlier content had, so that no old bytecode is used."""
        path.write_text(text, "utf-8")
        self.writes += 1
        moment = time.time() + self.writes
        os.utime(path, (moment, moment))

    def _run(self, test: str, mark: str, limit: float) -> int | None:
        """Run a test file and return the exit code of pytest, or None where it had to be stopped."""
        environment = os.environ | {
            "PYTHONPATH": str(self.folder),
            "XDG_CACHE_HOME": str(self.folder / "cache"),
            "OMP_NUM_THREADS": "1",
            "OPENBLAS_NUM_THREADS": "1",
        }
        command = [sys.executable, "-m", "pytest", "-x", "-q", "--tb=no", "-p", "no:cacheprovider"]
        process = subprocess.Popen(
            [*command, "-m", mark, test],
            cwd=self.root,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            return process.wait(limit)
        except subprocess.TimeoutExpired:
            return None
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()


def importers_of(root: Path) -> dict[str, set[str]]:
    """Return for each file of the package the others that import it; ``__init__.py`` stands for
    nothing."""
    files = [
        path.relative_to(root)
        for path in sorted(root.rglob("*.py"))
        if path.relative_to(root).parts[0] not in ("tests", "docs", "scripts")
    ]
    known = {path.as_posix() for path in files}
    found: dict[str, set[str]] = {}
    for path in files:
        for node in ast.walk(ast.parse((root / path).read_text("utf-8"))):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                program = (path.parent / node.value).as_posix()  # one that is started, not imported
                if program in known and program != path.as_posix():
                    found.setdefault(program, set()).add(path.as_posix())
            if isinstance(node, ast.ImportFrom) and node.level:
                start = path.parent.parts[: len(path.parent.parts) - node.level + 1]
                module = "/".join((*start, *(node.module.split(".") if node.module else ())))
                names = [f"{module}.py", *(f"{module}/{alias.name}.py" for alias in node.names)]
                for name in names:
                    if name in known and path.name != "__init__.py":
                        found.setdefault(name, set()).add(path.as_posix())
    return found


if __name__ == "__main__":
    main()
