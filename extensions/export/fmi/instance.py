"""An FMU that runs in this process: its values, its steps, its state and its log."""

from __future__ import annotations

import atexit
import ctypes
import os
import sys
import tempfile
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ....files.names import UnsafeNameError, inside
from ....runtime.language.errors import BlockError
from ....runtime.language.signals import Signal
from .description import Description, Variable, nearest

_REGISTERED: dict[int, ctypes.CDLL] = {}


def release_at_exit(binaries: Path) -> None:
    """Have an FMU's library, if this process has loaded it, let go of Python before the exit.

    PythonFMU3 keeps its hold on Python in a static ``shared_ptr``. On Linux its destructor frees
    what that holds, and after it the library's ``__attribute__((destructor))`` assigns to the
    destroyed pointer, which counts down in the freed memory. Sometimes glibc then finds its heap
    damaged ("corrupted double-linked list") and aborts a process whose work was done. The library
    exports the function that sets the pointer to null. Called before, while everything lives, it
    leaves the other two nothing to free. Of other FMUs' libraries nothing is called.

    Args:
        binaries: the folder ``binaries`` of the unpacked FMU.
    """
    if sys.platform != "linux":
        return
    for file in sorted(binaries.glob("*/*.so")):
        try:
            library = ctypes.CDLL(str(file), mode=os.RTLD_NOLOAD | os.RTLD_LAZY)
            release = library.finalizePythonInterpreter
        except (OSError, AttributeError):  # not loaded here, or not made by PythonFMU
            continue
        if library._handle not in _REGISTERED:
            _REGISTERED[library._handle] = library
            release.restype = None
            atexit.register(release)


_NATIVE = {
    "Real": "f8", "Float64": "f8", "Float32": "f4", "Integer": "i4", "Enumeration": "i8",
    "Int8": "i1", "UInt8": "u1", "Int16": "i2", "UInt16": "u2", "Int32": "i4", "UInt32": "u4",
    "Int64": "i8", "UInt64": "u8", "Boolean": "?",
}  # fmt: skip
"""The element type in memory of a variable's type; FMI 2.0 differs for two of them."""
_NATIVE_2 = {**_NATIVE, "Enumeration": "i4", "Boolean": "i4"}
_STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
LINES = 12
"""Number of the FMU's last log lines that are kept."""


class FmuInstance:
    """One instance of an FMU, initialised and ready for its first step.

    Args:
        described: the FMU.
        start: start values by the names of variables.
        time: when it begins [s].

    Raises:
        BlockError: it cannot be loaded or initialised, or a start value does not fit.
    """

    def __init__(self, described: Description, start: Mapping[str, Any], time: float) -> None:
        self.described = described
        self.log: deque[str] = deque(maxlen=LINES)
        self.warnings: list[str] = []
        self._folder = tempfile.TemporaryDirectory(prefix="aloft-fmu-", ignore_cleanup_errors=True)
        self._open = False
        self.failed = False
        """True after a failed call; then the FMU may only be left alone."""
        self._places = list(sys.path)
        with _Blame(self, "loaded"):
            self._fmu = self._load()
        with _Blame(self, "initialised"):
            self._initialise(start, time)
        self._open = True

    def _load(self) -> Any:
        from fmpy import extract
        from fmpy.fmi2 import FMU2Slave
        from fmpy.fmi3 import FMU3Slave

        _expect_fitting(self.described.path, Path(self._folder.name))
        folder = extract(str(self.described.path), self._folder.name)
        kind = FMU2Slave if self.described.version == 2 else FMU3Slave
        fmu = kind(
            guid=self.described.token,
            unzipDirectory=str(folder),
            modelIdentifier=self.described.identifier,
            instanceName=self.described.identifier,
        )
        if self.described.version == 2:
            fmu.instantiate(callbacks=_callbacks_2(self._hear), loggingOn=True)
        else:
            fmu.instantiate(
                loggingOn=True,
                logMessage=lambda _, status, category, text: self._hear(status, text),
            )
        release_at_exit(Path(folder) / "binaries")
        return fmu

    def _hear(self, status: int, text: bytes | None) -> None:
        """Keep a line of the FMU's log."""
        line = f"[{_STATUS[status]}] {(text or b'').decode('utf-8', 'replace').strip()}"
        self.log.append(line)
        if status == 1 and len(self.warnings) < LINES:
            self.warnings.append(line)

    def _initialise(self, start: Mapping[str, Any], time: float) -> None:
        fmu = self._fmu
        if self.described.version == 2:
            fmu.setupExperiment(startTime=time)
        for name, value in start.items():
            self._set_start(name, value)
        if self.described.version == 2:
            fmu.enterInitializationMode()
        else:
            fmu.enterInitializationMode(startTime=time)
        fmu.exitInitializationMode()

    def _set_start(self, name: str, value: Any) -> None:
        settable = self.described.settable
        if name not in settable:
            raise BlockError(
                f"{self.described.file} has no variable {name!r} that can be given a start value"
                + nearest(name, settable)
            )
        reference, kind, shape = settable[name]
        size = int(np.prod(shape)) if shape else 1
        values = np.ravel(np.asarray(value, None if kind == "String" else np.float64)).tolist()
        if len(values) != size:
            raise BlockError(f"{name} of {self.described.file} has {size} numbers, not {value}")
        convert = {"f": float, "i": int, "u": int, "?": bool}.get(_NATIVE.get(kind, "")[:1], str)
        named = "Int64" if kind == "Enumeration" and self.described.version == 3 else kind
        named = "Integer" if kind == "Enumeration" and self.described.version == 2 else named
        getattr(self._fmu, f"set{named}")([reference], [convert(each) for each in values])

    def writer(self, variables: Iterable[Variable], ports: Mapping[str, Signal]) -> Transfer:
        """Return the transfer that sets variables from the signals of ports."""
        return Transfer(self, variables, ports, setting=True)

    def reader(self, variables: Iterable[Variable], ports: Mapping[str, Signal]) -> Transfer:
        """Return the transfer that gets variables into the signals of ports."""
        return Transfer(self, variables, ports, setting=False)

    def call(self, name: str, *arguments: Any) -> None:
        """Call a function of the FMU. Raises ``BlockError`` with the FMU's log if it fails."""
        with _Blame(self, "set" if "Set" in name else "read"):
            getattr(self._fmu, name)(self._fmu.component, *arguments)

    def step(self, time: float, period: float) -> bool:
        """Go on by ``period``. Returns whether the FMU asks for the end of the run."""
        with _Blame(self, f"stepped from {time:.9g} s by {period:.9g} s"):
            answer = self._fmu.doStep(time, period)
        return bool(answer is not None and answer[1])

    def state(self) -> bytes:
        """Return the FMU's state."""
        fmu = self._fmu
        with _Blame(self, "asked for its state"):
            state = fmu.getFMUState()
            try:
                return bytes(fmu.serializeFMUState(state))
            finally:
                fmu.freeFMUState(state)

    def restore(self, data: bytes) -> None:
        """Go back to what the FMU remembered."""
        fmu = self._fmu
        with _Blame(self, "given back its state"):
            state = fmu.deserializeFMUState(data)
            try:
                fmu.setFMUState(state)
            finally:
                fmu.freeFMUState(state)

    def close(self) -> None:
        """Terminate the FMU and remove its files; a second call does nothing."""
        if not self._open:
            return
        self._open = False
        try:
            if not self.failed:
                with _Blame(self, "terminated"):
                    self._fmu.terminate()
                    self._fmu.freeInstance()
        finally:
            # an FMU that is written in Python puts its folder on the path, and leaves it there
            sys.path[:] = [p for p in sys.path if p in self._places or self._folder.name not in p]
            self._folder.cleanup()


MOST_UNPACKED = 1 << 32
"""Bytes that the files of an FMU may have, all together."""


def _expect_fitting(path: Path, folder: Path) -> None:
    """Raise ``BlockError`` for an archive with names that lead out of ``folder``, or that is too large."""
    from zipfile import ZipFile

    with ZipFile(path) as archive:
        entries = archive.infolist()
    size = sum(entry.file_size for entry in entries)
    if size > MOST_UNPACKED:
        raise BlockError(f"it would unpack to {size} bytes; expected {MOST_UNPACKED} at most")
    for entry in entries:
        try:
            inside(folder, entry.filename)
        except UnsafeNameError as error:
            raise BlockError(str(error)) from error


class Transfer:
    """Copies between the fields of ports and variables of an FMU; a call allocates no array."""

    def __init__(
        self,
        instance: FmuInstance,
        variables: Iterable[Variable],
        ports: Mapping[str, Signal],
        *,
        setting: bool,
    ) -> None:
        self._instance = instance
        self._setting = setting
        version = instance.described.version
        kinds: dict[str, list[Variable]] = {}
        for each in variables:
            kinds.setdefault(each.kind, []).append(each)
        self._calls: list[tuple[str, tuple[Any, ...]]] = []
        self._pairs: list[tuple[NDArray[Any], NDArray[Any]]] = []
        self._kept: list[NDArray[Any]] = []
        for kind, members in kinds.items():
            native = (_NATIVE_2 if version == 2 else _NATIVE)[kind]
            size = sum(each.size for each in members)
            values = np.zeros(size, native)
            references = np.array([r for each in members for r in each.references], np.uint32)
            first = 0
            for each in members:
                view = ports[each.port].views()[each.field]
                part = values[first : first + each.size].reshape(each.shape)
                self._pairs.append((part, view) if setting else (view, part))
                first += each.size
            self._kept += [values, references]
            name = {"Enumeration": "Integer" if version == 2 else "Int64"}.get(kind, kind)
            function = f"fmi{version}{'Set' if setting else 'Get'}{name}"
            arguments: list[Any] = [_pointer(references), len(references), _pointer(values)]
            self._calls.append((function, (*arguments, *([size] if version == 3 else []))))

    def __call__(self) -> None:
        """Set or get all of them. Raises ``BlockError``."""
        if self._setting:
            for target, source in self._pairs:
                np.copyto(target, source, casting="unsafe")
        for name, arguments in self._calls:
            self._instance.call(name, *arguments)
        if not self._setting:
            for target, source in self._pairs:
                np.copyto(target, source, casting="unsafe")


def _pointer(array: NDArray[Any]) -> Any:
    if array.dtype == np.bool_:
        return array.ctypes.data_as(ctypes.POINTER(ctypes.c_bool))
    return array.ctypes.data_as(ctypes.POINTER(np.ctypeslib.as_ctypes_type(array.dtype)))


class _Blame:
    """Turns what FMPy or an FMU raises into a ``BlockError`` that has the FMU's own log lines."""

    def __init__(self, instance: FmuInstance, doing: str) -> None:
        self._instance = instance
        self._doing = doing

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: object, error: BaseException | None, traceback: object) -> None:
        if error is None or isinstance(error, BlockError) or not isinstance(error, Exception):
            return
        self._instance.failed = True
        file, log = self._instance.described.file, self._instance.log
        said = " | ".join(log)
        raise BlockError(
            f"{file} could not be {self._doing}: {' '.join(str(error).split())}; "
            + (f"its log says: {said}" if said else "its log is empty")
        ) from error


def _callbacks_2(hear: Callable[[int, bytes], None]) -> Any:
    """Return the callbacks of FMI 2.0, with FMPy's proxy that fills in the arguments of log lines."""
    from fmpy import calloc, free
    from fmpy.fmi2 import (
        fmi2CallbackAllocateMemoryTYPE,
        fmi2CallbackFreeMemoryTYPE,
        fmi2CallbackFunctions,
        fmi2CallbackLoggerTYPE,
    )

    made = fmi2CallbackFunctions()
    made.logger = fmi2CallbackLoggerTYPE(
        lambda environment, name, status, category, message: hear(status, message)
    )
    made.allocateMemory = fmi2CallbackAllocateMemoryTYPE(calloc)
    made.freeMemory = fmi2CallbackFreeMemoryTYPE(free)
    try:
        from fmpy.logging import addLoggerProxy

        addLoggerProxy(ctypes.byref(made))
    except Exception:  # noqa: BLE001  there is none for this machine: lines stay unformatted
        return made
    return made
