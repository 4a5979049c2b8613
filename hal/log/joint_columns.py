"""Guesses which joint of a robot each column of a log is, where the log does not say, and how sure that is.

Orders that drivers have are tried: the columns of each leg side by side or turn by turn, along the chain, against it or by
the alphabet. Feet that stand tell which of them it is (``standing_feet``); if none, columns are exchanged as long as the feet stand
stiller. Limits of the joints exclude others. What carries no foot is told by limits and by custom alone: whole limbs side by side.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations, product
from typing import Literal

import numpy as np

from ...mathematics.arrays import Array, Flags2D
from ...robots.robot_description import RobotDescription
from .standing_feet import RATE, LoggedMotion, StandingFeet

SURE = 1.3
"""Times the unrest of feet by another order, above which that one is excluded."""
FLOOR = 0.3
"""Unrest that is added to both: below it, unrest tells nothing."""
LEAST_ROWS = 20
OUTSIDE, OFTEN = 0.1, 0.05
"""A distance [rad, m] beyond a joint's limits, and a share of rows there, that exclude a column."""
ROUNDS = 60
WORK = 1000
"""Exchanges of two columns, of which a search tries all at each step, times searches."""
AGREED = 1.01
"""Times the least unrest, below which another search has come to the same order, or to one that is as good."""
MOST_LIMBS = 6
"""Limbs without feet of which all orders are tried."""
_SIDES = re.compile(r"(^|_)(l|r|left|right)(?=_|$)", re.IGNORECASE)

Orders = dict[int, int]
"""The column of each joint that carries a foot."""


@dataclass(frozen=True)
class ColumnGuess:
    """The joint of one column: none where nothing tells it.

    Attributes:
        sure: ``told`` by standing feet, ``likely`` by them and the order of its leg, ``assumed`` by custom alone, ``open``.
        why: in words.
    """

    joint: str | None
    sure: Literal["told", "likely", "assumed", "open"]
    why: str


@dataclass(frozen=True)
class _Legs:
    """The columns of the legs' joints, and by joint how much less still feet would stand with another column there: of all orders,
    and of an exchange with any one column."""

    columns: Orders
    unrest: float
    margin: dict[int, float]
    exchange: dict[int, float]
    by_order: bool


def guess_columns(robot: RobotDescription, motions: Sequence[LoggedMotion]) -> list[ColumnGuess]:
    """Return a guess for each column.

    Args:
        robot: whose joints they are.
        motions: the same columns, by each of what may tell how the base moves; the most decisive one counts.
    """
    names = [joint.name for joint in robot.joints]
    count = motions[0].position.shape[1]
    fits = within_limits(robot, motions[0].position)
    looked = [StandingFeet(robot, motion) for motion in motions]
    found = [legs for feet in looked if (legs := _legs(feet, fits))]
    if not found and any(len(feet.rows) >= LEAST_ROWS for feet in looked):
        why = "no order that a driver may have lets the feet stand still, nor do searches for one agree"
        return [ColumnGuess(None, "open", why)] * count
    if not found:
        return _assumed(names, count, fits)
    legs = max(found, key=lambda each: min(each.margin.values()))
    guesses: list[ColumnGuess | None] = [None] * count
    for j, column in legs.columns.items():
        guesses[column] = _judged(names[j], legs, j)
    others = [column for column, guess in enumerate(guesses) if guess is None]
    rest = _rest(robot, [j for j in range(len(names)) if j not in legs.columns], others, fits)
    for column, guess in zip(others, rest, strict=True):
        guesses[column] = guess
    return [guess for guess in guesses if guess is not None]


def unrest_of(robot: RobotDescription, motion: LoggedMotion, names: Sequence[str]) -> float | None:
    """Return the unrest of the feet with the columns' names; none where no foot stands or a joint of a leg has no column."""
    feet, columns = _named(robot, motion, names)
    return None if columns is None else feet.unrest(columns)


def stiller(robot: RobotDescription, motion: LoggedMotion, names: Sequence[str]) -> float | None:
    """Return how many times as restless as with the best exchange of columns the feet are with the columns' names; none as above."""
    feet, columns = _named(robot, motion, names)
    if columns is None:
        return None
    fits = within_limits(robot, motion.position)
    return _times(feet.unrest(columns), _exchanged(feet, fits, columns)[0])


def _named(
    robot: RobotDescription, motion: LoggedMotion, names: Sequence[str]
) -> tuple[StandingFeet, Orders | None]:
    feet = StandingFeet(robot, motion)
    own = [robot.joints[j].name for j in feet.joints]
    if len(feet.rows) < LEAST_ROWS or not set(own) <= set(names):
        return feet, None
    return feet, {j: names.index(name) for j, name in zip(feet.joints, own, strict=True)}


def within_limits(robot: RobotDescription, position: Array) -> Flags2D:
    """Return which joint each column may be by its limits, (n_joints, n_columns)."""
    limits = robot.joint_limits[:, :, None, None]
    outside = (position < limits[:, 0] - OUTSIDE) | (position > limits[:, 1] + OUTSIDE)
    fits: Flags2D = outside.mean(axis=1) < OFTEN
    return fits


def _judged(name: str, legs: _Legs, joint: int) -> ColumnGuess:
    margin, exchange = legs.margin[joint], legs.exchange[joint]
    least = min(margin, exchange)
    if least >= SURE:
        return ColumnGuess(
            name, "told", f"any other column makes the feet {least:.1f} times as restless"
        )
    if margin >= SURE and legs.by_order:
        why = f"the order along its leg; other orders make the feet {margin:.1f} times as restless"
        return ColumnGuess(name, "likely", why)
    why = (
        f"perhaps {name}, but with another order the feet stand nearly as still ({least:.2f} times)"
    )
    return ColumnGuess(None, "open", why)


def _assumed(names: Sequence[str], count: int, fits: Flags2D) -> list[ColumnGuess]:
    """Return the robot's own order if it has as many joints and their limits allow it."""
    if count != len(names):
        return [ColumnGuess(None, "open", "nothing tells it")] * count
    if not fits[range(count), range(count)].all():
        return [
            ColumnGuess(None, "open", "the robot's own order is against its joints' limits")
        ] * count
    why = "the robot's own order, for there are as many; nothing tells it"
    return [ColumnGuess(name, "assumed", why) for name in names]


def _legs(feet: StandingFeet, fits: Flags2D) -> _Legs | None:
    """Return the order in which standing feet are stillest; none where none stands, or no order fits."""
    if len(feet.rows) < LEAST_ROWS:
        return None
    tried = [(feet.unrest(columns), columns) for columns in _orders(feet, fits)]
    ranked = sorted(tried, key=lambda each: each[0])
    unrest, columns = ranked[0] if ranked else (np.inf, {})
    rivals = ranked
    by_order = bool(ranked) and _times(unrest, _exchanged(feet, fits, columns)[0]) < SURE
    if not by_order:
        searched = _searched(feet, fits)
        if len(searched) < 2 or _times(searched[1][0], searched[0][0]) > AGREED:
            return None
        unrest, columns = searched[0]
        rivals = [*searched, *((feet.unrest(each), each) for each in _mirrored(feet, columns))]
    margin = dict.fromkeys(columns, np.inf)
    for value, rival in rivals:
        for j, column in columns.items():
            if rival[j] != column:
                margin[j] = min(margin[j], _times(value, unrest))
    exchange = {
        j: min(
            (_times(feet.unrest(each), unrest) for each in _exchanges(columns, j, fits)),
            default=np.inf,
        )
        for j in columns
    }
    return _Legs(columns, unrest, margin, exchange, by_order)


def _times(unrest: float, least: float) -> float:
    return (unrest + FLOOR) / (least + FLOOR)


def _orders(feet: StandingFeet, fits: Flags2D) -> Iterator[Orders]:
    """Give the orders that drivers have of the legs' columns."""
    count = fits.shape[1]
    names = [joint.name for joint in feet.robot.joints]
    legs = []
    for chain in feet.chains:
        found = set()
        for step in {1, len(feet.chains)}:
            span = step * (len(chain) - 1) + 1
            for start in range(count - span + 1):
                columns = range(start, start + span, step)
                for order in (chain, chain[::-1], sorted(chain, key=lambda j: names[j])):
                    if fits[order, columns].all():
                        found.add(tuple(sorted(zip(order, columns, strict=True))))
        legs.append(found)
    for each in product(*legs):
        whole = {j: column for leg in each for j, column in leg}
        if len(set(whole.values())) == sum(len(leg) for leg in each):
            yield whole


def _mirrored(feet: StandingFeet, columns: Orders) -> Iterator[Orders]:
    """Give the orders in which two legs have changed places."""
    for one, other in combinations(feet.chains, 2):
        if len(one) == len(other):
            pairs = list(zip(one, other, strict=True))
            yield columns | {a: columns[b] for a, b in pairs} | {b: columns[a] for a, b in pairs}


def _exchanges(columns: Orders, joint: int, fits: Flags2D) -> Iterator[Orders]:
    """Give the orders with another column for a joint; the joint that had it gets the first one's."""
    own = columns[joint]
    holder = {column: j for j, column in columns.items()}
    for column in np.flatnonzero(fits[joint]).tolist():
        other = holder.get(column)
        if column == own or (other is not None and not fits[other, own]):
            continue
        yield columns | {joint: column} | ({} if other is None else {other: own})


def _exchanged(feet: StandingFeet, fits: Flags2D, columns: Orders) -> tuple[float, Orders]:
    """Exchange columns as long as that makes the feet stand stiller; return the unrest and the order."""
    unrest = feet.unrest(columns)
    for _ in range(ROUNDS):
        trials = ((feet.unrest(e), e) for j in columns for e in _exchanges(columns, j, fits))
        least, best = min(trials, key=lambda each: each[0], default=(np.inf, columns))
        if least >= unrest - 1e-9:
            break
        unrest, columns = least, best
    return unrest, columns


def _searched(feet: StandingFeet, fits: Flags2D) -> list[tuple[float, Orders]]:
    """Return where searches from several orders end, the stillest first, until two ended at the best."""
    found: list[tuple[float, Orders]] = []
    for seed in (None, *range(max(2, WORK // (len(feet.joints) * fits.shape[1])))):
        start = _some_order(feet, fits, seed)
        if start is None:
            break
        found.append(_exchanged(feet, fits, start))
        found.sort(key=lambda each: each[0])
        if len(found) > 2 and _times(found[1][0], found[0][0]) < AGREED:
            break
    return found


def _some_order(feet: StandingFeet, fits: Flags2D, seed: int | None) -> Orders | None:
    """Return an order within the limits: at random, or by how each column turns the base over a standing foot: as its joint's axis
    does where the robot stands."""
    from scipy.optimize import linear_sum_assignment

    if seed is None:
        cost = _turning_apart(feet)
    else:
        cost = np.random.default_rng(seed).random((len(feet.joints), fits.shape[1]))
    cost = np.where(fits[feet.joints], cost, 1e3)
    rows, columns = linear_sum_assignment(cost)
    if len(rows) < len(feet.joints) or cost[rows, columns].max() >= 1e3:
        return None
    return {feet.joints[i]: int(column) for i, column in zip(rows, columns, strict=True)}


def _turning_apart(feet: StandingFeet) -> Array:
    """Return how far each column's axis, by least squares over standing feet, is from each joint's, (n_joints, n_columns)."""
    apart = np.zeros((len(feet.joints), feet.velocity.shape[1]))
    for f, chain in enumerate(feet.chains):
        rows = feet.closed[:, f]
        moving = feet.velocity[rows]
        turning = np.zeros((len(moving), 3)) if feet.rate is None else feet.rate[rows]
        known = moving.T @ moving / RATE**2 + np.eye(moving.shape[1])
        axes = np.linalg.solve(known, moving.T @ -turning / RATE**2)
        variance = np.diag(np.linalg.inv(known))
        for j, axis in zip(chain, feet.standing_axes(f), strict=True):
            squares = ((axes - axis) ** 2).sum(axis=1)
            apart[feet.joints.index(j)] = np.minimum(squares / (variance + 0.1), 20.0)
    return apart


def _rest(
    robot: RobotDescription, joints: Sequence[int], columns: Sequence[int], fits: Flags2D
) -> list[ColumnGuess]:
    """Return guesses of columns whose joints carry no foot: if just one order of limbs is possible."""
    names = [robot.joints[j].name for j in joints]
    possible = list(_limb_orders(robot, joints, columns, fits))
    found = []
    for k in range(len(columns)):
        mine = list(dict.fromkeys(order[k] for order in possible))
        if len(mine) == 1:
            name = robot.joints[mine[0]].name
            why = "whole limbs side by side, within their limits; no foot tells it"
            found.append(ColumnGuess(name, "assumed", why))
            continue
        others = [robot.joints[j].name for j in mine] or [
            name for name, j in zip(names, joints, strict=True) if fits[j, columns[k]]
        ]
        shown = ", ".join(others[:4]) + (" ..." if len(others) > 4 else "")
        found.append(
            ColumnGuess(None, "open", f"{shown or 'no joint'} by limits; no foot tells it")
        )
    return found


def _limb_orders(
    robot: RobotDescription, joints: Sequence[int], columns: Sequence[int], fits: Flags2D
) -> Iterator[list[int]]:
    """Give the joints of the columns in each possible order of whole limbs; of a limb's end, as of a hand, joints may lack,
    on both sides as many."""
    limbs = _limbs(robot, joints)
    if len(limbs) > MOST_LIMBS:
        return
    kinds = [_SIDES.sub("", robot.joints[limb[0]].name) for limb in limbs]
    longest = {kind: max(len(limb) for limb, own in zip(limbs, kinds, strict=True) if own == kind)
               for kind in kinds}  # fmt: skip
    for lengths in product(*(range(n + 1) for n in longest.values())):
        of_kind = dict(zip(longest, lengths, strict=True))
        cut = [limb[: of_kind[kind]] for limb, kind in zip(limbs, kinds, strict=True)]
        cut = [limb for limb in cut if limb]
        if sum(map(len, cut)) != len(columns):
            continue
        for order in permutations(cut):
            whole = [j for limb in order for j in limb]
            if fits[whole, columns].all():
                yield whole


def _limbs(robot: RobotDescription, joints: Sequence[int]) -> list[list[int]]:
    """Return joints by limbs: each begins where the robot branches."""
    own = set(joints)
    below: dict[str, list[int]] = {}
    for j in joints:
        below.setdefault(robot.joints[j].parent, []).append(j)
    limbs: list[list[int]] = []
    for j in joints:
        above = [k for k in own if robot.joints[k].child == robot.joints[j].parent]
        if above and len(below[robot.joints[j].parent]) == 1:
            next(limb for limb in limbs if limb[-1] == above[0]).append(j)
        else:
            limbs.append([j])
    return limbs
