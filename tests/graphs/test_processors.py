"""A run has the same bytes whichever processor its kernels and NumPy's BLAS are made for."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

import aloft
from aloft.logs.recording.recorder import Recorder

ROOT = Path(aloft.__file__).parent
RUN = """
import sys, aloft
from aloft.mathematics.compiling import machine_code
result = aloft.load(sys.argv[1]).run()
assert not any("plain Python" in warning for warning in result.warnings), result.warnings
print(machine_code.processor()[0], result.run_hash)
"""


def run_for(processor: str, folder: Path | None) -> str:
    """The hash of a jump whose kernels are for a processor, compiled into a folder."""
    changed = {}
    if folder is not None:
        changed = {"XDG_CACHE_HOME": str(folder), "ALOFT_CPU_NAME": processor}
    name, run_hash = run_with(changed, "jump.yaml")
    assert (name == processor) == (folder is not None)
    return run_hash


def run_with(changed: dict[str, str], graph: str) -> list[str]:
    """The processor of the kernels and the hash of a run, with those variables set."""
    ours = ("ALOFT_CPU", "OPENBLAS_CORETYPE")
    environment = {name: value for name, value in os.environ.items() if not name.startswith(ours)}
    command = [sys.executable, "-c", RUN, str(ROOT / "graphs" / graph)]
    found = subprocess.run(
        command, env=environment | changed, check=True, capture_output=True, text=True
    )
    return found.stdout.split()


def instructions(folder: Path) -> int:
    """How often machine code in a folder begins an instruction of AVX (VEX, two bytes)."""
    return sum(file.read_bytes().count(b"\xc5") for file in folder.rglob("*.o"))


@pytest.mark.long
@pytest.mark.skipif(platform.machine() not in {"x86_64", "AMD64"}, reason="names of x86 processors")
@pytest.mark.parametrize("processor", ["haswell", "nehalem"])
def test_a_jump_has_the_same_bytes_on_another_processor(tmp_path, processor):
    assert run_for(processor, tmp_path) == run_for("this one", None)
    count = instructions(tmp_path)
    assert count > 3_000 if processor == "haswell" else count < 3_000


@pytest.mark.long
@pytest.mark.skipif(platform.machine() not in {"x86_64", "AMD64"}, reason="names of x86 processors")
@pytest.mark.parametrize("graph", ["turn_60deg.yaml", "hops.yaml"])
def test_a_jump_has_the_same_bytes_with_the_blas_of_another_processor(graph):
    """Preparing a run multiplies matrices by ``mathematics.reproducible``, and no block of these
    graphs uses BLAS; ``hops.yaml`` has ``InvariantKalmanFilter``."""
    types = ("Haswell", "Nehalem")
    hashes = {run_with({"OPENBLAS_CORETYPE": each}, graph)[1] for each in types}
    assert len(hashes) == 1


@pytest.mark.long
@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="glibc chooses by the processor")
def test_a_controller_has_the_same_bytes_with_the_c_library_of_another_processor(tmp_path):
    """Without FMA and AVX2 glibc's sine differs in its last bit; the controller has one of its own."""
    recording = tmp_path / "jump.rrd"
    aloft.load("aloft:jump.yaml").run(sinks=[Recorder(recording)]).raise_if_failed()
    command = [sys.executable, "-m", "aloft", "replay", str(recording), "--check"]
    older = os.environ | {"GLIBC_TUNABLES": "glibc.cpu.hwcaps=-FMA,-FMA4,-AVX2"}
    for inputs, code in (("recorded", 0), ("seed", 1)):  # MuJoCo takes the C library's
        done = subprocess.run(
            [*command, "--inputs", inputs], env=older, capture_output=True, text=True, check=False
        )
        if code == 0 or has_fma():
            assert done.returncode == code, done.stdout + done.stderr


def has_fma() -> bool:
    """Whether the processor has what the older one lacks."""
    return "fma" in Path("/proc/cpuinfo").read_text(encoding="utf-8").split()
