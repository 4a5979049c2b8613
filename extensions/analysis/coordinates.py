"""The coordinates in which a graph is differentiated: its float state and chosen signals, by name.

A unit quaternion q has three coordinates, its rotation vector in the tangent space: q exp(d / 2). The
entries of a ring buffer are taken in the order of their age, so a delay is the same map in every tick.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...logs.file.format import RecordedField
from ...logs.file.header import recorded_states
from ...logs.viewing.signal_names import element_names, unit_of_element
from ...mathematics.arrays import Array, Indices
from ...mathematics.rotations import multiply
from ...runtime.language.errors import AloftError
from ...runtime.language.selection import WHOLE, Selection, read_selection, select
from ...runtime.running.memory import BoundGraph
from ...runtime.running.region import Region

_AXES = "xyz"


@dataclass(frozen=True)
class Coordinates:
    """Neighbouring float elements of the state or the bus that are perturbed together or one by one.

    Attributes:
        name: ``block.state.field``, with a part's name where the field mixes quantities.
        block: the path of the block that they belong to.
        labels, units: of every coordinate.
        places: the elements in the region's float section, (n,), oldest entry of a ring first at
            position zero.
        quaternion: the order of the elements of unit quaternions, or empty.
        ring: the position's element in the state's int64 section, and the number of entries; ``None``
            where it is no ring.
    """

    name: str
    block: str
    labels: tuple[str, ...]
    units: tuple[str, ...]
    region: Region
    places: Indices
    quaternion: str = ""
    ring: tuple[int, int] | None = None
    _by_position: dict[int, Indices] = field(default_factory=dict, repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.labels)

    def read(self, state: Region) -> Array:
        """Return the elements now, a ring's by age; ``state`` has the positions of rings."""
        values: Array = self.region.sections["float64"][self._now(state)]
        return values

    def write(self, state: Region, values: Array) -> None:
        """Set the elements, given as ``read`` gives them."""
        self.region.sections["float64"][self._now(state)] = values

    def displaced(self, values: Array, k: int, distance: float) -> Array:
        """Return the elements with coordinate ``k`` moved by ``distance``."""
        distances = np.zeros(len(self))
        distances[k] = distance
        return self.moved(values, distances)

    def moved(self, values: Array, distances: Array) -> Array:
        """Return the elements with all coordinates moved; an orientation turns about its rotation vector."""
        if not self.quaternion:
            return values + distances
        found = values.copy()
        for k in range(len(distances) // 3):
            vector, group = distances[3 * k : 3 * k + 3], slice(4 * k, 4 * k + 4)
            angle = float(np.linalg.norm(vector))
            if angle:
                turn = np.append(np.sin(0.5 * angle) / angle * vector, np.cos(0.5 * angle))
                found[group] = self._own_order(_product(self._xyzw(values[group]), turn))
        return found

    def difference(self, values: Array, nominal: Array) -> Array:
        """Return the coordinates of ``values`` relative to ``nominal``, (n,)."""
        if not self.quaternion:
            return values - nominal
        if (values == nominal).all():  # the product below rounds
            return np.zeros(len(self))
        found = []
        for start in range(0, len(values), 4):
            x, y, z, w = self._xyzw(nominal[start : start + 4])
            turned = _product(np.array([-x, -y, -z, w]), self._xyzw(values[start : start + 4]))
            sine = float(np.linalg.norm(turned[:3]))
            half = np.arctan2(sine, abs(turned[3]))
            size = 2.0 * half / sine if sine > 0.0 else 2.0
            found.append(turned[:3] * (size if turned[3] > 0.0 else -size))
        return np.concatenate(found)

    def _xyzw(self, quaternion: Array) -> Array:
        return quaternion if self.quaternion == "xyzw" else quaternion[[1, 2, 3, 0]]

    def _own_order(self, quaternion: Array) -> Array:
        return quaternion if self.quaternion == "xyzw" else quaternion[[3, 0, 1, 2]]

    def _now(self, state: Region) -> Indices:
        if self.ring is None:
            return self.places
        position, entries = self.ring
        oldest = int(state.sections["int64"][position])
        if oldest not in self._by_position:
            by_age = np.roll(self.places.reshape(entries, -1), -oldest, axis=0)
            self._by_position[oldest] = by_age.reshape(-1)
        return self._by_position[oldest]


def _product(a: Array, b: Array) -> Array:
    """Return Hamilton's product of two quaternions x, y, z, w."""
    out = np.empty(4)
    multiply(a, b, out)
    return out


def state_coordinates(bound: BoundGraph) -> Iterator[Coordinates]:
    """Yield all float elements of the declared state, field by field in file order."""
    region, robot = bound.memory.state, bound.graph.robot
    for each in recorded_states(bound):
        if each.dtype != "float64" or not each.size:
            continue
        path, name = _split(each.name)
        block = bound.blocks[path]
        places = np.arange(each.start, each.start + each.size)
        parts = block.state_elements().get(name)
        if parts is not None:
            start = 0
            for part in parts:
                names = [f"{path}.{part.name}"]
                if part.size > 1 and not part.quaternion:
                    names = [f"{names[0]}[{k}]" for k in range(part.size)]
                if part.name:
                    yield _coordinates(
                        f"{path}.{part.name}", path, names, [part.unit] * part.size, region,
                        places[start : start + part.size], part.quaternion,
                    )  # fmt: skip
                start += part.size
            continue
        state, _, attribute = name.partition(".")
        declared = type(block).states[state].signal.fields[attribute]
        ring = None
        if declared.ring:
            other = declared.ring if "." in declared.ring else f"{state}.{declared.ring}"
            ring = (region.layout.slots[f"{path}.{other}"].start, each.shape[0])
        yield _coordinates(
            each.name, path, _names(each, robot), _units(each, robot), region, places,
            _order(each), ring,
        )  # fmt: skip


def bus_coordinates(bound: BoundGraph, fields: dict[str, RecordedField]) -> Iterator[Coordinates]:
    """Yield all float elements of the outputs, which a graph of several rates may remember."""
    for each in fields.values():
        if each.dtype == "float64" and not each.constant and each.size:
            yield _of_field(bound, each, WHOLE)


def signal_coordinates(
    bound: BoundGraph, fields: dict[str, RecordedField], text: str
) -> Coordinates:
    """Return the elements of the signal that ``text`` names, such as ``robot.joints.position[*_knee]``.

    Raises:
        AloftError: there is no such signal or element, or it is not a float.
    """
    read = read_selection(text)
    if read is None:
        raise AloftError(
            f"{text!r} is no signal; write block.port.field or block.port.field[index]"
        )
    source, selection = read
    names = [n for n in fields if n.rpartition(".")[0] == source and not fields[n].constant]
    name = f"{source}.{selection.field}" if selection.field else names[0] if len(names) == 1 else ""
    if name not in fields:
        from difflib import get_close_matches

        near = names or get_close_matches(text, fields, 3, 0.0)
        raise AloftError(f"there is no signal {text!r}; there is {', '.join(near)}")
    found = fields[name]
    if found.dtype != "float64":
        raise AloftError(f"{text!r} is {found.dtype}: only float64 can be differentiated")
    try:
        return _of_field(bound, found, selection)
    except ValueError as error:
        raise AloftError(f"{text}: {error}") from error


def _of_field(bound: BoundGraph, recorded: RecordedField, selection: Selection) -> Coordinates:
    robot = bound.graph.robot
    named = robot.element_names if robot is not None else {}
    rows = named.get(str(recorded.dimensions[0]), ()) if recorded.dimensions else ()
    chosen = select(Selection("", selection.indices), recorded.shape, rows).reshape(-1)
    names, units, order = _names(recorded, robot), _units(recorded, robot), _order(recorded)
    if len(chosen) < recorded.size:
        order = ""
    return _coordinates(
        recorded.name, _split(recorded.name)[0], [names[k] for k in chosen], [units[k] for k in chosen],
        bound.memory.bus, chosen + recorded.start, order,
    )  # fmt: skip


def _coordinates(
    name: str, block: str, labels: Sequence[str], units: Sequence[str], region: Region,
    places: Indices, order: str = "", ring: tuple[int, int] | None = None,
) -> Coordinates:  # fmt: skip
    if order:
        count = len(places) // 4
        starts = [f"{name}[{k}]" if count > 1 else name for k in range(count)]
        labels = [f"{start}.rotation_{axis}" for start in starts for axis in _AXES]
        units = ["rad"] * len(labels)
    return Coordinates(name, block, tuple(labels), tuple(units), region, places, order, ring)


def _names(recorded: RecordedField, robot: object) -> list[str]:
    if not recorded.shape:
        return [recorded.name]
    named = element_names(recorded, robot)  # type: ignore[arg-type]
    if len(named) != recorded.size:
        named = [", ".join(map(str, index)) for index in np.ndindex(*recorded.shape)]
    return [f"{recorded.name}[{each.split(' [')[0].replace(' ', ', ')}]" for each in named]


def _units(recorded: RecordedField, robot: object) -> list[str]:
    return [unit_of_element(recorded, robot, k) for k in range(recorded.size)]  # type: ignore[arg-type]


def _order(recorded: RecordedField) -> str:
    return "xyzw" if recorded.field_name == "orientation" and recorded.shape[-1:] == (4,) else ""


def _split(name: str) -> tuple[str, str]:
    path, port, attribute = name.rsplit(".", 2)
    return path, f"{port}.{attribute}"
