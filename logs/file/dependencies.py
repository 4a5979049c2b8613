"""Dependencies of a run beside its graph: the files that parameters name, and the user's project.

A file is known by an entry and by the SHA-256 of its content. The entry of a file that a parameter
names is ``block.parameter: value``. A file that a block found in a folder, which one of its
parameters names, has the entry ``block.parameter/name``; a file that a block found otherwise has
the entry ``block: name``. A shipped file that a block found is named from the folder of the shipped
graphs on.
"""

from __future__ import annotations

import os
import subprocess
import zlib
from base64 import b64decode, b64encode
from collections.abc import Mapping
from hashlib import sha256
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from ...runtime.language.stages import CheckedGraph
from ...runtime.running.memory import BoundGraph

_SHIPPED = Path(str(files(__package__.partition(".logs")[0]) / "graphs"))
MOST_BYTES = 1 << 26
"""Files that are larger are not looked at."""
MOST_CARRIED = 1 << 24
"""The bytes of all files that a recording carries, compressed; further files are only named."""


def parameter_files(graph: CheckedGraph) -> dict[str, Path]:
    """Return every file that a parameter names, by its entry.

    A file is looked for beside the graph, and then among the shipped graphs.
    """
    return {
        f"{spec.path}.{name}: {value}": path
        for spec in graph.blocks
        for name, value in spec.params
        if (path := named_file(value, Path(spec.folder))) is not None
    }


def files_read(bound: BoundGraph) -> dict[str, Path]:
    """Return ``parameter_files`` and the files that blocks have found themselves when they were set
    up, such as plans: those in a block's attribute ``files_read``. The block's attribute
    ``files_folder`` may name the parameter that says in which folder they are looked for first."""
    found = parameter_files(bound.graph)
    for path, block in bound.blocks.items():
        folder = getattr(block, "files_folder", "")
        for file in getattr(block, "files_read", ()):
            name = found_name(file)
            found[f"{path}.{folder}/{name}" if folder else f"{path}: {name}"] = file
    return found


def found_name(file: Path) -> str:
    """Return the name of a file that a block found: of a shipped one its place, of another its own
    name."""
    file = file.absolute()
    return file.relative_to(_SHIPPED).as_posix() if file.is_relative_to(_SHIPPED) else file.name


def digests(files: Mapping[str, Path]) -> dict[str, str]:
    """Compute the SHA-256 of every file, by its entry."""
    return {entry: sha256(path.read_bytes()).hexdigest() for entry, path in files.items()}


def contents(files: Mapping[str, Path]) -> dict[str, str]:
    """Return the content of files as text, by SHA-256, as far as ``MOST_CARRIED`` allows."""
    found, room = {}, MOST_CARRIED
    for path in files.values():
        data = path.read_bytes()
        packed = zlib.compress(data, 6)
        if len(packed) <= room:
            room -= len(packed)
            found[sha256(data).hexdigest()] = b64encode(packed).decode()
    return found


def unpacked(content: str) -> bytes:
    """Unpack the bytes of a file from the text that ``contents`` made.

    Raises:
        ValueError: it is not such a text, or it unpacks to more than ``MOST_BYTES``.
    """
    unpacker = zlib.decompressobj()
    try:
        data = unpacker.decompress(b64decode(content, validate=True), MOST_BYTES + 1)
    except zlib.error as error:
        raise ValueError(f"it cannot be unpacked ({error})") from error
    if len(data) > MOST_BYTES:
        raise ValueError(f"it unpacks to more than {MOST_BYTES >> 20} MiB")
    if not unpacker.eof:
        raise ValueError("it was cut off")
    return data


def other_files(then: Mapping[str, str], now: Mapping[str, str]) -> list[str]:
    """Describe the changes of the files ``then`` in words."""
    found = []
    for name, content in then.items():
        if name not in now:
            found.append(f"the file of {name} is not there, or is not used any more")
        elif now[name] != content:
            found.append(f"the file of {name} has other content")
    return found


def named_file(value: Any, folder: Path) -> Path | None:
    """Find the file that a parameter's value names, beside the graph or among the shipped graphs."""
    if not isinstance(value, str | Path) or not str(value) or "\n" in str(value):
        return None
    try:
        for place in (folder, _SHIPPED):
            path = place / value
            if path.is_file() and path.stat().st_size <= MOST_BYTES:
                return path
    except (OSError, ValueError):  # a text that can be no name
        return None
    return None


def project_state(folder: Path) -> str:
    """Return the commit of the project that ``folder`` is in, and whether files differ from it;
    empty where it is no project under git.

    A project's own settings may name programs that git runs when it compares files (a file system
    monitor, filters, hooks). So git compares under settings of ours, which name none, and whose
    folder has the project's commit; of the project only the index and the objects are read.
    """
    try:
        found = _git(
            folder, {}, "rev-parse", "HEAD", "--show-toplevel", "--absolute-git-dir",
            "--path-format=absolute", "--git-path", "objects", "--git-path", "index",
        ).splitlines()  # fmt: skip
        commit, top, _, objects, index = found
    except (OSError, subprocess.SubprocessError, ValueError):
        return ""
    try:
        with TemporaryDirectory(prefix="aloft-git-") as ours:
            _write_settings(Path(ours), commit)
            places = {
                "GIT_DIR": ours, "GIT_WORK_TREE": top, "GIT_OBJECT_DIRECTORY": objects,
                "GIT_INDEX_FILE": index,
            }  # fmt: skip
            changed = _git(Path(top), places, "status", "--porcelain", *_OWN_FILES_ONLY)
    except (OSError, subprocess.SubprocessError):
        return f"{commit}, perhaps with changes"
    return f"{commit} with changes" if changed else commit


_OWN_FILES_ONLY = ("--untracked-files=no", "--ignore-submodules=all")
"""A submodule has settings of its own, under which git would run in it."""


def _write_settings(folder: Path, commit: str) -> None:
    """Make a folder ``.git`` without any settings, in which this commit is checked out."""
    for name in ("refs", "objects"):
        (folder / name).mkdir()
    (folder / "HEAD").write_text(f"{commit}\n", encoding="ascii")
    wide = len(commit) == 64
    version = "1\n[extensions]\n\tobjectformat = sha256" if wide else "0"
    (folder / "config").write_text(
        f"[core]\n\trepositoryformatversion = {version}\n", encoding="ascii"
    )


def _git(folder: Path, places: Mapping[str, str], *arguments: str) -> str:
    # without the index being written again: nobody's project is locked or changed by a run in it
    command = ["git", "--no-optional-locks", "-C", str(folder or "."), *arguments]
    alone = {"GIT_CONFIG_NOSYSTEM": "1", "GIT_CONFIG_GLOBAL": os.devnull} if places else {}
    done = subprocess.run(
        command, capture_output=True, text=True, timeout=2.0, check=True,
        env={**os.environ, **alone, **places},
    )  # fmt: skip
    return done.stdout.strip()
