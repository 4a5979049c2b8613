"""A stretch of a recorded run as a test of one block: its first state, inputs and expected outputs.

``aloft test --recording FILE --block NAME --ticks A:B`` writes such a test and the data beside it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...robots.description import RobotDescription
from ..language.block import Block
from ..language.parameter_change import Adjustment
from ..loading.checking.parameters import adjust
from ..running.differences import bits, ulp_distance
from ..running.live_parameters import LiveParameters
from .bench import BlockBench

Arrays = Mapping[str, NDArray[Any]]


class StretchError(AssertionError):
    """A block's outputs differ from the recorded ones; the message names the first difference."""


@dataclass(frozen=True)
class Setting:
    """Environment of a block, on which its outputs depend besides its parameters and inputs.

    These are the base ``rate`` [Hz], the ``period_ticks`` between two runs, the sizes of the
    ``dimensions``, the names of the ``wired`` inputs, the ``robot`` as plain data, and the
    parameters that were changed live, by tick.
    """

    rate: float
    period_ticks: int
    dimensions: Mapping[str, int]
    wired: tuple[str, ...]
    robot: Mapping[str, Any] | None = None
    changes: tuple[tuple[int, str, Any], ...] = ()


@dataclass(frozen=True)
class Stretch:
    """One block in some ticks of a run.

    Attributes:
        ticks: the ticks in which the block ran, (n,).
        state: every field of its state before the first of these ticks, by ``port.field``.
        before: its outputs before the first of these ticks, by ``port.field``.
        inputs, outputs: every field of its wired inputs and of its outputs, (n, ...).
    """

    setting: Setting
    ticks: NDArray[np.int64]
    state: Arrays = field(default_factory=dict)
    before: Arrays = field(default_factory=dict)
    inputs: Arrays = field(default_factory=dict)
    outputs: Arrays = field(default_factory=dict)

    def write(self, path: Path) -> None:
        """Write everything to one ``.npz`` file. Raises ``OSError``."""
        arrays: dict[str, Any] = {
            "setting": np.array(json.dumps(asdict(self.setting))),
            "ticks": self.ticks,
        }
        for group in ("state", "before", "inputs", "outputs"):
            arrays |= {f"{group}/{name}": value for name, value in getattr(self, group).items()}
        np.savez_compressed(path, allow_pickle=False, **arrays)

    @classmethod
    def read(cls, path: Path) -> Self:
        """Read a file that ``write`` has written. Raises ``OSError``."""
        groups: dict[str, dict[str, NDArray[Any]]] = {}
        with np.load(path, allow_pickle=False) as file:
            data = json.loads(str(file["setting"]))
            ticks = file["ticks"]
            for key in file.files:
                group, slash, name = key.partition("/")
                if slash:
                    groups.setdefault(group, {})[name] = file[key]
        data["wired"] = tuple(data["wired"])
        data["changes"] = tuple(tuple(change) for change in data["changes"])
        return cls(Setting(**data), ticks, **groups)

    @property
    def robot(self) -> RobotDescription | None:
        """The robot of the recorded run."""
        data = self.setting.robot
        return None if data is None else RobotDescription.model_validate(data)

    def check(
        self,
        block_type: type[Block],
        parameters: Mapping[str, Any],
        *,
        robot: str | RobotDescription | None = None,
        folder: Path | None = None,
        rtol: float = 0.0,
        atol: float = 0.0,
    ) -> None:
        """Run the block through the stretch and compare every element of every output.

        Args:
            block_type: the block's class.
            parameters: its parameters, as a graph file would give them.
            robot: the robot's name or description; by default the recorded description.
            folder: the folder that files named by a parameter are relative to.
            rtol, atol: floats must satisfy |found - expected| <= atol + rtol |expected|; with both
                zero every bit must be the same. Integers and booleans must always be equal.

        Raises:
            StretchError: an output differs; the message names the first one and its distance.
        """
        setting = self.setting
        with BlockBench(
            block_type, parameters, robot=robot or self.robot, rate=setting.rate,
            period_ticks=setting.period_ticks, dimensions=setting.dimensions,
            wired=setting.wired, folder=folder,
        ) as bench:  # fmt: skip
            self._restore(bench)
            changes = list(setting.changes)
            for row, tick in enumerate(self.ticks.tolist()):
                while changes and changes[0][0] <= tick:
                    _change(bench, *changes.pop(0))
                bench.clock.tick = tick
                for name, values in self.inputs.items():
                    port, _, entry = name.partition(".")
                    bench.set(port, **{entry: values[row]})
                bench.step()
                for name, values in self.outputs.items():
                    self._compare(bench, name, values[row], tick, rtol, atol)

    def _restore(self, bench: BlockBench[Block]) -> None:
        for name, value in self.state.items():
            port, _, entry = name.partition(".")
            bench.set(port, **{entry: value})
        for name, value in self.before.items():
            port, _, entry = name.partition(".")
            np.copyto(bench.get(port).views()[entry], value)
        bench.clock.tick = int(self.ticks[0]) if len(self.ticks) else 0
        bench.block.load_state()

    def _compare(
        self, bench: BlockBench[Block], name: str, expected: NDArray[Any], tick: int,
        rtol: float, atol: float,
    ) -> None:  # fmt: skip
        port, _, entry = name.partition(".")
        found = bench.get(port).views()[entry]
        if found.shape != expected.shape:
            raise StretchError(f"{name} has shape {found.shape}, expected {expected.shape}")
        wrong = bits(found) != bits(np.asarray(expected, found.dtype))
        if found.dtype == np.float64 and (rtol or atol):
            wrong &= ~np.isclose(found, expected, rtol, atol, equal_nan=True)
        if not wrong.any():
            return
        place = tuple(int(i) for i in np.argwhere(wrong)[0])
        now, was = found[place].item(), expected[place].item()
        index = f"[{', '.join(map(str, place))}]" if place else ""
        distance = ulp_distance(was, now) if isinstance(was, float) else None
        more = int(wrong.sum()) - 1
        raise StretchError(
            f"tick {tick}: {name}{index} is {now!r}, recorded was {was!r}"
            + ("" if distance is None else f", {distance} ULP apart")
            + (f" (and {more} more elements of this field)" if more else "")
        )


def _change(bench: BlockBench[Block], tick: int, name: str, value: Any) -> None:
    """Change a parameter between two ticks, as it was changed in the run."""
    path = bench.block.context.path
    adjustment: Adjustment = adjust({path: bench.block}, {f"{path}.{name}": value})
    LiveParameters({path: bench.block}).apply(adjustment, tick)
