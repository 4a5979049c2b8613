"""A verb's block ends at a signal, whatever the code under way makes of the interrupt."""

from __future__ import annotations

import os
import signal
from typing import Any

import pytest
from pydantic import BaseModel, model_serializer

from aloft.cli.shared.output import stopped_by_signals


class Interrupted(BaseModel):
    """It gets a signal while pydantic's compiled code calls back."""

    @model_serializer
    def _interrupt(self) -> dict[str, Any]:
        os.kill(os.getpid(), signal.SIGINT)
        return {}


def test_an_interrupt_ends_the_block() -> None:
    with stopped_by_signals() as received:
        os.kill(os.getpid(), signal.SIGTERM)
        pytest.fail("the signal did not end the block")
    assert received == [signal.SIGTERM]


def test_an_interrupt_that_compiled_code_makes_another_error_of_ends_it_too() -> None:
    with stopped_by_signals() as received:
        Interrupted().model_dump()
        pytest.fail("the signal did not end the block")
    assert received == [signal.SIGINT]


def test_other_errors_leave_the_block() -> None:
    with pytest.raises(ZeroDivisionError), stopped_by_signals():
        _ = 1 // 0
