"""The shipped studies: their files are right, and so is what they set in their graphs."""

from pathlib import Path

import pytest

import aloft
from aloft.extensions.analysis.studies.falsification import end_cells, searched_cells
from aloft.studies.expansion import Cell, cells, checked_cells
from aloft.studies.reading import read_study
from aloft.studies.tuning import extreme_cells, tuning_cells

STUDIES = sorted((Path(aloft.__file__).parent / "graphs" / "studies").glob("*.yaml"))


def each_label_once(expanded: list[Cell]) -> list[Cell]:
    """Enough cells that every label of every axis is among them."""
    seen: set[tuple[str, str]] = set()
    found = []
    for cell in expanded:
        if not seen.issuperset(cell.labels.items()):
            seen |= set(cell.labels.items())
            found.append(cell)
    return found


@pytest.mark.long
@pytest.mark.parametrize("path", STUDIES, ids=lambda path: path.stem)
def test_every_graph_takes_what_is_set(path: Path) -> None:
    if path.stem.endswith(".tuned"):
        pytest.skip("what tuning has found, no study")
    study = read_study(path)
    chosen = each_label_once(list(cells(study)))
    if study.tuning is not None:
        tried = tuning_cells(study)
        assert tried
        chosen += extreme_cells(study, tried)
    if study.falsification is not None:
        chosen += end_cells(study, searched_cells(study))
    assert len(checked_cells(chosen, study, "")) == len(chosen)
    assert min(study.seeds) >= 1000, "what a study reports is not what gains were tuned on"
