"""The command that installs the libraries of an extra."""

from __future__ import annotations


def pip_line(extra: str) -> str:
    """Return the command that installs what an extra of aloft's brings.

    It names the libraries themselves, so that it is right wherever aloft was installed from.
    """
    import re
    from importlib import metadata  # a tenth of a start, so only where something is missing

    try:
        declared = metadata.requires("aloft-robotics") or []
    except metadata.PackageNotFoundError:  # a folder on the path that was never installed
        declared = []
    mark = re.compile(rf"""extra\s*==\s*['"]{re.escape(extra)}['"]""")
    wanted = [each.partition(";")[0].strip() for each in declared if mark.search(each)]
    names = " ".join(f"'{each}'" for each in wanted)
    return f"pip install {names}" if names else f"pip install -e '.[{extra}]' where aloft lies"
