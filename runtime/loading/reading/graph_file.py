"""The keys of a graph file, with their types and texts, as pydantic models.

The reader takes the legal keys from here, the checks of ``clock`` and ``links`` are these models, and
the JSON Schema is made of them. Blocks, wires and rates are read from nodes instead, as they may be
references to the parameters of a sub-graph.
"""

import math
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from pydantic import WithJsonSchema as Schema
from pydantic_core import PydanticCustomError

from ....files.nodes import MapNode, kind, plain
from ....files.problems import Code, Problems
from ....files.validation import find_mistakes, info_at, path_text
from ...language.errors import UnitError
from ...language.signal_error import SignalErrorKind
from ...language.stages import ClockKind, LinkMode, Overrun, WhenLate
from ...language.units import parse_quantity

EXAMPLES = {"Hz": "500 Hz", "s": "4 s"}


def positive_quantity(value: object, unit: str) -> float:
    """Read a positive number in ``unit``, from a number or a text with a unit.

    Raises:
        UnitError: it is none; the text is empty where there is no more to say.
    """
    number = math.nan
    if isinstance(value, str):
        number = parse_quantity(value, unit)
    elif isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300:
        number = float(value)
    if not 0.0 < number < 1e12:
        raise UnitError("")
    return number


def _seconds(value: object) -> float:
    try:
        return positive_quantity(value, "s")
    except UnitError as error:
        expected = f"a positive number in s, such as {EXAMPLES['s']}"
        context = {"reason": str(error), "expected": expected}
        raise PydanticCustomError("quantity", "{reason}", context) from None


def _key(text: str, written: str = "", **schema: Any) -> Any:
    """Declare a key that may be missing; ``written`` where Python has another use for the word."""
    return Field(
        default_factory=lambda: None,
        alias=written or None,
        description=text,
        json_schema_extra=schema or None,
    )


class _Keys(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


UNDERSCORED: Any = {"^_": {"description": "ignored; a place for anchors"}}
Seconds = Annotated[
    float,
    BeforeValidator(_seconds),
    Schema({"anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"type": "string"}]}),
]
YamlFile = Annotated[str, Field(pattern=r"\.ya?ml$|^aloft:")]
Reference = Annotated[str, Field(pattern=r"^\$", description="a parameter's value")]
RateText = Annotated[str, Field(pattern=r"^[0-9.]+([eE][-+]?[0-9]+)?( */ *[0-9.]+)? *k?Hz$")]
Rate = Annotated[float, Field(gt=0)] | RateText | Reference
Source = Annotated[
    str,
    Field(
        pattern=r"^[A-Za-z][A-Za-z0-9_/]*(\.[A-Za-z_][A-Za-z0-9_]*){1,2}(\[[^\[\]]*\])*$",
        description="block.port, block.port.field or block.port.field[2]",
    ),
]
Constant = (
    float
    | bool
    | Annotated[str, Field(pattern="^[-+]?[0-9.]", description="a constant, such as 3 mm")]
)
Item = Source | Reference | Constant
Items = Annotated[
    list[Item | list[Any]], Field(min_length=1, description="sources one behind another")
]


def keys_of(model: type[BaseModel]) -> tuple[str, ...]:
    """Return the keys that a model declares, as they are written."""
    return tuple(info.alias or name for name, info in model.model_fields.items())


Fields = Annotated[
    dict[str, Item | Items],
    Field(
        min_length=1,
        description="a source for every field of the input",
        json_schema_extra=lambda schema: schema.update(
            propertyNames={"not": {"enum": list(SOURCE_KEYS)}}
        ),
    ),
]


class WireFrom(_Keys):
    """A wire with more than its source."""

    source: Item | Items | Fields = Field(alias="from")
    delay: Annotated[int, Field(ge=1)] | Reference = _key("periods of the source's block")
    initial: dict[str, Any] = _key("what is read before the first value, by field")
    allow: Literal["truth"] = _key("let it read simulation truth")


class WireValue(_Keys):
    """A constant of several fields."""

    value: dict[str, Any] = Field(description="values by field; the others are zero")


SOURCE_KEYS = keys_of(WireFrom)
WIRE_KEYS = (*SOURCE_KEYS, *keys_of(WireValue))


Wire: TypeAlias = Item | Items | Fields | WireFrom | WireValue
"""Source of an input."""


class BackgroundKeys(_Keys):
    """Keys of a block that works in the background."""

    latency: Seconds = _key("the time after which outputs appear: a multiple of the block's period")
    late: WhenLate = _key(
        "in real time, while a result is late: keep the last values, write zeros, or end the run"
    )
    initial: dict[str, dict[str, Any]] = _key(
        "outputs before the first result, by output and field; otherwise zero"
    )


class BlockEntry(_Keys):
    """One block, or one use of a sub-graph."""

    model_config = ConfigDict(json_schema_extra={"patternProperties": UNDERSCORED})

    use: Annotated[str, Field(pattern=r"^[\w.]+:\w+$")] | YamlFile | Reference = Field(
        description="a block, module:Class, or the file of a sub-graph"
    )
    parameters: dict[str, Any] = _key("parameters", "with", type=["object", "null"])
    inputs: dict[str, Wire] = _key("input: source", "in", type=["object", "null"])
    rate: Rate = _key("divides the base rate")
    offset: Annotated[int, Field(ge=0)] | Reference = _key(
        "tick of the first run, below the period"
    )
    machine: str = _key("the machine that the block runs on", "on")
    background: BackgroundKeys = _key("compute beside the control thread, with a declared latency")


class ClockKeys(_Keys):
    """Keys of the pacing of a run."""

    kind: ClockKind = _key("as fast as possible, by wall time, or by the robot")
    overrun: Overrun = _key("what follows where a tick begins too late")
    stop_after: Annotated[int, Field(ge=1, strict=True)] = _key(
        "the late ticks in a row that end the run"
    )
    late_after: Annotated[float, Field(gt=0.0, le=100.0)] = _key(
        "the share of a period after its deadline at which a tick is late: 0.1"
    )
    late_share: Annotated[float, Field(ge=0.0, le=1.0)] = _key(
        "the largest share of late ticks with which a run is a success; by default any"
    )
    hangs_after: Seconds = _key("the time after which a call of a block is taken to hang")


class RecordingKeys(_Keys):
    """Keys of the recorder."""

    ring_bytes: Annotated[int, Field(ge=1 << 16, le=1 << 36, strict=True)] = _key(
        "the largest ring between run and recorder, in bytes: 67108864"
    )


class LinkKeys(_Keys):
    """Keys of the policy on late messages."""

    max_age: Seconds = _key("the age at which 'late' takes effect")
    late: WhenLate = _key("keep the last values, read zeros, or end the run")
    watch: Annotated[bool, Field(strict=True)] = _key("whether its silence counts for 'watchdog'")


class Links(LinkKeys):
    """Settings by which the machines keep together."""

    mode: LinkMode = _key("wait for each other, or run free")
    of: dict[str, LinkKeys] = _key("the links of single blocks, by block")
    paths: dict[str, Seconds] = _key("the largest age by path: robot.imu -> robot.command: 4 ms")
    watchdog: Seconds = _key("how long a link that brings commands may be silent: 15 ms")
    lease: Seconds = _key("the silence after which a machine is taken for gone: 3 s")
    patience: Seconds = _key("how long a part in lockstep waits for a message: 30 s")


class GraphValues(_Keys):
    """The keys of the graph that is run which are one value."""

    rate: Rate = _key("base rate: 500 Hz; one tick is its inverse")
    duration: Seconds = _key("how long the graph runs: 4 s")
    robot: str = _key("name of a robot, or its YAML, URDF or MJCF file")
    actuators: str = _key("the robot's actuator profile in use; by default its first")


class SignalErrorKeys(_Keys):
    """A fault on a wire; which keys it has depends on its kind."""

    on: Source | list[Source] = Field(
        description="an output, an input, or elements of one: where it is"
    )
    kind: SignalErrorKind = Field(description="what goes wrong")
    when: str = _key("the event that it begins after: block.port.field == value")
    start: Seconds = _key("when it begins, after the start or its event")
    start_spread: Seconds = _key("up to so much later, drawn by the seed")
    duration: Seconds = _key("for how long")
    value: Constant = _key("what is stuck, the bias, what a drift reaches, the deviation of noise")
    time: Seconds = _key("when a drift has reached the value")
    factor: float = _key("what a scaled value is multiplied by")
    delay: Seconds = _key("how late a delayed value is")
    share: float = _key("share of the runs in which a value is lost or flipped")
    bit: int = _key("the bit that is flipped")
    seed: int = _key("of the random stream")


class GraphSections(_Keys):
    """The keys of the graph that is run which are mappings; files and overrides add to them."""

    dimensions: dict[str, Annotated[int, Field(ge=1)]] = _key("sizes by name")
    clock: ClockKeys = _key("how the run is paced")
    recording: RecordingKeys = _key("how the run is recorded")
    machines: dict[str, str] = _key("machines that share the graph: name and endpoint")
    place: dict[str, str] = _key("block or sub-graph: machine; wins over 'on'")
    links: Links = _key("how the machines keep together")
    faults: dict[str, SignalErrorKeys] = _key("faults on wires, by name")


class SubgraphKeys(_Keys):
    """The keys that only the file of a sub-graph may have."""

    inputs: dict[str, Any] = _key("of a sub-graph: required, optional or values")
    outputs: dict[str, Wire] = _key("of a sub-graph: name and block.port")
    parameters: dict[str, Any] = _key("of a sub-graph: name and default")


class CommonKeys(_Keys):
    """The keys of every file."""

    include: YamlFile | list[YamlFile] = _key(
        "files whose blocks, wires and settings are taken over"
    )
    blocks: dict[str, BlockEntry] = _key("blocks by name", patternProperties={"^_": {}})
    wires: dict[str, Wire] = _key("block.input: source; adds to or replaces included wires")
    set: dict[str, Any] = _key(
        "block.parameter: value; overrides included files",
        propertyNames={"pattern": r"^[^.]+\..+$"},
    )


SECTION_KEYS = keys_of(GraphSections)
GRAPH_KEYS = (*keys_of(GraphValues), *SECTION_KEYS)
SUBGRAPH_KEYS = keys_of(SubgraphKeys)
COMMON_KEYS = keys_of(CommonKeys)
BLOCK_KEYS = keys_of(BlockEntry)

_WRONG_KINDS = {"dict_type", "model_type", "bool_type"}
"""Pydantic's names for errors that are about the kind of a value."""


def read_section(
    node: MapNode, name: str, model: type[BaseModel], problems: Problems
) -> dict[str, Any]:
    """Read the values of a section of the graph; what is wrong is reported to ``problems`` and left
    out."""
    data = plain(node)
    try:
        return model.model_validate(data).model_dump(exclude_unset=True)
    except ValidationError as error:
        mistakes = find_mistakes(error, model, node)
    for mistake in mistakes:
        at = f"{name}.{path_text(mistake.path)}"
        if mistake.node is None:
            owner = at.rpartition(".")[0]
            problems.add(
                Code.UNKNOWN_KEY,
                f"{mistake.key!r} is not a key of {owner!r}",
                mistake.where,
                at=at,
                expected=mistake.expected[0],
                found=mistake.key,
                nearest=mistake.nearest,
                fix=mistake.fix,
            )
            continue
        info = info_at(model, mistake.location)
        problems.add(
            Code.WRONG_KIND if _WRONG_KINDS.intersection(mistake.kinds) else Code.BAD_VALUE,
            ": ".join([f"{at} cannot be {kind(mistake.node)}", *mistake.reasons]),
            mistake.where,
            at=at,
            expected=f"{' or '.join(mistake.expected)} ({info.description if info else ''})",
            found=kind(mistake.node),
            nearest=mistake.nearest,
            fix=mistake.fix,
        )
    wrong = {each.path[0] for each in mistakes}
    good = {key: value for key, value in data.items() if key not in wrong}
    return model.model_validate(good).model_dump(exclude_unset=True)
