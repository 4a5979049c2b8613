"""The documentation is true: its files work as they stand, its links lead somewhere."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from types import FunctionType

import numpy as np
import pytest
import yaml

import aloft
from aloft.cli.block_pages import as_markdown, reference_pages
from aloft.cli.blocks import all_references
from aloft.robots.description import find_robot
from aloft.robots.importing.package_files import find_file
from aloft.runtime.language.block import Block
from aloft.runtime.language.registry import find_block
from aloft.runtime.language.runtime_block import BlockHooks
from aloft.runtime.loading import LoadError

ROOT = Path(__file__).parent.parent
FILE = re.compile(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```", re.DOTALL)
EXCERPT = re.compile(r"<!-- from: (\S+) -->\n```\w+\n(.*?)```", re.DOTALL)
YAML = re.compile(r"```yaml\n(.*?)```", re.DOTALL)
PAGES = [
    *sorted(ROOT.glob("*.md")),
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs/blocks").glob("*.md")),
]


@pytest.fixture(scope="module")
def tutorial(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with every file that the tutorial shows."""
    folder = tmp_path_factory.mktemp("tutorial")
    files = FILE.findall((ROOT / "docs" / "tutorial.md").read_text())
    assert [name for name, _ in files] == [
        "low_pass.py",
        "test_low_pass.py",
        "filter.yaml",
        "use.py",
        "hop.yaml",
        "my_jump.yaml",
        "my_study.yaml",
    ]
    for name, text in files:
        (folder / name).write_text(text)
    return folder


@pytest.mark.long
@pytest.mark.parametrize(
    "command",
    [
        ["pytest", "-q", "-p", "no:cacheprovider", "test_low_pass.py"],
        ["aloft", "check", "filter.yaml"],
        ["aloft", "graph", "filter.yaml"],
        ["aloft", "run", "filter.yaml", "--no-record", "--set", "filter.tau=0.2"],
        ["aloft", "blocks", "low_pass:LowPass"],
        ["use.py"],
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_the_tutorial_works(tutorial: Path, command: list[str]) -> None:
    if command[0] == "pytest":
        command = ["-m", *command]
    elif command[0] == "aloft":
        command = ["-c", "from aloft.cli import main; main()", *command[1:]]
    done = subprocess.run(
        [sys.executable, *command],
        cwd=tutorial,
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.long
def test_the_tutorials_study_of_ones_own_robot_is_right(tutorial: Path) -> None:
    source = find_file(
        "package://example-robot-data/robots/go1_description/urdf/go1.urdf", tutorial
    )
    if source is None:
        pytest.skip("the package example-robot-data is not installed (pip install it)")
    shutil.copy(source, tutorial / "go1.urdf")
    for command, says in (
        (["robot", "import", "go1.urdf"], "go1.yaml"),
        (["study", "my_study.yaml", "--dry-run"], "3 cells and 10 seeds: 30 runs; no problems"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "aloft", *command], cwd=tutorial,
            capture_output=True, text=True, timeout=240, check=False,
        )  # fmt: skip
        assert done.returncode == 0 and says in done.stdout, done.stdout + done.stderr


def test_the_whole_graph_in_the_documentation_runs(tmp_path: Path) -> None:
    from aloft import load

    whole = [
        t for t in YAML.findall((ROOT / "docs" / "graph_files.md").read_text()) if "rate:" in t
    ]
    path = tmp_path / "servo.yaml"
    path.write_text(whole[0])
    result = load(path).run()
    assert result.success
    # a proportional controller follows a slow sine with a lag of 1 / gain
    error = result.signal("error.y.value")
    assert 0.1 < abs(error[-100:]).max() < 1.0


@pytest.mark.long
def test_the_first_study_on_its_page_tells_three_filters_apart(tmp_path: Path) -> None:
    for name, text in FILE.findall((ROOT / "docs" / "studies.md").read_text()):
        (tmp_path / name).write_text(text)
    done = subprocess.run(
        [sys.executable, "-m", "aloft", "study", "filters.yaml", "--json"],
        cwd=tmp_path, capture_output=True, text=True, timeout=240, check=False,
    )  # fmt: skip
    rows = json.loads(done.stdout.splitlines()[-1])["rows"]
    assert [row["n"] for row in rows] == [10, 10, 10]
    assert [row["rate"] for row in rows] == [0.0, 0.9, 0.0]


def test_a_task_of_the_users_own_is_used_by_the_whole_body_controller(tmp_path: Path) -> None:
    """The files of docs/whole_body.md beside the shipped graphs, and the mistakes it speaks of."""
    (tmp_path / "graphs").symlink_to(ROOT / "graphs")
    text = (ROOT / "docs" / "whole_body.md").read_text()
    for name, content in FILE.findall(text):
        (tmp_path / name).write_text(content)
    loaded = aloft.load(tmp_path / "symmetric_jump.yaml")
    result = loaded.run(duration=0.1, log=False)
    assert result.metrics["qp_failures"] == 0
    other = aloft.load(ROOT / "graphs" / "jump.yaml").run(duration=0.1, log=False)
    assert result.run_hash != other.run_hash
    graph = YAML.findall(text)[0].replace("jump.yaml", "graphs/jump.yaml")
    (tmp_path / "listed.yaml").write_text(graph)
    assert aloft.load(tmp_path / "listed.yaml").run(duration=0.02, log=False).run_hash
    entry = (tmp_path / "symmetric_jump.yaml").read_text()
    for wrong, right, message in (
        ('SymmetricJoint"', 'SymmetricJoints"', "module 'symmetric' has no class"),
        (
            "first: left_wing",
            "first: right_knee",
            "symmetric:SymmetricJoints: bruce has no joint left",
        ),
        (
            "{mass: 3}",
            "{weight: 3}",
            "gain 'mass'.*its gains are weight, stiffness, damping, first, second",
        ),
        ("- Torso\n", "- TorsoOrientation\n", "no task called 'Torso'; did you mean TorsoOrien"),
    ):
        assert right in entry
        (tmp_path / "wrong.yaml").write_text(entry.replace(right, wrong))
        with pytest.raises(LoadError, match=message):
            aloft.load(tmp_path / "wrong.yaml")


def test_a_block_says_what_it_needs_of_a_robot(tmp_path: Path) -> None:
    """The block of docs/block_needs.md, with a wrong joint and with the right one."""
    text = (ROOT / "docs" / "block_needs.md").read_text()
    ((name, content),) = FILE.findall(text)
    (tmp_path / name).write_text(content)
    graph = (
        f"include: [{ROOT / 'graphs' / 'jump.yaml'}]\nblocks:\n  margin:\n"
        '    use: "joint_margin:JointMargin"\n    in: {joints: robot.joints}\n\n'
        "    with: {joint: left_kneee}\n"
    )
    path = tmp_path / "margin.yaml"
    path.write_text(graph)
    with pytest.raises(LoadError) as caught:
        aloft.load(path)
    report = str(caught.value)
    answer, *_ = re.findall(r"```text\n(.*?)\n```", text, re.DOTALL)
    assert answer in report and "left_knee" in report
    path.write_text(graph.replace("kneee", "knee"))
    result = aloft.load(path).run(duration=0.02)
    robot = find_robot("bruce")
    knee = [joint.name for joint in robot.joints].index("left_knee")
    angle = result.signal("robot.joints.position")[-1, knee]
    low, high = robot.joint_limits[knee]
    assert result.signal("margin.margin.value")[-1] == min(angle - low, high - angle)


def test_the_reference_of_blocks_is_up_to_date() -> None:
    folder = ROOT / "docs" / "blocks"
    written = {file.name: file.read_text() for file in folder.iterdir()}
    assert written == reference_pages(all_references(ours=True)), (
        "run: make docs (aloft blocks --markdown docs/blocks)"
    )


def test_the_example_of_every_block_is_a_block_of_a_graph() -> None:
    """It is YAML, its parameters are taken, and it wires what the block needs."""
    for block in all_references(ours=True):
        ((_, entry),) = yaml.safe_load(block.example).items()
        kind = find_block(entry["use"])
        needed = [name for name, port in kind.inputs.items() if not port.optional]
        assert (entry["use"], list(entry.get("in", {}))) == (block.name, needed)
        for name, value in entry.get("with", {}).items():
            assert kind.Params.model_fields[name].is_required(), (block.name, name)
            example = kind.example_parameters()[name]
            assert value == example or str(example).endswith(f"/{value}"), (block.name, name)


def test_no_page_of_blocks_needs_a_long_scroll() -> None:
    """Half of what the one page of all blocks once had is the most of a family."""
    sizes = {file.name: file.stat().st_size for file in (ROOT / "docs" / "blocks").iterdir()}
    assert max(sizes.values()) < 100_000 and len(sizes) >= 10, sizes


@pytest.mark.parametrize(
    ("text", "page"),
    [
        ("With ``law: paper``\nit is 2*x and y = a * b.", "With `law: paper`\nit is 2\\*x and y = a * b."),
        ("The law:\n\n    p^x = W |l|\n    q = <b>\n\nand so on", "The law:\n\n```text\np^x = W |l|\nq = <b>\n```\n\nand so on"),
        ("a <b> in lower <= u, y[n] = u[n-k]", "a \\<b> in lower <= u, y[n] = u[n-k]"),
        ("* one, with\n  a second line;\n* two", "* one, with\n  a second line;\n* two"),
    ],
)  # fmt: skip
def test_a_docstring_becomes_markdown(text: str, page: str) -> None:
    assert as_markdown(text) == page


def test_the_block_and_the_graph_of_the_readme_run_as_they_stand(tmp_path: Path) -> None:
    files = dict(FILE.findall((ROOT / "README.md").read_text()))
    assert list(files) == ["spring.py", "bounce.yaml"]
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    result = aloft.load(tmp_path / "bounce.yaml").run()
    place = result.signal("mass.y.value")
    # 2 kg on 300 N/m with 2 N s/m: after 2 s the amplitude is exp(-0.5 * 2) of that at the start
    assert result.success and abs(place[-200:]).max() == pytest.approx(0.1 * np.exp(-0.95), rel=0.1)


def test_excerpts_are_from_the_files_they_name() -> None:
    excerpts = [found for page in PAGES for found in EXCERPT.findall(page.read_text())]
    assert len(excerpts) > 12
    for path, text in excerpts:
        assert text in (ROOT / path).read_text(), path


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page: Path) -> None:
    for target, anchor in re.findall(r"\]\(([^)#\s]*)(?:#([^)\s]+))?[^)]*\)", prose(page)):
        if target.startswith("https://"):
            continue
        there = page.parent / target if target else page
        assert there.exists(), target
        if anchor:
            assert anchor in anchors(there), f"{target}#{anchor}"


def prose(page: Path) -> str:
    return re.sub(r"^```.*?^```", "", page.read_text(), flags=re.DOTALL | re.MULTILINE)


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as they are made where pages are shown."""
    headings = re.findall(r"^#+ +(.*?) *$", prose(page), flags=re.MULTILINE)
    plain = (re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings)
    return {heading.replace(" ", "-") for heading in plain}


def test_the_readme_shows_first_how_to_jump_and_to_test() -> None:
    first = (ROOT / "README.md").read_text().split("```sh\n")[1].split("```")[0].splitlines()
    targets = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE)
    shown = [line.split()[1] for line in first if line.startswith("make ")]
    assert shown == ["jump", "test"] and set(shown) <= set(targets)


def test_the_readme_shows_files_that_are_there() -> None:
    text = (ROOT / "README.md").read_text()
    for path in re.findall(r"`([\w/]+\.(?:py|yaml|md))`", text):
        assert (ROOT / path).is_file(), path


def test_the_tutorial_has_every_method_that_a_block_may_define() -> None:
    table = (
        (ROOT / "docs" / "tutorial.md").read_text().split("| method | when |")[1].split("\n\n")[0]
    )
    named = [
        name for row in table.splitlines()[2:] for name in re.findall(r"`(\w+)`", row.split("|")[1])
    ]
    own = {"request_stop"}  # to be called, not to be defined
    defined = {
        name
        for base in (Block, BlockHooks)
        for name, value in vars(base).items()
        if not name.startswith("_") and isinstance(value, FunctionType | classmethod)
    }
    assert sorted(named) == sorted(defined - own)
