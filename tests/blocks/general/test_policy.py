"""``blocks.Policy``: values of networks made here, recurrent ones, determinism and errors."""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from onnx import TensorProto, helper, numpy_helper

import aloft
from aloft.blocks.general.policy import EXAMPLE, Policy
from aloft.logs.file.reader import read
from aloft.logs.recording.recorder import Recorder
from aloft.runtime.language.errors import BlockError
from aloft.runtime.testing import BlockBench

WEIGHTS = np.array([[0.5, -1.5]], np.float32)


def write(path: Path, nodes: list[Any], inputs: Any, outputs: Any, **constants: Any) -> Path:
    """Write a network; inputs and outputs are shapes by name."""

    def tensors(shapes: dict[str, Any], kind: int = TensorProto.FLOAT) -> list[Any]:
        return [helper.make_tensor_value_info(name, kind, shape) for name, shape in shapes.items()]

    graph = helper.make_graph(
        nodes, "policy", tensors(inputs), tensors(outputs),
        [numpy_helper.from_array(value, name) for name, value in constants.items()],
    )  # fmt: skip
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)])
    model.ir_version = 8
    onnx.checker.check_model(model)
    path.write_bytes(model.SerializeToString())
    return path


def simple(path: Path, batch: Any = 1) -> Path:
    """y = tanh(A u)."""
    nodes = [
        helper.make_node("Gemm", ["u", "A"], ["s"], transB=1),
        helper.make_node("Tanh", ["s"], ["y"]),
    ]
    return write(path, nodes, {"u": [batch, 2]}, {"y": [batch, 1]}, A=WEIGHTS)


def counting(path: Path) -> Path:
    """y = h + u and h' = h + u, with a value that nobody wants."""
    nodes = [
        helper.make_node("Add", ["u", "h"], ["next"]),
        helper.make_node("Identity", ["next"], ["action"]),
        helper.make_node("Neg", ["u"], ["value"]),
    ]
    shapes = {"value": [1, 3], "action": [1, 3], "next": [1, 3]}
    return write(path, nodes, {"u": [1, 3], "h": [1, 3]}, shapes)


def bench(file: Path, **params: Any) -> BlockBench:
    return BlockBench(Policy, {"file": file.name, **params}, folder=file.parent)


@pytest.mark.parametrize("batch", [1, "batch"])
def test_the_network_is_evaluated(tmp_path: Path, batch: Any) -> None:
    tested = bench(simple(tmp_path / "p.onnx", batch), n=2, m=1)
    for u in ([0.0, 0.0], [1.0, 0.5], [-0.3, 0.8]):
        tested.set("u", value=u)
        tested.step()
        expected = np.tanh(WEIGHTS @ np.array(u, np.float32))
        assert tested.get("y").value == pytest.approx(expected, abs=1e-6)


def test_the_example_is_this_network(tmp_path: Path) -> None:
    found, made = (onnx.load(p) for p in (EXAMPLE, simple(tmp_path / "p.onnx")))
    assert found.graph == made.graph


def test_a_recurrent_network_remembers_and_goes_on_after_a_restore(tmp_path: Path) -> None:
    counting(tmp_path / "p.onnx")
    text = """\
rate: 100 Hz
blocks:
  see: {use: blocks.Constant, with: {value: [1, 2, 0.5]}}
  act:
    use: blocks.Policy
    with: {file: p.onnx, n: 3, m: 3, output: action, state: {h: next}, size: 3}
    in: {u: see.y}
"""
    graph = aloft.load(text, path=tmp_path / "graph.yaml")
    with graph.open() as run:
        run.step(4)
        assert run["act.y.value"].tolist() == [4.0, 8.0, 2.0]
        kept = run.snapshot()
        run.step(3)
        once = run["act.y.value"]
        run.restore(kept)
        run.step(3)
        assert run["act.y.value"].tolist() == once.tolist() == [7.0, 14.0, 3.5]


def test_the_same_bytes_again_and_the_files_hash_is_kept(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    nodes = [
        helper.make_node("Gemm", ["u", "A"], ["s"]),
        helper.make_node("Elu", ["s"], ["t"]),
        helper.make_node("Gemm", ["t", "B"], ["y"]),
    ]
    weights = {"A": (48, 256), "B": (256, 12)}
    constants = {k: rng.normal(size=s).astype(np.float32) for k, s in weights.items()}
    file = write(tmp_path / "p.onnx", nodes, {"u": [1, 48]}, {"y": [1, 12]}, **constants)
    text = """\
rate: 100 Hz
duration: 2 s
blocks:
  see: {use: blocks.WhiteNoise, with: {n: 48, seed: 5}}
  act: {use: blocks.Policy, with: {file: p.onnx, n: 48, m: 12}, in: {u: see.y}}
"""
    graph = aloft.load(text, path=tmp_path / "graph.yaml")
    recorder = Recorder(tmp_path / "run.rrd")
    assert graph.run(sinks=[recorder]).run_hash == graph.run().run_hash
    sha = hashlib.sha256(file.read_bytes()).hexdigest()
    assert read(tmp_path / "run.rrd").header.files == {"act.file: p.onnx": sha}


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({"n": 3, "m": 1}, "input 'u' has 2 elements, and n is 3"),
        ({"n": 2, "m": 4}, "output 'y' has 1 elements, and m is 4"),
        ({"output": "z"}, "p.onnx has no output 'z'; it has y"),
        ({"state": {"h": "y"}}, "p.onnx has no input 'h'; it has u"),
        ({"state": {"u": "y"}}, "p.onnx must have one input beside its states; it has none"),
        ({"file": "q.onnx"}, "cannot read q.onnx: No such file or directory"),
        ({"file": "bad.onnx"}, "cannot read bad.onnx as an ONNX network: "),
    ],
)
def test_mistakes_are_reported_at_load(
    tmp_path: Path, params: dict[str, Any], message: str
) -> None:
    simple(tmp_path / "p.onnx")
    (tmp_path / "bad.onnx").write_text("this is no network")
    with pytest.raises(BlockError, match=message):
        BlockBench(Policy, {"file": "p.onnx", "n": 2, "m": 1, **params}, folder=tmp_path)


def test_the_size_of_the_states_is_proposed(tmp_path: Path) -> None:
    counting(tmp_path / "p.onnx")
    params = {"file": "p.onnx", "n": 3, "m": 3, "output": "action", "state": {"h": "next"}}
    with pytest.raises(BlockError, match=r"the states of p\.onnx have 3 elements; write size: 3"):
        BlockBench(Policy, params, folder=tmp_path)


def test_a_missing_library_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(BlockError, match=r"pip install 'onnxruntime"):
        bench(simple(tmp_path / "p.onnx"), n=2, m=1)
