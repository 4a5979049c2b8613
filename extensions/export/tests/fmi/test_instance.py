"""The library of an FMU lets go of Python before the process ends."""

import subprocess
import sys
from pathlib import Path

import pytest
from tests.needed import needs

from aloft.extensions.export.fmi.exporting.write import export
from aloft.extensions.export.fmi.instance import release_at_exit

needs("fmpy", "pythonfmu3")
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="the fault is of Linux alone")

GRAPH = """\
rate: 100 Hz
duration: 0.05 s
blocks: {wave: {use: blocks.WhiteNoise, with: {std: 1}}}
"""
USER = """\
rate: 100 Hz
duration: 0.05 s
blocks: {wave: {use: export.CoSimulation, with: {file: wave.fmu}}}
"""
WATCHED = """\
import atexit
import fmpy
import aloft

released = []
register = atexit.register
register(lambda: print(*released))  # the first that is registered runs last


def watch(function, *given, **named):
    def called():
        released.append(getattr(function, "__name__", ""))
        function(*given, **named)
    register(called)
    return function


atexit.register = watch
"""
BY_FMPY = WATCHED + "for _ in range(2): fmpy.simulate_fmu('wave.fmu', stop_time=0.05)\n"
# the block makes one instance to learn what the FMU can do, and one to run; each has a library
BY_ALOFT = WATCHED + "aloft.load('user.yaml').run().raise_if_failed()\n"


@pytest.mark.long
@pytest.mark.parametrize("program", [BY_FMPY, BY_ALOFT])
def test_each_of_two_libraries_is_released_once_before_the_exit(
    program: str, tmp_path: Path
) -> None:
    (tmp_path / "graph.yaml").write_text(GRAPH)
    (tmp_path / "user.yaml").write_text(USER)
    export(str(tmp_path / "graph.yaml"), tmp_path / "wave.fmu")
    done = subprocess.run(
        [sys.executable, "-c", program], check=False, cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split().count("finalizePythonInterpreter") == 2, done.stdout


def test_a_library_that_is_not_loaded_stays_so(tmp_path: Path) -> None:
    file = tmp_path / "x86_64-linux" / "none.so"
    file.parent.mkdir()
    file.write_bytes(b"no library")
    release_at_exit(tmp_path)
