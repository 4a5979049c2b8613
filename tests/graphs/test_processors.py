"""The kernels' machine code gives the same bytes whichever processor it is made for."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest

import aloft

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
    environment = {name: value for name, value in os.environ.items() if "NUMBA" not in name}
    if folder is not None:
        environment |= {"XDG_CACHE_HOME": str(folder), "NUMBA_CPU_NAME": processor}
    command = [sys.executable, "-c", RUN, str(ROOT / "graphs" / "jump.yaml")]
    found = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    name, run_hash = found.stdout.split()
    assert (name == processor) == (folder is not None)
    return run_hash


def instructions(folder: Path) -> int:
    """How often machine code in a folder begins an instruction of AVX (VEX, two bytes)."""
    return sum(file.read_bytes().count(b"\xc5") for file in folder.rglob("*.o"))


@pytest.mark.long
@pytest.mark.skipif(platform.machine() not in {"x86_64", "AMD64"}, reason="names of x86 processors")
@pytest.mark.parametrize("processor", ["haswell", "nehalem"])
def test_a_jump_has_the_same_bytes_on_another_processor(tmp_path, processor):
    assert run_for(processor, tmp_path) == run_for("this one", None)
    count = instructions(tmp_path)
    assert count > 10_000 if processor == "haswell" else count < 10_000
