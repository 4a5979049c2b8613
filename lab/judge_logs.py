"""Drawn logs played by ``hal.LogRobot``, judged by what nobody here wrote: pandas, NumPy and SciPy.

What every tick must have is worked out from the numbers that were written: pandas drops what is no number and rows of the same
stamp, ``merge_asof`` holds, ``numpy.interp`` is linear, a sum of trapezia over all breakpoints is the mean, SciPy turns. Every value,
mark and count is compared; a log with mistakes must be refused with all of them. Of a recording, the run's own signals are what was
written.

::

    python -m aloft.lab.judge_logs 2000 --graphs 20   # 10 minutes of processor time; every 20th as a whole graph
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..hal.log.log_file import LogError, read_log
from ..hal.log.log_robot import LogRobot
from ..hal.log.played_log import play
from ..robots.description import find_robot
from .drawn_logs import BAGS, STAMPS, Drawing, DrawnLog, Numbers
from .saved_logs import FLAWS, misspelt, save

LATE = 1e-6
"""A stamp may be so late and still be a tick's, as the contract of LogRobot says [s]."""
NEAR = 2e-9
"""Values may differ by so much, relative to the largest."""


class Tally(NamedTuple):
    """Counts of what came of drawn logs, and what was wrong."""

    counts: Counter[str]
    wrong: list[str]


class Table(NamedTuple):
    """Rows that count, of one quantity: ``times`` (n,) [s] and ``values`` (n, k)."""

    times: Numbers
    values: Numbers

    def at(self, times: Numbers, between: str, period: float) -> Numbers:
        """Return what ticks must have, (m, k)."""
        if between == "hold":
            return self.last(times)
        if between == "linear":
            return np.stack([np.interp(times, self.times, each) for each in self.values.T], axis=1)
        return np.stack([self._mean(time, period) for time in times])

    def last(self, times: Numbers) -> Numbers:
        """Return the last row at each time, (m, k)."""
        pandas = import_module("pandas")
        rows = pandas.DataFrame({"time": self.times, "row": np.arange(len(self.times))})
        ticks = pandas.DataFrame({"time": times + LATE})
        found = pandas.merge_asof(ticks, rows, on="time")["row"].fillna(0).astype(int)
        return self.values[found]

    def _mean(self, time: float, period: float) -> Numbers:
        begin, end = max(time - period, self.times[0]), min(time, self.times[-1])
        inside = self.times[(self.times > begin) & (self.times < end)]
        points = np.concatenate([[begin], inside, [end]])
        values = np.stack([np.interp(points, self.times, each) for each in self.values.T], axis=1)
        if end - begin < 1e-8:
            return values[-1]
        return np.trapezoid(values, points, axis=0) / (end - begin)


class Expected:
    """All that a log must play, worked out from what was written."""

    def __init__(self, drawn: DrawnLog, robot: Any) -> None:
        self.drawn, self.robot = drawn, robot
        self.tables: dict[str, Table] = {}
        self.jitter = 0.0
        self.first_instant = min(int(drawn.stamps_of(key).min()) for key in drawn.quantities) if drawn.kind in BAGS else None  # fmt: skip
        for key, quantity in drawn.quantities.items():
            values = quantity.meant.astype(float)
            if key == "truth.quaternion":
                norm = np.linalg.norm(values, axis=1, keepdims=True)
                values = np.divide(
                    values,
                    norm,
                    out=np.full_like(values, np.nan),
                    where=np.isfinite(norm) & (norm > 0),
                )
            self.tables[key] = self._table(key, values)
        begin = max(table.times[0] for table in self.tables.values())
        end = min(table.times[-1] for table in self.tables.values())
        params = drawn.params
        self.end_missing = "end" in params and params["end"] > end - begin + LATE
        end = begin + params["end"] if "end" in params else end
        begin += params.get("begin", 0.0)
        count = int((end - begin + LATE) // drawn.period) + 1
        self.ticks = begin + drawn.period * np.arange(count)

    def _table(self, key: str, values: Numbers) -> Table:
        pandas = import_module("pandas")
        times, order = self._times(key)
        rows = pandas.DataFrame(values[order]).assign(time=times)
        rows = rows.replace([np.inf, -np.inf], np.nan).dropna()
        rows = rows.drop_duplicates("time", keep="last")
        return Table(rows["time"].to_numpy(), rows.drop(columns="time").to_numpy())

    def _times(self, key: str) -> tuple[Numbers, Numbers]:
        drawn, counts = self.drawn, self.drawn.stamps_of(key)
        clock, rows = drawn.params.get("clock", {}), np.arange(len(counts))
        if "rate" in clock:
            return rows / clock["rate"], rows
        if drawn.wrapped:
            again = np.concatenate([[0], np.cumsum(np.diff(counts.astype(np.int64)) < 0)])
            counts = counts.astype(np.int64) + 2**32 * again
        start = counts[0] if self.first_instant is None else self.first_instant
        times = (counts - start).astype(float) * STAMPS[drawn.unit]
        order = np.argsort(times, kind="stable") if clock.get("sort") else rows
        times = times[order]
        steps = import_module("pandas").Series(times).diff()
        self.jitter = max(self.jitter, steps.std(ddof=0) / steps.mean())
        if clock.get("even"):
            times = times[0] + (times[-1] - times[0]) * rows / (len(rows) - 1)
        return times, order

    def at_ticks(self, key: str) -> Numbers:
        """Return a quantity at the ticks."""
        return self.tables[key].at(self.ticks, self.drawn.params["between"], self.drawn.period)

    def imu(self) -> Numbers:
        """Return the IMU's numbers in the base's axes and at its origin, (m, 6)."""
        turn = import_module("scipy.spatial.transform").Rotation
        mount = self.drawn.params.get("imu", {})
        rotation = turn.from_euler("xyz", mount.get("rpy", [0.0] * 3)).as_matrix()
        lever = np.array(mount.get("position", [0.0] * 3))
        gyro, force = self.tables["imu.angular_velocity"], self.tables["imu.specific_force"]
        rates = Table(gyro.times, gyro.values @ rotation.T)
        forces = force.values @ rotation.T
        if "link" in mount:
            rates, forces = self._carried(mount["link"], lever, rates, forces)
        elif lever.any():
            at = rates.at(force.times, "linear", 0.0)
            change = np.gradient(at, force.times, axis=0)
            forces = forces - np.cross(at, np.cross(at, lever)) - np.cross(change, lever)
        between, period = self.drawn.params["between"], self.drawn.period
        return np.hstack([
            rates.at(self.ticks, between, period), Table(force.times, forces).at(self.ticks, between, period)
        ])  # fmt: skip

    def _carried(
        self, link: str, place: Numbers, rates: Table, forces: Numbers
    ) -> tuple[Table, Numbers]:
        """Return rates and forces at the base of an IMU on a link, by the velocities of every joint on the way to it."""
        turn = import_module("scipy.spatial.transform").Rotation
        times = self.tables["imu.specific_force"].times
        names = [joint.name for joint in self.robot.joints]
        angles, speeds = np.tile(self.robot.standing_position, (len(times), 1)), np.zeros((len(times), len(names)))  # fmt: skip
        if "joints.position" in self.tables:
            self.joints("velocity")  # differences of the angles, where there are no speeds
            for column, name in enumerate(self.drawn.joints):
                if name in names:
                    for part, into in (("position", angles), ("velocity", speeds)):
                        table = self.tables[f"joints.{part}"]
                        into[:, names.index(name)] = np.interp(times, table.times, table.values[:, column])  # fmt: skip
        way = []
        while link != self.robot.base:
            way.append(next(joint for joint in self.robot.joints if joint.child == link))
            link = way[-1].parent
        here, turned = np.zeros((len(times), 3)), turn.identity(len(times))
        axes = []
        for joint in reversed(way):
            here = here + turned.apply(joint.origin)
            axes.append((turned.apply(joint.axis), here, speeds[:, [names.index(joint.name)]]))
            turned = turned * turn.from_rotvec(angles[:, [names.index(joint.name)]] * np.array([joint.axis]))  # fmt: skip
        here = here + turned.apply(place)
        spin = sum(axis * speed for axis, _, speed in axes)
        moved = sum(np.cross(axis, here - origin) * speed for axis, origin, speed in axes)
        own = turned.apply(rates.at(times, "linear", 0.0)) - spin
        force = turned.apply(forces) - np.cross(np.gradient(own, times, axis=0), here)
        force = force - np.cross(own, np.cross(own, here)) - 2.0 * np.cross(own, moved)
        return Table(times, own), force - np.gradient(moved, times, axis=0)

    def joints(self, part: str) -> Numbers:
        """Return positions, velocities or torques of all joints of the robot, (m, n_joints)."""
        names = [joint.name for joint in self.robot.joints]
        standing = (
            np.array(self.robot.standing_position) if part == "position" else np.zeros(len(names))
        )
        found = np.tile(standing, (len(self.ticks), 1))
        key = f"joints.{part}"
        if part == "velocity" and key not in self.tables and "joints.position" in self.tables:
            angles = self.tables["joints.position"]
            self.tables[key] = Table(angles.times, np.gradient(angles.values, angles.times, axis=0))
        if key in self.tables:
            rows = self.at_ticks(key)
            for column, name in enumerate(self.drawn.joints):
                if name in names:
                    found[:, names.index(name)] = rows[:, column]
        return found

    def closed(self) -> tuple[Numbers, Numbers]:
        """Return the switches (m, n_contacts), and whether they are valid (m,)."""
        feet = [foot.name for foot in self.robot.feet]
        flags, valid, any_foot = np.zeros((len(self.ticks), len(feet)), bool), np.ones(len(self.ticks), bool), False  # fmt: skip
        for key, table in self.tables.items():
            if not key.startswith("contacts."):
                continue
            any_foot = True
            foot, _, what = key.removeprefix("contacts.").rpartition(".")
            force = table.values[:, 0]
            state = (table.values != 0).any(axis=1)
            if what == "force":
                now, state = force[0] >= -5.0, np.zeros(len(force), bool)
                for k, each in enumerate(force):
                    now = True if each > 25.0 else False if each < -5.0 else now
                    state[k] = now
            rows = Table(table.times, state[:, None]).last(self.ticks)[:, 0]
            flags[:, feet.index(foot)] = rows
            valid &= ~self.in_gap(table)
        points = np.array(self.robot.foot_of_contact())
        return flags[:, points], valid & any_foot

    def in_gap(self, table: Table) -> Numbers:
        """Return at which ticks there is a gap of more than five usual steps, (m,)."""
        steps = np.diff(table.times)
        inside = np.zeros(len(self.ticks), bool)
        for k in np.flatnonzero(steps > 5.0 * np.median(steps)):
            inside |= (self.ticks > table.times[k] + LATE) & (
                self.ticks < table.times[k + 1] - LATE
            )
        return inside

    def valid(self, *keys: str) -> tuple[Numbers, float]:
        """Return at which ticks the samples of some quantities are new ones and in no gap (m,), and the share that repeats."""
        pandas = import_module("pandas")
        good, share = np.ones(len(self.ticks), bool), 0.0
        repeats = {}
        for key in keys:
            rows = pandas.DataFrame(self.tables[key].values, index=self.tables[key].times)
            repeats[key] = (rows == rows.shift()).all(axis=1)
        together = (
            pandas.DataFrame(repeats).astype("boolean").all(axis=1)
        )  # what is missing counts for none
        for key in keys:
            table = self.tables[key]
            same = together.loc[table.times].to_numpy(bool)
            if keys[0].startswith("joints"):
                speeds = self.tables["joints.velocity"]
                moving = np.stack([np.interp(table.times, speeds.times, each) for each in speeds.values.T], 1)  # fmt: skip
                same = same & (np.abs(moving) > 1e-9).any(axis=1)
            share = max(share, float(same.mean()))
            good &= ~table_last(table, same, self.ticks) & ~self.in_gap(table)
        return good, share

    def pose(self) -> tuple[Numbers, Numbers]:
        """Return pose (m, 7) and twist (m, 6) of the base."""
        turns = import_module("scipy.spatial.transform").Rotation
        count, period, between = len(self.ticks), self.drawn.period, self.drawn.params["between"]
        pose, twist = np.zeros((count, 7)), np.zeros((count, 6))
        pose[:, 6] = 1.0
        moving = "linear" if between == "hold" else between
        if "truth.position" in self.tables:
            pose[:, :3] = self.at_ticks("truth.position")
            rows = self.tables["truth.position"].at(self.ticks, moving, period)
            twist[:, :3] = np.gradient(rows, period, axis=0)
            key = next(key for key in ("truth.rpy", "truth.quaternion") if key in self.tables)
            table = self.tables[key]
            four = turns.from_euler("xyz", table.values).as_quat() if key.endswith("rpy") else table.values.copy()  # fmt: skip
            for k in range(1, len(four)):
                if four[k] @ four[k - 1] < 0.0:
                    four[k] = -four[k]
            spread = Table(table.times, four)
            pose[:, 3:] = turns.from_quat(spread.at(self.ticks, between, period)).as_quat()
            rows = spread.at(self.ticks, moving, period)
            rows = rows / np.linalg.norm(rows, axis=1, keepdims=True)
            change = np.gradient(rows, period, axis=0)
            # 2 conj(q) q', by the matrix that multiplies with the conjugate
            for k, (x, y, z, w) in enumerate(rows):
                twist[k, 3:] = 2.0 * np.array([[w, z, -y, -x], [-z, w, x, -y], [y, -x, w, -z]]) @ change[k]  # fmt: skip
        return pose, twist


def table_last(table: Table, flags: Numbers, ticks: Numbers) -> Numbers:
    """Return a flag of the last row at each tick."""
    return Table(table.times, flags[:, None]).last(ticks)[:, 0].astype(bool)


def compare(expected: Expected, played: Any) -> list[str]:
    """Return what of a played log is not as it must be."""
    rows, drawn = played.rows, expected.drawn
    if len(rows.imu) != len(expected.ticks):
        return [f"{len(rows.imu)} ticks, expected {len(expected.ticks)}"]
    wrong: list[str] = []

    def near(what: str, found: Numbers, right: Numbers, by: float = NEAR) -> None:
        size = max(1.0, float(np.abs(right).max()))
        if not np.isfinite(found).all() or np.abs(found - right).max() > by * size:
            k = int(np.argmax(np.abs(np.nan_to_num(found, nan=1e9) - right).max(axis=1)))
            wrong.append(f"{what}: tick {k} has {found[k]}, expected {right[k]}")

    def same(what: str, found: Numbers, right: Numbers) -> None:
        if not np.array_equal(found, right):
            k = int(np.argmax(np.reshape(found != right, (len(found), -1)).any(axis=1)))
            wrong.append(f"{what}: tick {k} has {found[k]}, expected {right[k]}")

    near("imu", rows.imu, expected.imu(), _near_imu(drawn))
    imu_valid, imu_share = expected.valid("imu.angular_velocity", "imu.specific_force")
    same("imu_valid", rows.imu_valid, imu_valid)
    for part in ("position", "velocity", "torque"):
        near(f"joints.{part}", getattr(rows, part).at_ticks(), expected.joints(part))
    shares = [("log_repeated_imu_share", played.imu_repeats, imu_share)]
    if drawn.joints:
        own = ["joints.position"]
        if "joints.velocity" in drawn.quantities:
            own.append("joints.velocity")
        valid, share = expected.valid(*own)
        same("joints_valid", rows.joints_valid, valid)
        shares.append(("log_repeated_joints_share", played.joint_repeats, share))
    closed, contacts_valid = expected.closed()
    same("closed", rows.closed, closed)
    same("contacts_valid", getattr(rows, "contacts_valid", np.ones(len(rows.imu), bool)), contacts_valid)  # fmt: skip
    pose, twist = expected.pose()
    near("pose", rows.pose, pose)
    near("twist", rows.twist * drawn.period, twist * drawn.period)
    used = [table.times for key, table in expected.tables.items() if key in drawn.quantities]
    gaps = max(int((np.diff(times) > 5.0 * np.median(np.diff(times))).sum()) for times in used)
    longest = max(used, key=len)
    shares += [("log_jitter", played.jitter, expected.jitter), ("log_gaps", played.gaps, gaps), ("log_rows", played.count, len(longest)),
               ("log_rate_hz", played.rate, 1.0 / np.diff(longest).mean())]  # fmt: skip
    wrong += [
        f"{what} is {found}, expected {right}"
        for what, found, right in shares
        if abs(found - right) > 1e-9 * max(1.0, abs(right))
    ]
    return wrong


def _near_imu(drawn: DrawnLog) -> float:
    """Return by how much an IMU's numbers may differ: the velocity of a link is a difference of its places."""
    return 1e-5 if "link" in drawn.params.get("imu", {}) else NEAR


def judged(drawn: DrawnLog, robot: Any, folder: Path) -> tuple[str, list[str]]:
    """Return what came of a log, ``right``, ``wrong``, ``refused`` ..., and what was wrong."""
    params = save(drawn, folder)
    try:
        given = LogRobot.Params.model_validate(params)
        played = play(read_log(folder / params["file"]), given, robot, drawn.period)
    except (LogError, ValueError) as error:
        return "refused", [str(error)]
    said = [f"{each.parameter}: {each.message}" for each in played.problems]
    named = [each for each in played.problems if "has no joint" in each.message or "has no foot" in each.message]  # fmt: skip
    unfixed = [each.parameter for each in played.problems if "has no column" in each.message and repr(misspelt(each.fix)) not in each.message]  # fmt: skip
    if drawn.flaws:
        missing = []
        for key, flaw in drawn.flaws.items():
            place = key.rpartition(".")[0] if key.startswith("contacts.") else key
            if place.startswith("contacts.") and "contacts" in drawn.flaws:
                place += "t"  # as its foot is called there
            if not any(
                line.startswith(f"{place}: ")
                and any(each in line for each in FLAWS[flaw].split("|"))
                for line in said
            ):
                missing.append(f"{flaw} at {place} is not said: {said}")
        missing += [f"the fix of {each} is none" for each in unfixed]
        missing += [f"{each} has no {part}" for each in named for part in ("expected", "found", "fix") if not getattr(each, part)]  # fmt: skip
        feet = len(params["contacts"]) - 1 if "contacts" in drawn.flaws else 0
        if len(said) > len(drawn.flaws) + feet:
            missing.append(f"more is said than the mistakes {drawn.flaws}: {said}")
        return ("a mistake not said" if missing else "refused, as is right"), missing
    expected = Expected(drawn, robot)
    if expected.end_missing:
        right = any(line.startswith("end: the log ends before") for line in said)
        return ("refused, as is right" if right else "wrong"), [] if right else ["end is beyond the log"]  # fmt: skip
    if said:
        return "refused", said
    wrong = compare(expected, played)
    return ("wrong" if wrong else "right"), wrong


def judge(count: int, seed: int = 0, graphs: int = 0) -> Tally:
    """Draw logs and judge each; every ``graphs``-th also as a graph that runs."""
    robot, counts, wrong = find_robot("bruce"), Counter[str](), []
    for k in range(count):
        drawn = Drawing(seed * 1_000_000 + k, robot).log()
        with tempfile.TemporaryDirectory() as folder:
            what, lines = judged(drawn, robot, Path(folder))
            counts[what] += 1
            counts[f"{drawn.kind} {what}"] += 1
            wrong += [f"{drawn.kind} {drawn.seed}, {what}: {line}" for line in lines]
            if graphs and k % graphs == 0 and what == "right":
                lines = _run(drawn, robot, Path(folder))
                counts["graphs"] += 1
                wrong += [f"graph {drawn.seed}: {line}" for line in lines]
    return Tally(counts, wrong)


def _run(drawn: DrawnLog, robot: Any, folder: Path) -> list[str]:
    """Run a graph of the log; return which ports do not have what was worked out."""
    from .. import load

    drawn = Drawing(drawn.seed, robot).log()
    with tempfile.TemporaryDirectory() as other:
        params = save(drawn, Path(other))
        graph = {"rate": f"{1.0 / drawn.period:g} Hz", "robot": "bruce",
                 "blocks": {"robot": {"use": "hal.LogRobot", "with": params}}}  # fmt: skip
        result = load(graph).run()
    expected = Expected(drawn, robot)
    wrong = []
    imu, pose = expected.imu(), expected.pose()[0]
    for name, right in {
        "robot.imu.angular_velocity": imu[:, :3], "robot.imu.specific_force": imu[:, 3:],
        "robot.joints.position": expected.joints("position"), "robot.joints.velocity": expected.joints("velocity"),
        "robot.joints.torque": expected.joints("torque"), "robot.contacts.closed": expected.closed()[0],
        "robot.health.contacts_valid": expected.closed()[1], "robot.truth.base_position": pose[:, :3],
        "robot.health.imu_valid": expected.valid("imu.angular_velocity", "imu.specific_force")[0],
        "robot.truth.base_orientation": pose[:, 3:],
    }.items():  # fmt: skip
        found = result.signal(name)[: len(right)]  # a run ends a tick behind its log
        if len(found) < len(right) or np.abs(found * 1.0 - right).max() > _near_imu(drawn) * max(1.0, np.abs(right).max()):  # fmt: skip
            wrong.append(f"{name} is not as it must be")
    return wrong


def main() -> None:
    """Judge as many logs as the command line says."""
    parser = argparse.ArgumentParser()
    parser.add_argument("count", type=int)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--graphs", type=int, default=0, help="run every so many logs as a graph")
    given = parser.parse_args()
    tally = judge(given.count, given.seed, given.graphs)
    for line in tally.wrong[:40]:
        print(line[:600])
    for what, number in sorted(tally.counts.items()):
        print(f"{number:6d}  {what}")
    raise SystemExit(bool(tally.wrong))


if __name__ == "__main__":
    main()
