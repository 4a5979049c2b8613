"""The verbs of the core: the panel of the help that each is in, and its summary.

This is data, so that ``aloft --help`` imports no verb. Extensions declare the same in the table ``help``
of their ``extension.toml``.
"""

from __future__ import annotations

from collections.abc import Mapping

PANELS = ("Run", "Recordings", "Studies", "Robots", "Machines", "Develop")
"""The panels of the help, in their order."""

CORE: Mapping[str, tuple[str, str]] = {
    "run": ("Run", "Run a graph, and write a recording."),
    "check": ("Run", "Report every mistake in a graph, each with a fix."),
    "graph": ("Run", "Print or draw a graph; --live shows a running one."),
    "params": ("Run", "List, get or set the parameters of a running graph."),
    "view": ("Recordings", "Look at a recording: the robot in 3D, and every signal."),
    "plot": ("Recordings", "Plot signals, in the terminal or into a file."),
    "render": ("Recordings", "Draw a film or a picture of a recording."),
    "log": ("Recordings", "Inspect, export, compare and repair recordings."),
    "replay": ("Recordings", "Re-run a recording and check that it is bit-identical."),
    "study": ("Studies", "Run many graphs, settings and seeds on all cores."),
    "robot": ("Robots", "Look at a robot, import one, let it stand, bring it up."),
    "jump": ("Robots", "Plan a jump and run it."),
    "plan": ("Robots", "Plan jumps and keep the valid plans in a library."),
    "twin": ("Robots", "Serve emulated drives and sensors on serial ports."),
    "new": ("Develop", "Write the first files of a project, block, graph or robot."),
    "blocks": ("Develop", "List all blocks, or print the contract of one."),
    "test": ("Develop", "Test blocks; write a test from a recording."),
    "doctor": ("Develop", "Check libraries, and real time on this machine."),
}
"""Each verb of the core with its panel and its summary, which ends with a full stop."""

EXIT_CODES = """\
Exit codes:
  0    the graph ran and its own criteria hold
  1    it ran to its end, but a criterion failed: a fall, a missed target
  2    the graph, an override or the command line is wrong; nothing moved
  3    a block failed, a signal was not finite, or a policy ended the run
  4    it ran, but its recording could not be written, or not all of it
  130  stopped cleanly by SIGINT
  137  a block hung in compiled code; the process was killed
  143  stopped cleanly by SIGTERM
"""

OPTIONS = """\
Options:
  --version             Print the version.
  --install-completion  Install completion for the current shell.
  --show-completion     Print the completion for the current shell.
  --help                Print this page; aloft VERB --help explains a verb.
"""


def help_page() -> str:
    """Return what ``aloft --help`` prints: all verbs by panel, without importing one of them.

    Raises:
        ExtensionError: an extension's declaration is wrong.
    """
    from ..runtime.language.extensions import extensions

    found: dict[str, list[tuple[str, str]]] = {panel: [] for panel in PANELS}
    for verb, (panel, summary) in CORE.items():
        found[panel].append((verb, summary))
    for each in extensions():
        for verb in each.verbs:
            if " " not in verb:  # those of a group are on the group's own page
                panel, colon, summary = each.help.get(verb, "").partition(": ")
                found.setdefault(panel if colon else "Other", []).append((verb, summary))
    width = max(len(verb) for verbs in found.values() for verb, _ in verbs) + 2
    parts = ["Usage: aloft VERB ...", "Control loops for robots as typed block diagrams."]
    for panel, verbs in found.items():
        lines = (f"  {verb:<{width}}{summary}".rstrip() for verb, summary in verbs)
        if verbs:
            parts.append("\n".join([f"{panel}:", *lines]))
    return "\n\n".join([*parts, OPTIONS + "\n" + EXIT_CODES])
