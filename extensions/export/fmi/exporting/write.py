"""Writes an FMU: the cut graph, the files and modules it needs, and PythonFMU3's library."""

from __future__ import annotations

import hashlib
import json
import shutil
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..... import __version__
from .....files.pip_line import pip_line
from .....logs.file.dependencies import named_file
from .....runtime.bundle import copy_module, with_robot_beside
from .....runtime.language.errors import AloftError
from ...clib.cut import Cut, Terminal, cut, start_of
from ...clib.input_delays import InputDelay
from ...clib.part import NeedsPython
from ...clib.write import prepare
from .native import compiler, write_native
from .slave import GRAPH, INTERFACE

_SCRIPT = '''\
"""A graph of aloft as an FMU; the graph is in the folder ``graph``."""
from aloft.extensions.export.fmi.exporting.slave import GraphSlave
from pythonfmu3 import Fmi3Slave


class {name}(GraphSlave, Fmi3Slave):
    pass
'''


@dataclass(frozen=True)
class Exported:
    """Exported file, its terminals, and the findings of FMPy's validator, if it is installed. ``python`` holds the
    reasons why the FMU needs Python; empty: it does not.
    """

    file: Path
    period: float
    inputs: tuple[Terminal, ...]
    outputs: tuple[Terminal, ...]
    problems: tuple[str, ...] | None
    python: tuple[str, ...] = ()
    delays: tuple[InputDelay, ...] = ()


def export(
    path: str,
    to: Path,
    part: str = "",
    overrides: Sequence[str] = (),
    outputs: Sequence[str] = (),
    version: str = "3.0",
    delays: str = "inside",
) -> Exported:
    """Write a graph, or a sub-graph, as an FMU for co-simulation.

    It is made of the library of C that ``aloft export c`` writes. Where that cannot be, since a block
    needs Python or there is no compiler, the FMU runs the graph in Python.

    Args:
        path: the graph file.
        to: the FMU to write.
        part: the path of the sub-graph; empty for the whole graph.
        overrides: parameters to change.
        outputs: what the outputs are, ``block.port``; by default as ``cut`` says.
        version: of FMI, ``3.0`` or ``2.0``.
        delays: the side of those of wires into the part, ``inside`` or ``outside``.

    Raises:
        LoadError: the graph may not run.
        AloftError: FMPy or PythonFMU3 is missing, the part cannot be cut out or does not run alone, or
            it needs Python and the version is 2.0.
    """
    name = to.stem
    if to.suffix != ".fmu" or not name.isidentifier():
        raise AloftError(f"{to} cannot be the name of an FMU; write it as my_controller.fmu")
    if version not in ("3.0", "2.0"):
        raise AloftError(f"there is no FMI {version!r} here; there is 3.0, 2.0")
    title = f"{Path(path).stem}{f', {part}' if part else ''}, by aloft {__version__}"
    try:
        made = prepare(path, name, part, overrides, outputs, delays=delays)
        if compiler():
            write_native(made, to, version, title)
            inside = made.part.cut
            return Exported(
                to, inside.graph.base_period, inside.inputs, inside.outputs, _validated(to),
                delays=inside.delays,
            )  # fmt: skip
        reasons: tuple[str, ...] = ("there is no C compiler (cc)",)
    except NeedsPython as error:
        reasons = error.reasons
    if version != "3.0":
        raise AloftError("\n  ".join(("the FMU needs Python, and such are of FMI 3.0:", *reasons)))
    return _with_python(to, cut(path, part, overrides, outputs, delays=delays), title, reasons)


def _with_python(to: Path, cut_out: Cut, title: str, reasons: tuple[str, ...]) -> Exported:
    """Write an FMU that runs its graph in Python."""
    try:
        from pythonfmu3.builder import FmuBuilder
    except ImportError:
        raise AloftError(f"an FMU is made with PythonFMU3: {pip_line('fmi')}") from None
    with tempfile.TemporaryDirectory(prefix="aloft-export-") as made:
        folder = Path(made) / "graph"
        folder.mkdir()
        _write_graph(cut_out, folder, title)
        script = Path(made) / f"aloft_fmu_{_hash(folder)}.py"
        script.write_text(_SCRIPT.format(name=to.stem), encoding="utf-8")
        try:
            written = FmuBuilder.build_FMU(
                script,
                Path(made) / "fmu",
                project_files=[folder],
                canGetAndSetFMUState=True,
                canSerializeFMUState=True,
                canHandleVariableCommunicationStepSize=True,
            )
        except (AloftError, OSError) as error:
            raise AloftError(f"the part does not run alone: {error}") from error
        finally:
            sys.modules.pop(script.stem, None)
        to.parent.mkdir(parents=True, exist_ok=True)
        shutil.move(written, to)
    found = cut_out.inputs, cut_out.outputs
    return Exported(to, cut_out.graph.base_period, *found, _validated(to), reasons, cut_out.delays)


def _write_graph(cut_out: Cut, folder: Path, title: str) -> None:
    """Write the graph, its interface, and the files and modules that it names."""
    graph = cut_out.graph
    beside = with_robot_beside(cut_out.flat, graph.robot, folder)
    text = replace(cut_out, flat=beside).text
    overrides: dict[str, Any] = {}
    for block in cut_out.inside:
        spec = graph.block(block.path)
        for name, value in spec.params:
            file = named_file(value, Path(spec.folder))
            if file is not None:
                copy = Path("files") / f"{len(overrides)}" / file.name
                (folder / copy).parent.mkdir(parents=True)
                shutil.copyfile(file, folder / copy)
                overrides[f"{block.path}.{name}"] = copy.as_posix()
        if ":" in block.use:
            copy_module(block.use.partition(":")[0], spec.block_type.__module__, folder)
    (folder / GRAPH).write_text(text, encoding="utf-8")
    inputs = [{**t.plain(), "start": list(start_of(t))} for t in cut_out.inputs]
    outputs = [t.plain() for t in cut_out.outputs]
    interface = {
        "description": title,
        "stop_time": None if graph.ticks is None else graph.ticks * graph.base_period,
        "overrides": overrides,
        "inputs": inputs,
        "outputs": outputs,
    }
    content = json.dumps([interface, text], sort_keys=True).encode()
    interface["token"] = hashlib.sha256(content).hexdigest()[:32]
    (folder / INTERFACE).write_text(json.dumps(interface, indent=1), encoding="utf-8")


def _hash(folder: Path) -> str:
    """Return the hash of what the FMU is made of, for the name of its module, which Python knows once."""
    digest = hashlib.sha256()
    for file in sorted(folder.rglob("*")):
        if file.is_file():
            digest.update(str(file.relative_to(folder)).encode() + file.read_bytes())
    return digest.hexdigest()[:12]


def _validated(file: Path) -> tuple[str, ...] | None:
    try:
        from fmpy.validation import validate_fmu
    except ImportError:
        return None
    return tuple(" ".join(problem.split()) for problem in validate_fmu(str(file)))
