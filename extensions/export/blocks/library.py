"""A library of C that ``aloft export c`` has written, as a block: software in the loop."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ....robots.description import RobotDescription
from ....runtime.language.block import Block, Context, Input, Output, State, UnmetRequirement
from ....runtime.language.errors import AloftError, BlockError
from ....runtime.language.parameters import Parameters, parameter
from ....runtime.language.signals import Field, Signal, signal_of
from ..clib.library import SharedLibrary as Instance
from ..clib.library import description_in, read_description
from ..clib.remote_library import RemoteSharedLibrary


class CLibraryState(Signal):
    """The state of a library."""

    steps = Field(dtype="int64", text="the steps that were made")
    data = Field(
        "library_state", dtype="int64", text="the state as the library saves it, by eight bytes"
    )


class CLibraryParameters(Parameters):
    """The library to run, and the way to run it."""

    folder: str = parameter(
        text="the folder that aloft export c has written, relative to that of the graph"
    )
    live: dict[str, float] = parameter(
        {}, text="values of the library's live parameters, by their names in NAME.json"
    )
    memory: str = parameter(
        "", text="the shared memory of a process that runs the library; empty: it runs here"
    )


class CLibraryBlock(Block):
    """A block whose ports are those of a library."""

    Params = CLibraryParameters
    params: CLibraryParameters
    program_files = ("folder",)
    state = State(CLibraryState, text="state of the library")
    about: ClassVar[Mapping[str, Any]] = {}
    """The content of the library's description."""

    files_folder = "folder"

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a library that cannot run here, or not at this rate."""
        assert isinstance(params, CLibraryParameters)
        try:
            about = _read(params, context.folder)
        except AloftError as error:
            yield UnmetRequirement(str(error), "folder")
            return
        period = float(about["period_s"])
        if abs(context.period - period) > 1e-9 * period:
            yield UnmetRequirement(
                f"a step of {about['name']} is a tick of {period:.9g} s, and the block runs every "
                f"{context.period:.9g} s",
                "folder",
                fix=f"rate: {1.0 / period:.9g} Hz",
            )
        names = [each["name"] for each in about["parameters"]]
        for name in params.live:
            if name not in names:
                yield UnmetRequirement(
                    f"{about['name']} has no live parameter {name!r}",
                    f"live.{name}",
                    expected=", ".join(names[:12]) or "none: it has no live parameters",
                    nearest=tuple(get_close_matches(name, names, 1, 0.3)),
                )

    @classmethod
    def state_dimensions(
        cls, params: Parameters, robot: RobotDescription | None
    ) -> Mapping[str, int]:
        """Return the size of the library's state, in numbers of 8 bytes."""
        return {"library_state": -(-int(cls.about["state_bytes"]) // 8)}

    def setup(self) -> None:
        """Make an instance of the library, and bind its terminals to the ports."""
        description = description_in(self.context.folder / self.params.folder)
        self.files_read = (description, description.with_name(f"lib{self.about['name']}.so"))
        self._instance: Instance | RemoteSharedLibrary
        if self.params.memory:
            self._instance = RemoteSharedLibrary(self.about, Path(self.params.memory))
        else:
            self._instance = Instance(description)
            for name, value in self.params.live.items():
                self._instance.set(name, value)
        self._given = self._pairs("inputs", self._instance.inputs)
        self._found = self._pairs("outputs", self._instance.outputs)
        self._asked: dict[str, int] = {}
        self.save_state()

    def _pairs(
        self, kind: str, views: Mapping[str, NDArray[Any]]
    ) -> list[tuple[NDArray[Any], NDArray[Any]]]:
        """Return the pairs of a port's field and the library's terminal that belong together."""
        return [
            (getattr(self, port).views()[each["field"]], views[each["name"]])
            for port, fields in _ports(self.about)[kind].items()
            for each in fields
        ]

    def _advance(self) -> None:
        """One step of the library."""
        status = self._instance.step()
        if status:
            text = self.about["statuses"]
            code, said = next((c, t[1]) for c, t in text.items() if t[0] == status)
            block = self._instance.last_block()
            where = f", block {block}" if block else ""
            if status < 0:
                raise BlockError(f"a step of {self.about['name']} returns {code}{where}: {said}")
            key = f"{code}{where}"
            self._asked[key] = self._asked.get(key, 0) + 1

    def _take(self) -> None:
        for port, terminal in self._given:
            np.copyto(terminal, port)

    def _give(self) -> None:
        for port, terminal in self._found:
            np.copyto(port, terminal)

    def save_state(self) -> None:
        """Write the library's state into the block's own."""
        if isinstance(self._instance, RemoteSharedLibrary):
            return
        kept = np.frombuffer(self._instance.save(), np.uint8)
        self.state.data.view(np.uint8)[: kept.size] = kept

    def load_state(self) -> None:
        """Give the library its state back."""
        if isinstance(self._instance, RemoteSharedLibrary):
            if self.state.steps[()]:
                raise BlockError(
                    f"the state of {self.about['name']} is in the process that shares {self.params.memory}: "
                    "a run with it cannot be restored"
                )
            return
        size = int(self.about["state_bytes"])
        self._instance.restore(self.state.data.view(np.uint8)[:size].tobytes())

    def warnings(self) -> Sequence[str]:
        """Return the codes with which the library asked for attention, and the number of ticks."""
        return [
            f"{self.about['name']} returned {key} in {n} ticks" for key, n in self._asked.items()
        ]


class CLibrary(CLibraryBlock):
    """Runs a library of C that ``aloft export c`` has written, in place of the blocks that it was made of.

    The ports follow from its description ``NAME.json``, with shapes, units and frames: a terminal
    ``robot.imu.angular_velocity`` is the field ``angular_velocity`` of the port ``robot_imu``, and one with
    one field is a port of that field alone, such as ``force.value``. Where inputs and outputs would
    share a port, that of the inputs ends in ``_in``. The block runs once in a tick of the library; outputs
    are the bytes of the graph's own blocks. If no output depends on an input at once, they are there before
    the inputs, and the block breaks a loop of wires.

    Loading compares the shared library with its digest in the description. Both travel in the recording, and
    a snapshot has the library's state. Where a block of the library asks for attention, the run goes on, and its
    end reports how often; see the codes in extensions/export/c_library.md.

    With ``memory`` the library runs in a process of its own, the program ``main`` that was exported with it:
    in lockstep the bytes are the same; in real time the block gives the newest inputs and takes the newest outputs.

    Source: extensions/export/c_library.md.

    Raises:
        BlockError: there is no such library, it is not for this computer or this rate, its digest is
            another, or a step fails.
    """

    @classmethod
    def specialize(
        cls,
        params: Parameters,
        folder: Path,
        robot: RobotDescription | None = None,
        graph_folder: Path | None = None,
    ) -> type[Block]:
        """Make the class with the ports of the library."""
        assert isinstance(params, CLibraryParameters)
        try:
            return _class_for(_read(params, folder), remote=bool(params.memory))
        except AloftError as error:
            raise BlockError(str(error)) from error

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Return the folder of a library, which has to be written first, for this computer."""
        return {"folder": "controller"}

    def step(self) -> None:
        """One tick of the library."""
        self._take()
        self._advance()
        self._give()
        self.state.steps[()] += 1


class _WithoutFeedthrough(CLibraryBlock):
    """A library whose outputs do not depend on its inputs at once."""

    _instance: Instance

    def emit(self) -> None:
        """Write the outputs, which any inputs give; the step itself is made with those of this tick."""
        self._instance.keep()
        self._advance()
        self._give()
        self._instance.go_back()

    def update(self) -> None:
        """One tick of the library."""
        self._take()
        self._advance()
        self.state.steps[()] += 1


def _read(params: CLibraryParameters, folder: Path) -> Mapping[str, Any]:
    return read_description(description_in(folder / params.folder))


def _ports(about: Mapping[str, Any]) -> dict[str, dict[str, list[Mapping[str, Any]]]]:
    """Return the terminals of inputs and of outputs by the names of their ports."""
    found: dict[str, dict[str, list[Mapping[str, Any]]]] = {"outputs": {}, "inputs": {}}
    for kind, ports in found.items():
        for each in about[kind]:
            name = "".join(c if c.isalnum() else "_" for c in each["port"])
            name = f"{name}_" if hasattr(Block, name) or name in ("params", "context") else name
            name = f"{name}_in" if kind == "inputs" and name in found["outputs"] else name
            ports.setdefault(name, []).append(each)
    return found


_CLASSES: dict[str, type[Block]] = {}


def _class_for(about: Mapping[str, Any], *, remote: bool) -> type[Block]:
    """Return the class of a library; the same one for the same library, so that graphs compare equal."""
    key = repr((about, remote))
    if key not in _CLASSES:
        direct = remote or any(each["depends"] for each in about["outputs"])
        base: Any = CLibrary if direct else _WithoutFeedthrough
        body: dict[str, Any] = {"__doc__": CLibrary.__doc__, "__module__": CLibrary.__module__}
        for kind, ports in _ports(about).items():
            for name, fields in ports.items():
                signal = signal_of("OfLibrary", {each["field"]: each for each in fields})
                text = "; ".join(each["text"] for each in fields[:3])
                body[name] = (Input if kind == "inputs" else Output)(signal, text=text)
        body["about"], body["specialize"] = about, vars(CLibrary)["specialize"]
        body["acts_outside"] = remote
        _CLASSES[key] = type("Library", (base,), body)
    return _CLASSES[key]
