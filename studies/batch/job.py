"""One job of many: doing it, and what came of it."""

from __future__ import annotations

import traceback
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ...runtime.language.errors import AloftError


@dataclass(frozen=True)
class JobResult:
    """The result of one job.

    Attributes:
        index: the job's number, counted from zero.
        value: what the function returned; ``None`` where it failed.
        error: why it failed; empty where it did not.
    """

    index: int
    value: Any
    error: str = ""


def attempt(function: Callable[[Any], Any], job: Any) -> tuple[Any, str]:
    """Do a job in the process that is to do it.

    Returns:
        What the function returned, and an empty text; or ``None``, and why the job failed.
    """
    try:
        return function(job), ""
    except AloftError as error:
        return None, str(error)
    except Exception as error:  # noqa: BLE001  (a mistake in one job must not cost the others)
        last = traceback.format_exception_only(error)[-1].strip()
        frames = traceback.extract_tb(error.__traceback__)
        where = f" ({frames[-1].filename}:{frames[-1].lineno})" if frames else ""
        return None, f"{last}{where}"
