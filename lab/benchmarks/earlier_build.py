"""The sources of an earlier build, importable by processes of their own."""

from __future__ import annotations

import io
import os
import subprocess
import tarfile
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from ...runtime.language.errors import AloftError

ROOT = Path(__file__).parents[2]


class Build:
    """A build of aloft, and a folder for what its processes keep.

    Args:
        which: a folder with its sources, or a commit of this repository by any name that git knows.

    Attributes:
        folder: a folder of its own, in which ``aloft`` is the package.

    Raises:
        AloftError: there is no such folder, and these sources are no git repository or have no such commit.
    """

    def __init__(self, which: str | Path) -> None:
        self._temporary = tempfile.TemporaryDirectory(prefix="aloft_")
        self.folder = Path(self._temporary.name)
        if (Path(which) / "__init__.py").is_file():
            (self.folder / "aloft").symlink_to(Path(which).resolve(), target_is_directory=True)
            return
        found = subprocess.run(
            ["git", "-C", str(ROOT), "archive", "--format=tar", str(which)],
            check=False, capture_output=True,
        )  # fmt: skip
        if found.returncode:
            self.close()
            reason = found.stderr.decode(errors="replace").strip().splitlines() or ["git failed"]
            raise AloftError(
                f"the sources of {which} are not at hand: {reason[-1]}; "
                "--since needs a folder with them, or a clone with its history"
            )
        with tarfile.open(fileobj=io.BytesIO(found.stdout)) as archive:
            archive.extraction_filter = getattr(tarfile, "data_filter", None)  # not before 3.11.4
            archive.extractall(self.folder / "aloft")

    def environment(self, **more: str) -> Mapping[str, str]:
        """Return the variables with which a process imports this build; its bytecode is kept here."""
        kept = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
        path = os.pathsep.join((str(self.folder), os.environ.get("PYTHONPATH", "")))
        own = {"PYTHONPATH": path, "PYTHONPYCACHEPREFIX": str(self.folder / "bytecode")}
        return {**kept, **threads, **own, **more}

    def close(self) -> None:
        """Remove the folder."""
        self._temporary.cleanup()


@contextmanager
def builds_beside(since: str) -> Iterator[list[Build]]:
    """Open this build and, if one is named, an earlier one, in this order.

    Raises:
        AloftError: there is no such build.
    """
    builds = [Build(ROOT)]
    try:
        if since:
            builds.append(Build(since))
        yield builds
    finally:
        for build in builds:
            build.close()
