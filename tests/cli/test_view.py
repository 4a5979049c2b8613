"""``aloft view``: what it refuses; what it shows is tested in tests/logs/viewing/test_viewer.py."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aloft.cli import make_app
from aloft.cli.shared.viewing import diagram_of, how_to_view
from aloft.logs.file.reader import read
from aloft.logs.replay.opened_run import OpenedRun
from aloft.runtime.language.errors import AloftError

ROOT = Path(__file__).parent.parent.parent


def view(*arguments: str | Path) -> tuple[int, str]:
    result = CliRunner().invoke(make_app(), ["view", *map(str, arguments)])
    return result.exit_code, result.output


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    code, text = view(tmp_path / "a.rrd")
    assert code == 2 and "there is no recording" in text and "`aloft run` writes one" in text


def test_options_that_mean_nothing(tmp_path: Path) -> None:
    code, text = view(tmp_path / "a.rrd", "--with", "b.rrd", "--no-show")
    assert code == 2 and "add --out FILE.rrd" in text


@pytest.mark.long
def test_what_is_shown_can_be_kept(tmp_path: Path) -> None:
    recording, kept = tmp_path / "count.rrd", tmp_path / "kept.rrd"
    graph = str(ROOT / "tests/cli/count.yaml")
    CliRunner().invoke(make_app(), ["run", graph, "--record", str(recording), "-q"])
    code, _ = view(recording, "--out", kept, "--no-show")
    assert code == 0 and kept.stat().st_size > 1000
    assert b"\x89PNG" in kept.read_bytes(), "the diagram is in it"
    before = recording.read_bytes()
    code, text = view(recording, "--out", recording, "--no-show")
    assert code == 2 and "would overwrite the recording; name another file" in text
    code, text = view(kept, "--layout", tmp_path / "own.yaml")
    assert code == 2 and "has no signals for the layout" in text
    assert recording.read_bytes() == before


@pytest.mark.long
def test_where_the_code_has_gone_there_is_no_diagram(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    recording, kept = tmp_path / "count.rrd", tmp_path / "kept.rrd"
    graph = str(ROOT / "tests/cli/count.yaml")
    CliRunner().invoke(make_app(), ["run", graph, "--record", str(recording), "-q"])
    assert diagram_of(read(recording)).startswith(b"\x89PNG")

    def gone(*_: object) -> None:
        raise AloftError("the graph cannot be loaded any more")

    monkeypatch.setattr(OpenedRun, "changed", gone)
    assert diagram_of(read(recording)) == b""
    code, _ = view(recording, "--out", kept, "--no-show")
    assert code == 0 and b"\x89PNG" not in kept.read_bytes()


def test_a_comparison_of_what_is_no_recording(tmp_path: Path) -> None:
    path = tmp_path / "a.rrd"
    path.write_text("nothing")
    code, text = view(path, "--with", path, "--out", tmp_path / "both.rrd", "--no-show")
    assert code == 2 and "is not a recording: it does not begin like" in text


@pytest.mark.long
def test_two_runs_become_one_file(tmp_path: Path) -> None:
    runner = CliRunner()
    paths = [tmp_path / name for name in ("a.rrd", "b.rrd")]
    for path, seed in zip(paths, ("0", "1"), strict=True):
        arguments = [str(ROOT / "graphs" / "jump.yaml"), "--record", str(path), "-q"]
        runner.invoke(
            make_app(), ["run", *arguments, "--duration", "0.05 s", "--set", f"robot.seed={seed}"]
        )
    both = tmp_path / "both.rrd"
    code, _ = view(paths[0], "--with", paths[1], "--out", both, "--no-show")
    assert code == 0
    from rerun.chunk import RrdReader

    entities = {str(chunk.entity_path) for chunk in RrdReader(both).stream()}
    for root in ("a", "b"):
        assert f"/{root}/signals/robot/truth/com" in entities
        assert any(entity.startswith(f"/{root}/world/robot/") for entity in entities)


def test_many_seeds_are_not_shown() -> None:
    arguments = ["run", str(ROOT / "graphs" / "jump.yaml"), "--seeds", "0:2", "--rerun", "web"]
    result = CliRunner().invoke(make_app(), arguments)
    assert result.exit_code == 2 and "--rerun is for one run" in result.output


def test_without_a_screen_the_run_goes_on(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(ROOT)
    arguments = ["run", str(ROOT / "tests/cli/count.yaml"), "--rerun", "live", "--no-record"]
    result = CliRunner().invoke(make_app(), arguments)
    assert result.exit_code == 0
    assert (
        "the run is not shown: the Rerun viewer cannot be shown: there is no screen"
        in result.output
    )


def test_without_a_screen_json_says_so_too(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.chdir(ROOT)
    arguments = ["run", str(ROOT / "tests/cli/count.yaml"), "--rerun", "live", "--no-record"]
    result = CliRunner().invoke(make_app(), [*arguments, "--json"])
    assert any("there is no screen" in text for text in json.loads(result.stdout)["warnings"])


def test_the_command_that_shows_a_recording_is_as_short_as_the_path_allows(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "bin" / "aloft"
    program.parent.mkdir()
    program.touch(mode=0o755)
    monkeypatch.setattr("sys.argv", [str(program)])
    monkeypatch.setenv("PATH", str(tmp_path))
    assert how_to_view(Path("a.rrd")) == f"{program} view a.rrd"
    monkeypatch.chdir(tmp_path)
    assert how_to_view(Path("a.rrd")) == "bin/aloft view a.rrd"
    monkeypatch.setenv("PATH", str(program.parent))
    assert how_to_view(Path("a.rrd")) == "aloft view a.rrd"
