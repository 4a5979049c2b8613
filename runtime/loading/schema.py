"""The JSON Schema of graph files, for completion and checks in editors.

It has the names of all blocks with their parameters and inputs. It is less strict than the loader
on purpose: a parameter or a wire may come from another file, so none is required here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from ..language.block import Block
from ..language.registry import all_blocks
from ..transports.registry import endpoint_pattern
from .reading.written import CLOCK_KEYS, SOURCE_KEYS

Schema = dict[str, Any]

_REFERENCE: Schema = {"type": "string", "pattern": "^\\$", "description": "a parameter's value"}
_EXPORTED: Schema = {
    "type": "object",
    "additionalProperties": False,
    "required": ["from"],
    "properties": {"from": {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_/]*\\.[A-Za-z_]"}},
    "description": "a value that another block exports: {from: block.name}",
}
_RATE: Schema = {
    "anyOf": [
        {"type": "number", "exclusiveMinimum": 0},
        {"type": "string", "pattern": "^[0-9.]+([eE][-+]?[0-9]+)?( */ *[0-9.]+)? *k?Hz$"},
        _REFERENCE,
    ]
}
_SOURCE: Schema = {
    "type": "string",
    "pattern": "^[A-Za-z][A-Za-z0-9_/]*(\\.[A-Za-z_][A-Za-z0-9_]*){1,2}(\\[[^\\[\\]]*\\])*$",
}
_NUMBER: Schema = {
    "anyOf": [{"type": ["number", "boolean"]}, {"type": "string", "pattern": "^[-+]?[0-9.]"}],
    "description": "a constant, such as 3 mm",
}
_ITEM: Schema = {"anyOf": [_SOURCE, _REFERENCE, _NUMBER]}
_LIST: Schema = {
    "type": "array",
    "items": {"anyOf": [_ITEM, {"type": "array"}]},
    "minItems": 1,
    "description": "sources one behind another",
}
_FIELDS: Schema = {
    "type": "object",
    "propertyNames": {"not": {"enum": list(SOURCE_KEYS)}},
    "additionalProperties": {"anyOf": [_ITEM, _LIST]},
    "minProperties": 1,
    "description": "a source for every field of the input",
}
_LINK_POLICY: Schema = {
    "max_age": {"anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"type": "string"}]},
    "late": {"enum": ["hold", "safe", "stop"]},
    "watch": {"type": "boolean", "description": "whether its silence counts for 'watchdog'"},
}
_VALUES: Schema = {"type": "object", "description": "values by field; the others are zero"}
_WIRE: Schema = {
    "anyOf": [
        {**_SOURCE, "description": "block.port, block.port.field or block.port.field[2]"},
        _REFERENCE,
        _NUMBER,
        _LIST,
        _FIELDS,
        {
            "type": "object",
            "additionalProperties": False,
            "required": ["from"],
            "properties": {
                "from": {"anyOf": [_ITEM, _LIST, _FIELDS]},
                "delay": {
                    "anyOf": [{"type": "integer", "minimum": 1}, _REFERENCE],
                    "description": "periods of the source's block",
                },
                "initial": {**_VALUES, "description": "what is read before the first value"},
                "allow": {"const": "truth", "description": "let it read simulation truth"},
            },
        },
        {
            "type": "object",
            "additionalProperties": False,
            "required": ["value"],
            "properties": {"value": _VALUES},
        },
    ]
}


def graph_schema(blocks: Mapping[str, type[Block]] | None = None) -> Schema:
    """The schema for graphs of these blocks; by default for all registered blocks."""
    known = dict(blocks) if blocks is not None else all_blocks()
    definitions: Schema = {"wire": _WIRE, "block": _block_schema(known)}
    for name, block_type in known.items():
        definitions[name] = _particular_schema(name, block_type, definitions)
    files = {"type": "string", "pattern": "\\.ya?ml$"}
    anything = {"type": "object"}
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "aloft graph",
        "type": "object",
        "additionalProperties": False,
        "patternProperties": {"^_": {"description": "ignored; a place for anchors"}},
        "properties": {
            "rate": {**_RATE, "description": "base rate: 500 Hz; one tick is its inverse"},
            "duration": {
                "anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"type": "string"}],
                "description": "how long the graph runs: 4 s",
            },
            "robot": {
                "type": "string",
                "description": "name of a robot, or its YAML, URDF or MJCF file",
            },
            "actuators": {
                "type": "string",
                "description": "the robot's actuator profile in use; by default its first",
            },
            "dimensions": {
                "type": "object",
                "additionalProperties": {"type": "integer", "minimum": 1},
                "description": "sizes by name",
            },
            "clock": _clock_schema(),
            "machines": {
                "type": "object",
                "additionalProperties": {"type": "string", "pattern": endpoint_pattern()},
                "description": "machines that share the graph: name and endpoint",
            },
            "links": {
                "type": "object",
                "additionalProperties": False,
                "properties": {
                    "mode": {"enum": ["lockstep", "free"]},
                    **_LINK_POLICY,
                    "of": {
                        "type": "object",
                        "additionalProperties": {
                            "type": "object",
                            "additionalProperties": False,
                            "properties": _LINK_POLICY,
                        },
                        "description": "the links of single blocks, by block",
                    },
                    "paths": {
                        "type": "object",
                        "additionalProperties": _LINK_POLICY["max_age"],
                        "description": "block.output -> block.input: the largest age",
                    },
                    "watchdog": {
                        **_LINK_POLICY["max_age"],
                        "description": "how long a link that brings commands may be silent: 15 ms",
                    },
                },
                "description": "how the machines keep together",
            },
            "place": {
                "type": "object",
                "additionalProperties": {"type": "string"},
                "description": "block or sub-graph: machine; wins over 'on'",
            },
            "include": {
                "anyOf": [files, {"type": "array", "items": files}],
                "description": "files whose blocks, wires and settings are taken over",
            },
            "inputs": {**anything, "description": "of a sub-graph: required, optional or values"},
            "outputs": {
                "type": "object",
                "additionalProperties": {"$ref": "#/definitions/wire"},
                "description": "of a sub-graph: name and block.port",
            },
            "parameters": {**anything, "description": "of a sub-graph: name and default"},
            "blocks": {
                "type": "object",
                "patternProperties": {"^_": {}},
                "additionalProperties": {"$ref": "#/definitions/block"},
            },
            "wires": {
                "type": "object",
                "additionalProperties": {"$ref": "#/definitions/wire"},
                "description": "block.input: source; adds to or replaces included wires",
            },
            "set": {
                "type": "object",
                "propertyNames": {"pattern": "^[^.]+\\..+$"},
                "description": "block.parameter: value; overrides included files",
            },
        },
        "definitions": definitions,
    }


def schema_text() -> str:
    """The schema as the text of a file."""
    return json.dumps(graph_schema(), indent=1) + "\n"


def _clock_schema() -> Schema:
    values: Schema = {
        "kind": {"enum": ["free", "paced", "robot"]},
        "overrun": {"enum": ["skip", "stop"]},
        "stop_after": {"type": "integer", "minimum": 1},
        "hangs_after": {"type": ["number", "string"], "exclusiveMinimum": 0},
    }
    return {
        "type": "object",
        "additionalProperties": False,
        "properties": {key: values[key] for key in CLOCK_KEYS},
    }


def _block_schema(known: Mapping[str, type[Block]]) -> Schema:
    return {
        "type": "object",
        "additionalProperties": False,
        "required": ["use"],
        "patternProperties": {"^_": {}},
        "properties": {
            "use": {
                "anyOf": [
                    {"enum": list(known)},
                    {"type": "string", "pattern": "^[\\w.]+:\\w+$"},
                    {"type": "string", "pattern": "\\.ya?ml$"},
                    _REFERENCE,
                ],
                "description": "a block, module:Class, or the file of a sub-graph",
            },
            "with": {"type": ["object", "null"], "description": "parameters"},
            "in": {
                "type": ["object", "null"],
                "additionalProperties": {"$ref": "#/definitions/wire"},
                "description": "input: source",
            },
            "rate": {**_RATE, "description": "divides the base rate"},
            "offset": {
                "anyOf": [{"type": "integer", "minimum": 0}, _REFERENCE],
                "description": "tick of the first run, below the period",
            },
            "on": {"type": "string", "description": "the machine that the block runs on"},
        },
        "allOf": [
            {
                "if": {"properties": {"use": {"const": name}}, "required": ["use"]},
                "then": {"$ref": f"#/definitions/{name}"},
            }
            for name in known
        ],
    }


def _particular_schema(name: str, block_type: type[Block], definitions: Schema) -> Schema:
    """The part of the schema that only blocks of this type have: their parameters and inputs."""
    model = block_type.Params.model_json_schema()
    for inner, schema in model.pop("$defs", {}).items():
        definitions[f"{name}.{inner}"] = _relocate(schema, name)
    properties: Schema = {}
    for key, schema in _relocate(model.get("properties", {}), name).items():
        schema.pop("live", None)
        description = " ".join(filter(None, [schema.pop("description", ""), _unit_text(schema)]))
        options = [schema, _REFERENCE, _EXPORTED]
        if schema.pop("unit", ""):  # a text with a unit may stand for each number, also in a list
            per_joint = "PerJoint" in json.dumps(schema)
            inside = {"type": "object"} if per_joint else {"type": "array"}
            options += [{"type": "string", "pattern": "^[-+0-9.]"}, inside]
        properties[key] = {"anyOf": options, "description": description}
    summary = (block_type.__doc__ or "").strip().partition("\n")[0]
    return {
        "description": summary,
        "properties": {
            "with": {
                "type": ["object", "null"],
                "additionalProperties": False,
                "properties": properties,
            },
            "in": {
                "type": ["object", "null"],
                "additionalProperties": False,
                "properties": {
                    port: {
                        "allOf": [{"$ref": "#/definitions/wire"}],
                        "description": f"{item.signal.__name__}: {item.text}",
                    }
                    for port, item in block_type.inputs.items()
                },
            },
        },
    }


def _unit_text(schema: Mapping[str, Any]) -> str:
    return f"[{schema['unit']}]" if schema.get("unit") else ""


def _relocate(schema: Any, name: str) -> Any:
    """The schema with its references pointing to the common definitions."""
    if isinstance(schema, dict):
        return {
            key: f"#/definitions/{name}.{value.rpartition('/')[2]}"
            if key == "$ref" and isinstance(value, str)
            else _relocate(value, name)
            for key, value in schema.items()
        }
    if isinstance(schema, list):
        return [_relocate(item, name) for item in schema]
    return schema
