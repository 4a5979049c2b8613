"""The graphs that are installed with aloft, and their addresses: ``aloft:jump``."""

from __future__ import annotations

from pathlib import Path

from .problems import nearest

PREFIX = "aloft:"
FOLDER = Path(__file__).parents[2] / "graphs"


def shipped_graphs() -> dict[str, Path]:
    """The files of all shipped graphs by address, such as ``aloft:jump``, sorted."""
    files = [*FOLDER.glob("*.yaml"), *FOLDER.glob("robots/*.yaml")]
    by_name = {path.relative_to(FOLDER).with_suffix("").as_posix(): path for path in files}
    return {f"{PREFIX}{name}": by_name[name] for name in sorted(by_name)}


def graph_path(path: str | Path) -> Path:
    """The file that a path or an address stands for; what is no known address stays as it is."""
    text = str(path)
    if not text.startswith(PREFIX):
        return Path(path)
    return shipped_graphs().get(text.removesuffix(".yaml"), Path(path))


def addresses_like(path: Path) -> tuple[str, ...]:
    """The addresses of shipped graphs that may be meant by a path where there is no file."""
    known = shipped_graphs()
    wanted = f"{PREFIX}{str(path.with_suffix('')).removeprefix(PREFIX).removeprefix('graphs/')}"
    return (wanted,) if wanted in known else nearest(wanted, known)


def summary(path: Path) -> str:
    """What the comment at the top of a file says first; empty where there is none."""
    words: list[str] = []
    for line in path.read_text(encoding="utf-8").splitlines():
        if not line.startswith("# "):
            break
        words.append(line.removeprefix("# "))
    return " ".join(words).partition(". ")[0].rstrip(".")
