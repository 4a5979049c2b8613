"""The documentation as a site: every page has its place, every code block and every link is right."""

from __future__ import annotations

import ast
import inspect
import re
import shlex
import subprocess
import sys
import threading
import time
import tomllib
from functools import partial
from html.parser import HTMLParser
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
import typer
import yaml

import aloft
from aloft.cli.app import make_app

from .logs.viewing.browser import PROGRAM, Browser

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = [
    *sorted(ROOT.glob("*.md")),
    *sorted(DOCS.rglob("*.md")),
    *sorted(ROOT.glob("extensions/*/*.md")),
    ROOT / "extensions" / "export" / "demo" / "README.md",
    ROOT / "lab" / "README.md",
]
BLOCK = re.compile(r"^( *)```(\w*)\n(.*?)^ *```$", re.DOTALL | re.MULTILINE)
TOCTREE = re.compile(r"```\{toctree\}\n:caption: (\S+)\n:hidden:\n\n(.*?)```", re.DOTALL)


def test_every_page_stands_once_in_one_of_four_parts() -> None:
    parts = dict(TOCTREE.findall((DOCS / "index.md").read_text()))
    assert list(parts) == ["Tutorials", "How-to", "Reference", "Explanation"]
    entries = [line for text in parts.values() for line in text.split("\n") if line]
    named = [re.sub(r".*<(.*)>", r"\1", entry) for entry in entries]
    found = [(DOCS / f"{name}.md").resolve() for name in named]
    families = re.search(
        r"```\{toctree\}\n:hidden:\n\n(.*?)```", (DOCS / "blocks/index.md").read_text(), re.DOTALL
    )
    assert families is not None
    found += [DOCS / "blocks" / f"{name}.md" for name in families[1].split()]
    assert sorted(found) == sorted(page for page in PAGES if page != DOCS / "index.md")


def code_blocks(language: str) -> list[str]:
    found = [
        re.sub(f"^{indent}", "", text, flags=re.MULTILINE)
        for page in PAGES
        for indent, kind, text in BLOCK.findall(page.read_text())
        if kind == language
    ]
    assert found
    return found


def test_code_on_a_page_can_be_read() -> None:
    for text in code_blocks("yaml"):
        assert yaml.safe_load(text) is not None or text.startswith("# yaml-language-server"), text
    for text in code_blocks("toml"):
        assert tomllib.loads(text), text
    for text in code_blocks("python"):
        assert ast.parse(text).body, text


COMMANDS = typer.main.get_command(make_app())


def unknown_in(line: str) -> str:
    """What a command line asks of ``aloft`` that it does not have."""
    words = shlex.split(line, comments=True)
    command, names = COMMANDS, "aloft"
    for word in words[1:]:
        inner = getattr(command, "commands", None)
        if inner is not None and not word.startswith("-"):
            if word not in inner:
                return f"{names} has no verb {word}"
            command, names = inner[word], f"{names} {word}"
        elif word.startswith("-") and not re.match(r"-\d", word):
            known = {o for p in command.params for o in [*p.opts, *p.secondary_opts]}
            if word.partition("=")[0] not in {*known, "--help", "--install-completion"}:
                return f"{names} has no option {word}"
    return ""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_commands_on_a_page_are_known(page: Path) -> None:
    for _, kind, text in BLOCK.findall(page.read_text()):
        if kind not in ("sh", "console", ""):
            continue
        for line in text.replace("\\\n", " ").splitlines():
            line = line.strip().removeprefix("$ ")
            if line.startswith("aloft "):
                line = re.split(r"\s(?:[|>&;]|2>)", line)[0]
                assert not unknown_in(line), line


def test_a_command_that_is_not_there_is_found() -> None:
    assert unknown_in("aloft runn graphs/jump.yaml") == "aloft has no verb runn"
    assert unknown_in("aloft run x.yaml --sead 3") == "aloft run has no option --sead"
    assert not unknown_in("aloft log export x.rrd --mcap y.mcap  # --nothing")


class References(HTMLParser):
    """What a built page refers to, and the anchors that it has."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.to: list[str] = []
        self.anchors: set[str] = set()
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("href", "src") and value:
                self.to.append(value)
            elif name == "id" and value:
                self.anchors.add(value)


OTHER_VERSIONS = ("0.1.0", "10.0.0")
"""Of which the site has a first page, and no other."""


@pytest.fixture(scope="module")
def built_site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the present version, beside older and newer ones."""
    folder = tmp_path_factory.mktemp("site")
    for version in OTHER_VERSIONS:
        page = folder / version / "docs" / "index.html"
        page.parent.mkdir(parents=True)
        page.write_text(f"<!doctype html><title>{version}</title>")
    site = folder / aloft.__version__
    done = subprocess.run(
        [sys.executable, "-m", "sphinx", "-q", "--fail-on-warning", "--keep-going", "-c", "docs",
         "-d", tmp_path_factory.mktemp("doctrees"), ".", site],
        cwd=ROOT, capture_output=True, text=True, timeout=500, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return site


@pytest.mark.long
@pytest.mark.skipif(PROGRAM is None, reason="chooses in a real browser; install Debian's chromium")
@pytest.mark.parametrize("page", ["docs/index.html", "docs/planning.html"])
def test_a_page_leads_to_other_versions(built_site: Path, tmp_path: Path, page: str) -> None:
    first = (built_site.parent / "index.html").read_text()
    assert "url=10.0.0/docs/index.html" in first  # 10.0.0 is newer than 0.2.0
    handler = partial(SimpleHTTPRequestHandler, directory=str(built_site.parent))
    with (
        ThreadingHTTPServer(("127.0.0.1", 0), handler) as server,
        Browser(tmp_path, (1200, 800)) as browser,
    ):
        threading.Thread(target=server.serve_forever, daemon=True).start()
        browser.open(f"http://127.0.0.1:{server.server_port}/{aloft.__version__}/{page}")

        def evaluate(expression: str) -> object:
            return browser.ask("Runtime.evaluate", expression=expression)["result"].get("value")

        box = "document.querySelector('label.versions')"
        assert (
            evaluate(f"{box}.innerText.split(/\\s+/).join(' ')")
            == f"Version 10.0.0 {aloft.__version__} 0.1.0"
        )
        assert evaluate(f"{box}.firstElementChild.value") == aloft.__version__
        # It has no page of that name but the first, to which the browser is led.
        evaluate(
            f"{{const list = {box}.firstElementChild; list.value = '0.1.0';"
            " list.dispatchEvent(new Event('change'));}"
        )
        for _ in range(300):
            if evaluate("document.title") == "0.1.0":
                break
            time.sleep(0.1)
        assert str(evaluate("location.href")).endswith("/0.1.0/docs/index.html")
        server.shutdown()


WIDTHS = (390, 1024, 1320, 1400)
"""Widths of a telephone and of the commonest screens [px]."""
SHOWN = ("index", "tutorial", "gallery", "results", "frameworks", "install", "known_gaps")


@pytest.mark.long
@pytest.mark.skipif(PROGRAM is None, reason="looks in a real browser; install Debian's chromium")
@pytest.mark.parametrize("theme", ["light", "dark"])
def test_no_page_scrolls_sideways_or_cuts_its_text(
    built_site: Path, tmp_path: Path, theme: str
) -> None:
    handler = partial(SimpleHTTPRequestHandler, directory=str(built_site.parent))
    wrong = []
    with (
        ThreadingHTTPServer(("127.0.0.1", 0), handler) as server,
        Browser(tmp_path, (1400, 900)) as browser,
    ):
        threading.Thread(target=server.serve_forever, daemon=True).start()
        # The page's own choice, which the theme keeps: dark text must not be laid out otherwise.
        for name in SHOWN:
            browser.open(
                f"http://127.0.0.1:{server.server_port}/{aloft.__version__}/docs/{name}.html"
            )
            browser.ask("Runtime.evaluate", expression=f"document.body.dataset.theme = {theme!r}")
            for width in WIDTHS:
                browser.ask(
                    "Emulation.setDeviceMetricsOverride",
                    width=width, height=900, deviceScaleFactor=1, mobile=False,
                )  # fmt: skip
                found = browser.ask("Runtime.evaluate", expression=SIDEWAYS, returnByValue=True)
                wrong += [f"{name} at {width} px: {each}" for each in found["result"]["value"]]
        server.shutdown()
    assert not wrong


SIDEWAYS = """(() => {
  const found = [], page = document.documentElement;
  if (page.scrollWidth > page.clientWidth) found.push("scrolls to " + page.scrollWidth + " px");
  for (const each of document.querySelectorAll(".content h1, .content h2, .content p, .toc-drawer a")) {
    const box = each.getBoundingClientRect(), shown = getComputedStyle(each);
    if (shown.overflow === "hidden" && each.scrollWidth > each.clientWidth + 1)
      found.push("cut: " + each.textContent.slice(0, 40));
    if (box.width && box.left < page.clientWidth && box.right > page.clientWidth + 1 && !each.closest(".table-wrapper, .toc-drawer"))
      found.push("beyond the edge: " + each.textContent.slice(0, 40));
  }
  return found;
})()"""
"""What sticks out of a page, as texts."""


@pytest.mark.long
def test_every_link_of_the_site_leads_somewhere(built_site: Path) -> None:
    site = built_site
    pages = {path: References(path.read_text()) for path in site.rglob("*.html")}
    assert len(pages) > len(PAGES)
    for path, page in pages.items():
        for target in page.to:
            address = urlsplit(target)
            if address.scheme:
                assert address.scheme in ("https", "data", "mailto"), target
                continue
            there = path
            if address.path:
                there = (path.parent / unquote(address.path)).resolve()
            assert there.is_file(), f"{path.relative_to(site)}: {target}"
            if address.fragment and there in pages:
                assert unquote(address.fragment) in pages[there].anchors, (path, target)
    interface = (site / "docs" / "api.html").read_text()
    for name in aloft.__all__:
        if inspect.isclass(value := getattr(aloft, name)) or inspect.isfunction(value):
            assert f">{name}</span>" in interface, name
    assert "searchindex" in (site / "search.html").read_text()
    assert "docs/tutorial" in (site / "searchindex.js").read_text()
    assert "data-theme" in (site / "docs" / "index.html").read_text()
