"""What is shipped: every sub-package, every data file, and a command line that starts at once."""

import json
import os
import shutil
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from collections.abc import Callable
from importlib import metadata
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

import aloft
from aloft.mathematics.compiling.machine_code import process_triple

ROOT = Path(__file__).parent.parent
NOT_SHIPPED = {
    "tests", "docs", "scripts", "lab", "recordings", "build", "dist", "aloft_robotics.egg-info",
}  # fmt: skip
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
LISTED = PROJECT["tool"]["setuptools"]["packages"]


def sub_packages() -> set[str]:
    tops = [p for p in ROOT.glob("*/") if p.name not in NOT_SHIPPED and not p.name.startswith(".")]
    folders = {path.parent for top in tops for path in top.rglob("__init__.py")}
    return {".".join(("aloft", *f.relative_to(ROOT).parts)) for f in folders} | {"aloft"}


def test_every_sub_package_is_listed() -> None:
    assert set(LISTED) == sub_packages()
    assert len(LISTED) == len(set(LISTED))


@pytest.mark.long
def test_the_wheel_holds_all_code_and_data(wheel: Path) -> None:
    inside = set(zipfile.ZipFile(wheel).namelist())
    expected = {"aloft/py.typed", "aloft/robots/bruce/bruce.yaml"}
    for package in LISTED:
        folder = ROOT.joinpath(*package.split(".")[1:])
        expected |= {f"{package.replace('.', '/')}/{path.name}" for path in folder.glob("*.py")}
    expected.add("aloft/blocks/general/example_policy.onnx")
    for path in (ROOT / "graphs").rglob("*.yaml"):
        expected.add(f"aloft/{path.relative_to(ROOT).as_posix()}")
    assert expected - inside == set()


def test_the_wheel_holds_nothing_else(wheel: Path) -> None:
    tops = {name.split("/")[0] for name in zipfile.ZipFile(wheel).namelist()}
    assert tops == {"aloft", f"aloft_robotics-{aloft.__version__}.dist-info"}
    shipped = {name.split("/")[1] for name in zipfile.ZipFile(wheel).namelist()}
    assert shipped.isdisjoint(NOT_SHIPPED)


@pytest.mark.long
def test_without_the_source_bench_says_how_to_get_the_benchmarks(
    wheel: Path, tmp_path: Path
) -> None:
    zipfile.ZipFile(wheel).extractall(tmp_path)
    packages = [path for path in sys.path if path.endswith("site-packages")]
    done = subprocess.run(
        # without `site`, which would find the checkout that is installed here
        [sys.executable, "-S", "-m", "aloft", "bench", "startup"],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path), *packages])},
        cwd=tmp_path,
        check=False,
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(
        "error: 'aloft bench' is part of the lab, which is not in the wheel; install aloft from"
    )
    assert "from a clone of its repository instead: pip install --editable ." in done.stderr


FIRST_RUN = """
import json
from pathlib import Path
import aloft
from aloft.mathematics.compiling.compile_calls import watchers

told = []
watchers.append(lambda done, total: told.append(total))
result = aloft.load(Path(aloft.__file__).parent / "graphs/jump.yaml").run({duration})
print(json.dumps([aloft.__file__, told, result.run_hash]))
"""


@pytest.mark.long
def test_a_wheel_with_machine_code_compiles_nothing_on_its_first_run(
    tracked_files: Path, tmp_path: Path, build: Callable[[str, Path, Path], Path]
) -> None:
    def python(*arguments: str, path: Path) -> str:
        packages = [entry for entry in sys.path if entry.endswith("site-packages")]
        environment = {
            "PYTHONPATH": os.pathsep.join([str(path), *packages]),
            "XDG_CACHE_HOME": str(tmp_path / "cache"),
        }
        command = [sys.executable, "-S", *arguments]
        done = subprocess.run(
            command, env=os.environ | environment, cwd=empty, check=False, capture_output=True, text=True
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout

    empty, source, installed = (tmp_path / name for name in ("empty", "aloft", "installed"))
    empty.mkdir()
    shutil.copytree(tracked_files, source)
    ship = [str(ROOT / "scripts" / "ship_kernels.py"), str(source / "graphs" / "jump.yaml")]
    told = python(*ship, "--triple", process_triple(), path=tmp_path)
    assert told.startswith(f"{process_triple()}.zip: ")
    zipfile.ZipFile(build("wheel", source, tmp_path / "wheel")).extractall(installed)
    shutil.rmtree(tmp_path / "cache", ignore_errors=True)
    file, compiled, run_hash = json.loads(
        python("-c", FIRST_RUN.format(duration=0.2), path=installed)
    )
    assert file.startswith(str(installed)) and compiled == []
    here = aloft.load(ROOT / "graphs" / "jump.yaml").run(0.2)
    assert run_hash == here.run_hash
    # a source that has changed is compiled
    with (installed / "aloft/blocks/jumping/landing_heuristic.py").open("a") as source_file:
        source_file.write("\n# changed\n")
    _, compiled, run_hash = json.loads(python("-c", FIRST_RUN.format(duration=0.2), path=installed))
    assert compiled and run_hash == here.run_hash


@pytest.mark.long
def test_the_source_distribution_has_what_the_benchmarks_need(
    source_distribution: Path, wheel: Path
) -> None:
    assert source_distribution.name == f"aloft_robotics-{aloft.__version__}.tar.gz"
    with tarfile.open(source_distribution) as tar:
        inside = {name.partition("/")[2] for name in tar.getnames()}
    expected = {path.relative_to(ROOT).as_posix() for path in (ROOT / "lab").rglob("*.py")}
    for name in zipfile.ZipFile(wheel).namelist():
        if name.startswith("aloft/"):
            expected.add(name.partition("/")[2])
    assert expected - inside == set()


def test_one_version() -> None:
    assert PROJECT["project"]["version"] == aloft.__version__ == metadata.version("aloft-robotics")
    assert yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"] == aloft.__version__
    major = aloft.__version__.rpartition(".")[0]
    assert f"| {major} | yes |" in (ROOT / "SECURITY.md").read_text()


def test_the_lock_file_is_of_these_requirements() -> None:
    """Whoever uses uv gets versions that fit: `uv lock` was run after the last change of pyproject.toml."""
    lock = tomllib.loads((ROOT / "uv.lock").read_text())
    (own,) = (package for package in lock["package"] if package["name"] == "aloft-robotics")
    groups = PROJECT["dependency-groups"]["dev"]
    asked = [
        *PROJECT["project"]["dependencies"], *groups,
        *(line for extra in PROJECT["project"]["optional-dependencies"].values() for line in extra),
    ]  # fmt: skip
    locked = {
        (entry["name"], SpecifierSet(entry.get("specifier", "")))
        for entry in (*own["metadata"]["requires-dist"], *own["metadata"]["requires-dev"]["dev"])
    }
    wanted = {
        (canonicalize_name(requirement.name), requirement.specifier)
        for requirement in map(Requirement, asked)
    }
    assert locked == wanted, "run: uv lock"
    versions = {package["name"]: package.get("version") for package in lock["package"]}
    for name, specifier in wanted - {("aloft-robotics", SpecifierSet(""))}:
        assert specifier.contains(versions[name] or "", prereleases=True), (name, versions[name])


def loaded_by(code: str) -> set[str]:
    """The top-level modules in memory after ``code`` in a fresh interpreter."""
    script = f"import sys\n{code}\nprint(' '.join(m for m in sys.modules if '.' not in m))"
    done = subprocess.run(
        [sys.executable, "-c", script], check=True, capture_output=True, text=True
    )
    return set(done.stdout.split())


@pytest.mark.parametrize("code", ["import aloft.cli", "import aloft; aloft.load"])
def test_importing_loads_no_heavy_library(code: str) -> None:
    heavy = {"mujoco", "pinocchio", "rerun", "qpsolvers", "scipy", "pyarrow", "daqp"}
    assert loaded_by(code) & heavy == set()


def test_importing_the_package_itself_loads_nothing() -> None:
    assert loaded_by("import aloft") & {"numpy", "pydantic", "typer", "yaml"} == set()


def test_the_package_page_has_nothing_that_an_index_cannot_show() -> None:
    text = (ROOT / PROJECT["project"]["readme"]).read_text()
    assert "](" not in text and "<img" not in text
    graph = text.split("```yaml\n")[1].split("```")[0]
    assert graph in (ROOT / "README.md").read_text()


def test_the_extra_all_has_every_extra_of_users() -> None:
    extras = PROJECT["project"]["optional-dependencies"]
    (all_of_them,) = extras["all"]
    assert set(all_of_them.split("[")[1].rstrip("]").split(",")) == set(extras) - {"all", "peers"}


def test_notice_names_every_robot_whose_file_is_from_elsewhere() -> None:
    notice = (ROOT / "NOTICE").read_text()
    for path in sorted((ROOT / "robots").glob("*/*.yaml")):
        assert path.stem in notice, path.stem


def test_the_root_hides_no_package_that_people_import_beside_aloft() -> None:
    """The root is the package, so Python in it finds our files first."""
    ours = {path.stem for path in ROOT.glob("*.py")} | {
        path.parent.name for path in ROOT.glob("*/__init__.py")
    }
    brought = {
        "gym",
        "gymnasium",
        "numpy",
        "mujoco",
        "pinocchio",
        "rerun",
        "control",
        "optuna",
        "mcap",
        "zenoh",
    }
    assert not ours & brought
