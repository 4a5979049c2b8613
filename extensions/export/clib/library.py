"""A library that ``aloft export c`` has written, called from Python."""

from __future__ import annotations

import ctypes
import json
import platform
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....files.names import is_file_name
from ....runtime.language.errors import AloftError


class SharedLibrary:
    """One instance of a library, in memory of its own.

    Args:
        description: the file ``NAME.json``; the shared library lies beside it.

    Attributes:
        about: what the description says.
        inputs, outputs: views of what a step reads and writes, by the names of the terminals.
        memory: the bytes of the instance.

    Raises:
        AloftError: there is no such library, or it cannot be loaded here.
    """

    def __init__(self, description: Path) -> None:
        self.about = read_description(description)
        name = self.about["name"]
        file = description.parent.resolve() / f"lib{name}.so"
        try:
            self._code: Any = ctypes.CDLL(str(file))
        except OSError as error:
            raise AloftError(f"{file} cannot be loaded here: {error}") from error
        self.memory = _aligned(self.about["memory_bytes"])
        self._in, self._out = (_aligned(self.about[f"{k}_bytes"]) for k in ("input", "output"))
        self.inputs = views(self._in, self.about["inputs"])
        self.outputs = views(self._out, self.about["outputs"])
        self._self, self._arguments = (
            _pointer(self.memory),
            (_pointer(self._in), _pointer(self._out)),
        )
        self._step, self._save, self._restore = map(self._function, ("step", "save", "restore"))
        self._state = _aligned(self.about["state_bytes"])
        self._at_state = _pointer(self._state)
        self._expect(self._function("init")(self._self, ctypes.c_int64(self.memory.size)), "init")

    def _function(self, key: str) -> Any:
        function = self._code[f"{self.about['name']}_{key}"]
        function.restype = ctypes.c_int32
        return function

    def _expect(self, status: int, what: str) -> None:
        if status:
            raise AloftError(f"{self.about['name']}_{what} returns {status}")

    def reset(self) -> None:
        """Go back to the state of a new instance."""
        self._expect(self._function("reset")(self._self), "reset")

    def take(self, inputs: NDArray[np.uint8]) -> None:
        """Take all inputs from the bytes of their struct in C."""
        self._in[:] = inputs

    def step(self) -> int:
        """Make one tick: from ``inputs`` to ``outputs``. Returns the status."""
        return int(self._step(self._self, *self._arguments))

    def last_block(self) -> str:
        """Return the path of the block that the last status is about; empty where it is about none."""
        number = self._function("last_block")(self._self)
        return str(self.about["blocks"][number]) if number >= 0 else ""

    def keep(self) -> None:
        """Keep the state for ``go_back``."""
        self._expect(self._save(self._self, self._at_state), "save")

    def go_back(self) -> None:
        """Take back the state that was kept last."""
        self._expect(self._restore(self._self, self._at_state), "restore")

    def save(self) -> bytes:
        """Return the state as bytes."""
        self.keep()
        return self._state.tobytes()

    def restore(self, state: bytes) -> None:
        """Take back a state that ``save`` gave.

        Raises:
            AloftError: it is of another library.
        """
        if len(state) != self._state.size:
            raise AloftError(
                f"a state of {self.about['name']} has {self._state.size} bytes, not {len(state)}"
            )
        self._state[:] = np.frombuffer(state, np.uint8)
        self.go_back()

    def set(self, parameter: str, value: float) -> None:
        """Change a live parameter, ``block.parameter`` or an element of it, ``block.parameter[0]``.

        Raises:
            AloftError: there is none of that name, or the value is outside its bounds.
        """
        number = self._number(parameter)
        if self._function("set")(self._self, number, ctypes.c_double(value)):
            raise AloftError(f"{parameter} cannot be {value!r}")

    def get(self, parameter: str) -> float:
        """Return the present value of a live parameter.

        Raises:
            AloftError: there is none of that name.
        """
        function = self._code[f"{self.about['name']}_get"]
        function.restype = ctypes.c_double
        return float(function(self._self, self._number(parameter)))

    def _number(self, parameter: str) -> ctypes.c_int32:
        names = [each["name"] for each in self.about["parameters"]]
        if parameter not in names:
            raise AloftError(
                f"no live parameter {parameter!r}; there is {', '.join(names) or 'none'}"
            )
        return ctypes.c_int32(names.index(parameter))


def description_in(folder: Path) -> Path:
    """Return the description ``NAME.json`` in a folder that ``aloft export c`` has written.

    Raises:
        AloftError: there is none, or there are several files of that kind.
    """
    found = sorted(folder.glob("*.json"))
    if len(found) == 1:
        return found[0]
    if not folder.is_dir():
        raise AloftError(
            f"there is no folder {folder}; write it with aloft export c --out {folder}"
        )
    many = f"{', '.join(each.name for each in found)}, of which one may be" if found else "none"
    raise AloftError(
        f"{folder} has to have one description NAME.json, as aloft export c writes it; there is {many}"
    )


def read_description(description: Path) -> Mapping[str, Any]:
    """Return the description of a library, if the library can run here.

    Raises:
        AloftError: it is no description, it is of another processor, or the shared library is missing
            or another one; the message says what to do.
    """
    try:
        about = json.loads(description.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise AloftError(f"{description} cannot be read: {error}") from error
    if not isinstance(about, dict) or not {"name", "target", "files", "memory_bytes"} <= set(about):
        raise AloftError(f"{description} describes no library; aloft export c writes such files")
    if not is_file_name(str(about["name"])):
        raise AloftError(
            f"{description} describes no library: {about['name']!r} is no name of a file"
        )
    if about["target"] != platform.machine():
        raise AloftError(
            f"{description} is for {about['target']}, and this computer is {platform.machine()}; "
            f"export it with --target {platform.machine()}"
        )
    name = f"lib{about['name']}.so"
    file = description.parent / name
    if not file.is_file():
        raise AloftError(f"{file} is missing: without a C compiler no shared library is written")
    digest, own = sha256(file.read_bytes()).hexdigest(), about["files"].get(name, {}).get("sha256")
    if digest != own:
        raise AloftError(
            f"{file} is not the library that {description.name} describes: its SHA-256 begins with "
            f"{digest[:12]}, not {str(own)[:12]}; export both again"
        )
    return about


def views(
    data: NDArray[np.uint8], terminals: Sequence[Mapping[str, Any]]
) -> dict[str, NDArray[Any]]:
    """Return the terminals in the bytes of a struct of C, or of several, (..., bytes)."""
    found = {}
    for each in terminals:
        dtype, first = np.dtype(each["dtype"]), each["offset"]
        size = int(np.prod(each["shape"], dtype=np.int64)) * dtype.itemsize
        part = data[..., first : first + size].view(dtype)
        found[each["name"]] = part.reshape((*data.shape[:-1], *each["shape"]))
    return found


def _aligned(size: int) -> NDArray[np.uint8]:
    raw = np.zeros(size + 64, np.uint8)
    start = -raw.ctypes.data % 64
    return raw[start : start + size]


def _pointer(array: NDArray[np.uint8]) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
