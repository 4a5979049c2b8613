"""A policy that was trained elsewhere: a neural network in an ONNX file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...files.pip_line import pip_line
from ...runtime.language.block import Block, Context, Input, Output, State, UnmetRequirement
from ...runtime.language.parameters import Parameters, parameter
from ...runtime.language.signals import Field, Signal
from .vectors import SourceParameters, UnitFromParameters

EXAMPLE = Path(__file__).with_name("example_policy.onnx")
"""y = tanh(A u) of two inputs and one output, made by the test of this block."""
_DTYPES = {"tensor(float)": np.float32, "tensor(double)": np.float64}


class Observation(Signal):
    """Observation of a policy: ``n`` numbers of any units."""

    value = Field("n", inferred=True, text="the observation's elements, in the network's order")


class Action(Signal):
    """Action of a policy: ``m`` numbers."""

    value = Field("m", inferred=True, text="the action's elements, in the network's order")


class NetworkState(Signal):
    """Memory of a recurrent network."""

    value = Field("size", text="all of its states, one after the other")


class Policy(UnitFromParameters, Block):
    """The output of a neural network, y = f(u), from an ONNX file, run by ONNX Runtime.

    The network has one input beside its states, of n elements, and ``output`` names the one of its
    outputs that is y, by default the first that is no state. Numbers may be float or double, and a
    dimension without a size, such as a batch, counts as 1. ``state`` names the inputs of a
    recurrent network and the output that each is fed from in the next tick; they begin at zero and
    are part of the block's declared state, so a restored run goes on with the same bytes.

    It runs on the processor, in one thread and without waiting for others, so a run gives the same
    bytes again on the same kind of machine; on another kind the last bits of the network's sums may
    differ. The file travels in the recording, with its SHA-256. The extra ``onnx`` is needed.

    Raises:
        BlockError: at set-up, the file cannot be read or does not fit; loading reports it before.
    """

    class Params(SourceParameters):
        file: str = parameter(text="the ONNX file, relative to the graph's folder")
        n: int = parameter(ge=1, text="elements of the observation")
        m: int = parameter(ge=1, text="elements of the action")
        output: str = parameter("", text="name of the network's output; empty for the first")
        state: dict[str, str] = parameter(
            {}, text="of a recurrent network: the output that feeds each input in the next tick"
        )
        size: int = parameter(1, ge=1, text="elements of all states together")

    params: Params
    u = Input(Observation, text="observation of the policy")
    y = Output(Action, text="action of the policy")
    memory = State(NetworkState, text="the states of a recurrent network")

    @classmethod
    def requires(cls, params: Parameters, context: Context) -> Iterable[UnmetRequirement]:
        """Report a file that is no network with these inputs and outputs."""
        assert isinstance(params, cls.Params)
        try:
            Network(params, context.folder)
        except ValueError as error:
            yield UnmetRequirement(str(error), "file")

    @classmethod
    def example_parameters(cls) -> Mapping[str, Any]:
        """Return the network beside this file."""
        return {"file": str(EXAMPLE), "n": 2, "m": 1}

    def setup(self) -> None:
        """Read the network and bind its memory."""
        self._network = Network(self.params, self.context.folder)

    def step(self) -> None:
        """Run the network once."""
        network, kept = self._network, self.memory.value
        network.observation[...] = self.u.value
        first = 0
        for state in network.states:
            state[...] = kept[first : first + len(state)]
            first += len(state)
        network.run()
        self.y.value[...] = network.action
        first = 0
        for state in network.next_states:
            kept[first : first + len(state)] = state
            first += len(state)


class Network:
    """A network with fixed memory for its inputs and outputs; all arrays are flat.

    Raises:
        ValueError: there is no such file, it is no network, or it does not fit the parameters.
    """

    def __init__(self, params: Policy.Params, folder: Path) -> None:
        self._session = _session(folder / params.file, params.file)
        inputs = {node.name: node for node in self._session.get_inputs()}
        outputs = {node.name: node for node in self._session.get_outputs()}
        for name, source in params.state.items():
            if name not in inputs:
                raise ValueError(f"{params.file} has no input {name!r}; it has {_names(inputs)}")
            if source not in outputs:
                raise ValueError(
                    f"{params.file} has no output {source!r}; it has {_names(outputs)}"
                )
        others = [name for name in inputs if name not in params.state]
        if len(others) != 1:
            raise ValueError(
                f"{params.file} must have one input beside its states; it has {_names(others)}"
            )
        fed = [name for name in outputs if name not in params.state.values()]
        wanted = params.output or (fed[0] if fed else "")
        if wanted not in outputs:
            raise ValueError(f"{params.file} has no output {wanted!r}; it has {_names(outputs)}")
        self._binding = self._session.io_binding()
        self.observation = self._bind(inputs[others[0]], "input", params.n, "n")
        self.action = self._bind(outputs[wanted], "output", params.m, "m")
        self.states = [self._bind(inputs[name], "input") for name in params.state]
        self.next_states = [self._bind(outputs[name], "output") for name in params.state.values()]
        for (name, source), a, b in zip(
            params.state.items(), self.states, self.next_states, strict=True
        ):
            if len(a) != len(b):
                raise ValueError(
                    f"input {name!r} of {params.file} has {len(a)} elements, and output {source!r} "
                    f"that feeds it {len(b)}"
                )
        size = sum(map(len, self.states))
        if self.states and size != params.size:
            raise ValueError(
                f"the states of {params.file} have {size} elements; write size: {size}"
            )
        self.run()

    def run(self) -> None:
        """Compute the outputs from the inputs."""
        self._session.run_with_iobinding(self._binding)

    def _bind(self, node: Any, kind: str, elements: int = 0, parameter: str = "") -> NDArray[Any]:
        """NetworkState for an input or output; ``elements`` is how many it must have, if that is known."""
        if node.type not in _DTYPES:
            raise ValueError(
                f"{kind} {node.name!r} is a {node.type}, not a tensor of float or double"
            )
        open_ends = [size for size in node.shape if not isinstance(size, int)]
        shape = [size if isinstance(size, int) else 1 for size in node.shape]
        if elements and len(open_ends) == 1 and not isinstance(node.shape[-1], int):
            shape[-1] = elements // prod(shape)  # the network takes any number of them
        if elements and prod(shape) != elements:
            raise ValueError(
                f"{kind} {node.name!r} has {prod(shape)} elements, and {parameter} is {elements}"
            )
        array = np.zeros(shape, _DTYPES[node.type])
        bind = self._binding.bind_input if kind == "input" else self._binding.bind_output
        bind(node.name, "cpu", 0, array.dtype.type, shape, array.ctypes.data)
        return array.reshape(-1)


def _session(path: Path, shown: str) -> Any:
    """Open the network, to be run in one thread. Raises ``ValueError``."""
    try:
        import onnxruntime
    except ImportError:
        raise ValueError(f"blocks.Policy needs ONNX Runtime: {pip_line('onnx')}") from None
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.execution_mode = onnxruntime.ExecutionMode.ORT_SEQUENTIAL
    options.use_deterministic_compute = True
    options.log_severity_level = 4  # what goes wrong is an error of ours
    try:
        data = path.read_bytes()
    except OSError as error:
        raise ValueError(f"cannot read {shown}: {error.strerror or error}") from None
    try:
        return onnxruntime.InferenceSession(data, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # noqa: BLE001  # its own errors have no common base
        reason = str(error).splitlines()[0].partition(" : ")[2] or str(error)
        raise ValueError(f"cannot read {shown} as an ONNX network: {reason}") from None


def _names(nodes: Iterable[str]) -> str:
    return ", ".join(nodes) or "none"
