"""Every block of ours keeps the promises of all blocks."""

import pytest

from aloft.runtime.language.registry import find_block, known_names
from aloft.runtime.testing.conformance import check_block, conformance_cases


@pytest.mark.parametrize("case", conformance_cases())
@pytest.mark.parametrize("name", known_names())
def test_conformance(name: str, case: str) -> None:
    check_block(find_block(name), robot="bruce", cases=[case])
