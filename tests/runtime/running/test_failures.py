"""Errors of blocks: their text, and the statement of the user that they come from."""

import inspect
import traceback

import numpy as np
import pytest

from aloft.runtime.graph import load
from aloft.runtime.language.errors import BlockError, RunError
from aloft.runtime.running.failures import (
    Hang,
    blame,
    describe,
    locate,
    location_of,
    location_of_frames,
)


def line() -> int:
    """The line that calls this."""
    frame = inspect.currentframe()
    assert frame is not None and frame.f_back is not None
    return frame.f_back.f_lineno


def raised() -> tuple[Exception, int]:
    at = 0
    try:
        at = line() + 1
        np.linalg.inv(np.zeros((2, 2)))
    except np.linalg.LinAlgError as error:
        return error, at
    raise AssertionError


def test_the_text_has_the_type_unless_it_was_written_for_users() -> None:
    assert describe(ValueError("no such pose")) == "ValueError: no such pose"
    assert describe(ZeroDivisionError()) == "ZeroDivisionError"
    assert describe(BlockError("too heavy")) == "too heavy"
    assert describe(Hang()) == "it did not return in time"


def test_an_error_inside_a_library_is_placed_where_it_was_called() -> None:
    error, at = raised()
    frames = traceback.extract_tb(error.__traceback__)
    assert "site-packages" in frames[-1].filename, "it was raised inside NumPy"
    assert location_of(error) == f"{__file__}:{at}"
    # where nothing is the user's, the innermost statement of all
    inside = traceback.StackSummary.from_list(frames[1:])
    assert location_of_frames(inside) == f"{frames[-1].filename}:{frames[-1].lineno}"
    assert location_of_frames(traceback.StackSummary()) == "" and location_of(ValueError()) == ""


def test_a_place_and_a_traceback_are_noted_once() -> None:
    cause, at = raised()
    error = RunError("it failed")
    assert locate(error).where == "", "without a cause there is none"
    error.__cause__ = cause
    assert locate(error) is error
    assert error.where == f"{__file__}:{at}" and "Singular matrix" in error.traceback
    error.traceback, error.where = "said before", "there:1"
    assert locate(error).where == "there:1"


def test_whatever_a_block_raises_names_the_block_and_its_place() -> None:
    text = "rate: 100 Hz\nblocks:\n  one: {use: blocks.Constant, with: {value: [1.0]}}\n"
    (spec,) = load(text, path="graph.yaml").checked.blocks
    with pytest.raises(RunError) as caught, blame(spec, "start"):
        at = line() + 1
        raise KeyError("wheel\nleft")
    assert str(caught.value) == (
        f"graph.yaml:3:3: block 'one' failed in start: KeyError: 'wheel\\nleft' (at {__file__}:{at})"
    )
    assert caught.value.block == "one" and caught.value.where == f"{__file__}:{at}"
    with pytest.raises(RunError, match=r"in setup: too heavy$"), blame(spec, "setup"):
        raise BlockError("too heavy")
