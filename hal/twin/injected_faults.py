"""Faults that a twin can have: what goes wrong, from when, for how long, and where."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from pydantic import ValidationError

from ...files.validation import describe
from ...runtime.language.errors import AloftError
from ...runtime.language.parameters import Parameters, parameter

Kind = Literal[
    "lost", "truncated", "corrupted", "late", "corrupted_request", "dead", "stuck_encoder", "low_voltage",
    "hot", "second_writer", "pulled_cable", "pulled_board", "silent_board", "frozen_imu", "saturated_gyro", "stuck_switch",
    "open_switch", "bouncing_switch",
]  # fmt: skip

ANSWERS: tuple[Kind, ...] = ("lost", "truncated", "corrupted", "late")
"""The kinds that spoil answers of drives."""


class InjectedFault(Parameters):
    """One fault, as a graph has it: ``{kind: dead, start: 0.5 s, target: left_knee_motor}``."""

    kind: Kind = parameter(..., text="kind of the fault")
    start: float = parameter(0.0, unit="s", ge=0, text="start, after the robot was let go")
    duration: float = parameter(1e6, unit="s", gt=0, text="its duration; by default to the end")
    target: str = parameter(
        "", text="the motor, or the contact point of a switch; by default all of them"
    )
    share: float = parameter(
        1.0, gt=0, le=1, text="share of answers, requests or readings it befalls"
    )
    value: float = parameter(0.0, text="a low voltage [V], a high temperature [deg C]")


class InjectedFaults:
    """The faults at an instant. For a fault that befalls only a share, draws follow from the seed, the exchange and the
    place, so that they do not depend on those before."""

    def __init__(self, faults: Sequence[InjectedFault], seed: int) -> None:
        self._faults = tuple(faults)
        self._seed = seed
        self.now = -1.0
        self.exchange = 0

    def __bool__(self) -> bool:
        return bool(self._faults)

    def active(self, *kinds: Kind) -> list[InjectedFault]:
        """Return the faults of these kinds that are there now."""
        if not self._faults:
            return []
        return [
            fault
            for fault in self._faults
            if fault.kind in kinds and fault.start <= self.now < fault.start + fault.duration
        ]

    def of(self, target: str, *kinds: Kind) -> list[InjectedFault]:
        """Return the active faults that concern ``target``, after the draw of their share."""
        return [
            fault
            for fault in self.active(*kinds)
            if fault.target in ("", target) and self._applies(fault, target)
        ]

    def draw(self, target: str, purpose: int) -> np.random.Generator:
        """Random numbers for one exchange and place."""
        place = int.from_bytes(target.encode()[:6].ljust(6, b"_"), "big")
        return np.random.default_rng([self._seed, self.exchange, place, len(target), purpose])

    def _applies(self, fault: InjectedFault, target: str) -> bool:
        return fault.share >= 1.0 or bool(self.draw(target, 0).random() < fault.share)


def apply_fault(fault: InjectedFault, answer: bytes, draws: np.random.Generator) -> bytes:
    """Return the bytes of a drive's answer that really travel; empty where none do in time."""
    if fault.kind == "truncated":
        return answer[: int(draws.integers(0, len(answer)))]
    if fault.kind == "corrupted":
        return corrupt_byte(answer, draws)
    return b""


def corrupt_byte(data: bytes, draws: np.random.Generator) -> bytes:
    """Return the data with one byte changed at random."""
    hurt = bytearray(data)
    hurt[int(draws.integers(0, len(hurt)))] ^= int(draws.integers(1, 256))
    return bytes(hurt)


def read_fault(text: str) -> InjectedFault:
    """Read a fault from a text such as ``dead 0.5 left_knee_motor`` or ``lost 1 * share=0.1``: the kind, its start in
    seconds, its target (``*`` for all), and further settings.

    Raises:
        AloftError: it is none; the message names the mistake.
    """
    settings: dict[str, Any] = {}
    names = ["kind", "start", "target"]
    for word in text.split():
        name, equals, value = word.partition("=")
        if not equals:
            if not names:
                raise AloftError(f"fault {text!r}: {word!r} is one word too many")
            name, value = names.pop(0), word
        settings[name] = "" if value == "*" else value
    try:
        return InjectedFault.model_validate(settings)
    except ValidationError as error:
        first = describe(error.errors(include_url=False)[0], InjectedFault)
        raise AloftError(f"fault {text!r}: {first}") from error
