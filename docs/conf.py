"""The documentation as a site: `make site` builds it from the same pages that are read in the repository.

Sphinx starts from the folder above, so README, the pages of docs/ and the projects link to each other as
they stand, and a link to a source file leads to a copy of it. docs/index.md says which page is in which part.

Each version lies in a folder of its own, `site/VERSION`. Those that were built before stay, and every page leads to them.
"""

import json
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT.parent))

import aloft

project = "aloft"
release = aloft.__version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
source_suffix = {".md": "markdown"}
root_doc = "docs/index"
include_patterns = [
    "*.md",
    "docs/**",
    "extensions/*/*.md",
    "extensions/export/demo/README.md",
    "lab/README.md",
]
exclude_patterns = ["**/__pycache__", "**/.*"]

html_theme = "furo"
html_title = f"aloft {release}"
html_copy_source = False
html_show_copyright = False
html_static_path = ["site.css"]
html_css_files = ["site.css"]
templates_path = ["site_templates"]
html_sidebars = {
    "**": [
        "sidebar/brand.html", "versions.html", "sidebar/search.html", "sidebar/scroll-start.html",
        "sidebar/navigation.html", "sidebar/scroll-end.html",
    ]
}  # fmt: skip
html_theme_options = {
    "light_css_variables": {"font-stack--monospace": "'DejaVu Sans Mono', monospace"},
}
pygments_style = "friendly"
pygments_dark_style = "github-dark"

myst_heading_anchors = 4
napoleon_use_ivar = True
napoleon_use_rtype = False
# the pages that programs write put a table's title two levels below
suppress_warnings = ["myst.header"]


def list_versions(app: Any, failure: Exception | None) -> None:
    """Write beside the versions which there are, and a first page that leads to the newest."""
    if failure is not None or app.builder.format != "html":
        return
    folder = Path(app.outdir).parent
    versions = sorted(
        (found.parents[1].name for found in folder.glob("*/docs/index.html")),
        key=lambda name: [int(part) for part in re.findall(r"\d+", name)],
        reverse=True,
    )
    (folder / "versions.js").write_text(f"window.siteVersions = {json.dumps(versions)};\n")
    page = f'<!doctype html><meta http-equiv="refresh" content="0; url={versions[0]}/docs/index.html">\n'
    (folder / "index.html").write_text(page)


def keep_colons(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """Keep text before a colon in an attribute's docstring from being read as a type, as Google's
    style has it."""
    if what in ("attribute", "data", "property"):
        lines.insert(0, "")


def setup(app: Any) -> None:
    """Connect what is above."""
    app.connect("autodoc-process-docstring", keep_colons, priority=400)  # before napoleon
    app.connect("build-finished", list_versions)
