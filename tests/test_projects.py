"""The projects in the documentation work from an empty folder with the built wheel, as described."""

import compileall
import json
import os
import re
import shutil
import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PROJECTS = ROOT / "docs" / "projects"
COMMANDS = re.compile(r"Run these in the folder:\n\n```\n(.*?)```", re.DOTALL)


@pytest.fixture(scope="module")
def bin_folder(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The programs of a fresh environment with the wheel alone; what it needs is seen from here."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False, symlinks=True)
    place = subprocess.run(
        [folder / "bin" / "python", "-c", "import sysconfig; print(sysconfig.get_path('purelib'))"],
        check=True, capture_output=True, text=True,
    )  # fmt: skip
    packages = Path(place.stdout.strip())
    shutil.unpack_archive(wheel, packages, "zip")
    compileall.compile_dir(packages, quiet=1)  # as pip does
    # The environment's own packages come first, so it is the wheel's aloft that is imported.
    others = [path for path in sys.path if path.endswith("site-packages")]
    (packages / "others.pth").write_text("\n".join(others) + "\n")
    program = folder / "bin" / "aloft"
    program.write_text(
        f"#!{folder / 'bin' / 'python'}\n"
        "from aloft.cli import main\n"
        "if __name__ == '__main__':\n    main()\n"  # its workers import it
    )
    program.chmod(0o755)
    return folder / "bin"


def run(bin_folder: Path, folder: Path, command: str) -> subprocess.CompletedProcess[str]:
    """Run a command line as a user would who has activated the environment."""
    kept = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    path = f"{bin_folder}{os.pathsep}{os.environ['PATH']}"
    return subprocess.run(
        command, shell=True, cwd=folder, env={**kept, "PATH": path}, capture_output=True,
        text=True, timeout=300, check=False,
    )  # fmt: skip


@pytest.fixture(params=["arm", "cart_pole", "quadrotor"])
def project(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    """A copy of a project's files in an empty folder."""
    folder = tmp_path / request.param
    ignored = shutil.ignore_patterns("__pycache__", "recordings", ".*")
    shutil.copytree(PROJECTS / request.param, folder, ignore=ignored)
    return folder


@pytest.mark.long
def test_every_command_of_the_page_works(bin_folder: Path, project: Path) -> None:
    where = run(bin_folder, project, "python -c 'import aloft; print(aloft.__file__)'")
    assert Path(where.stdout.strip()).is_relative_to(bin_folder.parent)
    (listed,) = COMMANDS.findall((project / "README.md").read_text())
    commands = listed.strip().splitlines()
    assert [command.split()[1] for command in commands] == ["robot", "check", "run", "run", "-m"]
    for command in commands:
        done = run(bin_folder, project, command)
        assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"


def test_the_page_lists_every_file(project: Path) -> None:
    text = (project / "README.md").read_text()
    for path in project.iterdir():
        assert path.name in text or path.name == "README.md"


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "graph", "metric", "most"),
    [("arm", "reach", "target_error_rad", 0.01),
     ("cart_pole", "balance", "largest_position", 0.05),
     ("quadrotor", "flight", "hover_error_after_m", 0.15)],
)  # fmt: skip
def test_the_graph_does_what_the_page_says(
    bin_folder: Path, tmp_path: Path, name: str, graph: str, metric: str, most: float
) -> None:
    shutil.copytree(PROJECTS / name, tmp_path / name)
    result = json.loads(
        run(bin_folder, tmp_path / name, f"aloft run {graph}.yaml --json --seeds 0:3").stdout
    )
    assert [row["seed"] for row in result["rows"]] == [0, 1, 2]
    for row in result["rows"]:
        assert row["success"] and row["metrics"][metric] < most
