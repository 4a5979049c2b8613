"""What a recording says of files, plans and the processor's BLAS kernel."""

import os
import subprocess
import zlib
from base64 import b64encode
from hashlib import sha256
from pathlib import Path

import pytest

from aloft.logs.file.dependencies import MOST_BYTES, other_files, project_state, unpacked
from aloft.logs.file.header import header_of, machine
from aloft.runtime.language.block import Block, Output
from aloft.runtime.language.parameters import Parameters, parameter
from aloft.runtime.language.signals import Field, Signal
from aloft.runtime.running.memory import BoundGraph
from aloft.runtime.testing.graphs import BlockUse, checked_graph


class Number(Signal):
    value = Field()


class Reads(Block):
    """A block that names a file and finds another one itself."""

    y = Output(Number)

    class Params(Parameters):
        table: str = parameter("", text="a file")

    def setup(self) -> None:
        self.files_read = (Path(self.params.table).with_name("plan.npz"),)

    def step(self) -> None:
        """Nothing."""


def test_files_are_known_by_their_content(tmp_path: Path) -> None:
    (tmp_path / "table.csv").write_text("1")
    (tmp_path / "plan.npz").write_text("2")
    name = str(tmp_path / "table.csv")
    bound = BoundGraph(checked_graph({"r": BlockUse(Reads, {"table": name})}))
    header = header_of(bound)
    then = header.files
    assert then == {
        f"r.table: {name}": sha256(b"1").hexdigest(),
        "r: plan.npz": sha256(b"2").hexdigest(),
    }
    assert {digest: unpacked(text) for digest, text in header.contents.items()} == {
        sha256(b"1").hexdigest(): b"1",
        sha256(b"2").hexdigest(): b"2",
    }
    (tmp_path / "plan.npz").write_text("another plan")
    now = header_of(bound).files
    assert other_files(then, now) == ["the file of r: plan.npz has other content"]
    assert other_files(then, {}) == [
        f"the file of r.table: {name} is not there, or is not used any more",
        "the file of r: plan.npz is not there, or is not used any more",
    ]


def test_the_kernel_of_blas_is_named() -> None:
    assert machine()["blas kernel"]


def test_the_state_of_the_project_is_named(tmp_path: Path) -> None:
    assert project_state(tmp_path) == ""
    git = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b"]
    (tmp_path / "a").write_text("1")
    for arguments in (["init", "-q"], ["add", "a"], ["commit", "-qm", "first"]):
        subprocess.run([*git, *arguments], check=True)
    clean = project_state(tmp_path)
    assert len(clean) == 40
    (tmp_path / "a").write_text("2")
    assert project_state(tmp_path) == f"{clean} with changes"


def test_asking_for_the_state_of_the_project_writes_nothing(tmp_path: Path) -> None:
    git = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b"]
    (tmp_path / "a").write_text("1")
    for arguments in (["init", "-q"], ["add", "a"], ["commit", "-qm", "first"]):
        subprocess.run([*git, *arguments], check=True)
    os.utime(tmp_path / "a", (1e9, 1e9))  # the index would be refreshed
    index = (tmp_path / ".git" / "index").read_bytes()
    assert len(project_state(tmp_path)) == 40
    assert (tmp_path / ".git" / "index").read_bytes() == index


def test_no_program_of_a_project_runs(tmp_path: Path) -> None:
    git = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@b"]
    (tmp_path / "a.x").write_text("1")
    (tmp_path / ".gitattributes").write_text("*.x filter=strange\n")
    for arguments in (["init", "-q"], ["add", "."], ["commit", "-qm", "first"]):
        subprocess.run([*git, *arguments], check=True)
    marker = tmp_path.parent / f"{tmp_path.name}-marker"
    for key in ("core.fsmonitor", "filter.strange.clean"):
        subprocess.run([*git, "config", key, f"touch {marker}; cat"], check=True)
    os.utime(tmp_path / "a.x", (1e9, 1e9))  # so that git would compare the content
    assert len(project_state(tmp_path)) == 40
    assert not marker.exists()
    subprocess.run([*git, "status"], check=False, capture_output=True)
    assert marker.exists(), "git itself runs them"


def test_what_unpacks_to_too_much_is_refused() -> None:
    packed = b64encode(zlib.compress(bytes(MOST_BYTES + 1))).decode()
    with pytest.raises(ValueError, match="unpacks to more than 64 MiB"):
        unpacked(packed)
    with pytest.raises(ValueError, match="cut off"):
        unpacked(b64encode(zlib.compress(b"abc" * 100)[:-8]).decode())
