"""An FMU without Python: the exported library of C, and the functions of FMI that call it.

The FMU has its sources, and a binary of them for this computer. The sources are the wrapper in C, and the
kernels as a text for the assembler in a C file, for x86-64 and for aarch64 as the compiler chooses.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from hashlib import sha256
from math import prod
from pathlib import Path

from .....files.pip_line import pip_line
from .....runtime.language.errors import AloftError
from ...clib.cut import start_of
from ...clib.module import STATUS_TEXTS
from ...clib.targets import TARGETS, assembler
from ...clib.write import Prepared
from .model_description import Scalar, build_description, model_description

_HERE = Path(__file__).parent
_FOLDERS = {"3.0": "x86_64-linux", "2.0": "linux64"}
_PROCESSORS = {"x86_64": "__x86_64__", "aarch64": "__aarch64__"}
_KINDS = {"float64": "f", "int64": "i", "bool": "b"}


def write_native(made: Prepared, to: Path, version: str, title: str) -> None:
    """Write an FMU for co-simulation that needs nothing but C's mathematical library.

    Args:
        made: the part of the graph as code.
        to: the file.
        version: of FMI, ``3.0`` or ``2.0``.
        title: what the FMU is.

    Raises:
        AloftError: the compiler fails, or FMPy, which has the headers of the standard, is missing.
    """
    try:
        import fmpy
    except ImportError:
        raise AloftError(f"the headers of FMI come with FMPy: {pip_line('fmi')}") from None
    name, scalars = made.name, list(_variables(made, version))
    text = made.module.text()
    token = sha256(f"{version} {made.about['graph_hash']} {text}".encode()).hexdigest()[:32]
    kernels = f"{name}_kernels.c"
    files = {
        "variables.h": _variables_header(made, scalars, token),
        f"{name}.h": made.header(),
        kernels: _assembler_in_c(text),
    }
    headers = Path(fmpy.__file__).parent / "c-code"
    wrapper = f"fmi{version[0]}.c"
    sources = (wrapper, kernels)
    with tempfile.TemporaryDirectory(prefix="aloft-export-") as folder:
        root = Path(folder)
        (root / "sources").mkdir()
        binaries = root / "binaries" / _FOLDERS[version]
        binaries.mkdir(parents=True)
        for file, content in files.items():
            (root / "sources" / file).write_text(content, encoding="utf-8")
        for each in (_HERE / wrapper, _HERE / "model.h", *headers.glob(f"fmi{version[0]}*.h")):
            shutil.copyfile(each, root / "sources" / each.name)
        _compile(root / "sources", sources, binaries / f"{name}.so")
        description = model_description(made, scalars, version, token, title, sources)
        (root / "modelDescription.xml").write_bytes(description)
        if version == "3.0":
            (root / "sources" / "buildDescription.xml").write_bytes(
                build_description(name, sources)
            )
        to.parent.mkdir(parents=True, exist_ok=True)
        with zipfile.ZipFile(to, "w", zipfile.ZIP_DEFLATED) as archive:
            for each in sorted(p for p in root.rglob("*") if p.is_file()):
                # the same bytes whenever it is written
                info = zipfile.ZipInfo(each.relative_to(root).as_posix())
                info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
                archive.writestr(info, each.read_bytes())


def compiler() -> str:
    """Return the C compiler for the binary; empty where there is none."""
    return TARGETS["x86_64"].linker()


def _compile(folder: Path, sources: Sequence[str], to: Path) -> None:
    command = [
        compiler(), "-shared", "-fPIC", "-O2", "-std=gnu11", "-ffp-contract=off", "-Wl,-Bsymbolic", *sources,
        "-lm", "-o", str(to),
    ]  # fmt: skip
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode:
        raise AloftError(f"{' '.join(command)} fails: {done.stderr.strip()}")


def _variables(made: Prepared, version: str) -> Iterator[Scalar]:
    """Yield the variables of the FMU; in FMI 2.0 every element is one."""
    yield Scalar("time", "t", "f", 0, (), "s", "the time")
    cut = made.part.cut
    for of, terminals, fields in (
        ("i", cut.inputs, made.module.input_fields),
        ("o", cut.outputs, made.module.output_fields),
    ):
        for each in terminals:
            place, starts = fields[each.name][0], tuple(start_of(each)) if of == "i" else ()
            size, kind = prod(each.shape), _KINDS[each.dtype]
            shape = each.shape if size > 1 else ()
            whole = Scalar(
                each.name, of, kind, place, shape, each.unit, each.text, starts, each.name, each.depends
            )  # fmt: skip
            if version == "3.0" or size == 1:
                yield whole
            else:
                yield from whole.elements(1 if kind == "b" else 8)
    for k, parameter in enumerate(made.part.parameters):
        array = made.part.bound.blocks[parameter.block].parameter_arrays[parameter.parameter]
        yield Scalar(
            parameter.name.replace("/", "."), "p", "f", k, (), parameter.unit or None, parameter.text,
            (float(array.reshape(-1)[parameter.element]),), least=parameter.at_least, most=parameter.at_most,
        ).counted_from_one()  # fmt: skip


def _variables_header(made: Prepared, scalars: Sequence[Scalar], token: str) -> str:
    name, upper = made.name, made.name.upper()
    rows = "\n".join(
        f"    {{'{each.of}', '{each.kind}', {each.place}, {prod(each.shape)}}}, /* {each.name} */"
        for each in scalars
    )
    starts = ", ".join(repr(float(v)) for each in scalars if each.of == "i" for v in each.start)
    cases = "\n".join(
        f'    case {int(code)}: return "{text}";' for code, text in STATUS_TEXTS.items()
    )
    return f"""\
/* The variables of the FMU by their value references: time, input, output or parameter; float, integer or
 * boolean; the byte in the struct of C, or the number of the parameter; and how many numbers. */
#include "{name}.h"

#define LIB(function) {name}_##function
#define LIB_TOKEN "{token}"
#define LIB_PERIOD {upper}_PERIOD
#define LIB_MEMORY {upper}_MEMORY_SIZE
#define LIB_STATE {upper}_STATE_SIZE
#define LIB_PARAMETERS {len(made.part.parameters)}
typedef {name} lib;
typedef {name}_inputs lib_inputs;
typedef {name}_outputs lib_outputs;

typedef struct {{
    char of, type;
    int32_t place, count;
}} variable;

static const variable variables[] = {{
{rows}
}};
enum {{ VARIABLES = {len(scalars)} }};

/* what the inputs are at first */
static const double starts[] = {{{starts or "0.0"}}};

static const char *text_of(int32_t status)
{{
    switch (status) {{
{cases}
    default: return "";
    }}
}}
"""


def _assembler_in_c(text: str) -> str:
    """Return the kernels as one C file that holds their text for an assembler, by the kind of processor."""
    parts = [
        "/* The kernels of the graph, as GNU C: machine code as a text, by the kind of processor. */"
    ]
    for k, (target, macro) in enumerate(_PROCESSORS.items()):
        parts.append(f"#{'el' if k else ''}if defined({macro})\n__asm__(")
        for line in assembler(text, TARGETS[target]).splitlines():
            escaped = line.replace("\\", "\\\\").replace('"', '\\"').replace("\t", "\\t")
            parts.append(f'"{escaped}\\n"')
        parts.append(");")
    parts.append('#else\n#error "the kernels are here for x86-64 and aarch64"\n#endif\n')
    return "\n".join(parts)
