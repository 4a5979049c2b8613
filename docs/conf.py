"""The documentation as a site: `make site` builds it from the same pages that are read in the repository.

Sphinx starts from the folder above, so README, the pages of docs/ and the projects link to each other as
they stand, and a link to a source file leads to a copy of it. docs/index.md says which page is in which part.
"""

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
include_patterns = ["*.md", "docs/**"]
exclude_patterns = ["**/__pycache__", "**/.*"]

html_theme = "furo"
html_title = f"aloft {release}"
html_copy_source = False
html_show_copyright = False
html_static_path = ["site.css"]
html_css_files = ["site.css"]
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


def redirect(app: Any, failure: Exception | None) -> None:
    """The site begins at its root, too."""
    if failure is None and app.builder.format == "html":
        page = '<!doctype html><meta http-equiv="refresh" content="0; url=docs/index.html">\n'
        (Path(app.outdir) / "index.html").write_text(page)


def keep_colons(app: Any, what: str, name: str, thing: Any, options: Any, lines: list[str]) -> None:
    """What stands before a colon in the text of an attribute is no type, as Google's style has it."""
    if what in ("attribute", "data", "property"):
        lines.insert(0, "")


def setup(app: Any) -> None:
    """Connect what is above."""
    app.connect("autodoc-process-docstring", keep_colons, priority=400)  # before napoleon
    app.connect("build-finished", redirect)
