"""The JSON Schema of graph files, for completion and checks in editors.

It has the names of all blocks with their parameters and inputs. It is less strict than the loader
on purpose: a parameter or a wire may come from another file, so none is required here.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from pydantic import ConfigDict

from ..language.block import Block
from ..language.parameters import Parameters, group_of, takes_none
from ..language.registry import all_blocks
from ..transports.registry import endpoint_pattern
from .reading.graph_file import UNDERSCORED, CommonKeys, GraphSections, GraphValues, SubgraphKeys

Schema = dict[str, Any]

_REFERENCE: Schema = {"type": "string", "pattern": "^\\$", "description": "a parameter's value"}
_EXPORTED: Schema = {
    "type": "object",
    "additionalProperties": False,
    "required": ["from"],
    "properties": {"from": {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_/]*\\.[A-Za-z_]"}},
    "description": "a value that another block exports: {from: block.name}",
}


class GraphFile(CommonKeys, SubgraphKeys, GraphSections, GraphValues):
    """A graph, a file that graphs include, or a sub-graph."""

    model_config = ConfigDict(
        title="aloft graph", json_schema_extra={"patternProperties": UNDERSCORED}
    )


def graph_schema() -> Schema:
    """Return the schema for graphs of all registered blocks."""
    known = all_blocks()
    schema = GraphFile.model_json_schema(ref_template="#/definitions/{model}")
    definitions: Schema = schema.pop("$defs")
    schema["properties"]["machines"]["additionalProperties"]["pattern"] = endpoint_pattern()
    entry = definitions["BlockEntry"]
    entry["properties"]["use"]["anyOf"].insert(0, {"enum": list(known)})
    definitions["Wire"] = entry["properties"]["in"]["additionalProperties"]
    entry["allOf"] = [
        {
            "if": {"properties": {"use": {"const": name}}, "required": ["use"]},
            "then": {"$ref": f"#/definitions/{name}"},
        }
        for name in known
    ]
    for name, block_type in known.items():
        definitions[name] = _particular_schema(name, block_type, definitions)
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        **schema,
        "definitions": definitions,
    }


def schema_text() -> str:
    """Return the schema as the text of a file."""
    return json.dumps(graph_schema(), indent=1) + "\n"


def _build(model: type[Parameters]) -> None:
    """Build the validators of a model and of its groups: pydantic 2.7 writes no default of a group without them."""
    for info in model.model_fields.values():
        if (group := group_of(info)) is not None:
            _build(group)
    model.model_rebuild()


def _particular_schema(name: str, block_type: type[Block], definitions: Schema) -> Schema:
    """Return the part of the schema that only blocks of this type have: their parameters and
    inputs."""
    _build(block_type.Params)
    model = block_type.Params.model_json_schema()
    for inner, schema in model.pop("$defs", {}).items():
        inside = definitions[f"{name}.{inner}"] = _relocate(schema, name)
        for key, value in inside.get("properties", {}).items():
            value.pop("live", None)
            options = [value, _EXPORTED]
            if value.pop("unit", ""):
                options += _quantity(value)
            inside["properties"][key] = {"anyOf": options}
    in_unit = getattr(block_type.Params, "in_unit", ())
    properties: Schema = {}
    for key, schema in _relocate(model.get("properties", {}), name).items():
        schema.pop("live", None)
        description = " ".join(filter(None, [schema.pop("description", ""), _unit_text(schema)]))
        options = [schema, _REFERENCE, _EXPORTED]
        if schema.pop("unit", "") or key in in_unit:
            options += _quantity(schema)
        if takes_none(block_type.Params.model_fields[key]):
            options.append({"const": "none"})
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
                "additionalProperties": _further_inputs(block_type),
                "properties": {
                    port: {
                        "allOf": [{"$ref": "#/definitions/Wire"}],
                        "description": f"{item.signal.__name__}: {item.text}",
                    }
                    for port, item in block_type.inputs.items()
                },
            },
        },
    }


def _quantity(schema: Schema) -> list[Schema]:
    """Return alternatives for a value with a unit: a text may stand for each number, also in a
    list."""
    per_joint = "PerJoint" in json.dumps(schema)
    inside = {"type": "object"} if per_joint else {"type": "array"}
    return [{"type": "string", "pattern": "^[-+0-9.]"}, inside]


def _further_inputs(block_type: type[Block]) -> Schema | bool:
    """Return the schema of inputs that the class does not declare: their parameters may make
    some."""
    made = block_type.specialize.__func__ is not Block.specialize.__func__  # type: ignore[attr-defined]
    return {"$ref": "#/definitions/Wire"} if made and not block_type.inputs else False


def _unit_text(schema: Mapping[str, Any]) -> str:
    return f"[{schema['unit']}]" if schema.get("unit") else ""


def _relocate(schema: Any, name: str) -> Any:
    """Return the schema with its references pointing to the common definitions."""
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
