"""A file of plans of many hops, from which the plan of any hop between them is interpolated.

All of them have the same knots, so that of any two plans the same rows belong together. The weights of
the plans are those of a moving least squares fit: they sum to one, and give every linear function
of the request exactly.
"""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....mathematics.arrays import Array
from ....mathematics.compiling.compile_calls import compile_calls
from ....mathematics.compiling.kernel_call import KernelCall
from ....mathematics.linear_algebra import product, solve_positive, weighted_sum
from ....planner.task.files import write_whole
from ....planner.task.phase import Phase
from ....planner.task.plan import ARRAYS, PlanFileError, PlannedJump
from .hop_request import HopReach, HopRequest, StepReach, task_of

FILE_FORMAT = "aloft hop plans 3"
SCALES = np.array([0.1, 0.1, 0.4, 0.05])
"""Difference of each part of a request that counts as a distance of 1."""
NEAR = 0.3
"""Distance within which plans count alike."""
KEPT_EXACTLY = ("contact", "phase")


@dataclass(frozen=True)
class PlanSamples:
    """Valid plans of one robot, all on level ground, or all up or down.

    Attributes:
        robot: its name.
        requests: (n, 4), one row a plan in the order of ``HopRequest``.
        arrays: those of ``PlannedJump``, each with a first axis of n.
        flights: lift-off and touchdown [s], (n, 2).
        reach: the limits of the requests that may be asked for.
    """

    robot: str
    requests: Array
    arrays: dict[str, NDArray[np.generic]]
    flights: Array
    reach: HopReach | StepReach

    def weights(self, wanted: HopRequest) -> Array:
        """Return the share of each plan in that of the request, (n,). Feet land in another way after a jump back than
        after one ahead, so plans of the other direction have none.
        """
        apart = differences(self.requests, wanted)
        square = (apart * apart).sum(axis=1)
        alike = (self.requests[:, 0] < 0.0) == (wanted.ahead < 0.0)
        trust = alike / (square + NEAR * NEAR) ** 3
        # w = trust (a + b . apart) with sum w = 1 and sum w apart = 0, for what differs among the plans.
        varied = apart[:, np.ptp(self.requests, axis=0) > 0.0]
        basis = np.concatenate([np.ones((len(apart), 1)), varied], axis=1)
        goal = np.zeros(basis.shape[1])
        goal[0] = 1.0
        solve_positive(product((basis * trust[:, None]).T, basis), goal)
        return np.asarray(trust * (basis * goal).sum(axis=1))

    def nearest(self, wanted: HopRequest) -> int:
        """Return the plan whose request is the nearest, of those within reach."""
        apart = differences(self.requests, wanted)
        square = (apart * apart).sum(axis=1)
        return int(np.where(self._within, square, np.inf).argmin())

    @cached_property
    def _within(self) -> NDArray[np.bool_]:
        """Whether each request is within reach."""
        requests = [HopRequest(*each) for each in self.requests.tolist()]
        return np.array([self.reach.nearest(each) == each for each in requests])

    def plan(self, row: int) -> PlannedJump:
        """Return one of the plans. Its flight begins and ends at knots, whose times are in single precision."""
        weights = np.eye(len(self.requests))[row]
        plan = self._make(HopRequest(*self.requests[row].tolist()), weights)
        flying = np.flatnonzero(plan.phase == Phase.FLIGHT)
        lift_off, touchdown = plan.time[[flying[0], flying[-1] + 1]].tolist()
        return replace(plan, lift_off_time=lift_off, touchdown_time=touchdown)

    def interpolated(self, wanted: HopRequest) -> PlannedJump:
        """Return a motion near the plan of a request. It obeys no law of motion exactly."""
        return self._make(wanted, self.weights(wanted))

    @cached_property
    def _mean(self) -> tuple[KernelCall, Array, Array]:
        """The call that sums all arrays and the flights, with the weights that it takes and what it gives."""
        parts = [array for name, array in self.arrays.items() if name not in KEPT_EXACTLY]
        side_by_side = [part.reshape(len(part), -1) for part in (*parts, self.flights)]
        rows = np.concatenate(side_by_side, axis=1, dtype=np.float64)
        weights, found = np.zeros(len(rows)), np.zeros(rows.shape[1])
        call = KernelCall(weighted_sum, weights, rows, found)
        compile_calls([call])
        return call, weights, found

    def _make(self, wanted: HopRequest, weights: Array) -> PlannedJump:
        call, given, found = self._mean
        given[:] = weights
        call.run()
        mean, values, start = found.copy(), dict[str, Any](), 0
        for name, array in self.arrays.items():
            if name in KEPT_EXACTLY:
                values[name] = array[0]
                continue
            values[name] = mean[start : start + array[0].size].reshape(array.shape[1:])
            start += array[0].size
        turn = values["position"][:, 3:7]
        turn /= np.linalg.norm(turn, axis=1)[:, None]
        lift_off, touchdown = mean[start:].tolist()
        return PlannedJump(
            task=task_of(wanted, self.robot, self.reach.rise),
            lift_off_time=lift_off,
            touchdown_time=touchdown,
            statistics={"coordinates": "full"},
            **values,
        )


def differences(requests: Array, wanted: HopRequest) -> Array:
    """Return the differences of requests (..., 4) from the wanted one, in units of ``SCALES``."""
    # A difference of height that no plan is made for is no distance between plans on level ground.
    other = np.array(wanted if not wanted.level else (*wanted[:3], 0.0))
    return np.asarray((requests - other) / SCALES)


def samples_of(
    robot: str,
    plans: Sequence[PlannedJump],
    asked: Sequence[HopRequest],
    reach: HopReach | StepReach,
) -> PlanSamples:
    """Return the plans of these requests together. Quaternions take the sign with w >= 0."""
    arrays = {name: np.stack([getattr(plan, name) for plan in plans]) for name in ARRAYS}
    turn = arrays["position"][:, :, 3:7]
    turn *= np.where(turn[:, :, 3:] < 0.0, -1.0, 1.0)
    flights = np.array([[plan.lift_off_time, plan.touchdown_time] for plan in plans])
    return PlanSamples(robot, np.array(asked, dtype=np.float64), arrays, flights, reach)


def write_samples(path: Path, samples: PlanSamples) -> Path:
    """Write the file, in single precision: plans made from it are solved and checked anew."""
    memory = io.BytesIO()
    header = json.dumps(
        {
            "format": FILE_FORMAT,
            "robot": samples.robot,
            "reach": samples.reach._asdict(),
            "units": ARRAYS,
        }
    )
    stored: dict[str, Any] = {
        name: array if name in KEPT_EXACTLY else array.astype(np.float32)
        for name, array in samples.arrays.items()
    }
    np.savez_compressed(
        memory,
        header=np.array(header),
        requests=samples.requests,
        flights=samples.flights,
        **stored,
    )
    return write_whole(path, memory.getvalue())


def read_samples(path: Path) -> PlanSamples:
    """Return the plans in a file.

    Raises:
        PlanFileError: there is no file, it is broken, or it is of another format.
    """
    try:
        with np.load(path, allow_pickle=False) as file:
            header = json.loads(str(file["header"]))
            if header.get("format") != FILE_FORMAT:
                raise PlanFileError(
                    f"{path} is of format {header.get('format')!r}, expected {FILE_FORMAT!r}"
                )
            arrays = {name: file[name] for name in ARRAYS}
            limits = header["reach"]
            reach = StepReach(**limits) if "least" in limits else HopReach(**limits)
            return PlanSamples(header["robot"], file["requests"], arrays, file["flights"], reach)
    except OSError as error:
        raise PlanFileError(f"cannot read {path}: {error.strerror or error}") from error
    except PlanFileError:
        raise
    except Exception as error:  # a damaged archive raises nearly anything
        raise PlanFileError(
            f"{path} has no plans of hops: {error or type(error).__name__}"
        ) from error
