"""Signals are the records of fixed layout that travel on the wires of a graph.

A signal is declared once as a class whose attributes are fields::

    class ImuReading(Signal):
        \"\"\"One sample of the inertial measurement unit.\"\"\"

        angular_velocity = Field(3, unit="rad/s", frame="body", text="gyroscope")
        specific_force = Field(3, unit="m/s^2", frame="body", text="accelerometer")

On an instance that is bound to a graph's memory each field is a NumPy view of that memory, so
reading and writing a signal copies nothing and allocates nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from enum import IntEnum
from math import prod
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, overload

import numpy as np
from numpy.typing import NDArray

from ...mathematics.compiling.kinds import ArrayKind, Kind
from .errors import DeclarationError
from .units import Unit, parse_unit

Dimension = int | str
"""A size, or the name of a dimension whose size the graph gives."""

DTYPES: Mapping[str, np.dtype[Any]] = {
    "float64": np.dtype(np.float64),
    "int64": np.dtype(np.int64),
    "bool": np.dtype(np.bool_),
}
"""The element types a field may have. Floats are checked for finiteness on every tick."""


class StateElements(NamedTuple):
    """Some neighbouring elements of a state whose field mixes quantities; see ``Block.state_elements``.

    ``quaternion`` is the order of a unit quaternion's four elements, ``xyzw`` or ``wxyz``; else empty.
    ``name`` is empty for a solver's initial guess, which changes no result beyond its tolerance.
    """

    name: str
    size: int
    unit: str = ""
    quaternion: str = ""


class Field:
    """One named array of a signal.

    Args:
        shape: sizes, or names of dimensions such as ``"n_joints"``; ``()`` is a scalar.
        unit: the physical unit as text (``"rad/s"``), ``""`` for dimensionless, ``None`` where a
            field mixes units and is not checked.
        frame: the coordinate frame the numbers are expressed in (``"world"``, ``"body"``), or
            ``None`` where that has no meaning.
        dtype: ``"float64"``, ``"int64"`` or ``"bool"``.
        text: one line on what the field is.
        values: what the numbers of an ``"int64"`` field stand for; shown by name in recordings.
        inferred: unit and frame are those of whatever the graph wires to the block: an input takes
            any, and ``Block.infer_units`` returns those of an output.
        ring: of a state that is a ring buffer along its first axis: the field with the place of its
            oldest entry, ``name`` of the same signal or ``state.name`` of the same block.
        quaternion: the last dimension is a unit quaternion x, y, z, w, which is the identity before its first
            value. Other fields are zero before it.

    Raises:
        DeclarationError: the dtype or the unit is unknown, a size is not positive, or an inferred
            field has a unit or a frame of its own, or a quaternion has another shape.
    """

    def __init__(
        self,
        shape: Dimension | tuple[Dimension, ...] = (),
        *,
        unit: str | None = None,
        frame: str | None = None,
        dtype: str = "float64",
        text: str = "",
        values: type[IntEnum] | None = None,
        inferred: bool = False,
        ring: str = "",
        quaternion: bool = False,
    ) -> None:
        self.shape: tuple[Dimension, ...] = shape if isinstance(shape, tuple) else (shape,)
        if dtype not in DTYPES:
            raise DeclarationError(f"dtype {dtype!r} is not one of {', '.join(DTYPES)}")
        for size in self.shape:
            if isinstance(size, int) and size < 1:
                raise DeclarationError(f"shape {self.shape} has a size below 1")
        self.dtype_name = dtype
        self.dtype = DTYPES[dtype]
        self.unit: Unit | None = None if unit is None else parse_unit(unit)
        self.frame = frame
        self.text = text
        self.values = values
        if inferred and (unit is not None or frame is not None):
            raise DeclarationError("an inferred field has no unit and no frame of its own")
        self.inferred = inferred
        self.ring = ring
        if quaternion and (dtype != "float64" or self.shape[-1:] != (4,)):
            raise DeclarationError(f"a quaternion has 4 floats last, not {dtype} {self.shape}")
        self.quaternion = quaternion
        self.name = ""

    def __set_name__(self, owner: type, name: str) -> None:
        self.name = name

    # A field is a non-data descriptor: on a bound signal the view in the instance's own
    # dictionary wins at full speed, and this method is only what tells a type checker so. It says
    # Any, because in a kernel a scalar field is a number.
    @overload
    def __get__(self, instance: None, owner: type) -> Field: ...
    @overload
    def __get__(self, instance: Signal, owner: type) -> Any: ...
    def __get__(self, instance: Signal | None, owner: type) -> Any:
        if instance is None:
            return self
        raise AttributeError(f"{owner.__name__}.{self.name} is not bound to memory")

    if TYPE_CHECKING:  # a scalar field is assigned like a number; see ``Signal.__setattr__``

        def __set__(self, instance: Signal, value: Any) -> None: ...

    def resolve(self, dimensions: Mapping[str, int]) -> tuple[int, ...]:
        """Return the shape in numbers.

        Raises:
            KeyError: a dimension's name is not in ``dimensions``.
        """
        return tuple(size if isinstance(size, int) else dimensions[size] for size in self.shape)

    def blank(self, shape: tuple[int, ...]) -> NDArray[Any]:
        """Return an array of a resolved shape as it is before the first value."""
        values = np.zeros(shape, self.dtype)
        if self.quaternion:
            values[..., 3] = 1.0
        return values

    def describe(self) -> str:
        """Return the field's type in one line, e.g. ``float64[n_joints] rad``."""
        shape = f"[{', '.join(map(str, self.shape))}]" if self.shape else ""
        unit = f" {self.unit}" if self.unit is not None else ""
        frame = f" in {self.frame}" if self.frame else ""
        return f"{self.dtype_name}{shape}{unit}{frame}"


class Signal:
    """The base of all signals; see the module's text. Instances are made by the runtime."""

    fields: ClassVar[Mapping[str, Field]] = {}

    def __init_subclass__(cls, **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        own = {name: value for name, value in vars(cls).items() if isinstance(value, Field)}
        cls.fields = {**cls.fields, **own}

    @classmethod
    def bind(cls, views: Mapping[str, NDArray[Any]]) -> Self:
        """Return an instance whose fields are the given arrays, themselves not copied."""
        signal = cls.__new__(cls)
        for name, view in views.items():  # using __dict__ would slow down every later access
            object.__setattr__(signal, name, view)
        return signal

    if not TYPE_CHECKING:  # a type checker would conclude that any name may be assigned

        def __setattr__(self, name: str, value: Any) -> None:
            """Write a number into a scalar field: ``signal.count = 3``.

            Raises:
                AttributeError: there is no such field, or it is an array, which would silently leave
                    the graph's memory unchanged; ``signal.field += x`` assigns its own view.
            """
            view = getattr(self, name, None)  # using __dict__ would slow down every later access
            if name in type(self).fields and view is value:
                return
            if view is not None and view.ndim == 0:
                view[()] = value
                return
            raise AttributeError(
                f"{type(self).__name__}.{name} cannot be assigned: a field is a view of the "
                f"graph's memory; write into it, as in .{name}[...] = value"
                if name in type(self).fields
                else f"{type(self).__name__} has no field {name!r}; it has "
                + ", ".join(type(self).fields)
            )

    @classmethod
    def kernel_kinds(cls) -> Mapping[str, Kind]:
        """Return the kind of each field in the equations of a kernel: its known sizes and its
        elements."""
        elements: Mapping[str, type] = {"float64": float, "int64": int, "bool": bool}
        return {
            name: ArrayKind(
                tuple(size if isinstance(size, int) else None for size in field.shape),
                elements[field.dtype_name],
            )
            for name, field in cls.fields.items()
        }

    @classmethod
    def allocate(cls, dimensions: Mapping[str, int] | None = None) -> Self:
        """Return a free-standing instance before its first value, with memory of its own, for tests and
        tools."""
        sizes = dimensions or {}
        return cls.bind({n: f.blank(f.resolve(sizes)) for n, f in cls.fields.items()})

    def views(self) -> Mapping[str, NDArray[Any]]:
        """Return the arrays by field name, in the order of declaration."""
        return {name: self.__dict__[name] for name in type(self).fields}

    def __iter__(self) -> Iterator[tuple[str, NDArray[Any]]]:
        return iter(self.views().items())

    def __repr__(self) -> str:
        inner = ", ".join(f"{n}={v.tolist()}" for n, v in self.views().items())
        return f"{type(self).__name__}({inner})"


@dataclass(frozen=True)
class Slot:
    """The place of one field in a buffer: its section, its first element there, and its shape."""

    section: str
    start: int
    shape: tuple[int, ...]

    @property
    def size(self) -> int:
        """The number of elements."""
        return prod(self.shape)


def signal_of(name: str, fields: Mapping[str, Mapping[str, Any]]) -> type[Signal]:
    """Make a signal that is declared by data, such as the description of an exported one.

    Args:
        name: its name.
        fields: of each field ``shape``, ``dtype``, ``unit``, ``frame``, ``text`` and ``quaternion``, each of which
            may be missing.

    Raises:
        DeclarationError: as for ``Field``.
    """
    body: dict[str, Any] = {"__doc__": "A signal declared by data."}
    for key, field in fields.items():
        body[key] = Field(
            tuple(field.get("shape", ())),
            unit=field.get("unit"),
            frame=field.get("frame"),
            dtype=field.get("dtype", "float64"),
            text=field.get("text") or f"{key}, from outside",
            quaternion=field.get("quaternion", False),
        )
    return type(name, (Signal,), body)
