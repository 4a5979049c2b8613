"""``aloft doctor``: whether this machine can run a graph, and what it allows a control loop."""

from __future__ import annotations

from .shared.options import AsJson
from .shared.output import console, print_json, say, table


def doctor(
    as_json: AsJson = False,
) -> None:
    """Say whether all libraries load, what this machine allows a control loop in real time, and what
    to change; nothing is changed."""
    from ..runtime.running.machine_check import examine_libraries, examine_machine

    findings = [examine_libraries(), *examine_machine()]
    if as_json:
        ready = all(finding.good for finding in findings)
        print_json({"ready": ready, "findings": [finding.as_json() for finding in findings]})
        return
    out = console()
    rows = [(f.name, "good" if f.good else "not yet", f.found) for f in findings]
    out.print(table("", ("what", "is", "found"), rows))
    for finding in findings:
        if finding.change:
            say(out, f"{finding.name}: {finding.change}")
