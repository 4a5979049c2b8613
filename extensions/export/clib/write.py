"""Writes a library and what belongs to it into a folder: header, example, CMake file, description."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

from .... import __version__
from ....runtime.language.errors import AloftError
from ....runtime.language.layout import Layout
from .cut import Terminal
from .input_delays import rates
from .module import STATUS_TEXTS, Module, Status
from .part import SubGraph, take_part, terminal_groups
from .targets import TARGETS, compile_module, link

_C_TYPES = {"float64": "double", "int64": "int64_t", "bool": "uint8_t"}
_WORDS = """
auto break case char const continue default do double else enum extern float for goto if int long
register return short signed sizeof static struct switch typedef union unsigned void volatile while
inline restrict bool class new delete this template operator
"""
_KEYWORDS = frozenset(_WORDS.split())


@dataclass(frozen=True)
class Prepared:
    """Ingredients of a library: its name, the part, the code, and the content of ``NAME.json``."""

    name: str
    part: SubGraph
    module: Module
    about: dict[str, Any]

    def header(self) -> str:
        """Return the text of ``NAME.h``."""
        return _header(self.name, self.part, self.about)


@dataclass(frozen=True)
class Written:
    """Written library: the description ``NAME.json``, all files, and the description's content."""

    description: Path
    files: tuple[Path, ...]
    about: dict[str, Any]


def write_library(
    path: str,
    to: Path,
    part: str = "",
    overrides: Sequence[str] = (),
    outputs: Sequence[str] = (),
    target: str = "x86_64",
    delays: str = "inside",
) -> Written:
    """Write a graph, or a part of it, as a library of C.

    Args:
        path: the graph file.
        to: the folder; its name is the library's.
        part: the path of a sub-graph or of a block; empty for the whole graph without its robot.
        overrides: parameters to change.
        outputs: what the outputs are, ``block.port``.
        target: the kind of processor, of ``TARGETS``.
        delays: the side of those of wires into the part, ``inside`` or ``outside``.

    Raises:
        LoadError: the graph may not run.
        AloftError: the part needs Python, the name is none in C, or a tool fails.
    """
    made = prepare(path, to.name, part, overrides, outputs, target, delays)
    name, taken, about = made.name, made.part, made.about
    to.mkdir(parents=True, exist_ok=True)
    (to / f"{name}.o").write_bytes(compile_module(made.module.text(), TARGETS[target]))
    libraries = link(name, to, TARGETS[target])
    about["files"] = {
        each.name: {"bytes": each.stat().st_size, "sha256": sha256(each.read_bytes()).hexdigest()}
        for each in (to / f"{name}.o", *libraries)
    }
    description = to / f"{name}.json"
    contents = {
        description: json.dumps(about, indent=1) + "\n",
        to / f"{name}.h": made.header(),
        to / "example.c": _example(name, taken),
        to / "main.c": _main(name),
        to / "CMakeLists.txt": _cmake(name),
        to / "README.md": _readme(name, about, taken),
    }
    for file, text in contents.items():
        file.write_text(text, encoding="utf-8")
    return Written(description, (to / f"{name}.o", *libraries, *contents), about)


def prepare(
    path: str,
    name: str,
    part: str = "",
    overrides: Sequence[str] = (),
    outputs: Sequence[str] = (),
    target: str = "x86_64",
    delays: str = "inside",
) -> Prepared:
    """Return a part of a graph as code, with its description; the parameters are those of ``write_library``.

    Raises:
        LoadError: the graph may not run.
        AloftError: the part needs Python, or the name is none in C.
    """
    if not name.isidentifier() or not name.isascii() or name in _KEYWORDS:
        raise AloftError(
            f"{name!r} cannot be the name of a library; write it as --out my_controller"
        )
    if target not in TARGETS:
        raise AloftError(f"there is no target {target!r}; there is {', '.join(TARGETS)}")
    taken = take_part(path, part, overrides, outputs, delays)
    digest = sha256(
        taken.graph.text.encode() + f"{part} {outputs}{_moved(taken)}".encode()
    ).hexdigest()
    texts = {"version": f"aloft {__version__}", "graph_hash": digest}
    module = Module(name, taken, int(digest[:15], 16), texts)
    about = _describe(name, target, taken, module, texts)
    about["graph"], about["part"] = Path(path).name, part
    return Prepared(name, taken, module, about)


def _moved(part: SubGraph) -> str:
    """Return the delays that are outside, as the hash of a graph has them."""
    return "".join(str(each) for each in part.cut.delays if each.side == "outside")


def _describe(
    name: str, target: str, part: SubGraph, module: Module, texts: dict[str, str]
) -> dict[str, Any]:
    """Return the content of ``NAME.json``."""
    memory = part.bound.memory
    return {
        "name": name,
        "target": target,
        **texts,
        "period_s": part.graph.base_period,
        "memory_bytes": module.image.size,
        "constant_bytes": module.image.constants,
        "state_bytes": module.state_size,
        "input_bytes": module.input_size,
        "output_bytes": module.output_size,
        "inputs": _terminals(part.cut.inputs, module.input_fields),
        "outputs": _terminals(part.cut.outputs, module.output_fields),
        "parameters": [each._asdict() for each in part.parameters],
        "fixed_parameters": list(part.fixed),
        "blocks": list(part.blocks),
        "rates": rates({spec.path: spec for spec in part.graph.blocks}, part.blocks),
        "input_delays": [each.plain() for each in part.cut.delays],
        "signals": _slots(memory.bus.layout, module.bus_place, part),
        "states": _slots(memory.state.layout, module.state_place, part),
        "statuses": {each.name: [int(each), STATUS_TEXTS[each]] for each in Status},
        "licences": {"aloft": "see the licence of aloft; the graph and its plans are yours"},
    }


def _terminals(
    terminals: Sequence[Terminal], fields: dict[str, tuple[int, int, int]]
) -> list[dict[str, Any]]:
    return [
        {**each.plain(), "port": port, "field": field, "offset": fields[each.name][0]}
        for port, group in terminal_groups(terminals).items()
        for field, each in group
    ]


def _slots(layout: Layout, place: int, part: SubGraph) -> dict[str, Any]:
    """Return the first byte in an instance, type and shape of each signal or state of the blocks inside."""
    return {
        name: [place + layout.byte_range(name)[0], slot.section, list(slot.shape)]
        for name, slot in layout.slots.items()
        if name.rpartition(".")[0].rpartition(".")[0] in part.blocks
    }


def c_name(text: str) -> str:
    """Return a name of the graph as an identifier of C."""
    made = "".join(each if each.isascii() and each.isalnum() else "_" for each in text).strip("_")
    return f"{made}_" if made in _KEYWORDS else f"_{made}" if made[:1].isdigit() else made


def _struct(name: str, kind: str, terminals: Sequence[Terminal]) -> str:
    lines = [f"typedef struct {name}_{kind} {{"]
    for port, fields in terminal_groups(terminals).items():
        alone = len(fields) == 1 and fields[0][1].name == port
        if not alone:
            lines.append("    struct {")
        for field, each in fields:
            sizes = "".join(f"[{size}]" for size in each.shape)
            unit = "any unit" if each.unit is None else f"[{each.unit}]" if each.unit else "[1]"
            unit = f"[{', '.join(text or 'any' for text in each.units)}]" if each.units else unit
            frame = f", in {each.frame}" if each.frame else ""
            own = c_name(port if alone else field)
            indent = "    " if alone else "        "
            lines.append(
                f"{indent}{_C_TYPES[each.dtype]} {own}{sizes}; /* {unit}{frame}: {each.text} */"
            )
        if not alone:
            lines.append(f"    }} {c_name(port)};")
    if not terminals:
        lines.append("    double none;")
    return "\n".join((*lines, f"}} {name}_{kind};"))


def _slower(about: dict[str, Any], period: float) -> str:
    """Return a sentence on the blocks that do not run in every tick; nothing where there are none."""
    groups = [each for each in about["rates"] if each["every"] > 1]
    lines = [
        f" *   every {each['every']} ticks ({1.0 / (each['every'] * period):.9g} Hz), from tick {each['from']}: "
        + ", ".join(each["blocks"])
        for each in groups
    ]
    return "\n".join((" Blocks that do not run in every tick:", *lines, " *")) if lines else ""


def _header(name: str, part: SubGraph, about: dict[str, Any]) -> str:
    upper = name.upper()
    codes = "\n".join(
        f"    {upper}_{each.name} = {int(each)}, /* {STATUS_TEXTS[each]} */" for each in Status
    )
    parameters = "\n".join(
        f"    {upper}_{c_name(each.name).upper()} = {k}, /* [{each.unit or 1}] {each.text} */"
        for k, each in enumerate(part.parameters)
    )
    return f"""\
/* {name}: {about["graph"]}{f", {about['part']}" if about["part"] else ""}, written by {about["version"]}.
 *
 * A tick takes {part.graph.base_period:.9g} s of the controller's time.{_slower(about, part.graph.base_period)} The library allocates nothing, keeps
 * nothing outside of an instance, and uses no file, thread or lock: instances are independent.
 * Build with strict floating point, as compilers do unless they are told -ffast-math. */
#ifndef {upper}_H
#define {upper}_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {{
#endif

#define {upper}_GRAPH_HASH "{about["graph_hash"]}"
#define {upper}_PERIOD {part.graph.base_period!r} /* s */
#define {upper}_MEMORY_SIZE {about["memory_bytes"]} /* bytes of an instance */
#define {upper}_STATE_SIZE {about["state_bytes"]} /* bytes of a saved state */

typedef struct {name} {name}; /* an instance: memory of the caller, aligned to 8 bytes */

enum {{ /* what functions return; below zero nothing goes on before a reset */
{codes}
}};

{_struct(name, "inputs", part.cut.inputs)}

{_struct(name, "outputs", part.cut.outputs)}

enum {{ /* live parameters */
{parameters}
    {upper}_PARAMETERS = {len(part.parameters)}
}};

int64_t {name}_memory_size(void);
int64_t {name}_state_size(void);
const char *{name}_version(void);
const char *{name}_graph_hash(void);

/* Make an instance in memory of `size` bytes that the caller gives. */
int32_t {name}_init(void *memory, int64_t size);
/* Go back to the state after {name}_init; live parameters, too. */
int32_t {name}_reset({name} *self);
/* One tick. The outputs follow from these inputs and the state. */
int32_t {name}_step({name} *self, const {name}_inputs *inputs, {name}_outputs *outputs);
/* Write the state, {upper}_STATE_SIZE bytes, and take it back. Live parameters are no state. */
int32_t {name}_save({name} *self, void *state);
int32_t {name}_restore({name} *self, const void *state);
/* A live parameter by its number; a value outside its bounds is refused. */
int32_t {name}_set({name} *self, int32_t parameter, double value);
double {name}_get(const {name} *self, int32_t parameter);
/* What the last {name}_step returned, the block it was about, or -1, and the name of a block. */
int32_t {name}_last_error(const {name} *self);
int32_t {name}_last_block(const {name} *self);
const char *{name}_block_name(int32_t block);

#ifdef __cplusplus
}}
#endif
#endif
"""


def _example(name: str, part: SubGraph) -> str:
    starts = []
    for port, fields in terminal_groups(part.cut.inputs).items():
        for field, each in fields:
            if each.dtype == "float64" and field == "orientation":
                starts.append(f"    inputs.{c_name(port)}.{c_name(field)}[0] = 1.0;")
    lines = "\n".join(starts)
    return f"""\
/* Runs ten ticks of {name} on inputs that are zero. */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "{name}.h"

static uint64_t memory[({name.upper()}_MEMORY_SIZE + 7) / 8];

int main(void)
{{
    {name} *self = ({name} *)memory;
    {name}_inputs inputs;
    {name}_outputs outputs;
    memset(&inputs, 0, sizeof inputs);
{lines}
    if ({name}_init(memory, sizeof memory) != {name.upper()}_OK)
        return 1;
    for (int tick = 0; tick < 10; ++tick) {{
        int32_t status = {name}_step(self, &inputs, &outputs);
        printf("%d: %" PRId32 " %s\\n", tick, status, {name}_block_name({name}_last_block(self)));
        if (status < 0)
            return 1;
    }}
    return 0;
}}
"""


def _main(name: str) -> str:
    """Return the C text of the library as a process, in real time or in lockstep."""
    upper = name.upper()
    lines = [
        f"#define lib_{each} {name}_{each}"
        for each in ("init", "step", "last_block", "inputs", "outputs")
    ]
    lines += [
        f"#define LIB_{each} {upper}_{each}" for each in ("PERIOD", "MEMORY_SIZE", "GRAPH_HASH")
    ]
    text = (Path(__file__).parent / "real_time.c").read_text(encoding="utf-8")
    return "\n".join(
        ("#define _GNU_SOURCE", f'#include "{name}.h"', f"#define lib {name}", *lines, text)
    )


def _cmake(name: str) -> str:
    return f"""\
cmake_minimum_required(VERSION 3.13)
project({name} C)
add_library({name} STATIC {name}.o)
set_target_properties({name} PROPERTIES LINKER_LANGUAGE C)
set_source_files_properties({name}.o PROPERTIES EXTERNAL_OBJECT TRUE)
target_include_directories({name} PUBLIC ${{CMAKE_CURRENT_SOURCE_DIR}})
target_link_libraries({name} PUBLIC m)
add_executable(example example.c)
target_link_libraries(example PRIVATE {name})
if(CMAKE_SYSTEM_NAME STREQUAL "Linux")
  find_package(Threads REQUIRED)
  add_executable(main main.c)
  target_compile_features(main PRIVATE c_std_11)
  target_link_libraries(main PRIVATE {name} Threads::Threads)
endif()
"""


def _readme(name: str, about: dict[str, Any], part: SubGraph) -> str:
    sizes = "\n".join(
        f"| `{file}` | {each['bytes']} bytes |" for file, each in about["files"].items()
    )
    fixed = ", ".join(f"`{each}`" for each in part.fixed) or "none"
    return f"""\
# {name}

The {f"part `{about['part']}` of " if about["part"] else ""}graph `{about["graph"]}` as a library of C for {about["target"]}.
Written by {about["version"]}; hash of the graph {about["graph_hash"]}.

| what | how much |
|---|---|
{sizes}
| memory of an instance | {about["memory_bytes"]} bytes |
| constants, such as plans | {about["constant_bytes"]} bytes |
| a saved state | {about["state_bytes"]} bytes |
| a tick is for | {part.graph.base_period:.9g} s |

`{name}.h` has the functions, `example.c` calls them, `{name}.json` describes all ports, parameters and the layout of
an instance. Of the system the library needs memcpy, memset and functions of the mathematical library.

Live parameters that stay as they were when it was written, because Python computes what follows
from them: {fixed}.
"""
