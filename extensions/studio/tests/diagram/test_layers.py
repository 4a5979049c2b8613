"""Columns: wires lead from left to right, those that lead back are few, and crossings are reduced."""

from hypothesis import given
from hypothesis import strategies as st

from aloft.extensions.studio.diagram.diagram import Diagram, DiagramNode, DiagramWire
from aloft.extensions.studio.diagram.layers import WirePassage, arrange


def diagram_of(edges: list[tuple[str, str]], order: str = "") -> Diagram:
    nodes = {name: DiagramNode(name, name) for name in order.split()}
    wires = []
    for a, b in edges:
        for name in (a, b):
            nodes.setdefault(name, DiagramNode(name, name))
        if "y" not in nodes[a].outputs:
            nodes[a].outputs.append("y")
        port = f"u{len(nodes[b].inputs)}"
        nodes[b].inputs.append(port)
        wires.append(DiagramWire((a, "y"), (b, port)))
    return Diagram(nodes, wires)


def test_a_chain_is_a_row() -> None:
    layers = arrange(diagram_of([("a", "b"), ("b", "c")]))
    assert layers.columns == [["a"], ["b"], ["c"]]
    assert not layers.back


def test_a_feedback_is_the_one_wire_that_leads_back() -> None:
    layers = arrange(diagram_of([("a", "b"), ("b", "c"), ("b", "d"), ("c", "e"), ("e", "a")]))
    assert [(w.source[0], w.target[0]) for w in layers.back] == [("e", "a")]


def test_a_long_wire_passes_the_columns_between_once_for_all_its_readers() -> None:
    edges = [("a", "b"), ("b", "c"), ("c", "d"), ("a", "c"), ("a", "d")]
    layers = arrange(diagram_of(edges))
    passes = [
        place for column in layers.columns for place in column if isinstance(place, WirePassage)
    ]
    assert passes == [WirePassage(("a", "y"), 1), WirePassage(("a", "y"), 2)]


def test_a_source_stands_beside_its_reader() -> None:
    layers = arrange(diagram_of([("a", "b"), ("b", "c"), ("d", "c")], "a b d c"))
    assert layers.layer["d"] == 1


def test_crossings_are_taken_out() -> None:
    layers = arrange(diagram_of([("a", "x"), ("b", "y"), ("b2", "y"), ("c", "x")], "a b b2 c x y"))
    first = [place for place in layers.columns[0] if isinstance(place, str)]
    assert set(first[:2]) in ({"a", "c"}, {"b", "b2"})


NAMES = st.sampled_from([f"n{k}" for k in range(9)])


@given(st.lists(st.tuples(NAMES, NAMES), min_size=1, max_size=24))
def test_any_graph_has_columns(edges: list[tuple[str, str]]) -> None:
    diagram = diagram_of(edges)
    layers = arrange(diagram)
    assert sorted(p for c in layers.columns for p in c if isinstance(p, str)) == sorted(
        diagram.nodes
    )
    assert len(layers.forward) + len(layers.back) == len(diagram.wires)
    for wire in layers.forward:
        assert layers.layer[wire.source[0]] < layers.layer[wire.target[0]]
    for a, b in layers.links:
        left = a.layer if isinstance(a, WirePassage) else layers.layer[a]
        right = b.layer if isinstance(b, WirePassage) else layers.layer[b]
        assert right == left + 1
    assert arrange(diagram_of(edges)).columns == layers.columns


def test_what_writes_from_its_state_stands_where_few_wires_lead_back() -> None:
    edges = [("robot", "see"), ("see", "act"), ("act", "robot"), ("act", "late"), ("late", "see")]
    diagram = diagram_of([*edges, ("robot", "late"), ("see", "late")], "late robot see act")
    for path in ("robot", "late"):
        diagram.nodes[path].moore = True
    layers = arrange(diagram)
    assert layers.layer["robot"] == 0 and layers.layer["late"] == 3
    assert {(w.source[0], w.target[0]) for w in layers.back} == {("act", "robot"), ("late", "see")}
