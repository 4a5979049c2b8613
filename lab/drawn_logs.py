"""Logs that are drawn: what a robot's sensors gave at which instants, and files that hold it as people's files do.

A drawn log knows nothing of how logs are read: it has the numbers as they are in the file, what they mean, and the parameters that tell
``hal.LogRobot`` so.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

Numbers = Any

UNITS: dict[str, dict[str, float]] = {
    "rad": {"rad": 1.0, "deg": np.pi / 180.0, "mrad": 1e-3, "rev": 2.0 * np.pi},
    "rad/s": {"rad/s": 1.0, "deg/s": np.pi / 180.0, "rpm": 2.0 * np.pi / 60.0, "dps": np.pi / 180.0},
    "m/s^2": {"m/s^2": 1.0, "g": 9.80665, "mg": 9.80665e-3, "mm/s^2": 1e-3},
    "N m": {"N m": 1.0, "mN m": 1e-3, "Nm": 1.0},
    "N": {"N": 1.0, "kN": 1e3, "mN": 1e-3},
    "m": {"m": 1.0, "mm": 1e-3, "cm": 1e-2},
    "": {"": 1.0},
}  # fmt: skip
"""Units that files have with their factors, by the unit of a port."""
STAMPS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
FORMATS = ("csv", "npz", "h5", "mat", "parquet", "mcap", "bag", "rrd")
BAGS = ("mcap", "bag")
"""Formats whose topics have clocks of their own."""
RECORDED = {
    "imu.angular_velocity": "imu.angular_velocity", "imu.specific_force": "imu.specific_force", "joints.position": "joints.position",
    "joints.velocity": "joints.velocity", "joints.torque": "joints.torque", "truth.position": "truth.base_position",
    "truth.quaternion": "truth.base_orientation",
}  # fmt: skip
"""Ports of a robot, by quantity."""


@dataclass
class Quantity:
    """One quantity as the file has it: ``raw`` (n, k); what it means is ``scale * (raw - offset) * factor``."""

    raw: Numbers
    unit: str = ""
    factor: float = 1.0
    scale: list[float] = field(default_factory=lambda: [1.0])
    offset: list[float] = field(default_factory=lambda: [0.0])

    @property
    def meant(self) -> Numbers:
        """The numbers in the port's unit, (n, k)."""
        return self.factor * (np.array(self.scale) * (self.raw - np.array(self.offset)))


@dataclass
class DrawnLog:
    """A log: stamps of every group as the file has them, the quantities by ``group.name``, and the parameters that name them."""

    seed: int
    kind: str
    stamps: dict[str, Numbers]
    """Of each group, or quantity with a topic of its own, (n,) whole numbers or floats in ``unit``; of a bag in ns."""
    unit: str
    quantities: dict[str, Quantity]
    params: dict[str, Any]
    period: float
    joints: list[str] = field(default_factory=list)
    wrapped: bool = False
    order: str = "xyzw"
    """Of the columns of a quaternion; ``quantities`` have x, y, z, w."""
    flaws: dict[str, str] = field(default_factory=dict)
    """The kind of mistake in a column, by quantity."""
    played: DrawnLog | None = None
    """Of a recording: the log that plays the robot of the run that is recorded."""

    def stamps_of(self, quantity: str) -> Numbers:
        """Return the stamps of a quantity, (n,): its own, or those of its group."""
        parts = quantity.split(".")
        names = [".".join(parts[: k + 1]) for k in reversed(range(len(parts)))]
        return self.stamps[next(name for name in names if name in self.stamps)]


class Drawing:
    """Draws one log by a seed."""

    def __init__(self, seed: int, robot: Any) -> None:
        self.chance = np.random.default_rng(seed)
        self.robot, self.seed = robot, seed

    def one_of(self, *choices: Any) -> Any:
        """Return one of some things."""
        return choices[int(self.chance.integers(len(choices)))]

    def happens(self, share: float) -> bool:
        """Return true in a share of calls."""
        return bool(self.chance.random() < share)

    def log(self, kind: str | None = None) -> DrawnLog:
        """Return a log, of some format, or of one and without mistakes."""
        flawless, kind = kind is not None, kind or self.one_of(*FORMATS)
        if kind == "rrd":
            return self._recording()
        bag = kind in BAGS
        unit = "ns" if bag else self.one_of(*STAMPS)
        rate = float(self.one_of(50, 100, 125, 200, 250, 333, 500, 1000))
        duration = 1.0 + self.chance.random()
        groups = ["imu", "joints", "contacts", "truth"]
        if bag:
            groups += [f"contacts.{foot.name}" for foot in self.robot.feet]
        if bag and self.happens(0.3):
            groups += ["imu.angular_velocity", "imu.specific_force"]
        whole = unit in ("us", "ns") or self.happens(0.3)
        epoch = self.one_of(0.0, 0.0, 12.5, 1.7e9)
        wrap = not bag and whole and unit in ("us", "ns") and epoch < 1e9 and self.happens(0.3)
        stamps: dict[str, Numbers] = {}
        times: dict[str, Numbers] = {}
        common = self._instants(rate, duration)
        for group in groups:
            own = bag and self.happens(0.5)
            if own:
                own_rate = float(self.one_of(50, 100, 200, 400))
                times[group] = self.chance.random() * 0.05 + self._instants(own_rate, duration)
            else:
                times[group] = common
            counts = (epoch + times[group]) / STAMPS[unit]
            if whole:
                # first the epoch, exactly, then what floats can hold of the rest
                counts = round(epoch / STAMPS[unit]) + np.round(times[group] / STAMPS[unit]).astype(np.int64)  # fmt: skip
            stamps[group] = counts
        if not bag:
            counts = stamps["imu"]
            if wrap:
                counts = (counts + 2**32 - int(self.chance.integers(1, int(0.9 / STAMPS[unit])))) % 2**32  # fmt: skip
                counts = counts.astype(self.one_of(np.uint32, np.int64, np.float64))
            elif whole and self.happens(0.3) and counts.max() < 2**53:
                counts = counts.astype(np.float64)
            stamps = dict.fromkeys(groups, counts)
        drawn = DrawnLog(self.seed, kind, stamps, unit, {}, {}, self.one_of(0.001, 0.002, 0.004, 0.01), wrapped=wrap)  # fmt: skip
        self._fill(drawn, times)
        self._clock(drawn, rate)
        drawn.params["between"] = self.one_of("linear", "linear", "hold", "mean")
        if self.happens(0.3):
            drawn.params["begin"] = round(0.2 * self.chance.random(), 3)
        if self.happens(0.3):
            drawn.params["end"] = round(0.5 + 0.2 * self.chance.random(), 3)
        if not flawless and self.happens(0.15):
            self._spoil(drawn)
        return drawn

    def _recording(self) -> DrawnLog:
        """Return a run that is recorded: a log plays its robot, and what the ports had is known when it has run."""
        played = self.log("npz")
        played.params = {
            key: value for key, value in played.params.items() if key not in ("begin", "end")
        }
        drawn = DrawnLog(self.seed, "rrd", {}, "s", {}, {}, self.one_of(0.001, 0.002, 0.004, 0.01), played=played)  # fmt: skip
        drawn.joints = [joint.name for joint in self.robot.joints]
        for key in RECORDED:
            if self.happens(0.8) or key.startswith("imu"):
                drawn.quantities[key] = Quantity(np.zeros((1, 1)))
        keys = drawn.quantities
        if "joints.position" not in keys:
            drawn.joints = []
            for key in ("joints.velocity", "joints.torque"):
                keys.pop(key, None)
        if not {"truth.position", "truth.quaternion"} <= set(keys):
            for key in ("truth.position", "truth.quaternion"):
                keys.pop(key, None)
        for foot in self.robot.feet:
            if self.happens(0.5):
                keys[f"contacts.{foot.name}.closed"] = Quantity(np.zeros((1, 1)))
        drawn.params["between"] = self.one_of("linear", "hold", "mean")
        if self.happens(0.3):
            drawn.params["begin"] = round(0.2 * self.chance.random(), 3)
        if self.happens(0.15):
            self._spoil(drawn)
        return drawn

    def _instants(self, rate: float, duration: float) -> Numbers:
        """Return instants with jitter, drift, gaps and rows that have the stamp of the one before."""
        count = int(rate * duration)
        rate *= 1.0 + self.one_of(0.0, 0.01, -0.003)
        times = np.arange(count) / rate
        if self.happens(0.5):
            times = times + self.one_of(0.05, 0.3) / rate * self.chance.random(count)
        keep = np.ones(count, bool)
        for _ in range(self.one_of(0, 0, 1, 2)):
            first = int(self.chance.integers(5, count - 5))
            keep[first : first + self.one_of(2, 9, 20)] = False
        if self.happens(0.2):
            keep &= self.chance.random(count) > 0.05
        keep[-3:] = True
        times = times[keep]
        if self.happens(0.2):
            for k in self.chance.integers(1, len(times), 3):
                times[k] = times[k - 1]
        return np.maximum.accumulate(times)

    def _fill(self, drawn: DrawnLog, times: dict[str, Numbers]) -> None:
        params, own = drawn.params, drawn.quantities
        bag = drawn.kind in BAGS
        ports = {"imu": {"angular_velocity": ("rad/s", 3), "specific_force": ("m/s^2", 3)}}
        names = [joint.name for joint in self.robot.joints]
        if self.happens(0.8):
            self.chance.shuffle(names)
            drawn.joints = names[: self.one_of(len(names), 4, 7)]
            if self.happens(0.3):
                drawn.joints.insert(int(self.chance.integers(len(drawn.joints))), "gripper")
            width = len(drawn.joints)
            ports["joints"] = {"position": ("rad", width)}
            if self.happens(0.7):
                ports["joints"]["velocity"] = ("rad/s", width)
            if self.happens(0.5):
                ports["joints"]["torque"] = ("N m", width)
        if self.happens(0.7):
            ports["truth"] = {"position": ("m", 3)}
            turn = self.one_of("rpy", "quaternion")
            if bag:
                turn = "quaternion"
            if turn == "quaternion" and not bag:
                drawn.order = self.one_of("xyzw", "wxyz")
            ports["truth"][turn] = ("rad", 3) if turn == "rpy" else ("", 4)
        for group, parts in ports.items():
            for part, (unit, width) in parts.items():
                at = times.get(f"{group}.{part}", times[group])
                own[f"{group}.{part}"] = self._quantity(drawn, part, at, unit, width)
        for foot in [each.name for each in self.robot.feet][: self.one_of(0, 1, 2)]:
            own_topic = f"contacts.{foot}"
            at = times[own_topic if own_topic in times else "contacts"]
            if self.happens(0.7):
                own[f"contacts.{foot}.force"] = self._quantity(drawn, "force", at, "N", 1)
            else:
                switches = 1 if bag else self.one_of(1, 1, 3)
                flags = np.sin(np.outer(at, self.chance.uniform(2.0, 4.0, switches))) > 0
                own[f"contacts.{foot}.closed"] = Quantity(flags.astype(self.one_of(bool, np.int8, np.float64)))  # fmt: skip
        if self.happens(0.5):
            params["imu"] = {
                "position": self.chance.uniform(-0.1, 0.1, 3).round(3).tolist(),
                "rpy": self.chance.uniform(-3.0, 3.0, 3).round(3).tolist(),
            }
            if self.happens(0.3):
                params["imu"]["link"] = self.one_of(*(joint.child for joint in self.robot.joints))

    def _quantity(
        self, drawn: DrawnLog, part: str, times: Numbers, unit: str, width: int
    ) -> Quantity:
        """Return smooth numbers with noise, repeated samples and rows that are no numbers, in a unit of the file."""
        size = {"specific_force": 9.0, "force": 60.0}.get(part, 0.5)
        phases = self.chance.uniform(0.0, 6.0, width)
        meant = size * np.sin(np.outer(times, self.chance.uniform(2.0, 9.0, width)) + phases)
        meant += 0.01 * size * self.chance.standard_normal(meant.shape)
        if part == "quaternion":
            meant = np.stack([np.sin(times), np.cos(times), 0.3 * np.sin(2 * times), 0.5 + 0 * times], 1)  # fmt: skip
            meant /= np.linalg.norm(meant, axis=1, keepdims=True)
            meant *= np.where(self.chance.random(len(times)) < 0.1, -1.0, 1.0)[:, None]
        whole = part != "quaternion" and self.happens(0.15)
        bag = drawn.kind in BAGS
        chosen = self.one_of(*UNITS[unit]) if not bag and not whole else unit
        factor = UNITS[unit][chosen]
        quantity = Quantity(meant / factor, chosen, factor)
        if part not in ("quaternion", "force") and self.happens(0.4):
            quantity.scale = self.chance.choice([-1.0, 1.0], self.one_of(1, width)).tolist()
            quantity.offset = (size / factor * self.chance.uniform(-0.2, 0.2, self.one_of(1, width))).round(4).tolist()  # fmt: skip
            quantity.raw = quantity.raw / np.array(quantity.scale) + np.array(quantity.offset)
        if whole and not bag:
            quantity.raw = np.round(quantity.raw * 1000.0).astype(self.one_of(np.int16, np.int32, np.int64))  # fmt: skip
            quantity.scale = [each / 1000.0 for each in quantity.scale]
            quantity.offset = [each * 1000.0 for each in quantity.offset]
        elif self.happens(0.2) and not bag:
            quantity.raw = quantity.raw.astype(np.float32).astype(np.float64)
        if self.happens(0.3):
            for k in self.chance.integers(1, len(times), 4):
                quantity.raw[k] = quantity.raw[k - 1]
        if quantity.raw.dtype.kind == "f" and self.happens(0.2):
            for k in self.chance.integers(3, len(times) - 3, 3):
                quantity.raw[k, self.chance.integers(width)] = self.one_of(np.nan, np.nan, np.inf)
        if part == "quaternion" and self.happens(0.2):
            quantity.raw[len(times) // 2] = 0.0
        return quantity

    def _clock(self, drawn: DrawnLog, rate: float) -> None:
        """Draw how the clock is told, and rows out of order."""
        if drawn.kind in BAGS:
            if self.happens(0.2):
                drawn.params["clock"] = {"even": True}
            return
        way = self.one_of("stamps", "stamps", "stamps", "even", "rate")
        if way == "rate":
            drawn.params["clock"] = {"rate": rate}
            return
        drawn.params["clock"] = {"stamps": "t", "even": way == "even"}
        if not drawn.wrapped and self.happens(0.15):
            order = np.arange(len(drawn.stamps["imu"]))
            for k in self.chance.integers(1, len(order) - 1, 4):
                order[[k, k + 1]] = order[[k + 1, k]]
            drawn.stamps = dict.fromkeys(drawn.stamps, drawn.stamps["imu"][order])
            for quantity in drawn.quantities.values():
                quantity.raw = quantity.raw[order]
            drawn.params["clock"]["sort"] = True

    def _spoil(self, drawn: DrawnLog) -> None:
        """Note one to three mistakes that the file and the parameters will have, each at a quantity of its own."""
        bag = drawn.kind in BAGS
        kinds = [*{
            "rrd": (), "csv": ("text", "lost"), "parquet": ("text", "lost"), "mcap": ("text",), "bag": ("text",),
        }.get(drawn.kind, ("text", "lost", "complex", "one row", "deep")), "column", "unit", "unit's name", "width"]  # fmt: skip
        self.chance.shuffle(kinds)
        places = list(drawn.quantities)
        self.chance.shuffle(places)
        drawn.flaws = dict(zip(places[: self.one_of(1, 2, 3)], kinds, strict=False))
        for place, kind in drawn.flaws.items():
            if kind.startswith("unit") and place.endswith((".quaternion", ".closed")):
                drawn.flaws[place] = "column"  # which have none
            if kind == "width" and place.endswith(".closed"):
                drawn.flaws[place] = "column"  # which has any
            if kind == "text" and bag and not drawn.joints:
                drawn.flaws[place] = "column"
        if drawn.joints and self.happens(0.3):
            drawn.flaws["joints.names"] = "joint"
        if any(place.startswith("contacts.") for place in places) and self.happens(0.3):
            drawn.flaws["contacts"] = "foot"
