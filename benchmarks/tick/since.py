"""The controller of a jump as it was at an earlier commit, measured in the same run."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

from ...runtime.language.errors import AloftError
from .controller import OUTSIDE

ROOT = Path(__file__).parents[2]


class EarlierController:
    """The sources of a commit, in a temporary folder, and runs of their ``jump.yaml``.

    Args:
        commit: any name that git knows.

    Raises:
        AloftError: these sources are no git repository, or it has no such commit.
    """

    def __init__(self, commit: str) -> None:
        found = subprocess.run(
            ["git", "-C", str(ROOT), "archive", "--format=tar", commit],
            check=False, capture_output=True,
        )  # fmt: skip
        if found.returncode:
            reason = found.stderr.decode(errors="replace").strip().splitlines() or ["git failed"]
            raise AloftError(
                f"the sources of {commit} are not at hand: {reason[-1]}; "
                "--since needs a clone with its history"
            )
        self.commit = commit
        self._folder = tempfile.TemporaryDirectory(prefix="aloft_")
        with tarfile.open(fileobj=io.BytesIO(found.stdout)) as archive:
            archive.extractall(Path(self._folder.name) / "aloft", filter="data")

    def run(self) -> dict[str, float]:
        """Run its jump once, in a process of its own; returns the median time of every block of the
        controller [us], which contains neither the scheduler nor the recording.

        Raises:
            AssertionError: the run failed.
        """
        folder = Path(self._folder.name)
        done = subprocess.run(
            [sys.executable, "-m", "aloft", "run", "aloft/graphs/jump.yaml", "--json"],
            check=False, cwd=folder, capture_output=True, text=True, timeout=600,
            env={**os.environ, "PYTHONPATH": str(folder), "OMP_NUM_THREADS": "1",
                 "OPENBLAS_NUM_THREADS": "1"},
        )  # fmt: skip
        if done.returncode:
            raise AssertionError(f"the jump of {self.commit} failed: {done.stderr[-500:]}")
        blocks = json.loads(done.stdout)["blocks"]
        return {path: b["p50_us"] for path, b in blocks.items() if path not in OUTSIDE}

    def close(self) -> None:
        """Remove the sources."""
        self._folder.cleanup()
